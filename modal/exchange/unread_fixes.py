"""Say which fixes of a script of LAMMPS or LIGGGHTS are neither read nor known to do no harm."""

from collections.abc import Sequence

from modal.exchange.gravity import STYLE as GRAVITY
from modal.exchange.held import HOLDING, INTEGRATING, Fix, Run, find_runs_of_dump

READ = ("wall", "rigid", "property", GRAVITY, "pour", "deposit", "insert")
"""First words of the styles that are read, beside those that integrate or hold spheres."""
HARMLESS = (
    "adapt",
    "ave",
    "balance",
    "box",
    "check",
    "controller",
    "deform",
    "dt",
    "evaporate",
    "halt",
    "massflow",
    "mesh",
    "momentum",
    "particledistribution",
    "particletemplate",
    "press",
    "print",
    "recenter",
    "store",
    "vector",
    "viscous",
)
"""First words of the styles that leave spheres at rest as they are: a dump has positions, radii and
cell. Those of `adapt` that change the law are refused elsewhere."""


def remark_on_unread_fixes(runs: Sequence[Run], step: int) -> list[str]:
    """Return a remark on each fix that acted when a dump was written and that is not understood."""
    if not runs:
        return []
    fixes: dict[str, Fix] = {}
    for index in find_runs_of_dump(runs, step):
        fixes |= {fix.place: fix for fix in runs[index].fixes.values()}
    return [
        f"fix {fix.style} ({fix.place}) is ignored: forces that it gives to spheres are not in the "
        "network"
        for fix in fixes.values()
        if not _is_understood(fix)
    ]


def _is_understood(fix: Fix) -> bool:
    """Tell whether a fix is read, or does no harm to a packing at rest."""
    first_word = fix.style.split("/")[0]
    if INTEGRATING.fullmatch(fix.style) or fix.style in HOLDING:
        return True
    return first_word in (*READ, *HARMLESS)
