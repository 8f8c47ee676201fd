"""
The crystal: three answers
==========================

Up to which frequency does the face-centred cubic crystal carry P-waves? Theory, the modes and
the wave answer independently.
"""

import matplotlib.pyplot as plt
import numpy as np

import modal

net = modal.fcc(stress=1e5, cells=(1, 1, 200))
print(modal.describe(net))

# %%
# **Theory** has the dispersion in closed form, and its highest point.

crystal = modal.FccLattice(stress=1e5)
limit = crystal.low_pass_frequency
print(f"theory, Eq. 10: {limit / 1e3:.3f} kHz")

# %%
# **The modes** of the finite crystal between its walls: those that move along z in plane layers
# are the standing P-waves. The last one lies just below the end of the band.

modes = modal.eigenmodes(net, all=True)
print(f"last resonance: {modes.resonance_frequency[-1] / 1e3:.3f} kHz")
print(f"modes below the limit: {modal.count_modes(net, limit)} of {len(modes.frequency)}")

# %%
# **The wave** that the source wall sends; its front moves with the velocity of long waves.

wave = modal.propagate(net, duration=6e-4)
print(wave)

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4))
kappa = modes.resonance_wavenumber * crystal.layer_distance
left.plot(kappa / np.pi, modes.resonance_frequency / 1e3, ".", label="modes")
along = np.linspace(0, np.pi, 200)
left.plot(along / np.pi, limit / 1e3 * np.sin(along / 2), label="theory, Eq. 9")
left.set(xlabel=r"$\kappa l / \pi$", ylabel="frequency, kHz")
left.legend()
wave.plot(right)
figure.tight_layout()
plt.show()
