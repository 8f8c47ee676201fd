"""The linear wave by which a packing is measured: its pulse, its times, its coherent part.

All follow from the packing: spheres ten times smaller hear the same of a pulse ten times shorter.
"""

from __future__ import annotations

from dataclasses import replace

from analysis.estimators.coherent import DECAY, PASSAGES, Coherent, coherent_wave
from analysis.estimators.effective_medium import of_contacts
from modal.packing.network import Network
from modal.waves.propagate import propagate
from modal.waves.signals import Signals
from modal.waves.source import Motion, Pulse

FREQUENCY = 0.33
"""Of the pulse, in V / D of the affine wave: 100 kHz in the crystal of glass at 100 kPa. A
crystal's band ends at 0.45, a random packing's long before."""
AMPLITUDE = 1e-6
"""Of the pulse, mean diameters: 2.5 nm in the study."""
INTERVAL = 0.4
"""Between records, in D / V: two samples at 1.25 V / D, above all modes."""
RECORD = 1.5 * PASSAGES
"""Length of the record, in passages from wall to wall of the affine wave."""
SLOWER = 0.5
"""Least V_S over V_P for which an S-wave's record is long enough."""
HIGHEST = {True: 0.5, False: 0.2}
"""Highest frequency of the coherent wave, in V / D, of a crystal or not."""


def affine_frequency(network: Network) -> float:
    """V / D, Hz: V of a wave that strains the packing evenly, D the mean diameter."""
    return of_contacts(network).velocity / (2 * float(network.radius.mean()))


def own_pulse(network: Network) -> Pulse:
    """The pulse of a packing that no run has one for."""
    diameter = 2 * float(network.radius.mean())
    return Pulse(AMPLITUDE * diameter, FREQUENCY * affine_frequency(network))


def own_wave(
    network: Network,
    motion: Motion | None = None,
    direction: str = "z",
    *,
    interval: float | None = None,
    particles: bool = True,
) -> Signals:
    """The linear wave of a packing's own pulse, or another motion, of the wall along `direction`.

    P-waves are recorded on every particle, S-waves for longer, as they are slower. `interval`
    between records, s, by default `INTERVAL`.
    """
    frequency = affine_frequency(network)
    duration = RECORD * network.length / (2 * float(network.radius.mean())) / frequency
    return propagate(
        network,
        duration if direction == "z" else duration / SLOWER,
        motion=own_pulse(network) if motion is None else motion,
        interval=interval or INTERVAL / frequency,
        particles=particles and direction == "z",
        direction=direction,
    ).signals


def coherent_of(network: Network, record: Signals, crystal: bool, decay: float = DECAY) -> Coherent:
    """The coherent wave of a packing's record, to the highest frequency that is looked at."""
    if crystal:  # slabs a diameter thick would beat with its layers
        record = replace(record, layer_displacement=None)
    highest = HIGHEST[crystal] * affine_frequency(network)
    return coherent_wave(record, network.length, highest=highest, decay=decay)
