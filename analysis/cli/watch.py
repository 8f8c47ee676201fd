"""A wave or modes in three dimensions: one HTML page that opens without a network."""

from analysis.watch.page import watch_page
from modal.cli.options import Option, Options, output, say
from modal.cli.terminal import put

EXAMPLE = "watch mine.signals.h5 mine.network.h5 -o wave.html"
BESIDE = "what it was made from; the one beside it"
OPTIONS = [
    Option("product", "FILE", "*.signals.h5 or *.modes.h5", kind=str),
    Option("packing", "PACKING", BESIDE, kind=str, more={"nargs": "?"}),
    Option("--modes", "K ...", "which, from 1; all", kind=int),
    output("*.html", (".html",), required=True),
]


def run(options: Options) -> None:
    """Write the page, and print the notes for its reader."""
    for note in watch_page(options.product, options.output, options.packing, options.modes):
        say(f"note: {note}")
    put(options.output)
