"""The line of `print(network)` that stands on the rooms above packing: motions without energy."""

from __future__ import annotations

from modal.formats.hdf5 import InputError
from modal.packing.network import Network
from modal.packing.summary import FURTHER


def floppy_modes(network: Network) -> list[tuple[str, str]]:
    """Their number and kinds; nothing where there is no scipy to find them, as inside YADE."""
    try:
        from modal.modes.collective import easily_known_floppy
        from modal.modes.problem import Eigenproblem
    except ModuleNotFoundError:
        return []
    try:
        floppy = easily_known_floppy(Eigenproblem.of(network))
    except InputError as error:
        return [("floppy modes", str(error))]
    kinds = ", ".join(f"{n} {kind.replace('_', ' ')}" for kind, n in floppy.by_kind().items() if n)
    least = "" if floppy.counted else "at least "
    return [("floppy modes", f"{least}{floppy.total}" + f" ({kinds})" * bool(kinds))]


FURTHER.append(floppy_modes)
