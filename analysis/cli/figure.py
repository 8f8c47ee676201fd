"""Draw one figure of the cases, or redraw a figure from its own CSV."""

from pathlib import Path

from analysis.case import Case, cases_of_files, kind_of
from analysis.figures import FIGURES, Figure, compose
from analysis.figures.looks import refuse_undrawable
from analysis.figures.picture import read_picture
from analysis.figures.render import save
from analysis.packing_data import PackingData
from modal.cli.options import Option, Options, output_folder
from modal.cli.terminal import put
from modal.tools.errors import InputError


def _describe(name: str, figure: Figure) -> str:
    """Return the line of a figure in the help: its name, and its docstring without the verb."""
    definition = (figure.__doc__ or name).splitlines()[0].removeprefix("Draw ")
    return f"{name}: {definition}"


EPILOG = "\n".join(_describe(name, figure) for name, figure in FIGURES.items())
EXAMPLE = "figure dispersion mine.network.h5 -o pages"
FILES = "packings, and what was made from them; what lies beside under their name is read"
OPTIONS = [
    Option("name", "NAME", "one of those below, or a CSV file of one", kind=str),
    Option("file", "FILE", FILES, kind=str, more={"nargs": "*"}),
    output_folder("to write to", "products"),
]


def run(options: Options) -> None:
    """Draw into --output, then print the notes on the cases.

    Raises InputError if files are missing or superfluous, or if the figure cannot be drawn.
    """
    name = options.name
    cases: list[Case] = []
    if name.endswith(".csv"):
        if options.file:
            raise InputError(
                "cases_given", "a figure's CSV holds its cases already", remedy="leave FILE out"
            )
        picture = read_picture(name)
        refuse_undrawable(picture, name)
        stem = Path(name).stem
    else:
        if not options.file:
            raise InputError("no_file", "no file given", remedy="name a packing, or a figure's CSV")
        cases = cases_of_files(options.file)
        for path in options.file:
            if kind_of(path) == "other.signals":
                raise InputError(
                    "not_from_wall_to_wall",
                    f"{path}: not a wave from wall to wall",
                    remedy="a figure shows no other; measure and watch do",
                )
        picture = compose(name, [PackingData.of(case) for case in cases])
        stem = ".".join([*(case.name for case in cases), name])
    paths = save(picture, Path(options.output) / stem)
    put("\n".join(map(str, paths)))
    put("".join(f"note: {note}\n" for case in cases for note in case.notes), end="")
