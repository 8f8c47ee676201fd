"""Count exactly the modes below each frequency, by inertia counts."""

from modal.cli.options import REQUIRED, Group, Option, Options, Result, chosen
from modal.cli.reading import packing_of, remark_on_ends, springs
from modal.modes.collective import summary_at_zero
from modal.modes.counts import counts_below
from modal.solvers.factor import direct_solvers
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import frequencies

EXAMPLE = "count mine.network.h5 --at 1000 5000"
SOLVER_HELP = "what factorises (default: the fastest)"
OPTIONS = (
    *springs(),
    Option("--at", "HZ ...", "one or several frequencies", kind=str, more=REQUIRED),
    Group("advanced", [Option("--solver", "", SOLVER_HELP, kind=direct_solvers())]),
)


def run(options: Options) -> Result:
    """Count the modes below each frequency; name each count by the frequency as typed."""
    network = packing_of(options)
    system = LinearSystem.of(network, **chosen(options, "pre_stress", "sliding", "solver"))
    limits = frequencies(options.at)
    counts = counts_below(system, limits).tolist()
    at_zero = summary_at_zero(system)
    floppy = at_zero["floppy_modes"] + at_zero["unstable_modes"]
    for frequency, count in zip(limits.tolist(), counts, strict=True):
        below = frequency > 0 and count <= floppy < system.degrees_of_freedom
        above = frequency > 0 and count == system.degrees_of_freedom > floppy
        remark_on_ends(options, frequency, below, above)
    count_below = dict(zip(options.at, counts, strict=True))
    return {"count_below": count_below, **at_zero, "degrees_of_freedom": system.degrees_of_freedom}
