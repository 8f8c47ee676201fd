"""Draw one figure of the cases, or again from its own CSV."""

from pathlib import Path

from analysis.case import cases_of_files
from analysis.figures import FIGURES, compose
from analysis.figures.looks import refuse_undrawable
from analysis.figures.picture import read_picture
from analysis.figures.render import save
from analysis.packing_data import PackingData
from modal.cli.options import Option, Options, output_folder
from modal.cli.terminal import put
from modal.tools.errors import InputError

EPILOG = "\n".join(
    f"{name}: {(of.__doc__ or name).splitlines()[0]}" for name, of in FIGURES.items()
)
EXAMPLE = "figure dispersion mine.network.h5 -o pages"
FILES = "packings, and what was made from them; what lies beside under their name is read"
OPTIONS = [
    Option("name", "NAME", "one of those below, or a CSV file of one", kind=str),
    Option("file", "FILE", FILES, kind=str, more={"nargs": "*"}),
    output_folder("to write to", "products"),
]


def run(options: Options) -> None:
    """Draw into --output, then print what the cases' reader should know."""
    name, again = options.name, options.name.endswith(".csv")
    if again and options.file:
        raise InputError(
            "cases_given", "a figure's CSV holds its cases already", remedy="leave FILE out"
        )
    if not again and not options.file:
        raise InputError("no_file", "no file given", remedy="name a packing, or a figure's CSV")
    cases = cases_of_files(options.file) if options.file else []
    if again:
        picture, stem = read_picture(name), Path(name).stem
        refuse_undrawable(picture, name)
    else:
        picture = compose(name, [PackingData.of(case) for case in cases])
        stem = ".".join([*(case.name for case in cases), name])
    paths = save(picture, Path(options.output) / stem)
    put("\n".join(map(str, paths)))
    put("".join(f"note: {note}\n" for case in cases for note in case.notes), end="")
