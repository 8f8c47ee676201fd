"""
What passes at each frequency
=============================

The gain is the stress at the receiver wall over that at the source wall. Its maxima are the modes
of the packing whose source wall is free, about (r - 1/2) f_1, and not the standing waves r f_1
between walls that are held.
"""

import matplotlib.pyplot as plt

import modal

net = modal.fcc(stress=1e5, cells=(1, 1, 40))
response = modal.frequency_response(net, highest=3e4, resolution=200)
resonances = modal.eigenmodes(net, all=True).resonance_frequency

figure, ax = plt.subplots()
response.plot(ax)
for k, f in enumerate(resonances[resonances < 3e4]):
    label = {} if k else {"label": "standing waves between walls that are held"}
    ax.axvline(f / 1e3, color="0.6", ls=":", **label)
ax.set_ylim(top=60)
ax.legend(loc="upper right")
plt.show()
