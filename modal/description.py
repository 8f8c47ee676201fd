"""The line of `print(network)` that stands on the rooms above packing: motions without energy."""

from __future__ import annotations

from modal.packing.network import Network
from modal.packing.summary import FURTHER


def floppy_modes(network: Network) -> list[tuple[str, str]]:
    """Their number and kinds; nothing where there is no scipy to find them, as inside YADE."""
    try:
        from modal.modes.collective import every_floppy
        from modal.modes.problem import Eigenproblem
    except ModuleNotFoundError:
        return []
    floppy = every_floppy(Eigenproblem.of(network))
    kinds = ", ".join(f"{n} {kind.replace('_', ' ')}" for kind, n in floppy.by_kind().items() if n)
    return [("floppy modes", f"{floppy.total}" + f" ({kinds})" * bool(kinds))]


FURTHER.append(floppy_modes)
