"""Measure what changes with the amplitude of a pulse (`measure(amplitudes=...)`).

Two waves whose source moves by +d(t) and by -d(t) have the displacements u+ and u-. Their odd part,
(u+ - u-) / 2, is that of a linear wave except for terms of third order in the amplitude. Their even
part, (u+ + u-) / 2, is of second order: it has the harmonics, the drift, and the motion of a
packing that is not quite at rest. Slip and opening are not of any order: they begin at contacts
that are near their limit.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

import modal
from analysis.caveats import Caveat
from analysis.estimators.coherent import PASSAGES
from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities.registry import on_request
from analysis.record_rules import RECORD_INTERVAL_IN_D_PER_V
from analysis.steps import Step
from analysis.value import Value
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError
from modal.waves.motions import Pulse

AMPLITUDE = {
    "odd_part": "change of the odd part of waves pushed both ways from the linear one",
    "even_part": "largest even part of waves pushed both ways over the odd one",
    "second_harmonic": "twice the pulse's frequency over that, root mean squares",
    "slipping_share": "share of contacts that slide while a wave passes",
    "opening_share": "share of contacts that open while a wave passes",
    "slip_loss": "share of the source's work that slip dissipates",
    "slip_sharing": "number of contacts that share what slip dissipates",
}
"""Quantities by name, with their definitions.

If nothing slides, the odd part grows with the square of the amplitude, and the even part and the
second harmonic, root mean squares over the chain, grow with the amplitude. Shares are those of both
waves together, the loss is their mean. The number of contacts that share a loss is (sum e)^2
divided by sum e^2, with e the energy that each dissipates.
"""
COUNTED = "slipping_share", "opening_share", "slip_sharing"
"""Quantities without an error: exact for their packing."""
INTERVALS_PER_LINEAR_INTERVAL = 2
"""Number of records in the interval between two records of the linear wave: the second harmonic
then has eight records a period."""


class Responses(NamedTuple):
    """Results of two waves with opposite motions of the wall, at each of the amplitudes (na,).

    The first fields are the quantities of `AMPLITUDE`. time_step: s. step_error: the relative error
    from the time steps. noise: the packing's motion without a wave, divided by that of the wave.
    """

    odd_part: Floats
    even_part: Floats
    second_harmonic: Floats
    slipping_share: Floats
    opening_share: Floats
    slip_loss: Floats
    slip_sharing: Floats
    time_step: Floats
    step_error: Floats
    noise: Floats

    @property
    def error(self) -> Floats:
        """Return the error from the time steps and from the motion without a wave."""
        return np.hypot(self.step_error, self.noise)


@cached_on_packing
def responses(packing: PackingData) -> Responses:
    """Send pulses u = A (1 - cos 2 pi f t) with +A and with -A through the sample.

    Raises UnavailableError without amplitudes.
    """
    if len(packing.amplitudes) == 0:
        raise UnavailableError(
            "no_amplitudes", "it is measured of a sample over amplitudes, which were not given"
        )
    rows = [_respond(packing, amplitude) for amplitude in packing.amplitudes]
    return Responses(*np.array(rows, float).T)


def _respond(packing: PackingData, amplitude: float) -> tuple[float, ...]:
    """Return the fields of `Responses` at one amplitude, m."""
    frequency = (packing.source or packing.pulse).frequency
    duration = PASSAGES / (packing.affine_frequency * packing.diameter / packing.network.length)
    interval = RECORD_INTERVAL_IN_D_PER_V / INTERVALS_PER_LINEAR_INTERVAL / packing.affine_frequency
    send = partial(modal.propagate, packing.sample, duration, interval=interval)
    forward = send(nonlinear=True, motion=Pulse(amplitude, frequency))
    # All three waves take the same steps: their common error is no effect of the amplitude.
    step = forward.signals.time_step
    reverse_pulse = Pulse(-amplitude, frequency)
    reverse = send(nonlinear=True, motion=reverse_pulse, time_step=step)
    linear_wave = send(pre_stress="full", motion=reverse_pulse, time_step=step)
    linear = -linear_wave.signals.chain_displacement
    u_forward = forward.signals.chain_displacement
    u_reverse = reverse.signals.chain_displacement
    odd = (u_forward - u_reverse) / 2
    even = (u_forward + u_reverse) / 2
    phase = np.exp(-2j * np.pi * frequency * forward.signals.time)
    slid = (forward.dissipated > 0) | (reverse.dissipated > 0)
    losses = [wave.energy[-1, 3] / abs(wave.energy[-1, 0]) for wave in (forward, reverse)]
    sharing = [_count_sharing(wave.signals.slip_energy) for wave in (forward, reverse)]
    return (
        abs(odd - linear).max() / abs(linear).max(),
        abs(even).max() / abs(odd).max(),
        float(np.linalg.norm(phase**2 @ even) / np.linalg.norm(phase @ odd)),
        float(np.mean(slid)),
        float(np.mean(forward.opened | reverse.opened)),
        float(np.mean(losses)),
        float(np.mean(sharing)),
        step,
        forward.error,
        forward.noise,
    )


def _count_sharing(energy: Floats | None) -> float:
    """Return the participation number of contacts in the dissipation; 0 if nothing slides."""
    if energy is None or not energy.any():
        return 0.0
    return float(energy.sum() ** 2 / (energy**2).sum())


def _measure_over_amplitudes(packing: PackingData, name: str) -> Value:
    """Measure a quantity of `AMPLITUDE` over the amplitudes."""
    result = responses(packing)
    values = getattr(result, name)
    error = result.error
    if name in COUNTED:
        error = 0 * values
    sizes = ", ".join(f"{size:.3g}" for size in packing.amplitudes)
    caveats = (Caveat("amplitudes", {"sizes": sizes}),)
    steps = []
    for row, amplitude in enumerate(packing.amplitudes):
        numbers = {
            "amplitude": amplitude,
            "time_step": result.time_step[row],
            "step_error": result.step_error[row],
            "noise": result.noise[row],
        }
        steps.append(Step("fit", "waves_compared", numbers))
    return Value(values, "1", {"fit": error}, caveats, steps=tuple(steps))


for _name, _definition in AMPLITUDE.items():
    on_request("1", name=_name, definition=_definition)(
        partial(_measure_over_amplitudes, name=_name)
    )
