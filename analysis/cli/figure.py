"""Draw one figure of the cases, or again from its own CSV."""

from pathlib import Path

from analysis.case import cases_of
from analysis.figures import FIGURES, compose
from analysis.figures.picture import read_picture
from analysis.figures.render import save
from analysis.measuring import Measuring
from modal.cli.options import Given, Option, output
from modal.cli.terminal import put
from modal.tools.errors import InputError

EPILOG = "\n".join(
    f"{name}: {(of.__doc__ or name).splitlines()[0]}" for name, of in FIGURES.items()
)
EXAMPLE = "figure dispersion 2 -o pages"
CASE = "a case of --products by name, as 2; or files: a NETWORK and what was made from it"
PRODUCTS = Option("--products", "DIR", "folder to read", "products", str)
OPTIONS = [
    Option("name", "NAME", "one of those below, or a CSV file of one", kind=str),
    PRODUCTS,
    Option("case", "CASE", CASE, kind=str, more={"nargs": "*"}),
    output("to write to", "DIR")._replace(default="products"),
]


def run(options: Given) -> None:
    """Draw into --output, then print what the cases' reader should know."""
    name, again = options.name, options.name.endswith(".csv")
    cases, folder = cases_of(options.case, options.products), Path(options.output)
    for case in cases:
        case.check()
    if again and cases:
        raise InputError("a figure's CSV holds its cases already; leave CASE out")
    if not again and not cases:
        raise InputError("no case given; name at least one, or the CSV file of a figure")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if again:
            picture, stem = read_picture(name), Path(name).stem
        else:
            picture = compose(name, [Measuring.of(case) for case in cases])
            stem = ".".join([*(case.name for case in cases), name])
        paths = save(picture, folder / stem)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error}); choose another -o") from error
    put("\n".join(map(str, paths)))
    put("".join(f"note: {note}\n" for case in cases for note in case.notes), end="")
