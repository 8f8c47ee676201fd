"""Write the page that shows a wave or modes of a packing in three dimensions.

`packing.js` and `player.js` draw with three.js and uPlot. All of them, and the data, go into the
page, so that it opens offline.
"""

import json
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

from analysis.watch.shown_modes import describe_modes
from analysis.watch.shown_packing import describe_packing
from analysis.watch.shown_wave import describe_slip, describe_wave
from modal.exchange.picture import read_sphere_motion
from modal.exchange.registry import read
from modal.formats.provenance import packing_of, read_provenance, require_same_packing
from modal.formats.whole_file import write_whole
from modal.tools.errors import InputError
from modal.waves.signals import Signals


def watch_page(
    product: str | Path,
    output: str | Path,
    packing: str | Path | None = None,
    chosen: list[int] | None = None,
) -> list[str]:
    """Write the page of a wave or of modes.

    Parameters
    ----------
    product : path
        A file of a wave (`*.signals.h5`) or of modes (`*.modes.h5`) with the motion of all spheres.
    output : path
        The page, *.html.
    packing : path, optional
        The file from which `product` was made; by default the one of its name beside `product`.
    chosen : list of int, optional
        Numbers of modes, from 1; by default all modes.

    Returns
    -------
    list of str
        Notes for the reader, such as that the packing may have changed.

    Raises
    ------
    InputError
        If a file lacks the motion of spheres, or if the packing is missing or is another one.
    """
    motion, moved, numbers = read_sphere_motion(product, chosen, any_source=True)
    if not packing:
        packing = _find_packing(Path(product))
    note = require_same_packing(product, packing_of(packing))
    network = read(packing)
    data = describe_packing(network)
    if isinstance(motion, Signals):
        data |= describe_wave(network, motion, moved)
        data |= describe_slip(network, motion)
    else:
        data |= describe_modes(network, motion, moved, numbers)
    title = f"{Path(product).name}, {data['spheres']:,} spheres"
    write_whole(output, _fill_page(title, data).encode())
    if note:
        return [note]
    return []


def _find_packing(product: Path) -> Path:
    """Return the packing that a product names as its source, in its folder."""
    names = [source.name for source in read_provenance(product).packing if source.name]
    for name in names:
        if (product.parent / name).is_file():
            return product.parent / name
    listed = " or ".join(names) or "of unknown name"
    raise InputError(
        "no_packing",
        f"{product}: its packing, {listed}, is not beside it",
        remedy="name that as well",
    )


def _fill_page(title: str, data: dict[str, Any]) -> str:
    """Return the page with the texts and files that it names in doubled braces."""
    texts = {
        # A text in the data cannot end their script element.
        "data": json.dumps(data).replace("</", "<\\/"),
        "title": title.replace("&", "&amp;").replace("<", "&lt;"),
    }

    def read_part(place: re.Match[str]) -> str:
        name = place[1]
        return texts.get(name) or files("analysis.watch").joinpath(name).read_text()

    # In one pass: a text that is filled in may itself have doubled braces.
    page = files("analysis.watch").joinpath("page.html").read_text()
    return re.sub(r"\{\{([\w.]+)\}\}", read_part, page)
