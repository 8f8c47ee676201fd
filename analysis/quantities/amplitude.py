"""When is linear right? What changes with the amplitude of a pulse (`measure(amplitudes=...)`)."""

from __future__ import annotations

from analysis.measuring import Measuring
from analysis.quantities.registry import on_request
from analysis.value import Value
from modal.tools.arrays import Floats
from modal.tools.errors import InputError


def _over_amplitudes(packing: Measuring, name: str, *, counted: bool = False) -> Value:
    """One column of `FiniteAmplitude`; counts have no error but the choice of the packing."""
    if len(packing.amplitudes) == 0:
        raise InputError("it is measured of a sample over amplitudes, which were not given")
    values: Floats = getattr(packing.finite, name)
    sizes = ", ".join(f"{size:.3g}" for size in packing.amplitudes)
    error = 0 * values if counted else packing.finite.error
    return Value(values, "1", {"fit": error}, (f"at amplitudes of {sizes} m",))


@on_request("odd_part", "1", "change of the odd part of waves pushed both ways from the linear one")
def odd_part(packing: Measuring) -> Value:
    """Grows as the square of the amplitude where nothing slides."""
    return _over_amplitudes(packing, "odd")


@on_request("even_part", "1", "largest even part of waves pushed both ways over the odd one")
def even_part(packing: Measuring) -> Value:
    """Grows as the amplitude where nothing slides."""
    return _over_amplitudes(packing, "even")


@on_request("second_harmonic", "1", "twice the pulse's frequency over that, root mean squares")
def second_harmonic(packing: Measuring) -> Value:
    """Of the displacements of the chain."""
    return _over_amplitudes(packing, "harmonic")


@on_request("slipping_share", "1", "share of contacts that slide while a wave passes")
def slipping_share(packing: Measuring) -> Value:
    """Of both waves together."""
    return _over_amplitudes(packing, "slipping", counted=True)


@on_request("opening_share", "1", "share of contacts that open while a wave passes")
def opening_share(packing: Measuring) -> Value:
    """Of both waves together."""
    return _over_amplitudes(packing, "opening", counted=True)


@on_request("slip_loss", "1", "share of the source's work that slip dissipates")
def slip_loss(packing: Measuring) -> Value:
    """Mean of both waves; by contact it is in the file of `wave --nonlinear`."""
    return _over_amplitudes(packing, "loss")


@on_request("slip_sharing", "1", "number of contacts that share what slip dissipates")
def slip_sharing(packing: Measuring) -> Value:
    """Squared sum over the sum of squares: one where a single contact dissipates all."""
    return _over_amplitudes(packing, "sharing", counted=True)


AMPLITUDE = (
    *("odd_part", "even_part", "second_harmonic", "slipping_share", "opening_share"),
    *("slip_loss", "slip_sharing"),
)
"""Names of these."""
