"""A bench test with two transducers: velocity by each rule at each frequency."""

from pathlib import Path

from analysis.bench import RADIUS_IN_WIDTHS, TransducerRow, TransducerTest, transducers
from analysis.estimators.arrival_rules import RULES
from analysis.table import Table, number
from modal.cli.options import Option, Options, flag, output, say
from modal.cli.terminal import json_text, put
from modal.exchange.registry import read_remarked
from modal.tools.display import quantity
from modal.waves.signals import DIRECTIONS

EXAMPLE = "transducers mine.network.h5 --at 0.01 0.06 --frequency 5e3 1e4 2e4 -o traces.png"
RADIUS_HELP = f"of both discs, m (default: {RADIUS_IN_WIDTHS:g} of the smaller width)"
FREQUENCY_HELP = "of the sine bursts (default: those of waves of 25, 12, 8 and 6 diameters)"
OPTIONS = [
    Option("file", "FILE", "*.network.h5, or *.sample.h5", kind=str),
    Option("--at", ("Z1", "Z2"), "heights of source and receiver, m (default: the two ends)"),
    Option("--frequency", "HZ ...", FREQUENCY_HELP),
    Option("--radius", "R", RADIUS_HELP),
    Option("--direction", "", "of the motion: x or y for V_S, z for V_P", "x", DIRECTIONS),
    Option("--cycles", "N", "periods of a burst", 1, int),
    flag("--json", "print JSON"),
    output("the traces with the picks, *.png, and their numbers and a PDF beside it", (".png",)),
]


def run(options: Options) -> int:
    """Test the packing and print the table; return 3 if no rule has a velocity."""
    network = read_remarked(options.file, say)
    heights = tuple(options.at) if options.at else None
    test = transducers(
        network,
        heights,
        options.frequency,
        radius=options.radius,
        direction=options.direction,
        cycles=options.cycles,
    )
    if options.output:
        from analysis.figures.bench import traces  # Matplotlib takes a second to load
        from analysis.figures.render import save

        velocity = test.v_p if options.direction == "z" else test.v_s
        save(traces(test, velocity), Path(options.output).with_suffix(""))
    put(json_text(test.as_json()) if options.json else _text(test))
    if not any(row.velocity.known for row in test.rows):
        say("no rule has a velocity; the caveats say why")
        return 3
    return 0


def _text(test: TransducerTest) -> str:
    """Return the velocities by frequency and rule, those of the moduli, and the caveats."""
    rows_by_frequency: dict[float, list[TransducerRow]] = {}
    for row in test.rows:
        rows_by_frequency.setdefault(row.frequency, []).append(row)
    lines = []
    frequencies_by_caveat: dict[str, list[str]] = {}
    for frequency, rows in rows_by_frequency.items():
        cells = [number(row.velocity.value, row.velocity.error) or "-" for row in rows]
        lines.append([quantity(frequency, "Hz"), f"{rows[0].near_field:.2f}", *cells])
        for caveat in dict.fromkeys(str(each) for row in rows for each in row.velocity.caveats):
            frequencies_by_caveat.setdefault(caveat, []).append(quantity(frequency, "Hz"))
    rules = [rule.replace("_", " ") for rule in RULES]
    table = Table("", ["frequency", "d/lambda", *rules], lines).markdown()
    notes = [f"- {', '.join(at)}: {text}" for text, at in frequencies_by_caveat.items()]
    moduli = f"V_P {_velocity(test.v_p)}, V_S {_velocity(test.v_s)}"
    distance = f"over {quantity(test.distance, 'm')} from tip to tip"
    head = f"velocities in m/s {distance}; by the moduli {moduli}"
    return "\n".join([head, "", table, *notes])


def _velocity(velocity: float) -> str:
    """Return a velocity of the moduli, m/s, in words."""
    if velocity > 0:
        return f"{velocity:.4g} m/s"
    return "not known"
