"""Three answers to one question: up to which frequency does the FCC crystal carry P-waves?"""

import modal

net = modal.fcc(stress=1e5, cells=(2, 2, 60))
print(net)
modes = modal.eigenmodes(net, all=True)
wave = modal.propagate(net, duration=1.5e-4)
limit = modal.FccLattice(stress=1e5).low_pass_frequency
print(f"Eq. 10: {limit:.0f} Hz; last resonance: {modes.resonance_frequency[-1]:.0f} Hz")
print(f"modes below: {modal.count_modes(net, limit)} of {len(modes.frequency)}")
print(wave)
