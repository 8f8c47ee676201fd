"""When is linear right? What changes with the amplitude of a pulse (`measure(amplitudes=...)`)."""

from __future__ import annotations

from collections.abc import Callable

from analysis.estimators.coherent import PASSAGES
from analysis.estimators.finite_amplitude import FiniteAmplitude, finite_amplitude
from analysis.estimators.own_wave import affine_frequency, own_pulse
from analysis.measuring import Measuring, once
from analysis.quantities.registry import on_request
from analysis.value import Value
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

OF_AMPLITUDE = {
    "odd_part": ("odd", "change of the odd part of waves pushed both ways from the linear one"),
    "even_part": ("even", "largest even part of waves pushed both ways over the odd one"),
    "second_harmonic": ("harmonic", "twice the pulse's frequency over that, root mean squares"),
    "slipping_share": ("slipping", "share of contacts that slide while a wave passes"),
    "opening_share": ("opening", "share of contacts that open while a wave passes"),
    "slip_loss": ("loss", "share of the source's work that slip dissipates"),
    "slip_sharing": ("sharing", "number of contacts that share what slip dissipates"),
}
"""Name: a field of `FiniteAmplitude`, and what it is.

Where nothing slides the odd part grows as the square of the amplitude, the even one and the second
harmonic, of the chain, as the amplitude. Shares are of both waves together, the loss their mean.
"""
COUNTED = "slipping", "opening", "sharing"
"""What has no error but the choice of the packing."""
AMPLITUDE = tuple(OF_AMPLITUDE)


@once
def finite(m: Measuring) -> FiniteAmplitude:
    """Waves of the sample that are pushed both ways by each of the amplitudes."""
    if m.sample is None:
        raise InputError("waves of finite amplitude are those of a sample, with its friction")
    motion = m.source or own_pulse(m.network)
    rate = affine_frequency(m.network) * m.diameter / m.network.length
    return finite_amplitude(m.sample, m.amplitudes, motion.frequency, PASSAGES / rate)


def _over_amplitudes(field: str) -> Callable[[Measuring], Value]:
    def measured(packing: Measuring) -> Value:
        if len(packing.amplitudes) == 0:
            raise InputError("it is measured of a sample over amplitudes, which were not given")
        values: Floats = getattr(finite(packing), field)
        sizes = ", ".join(f"{size:.3g}" for size in packing.amplitudes)
        error = 0 * values if field in COUNTED else finite(packing).error
        return Value(values, "1", {"fit": error}, (f"at amplitudes of {sizes} m",))

    return measured


for _name, (_field, _definition) in OF_AMPLITUDE.items():
    on_request(_name, "1", _definition)(_over_amplitudes(_field))
