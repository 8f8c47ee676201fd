"""Waves and modes to watch on the site: the crystal of case 2 and the packings of cases 6 and 30.

Nothing of them is committed: they are made from the committed samples, and made again when a
sample, or what draws the pages, has changed.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
import modal  # noqa: E402
from analysis.watch.page import watch_page  # noqa: E402
from modal.modes.mode_set import write_modes  # noqa: E402
from modal.packing.network import write_network  # noqa: E402
from modal.waves.signals import write_signals  # noqa: E402

DURATION = {"case02": 4e-4, "case06": 8e-4, "case30": 9e-4}
"""Of each wave, s: to the other end of the packing, and not much further."""
CRYSTAL = "case02"
MODES = 8
"""Of the lowest, of each packing."""


def make_pages(folder: Path, *, quick: bool = False) -> None:
    """Write pages that are missing or older than their sources; `quick`: the crystal alone."""
    drawn_by = [Path(__file__), *(ROOT / "analysis/watch").iterdir()]
    for name, duration in DURATION.items():
        sample = ROOT / f"results/samples/{name}.sample.h5"
        sources = drawn_by if name == CRYSTAL else [sample, *drawn_by]
        newest = max(path.stat().st_mtime for path in sources)
        pages = [folder / f"{name}_{kind}.html" for kind in ("wave", "modes")]
        if (quick and name != CRYSTAL) or all(
            page.exists() and page.stat().st_mtime > newest for page in pages
        ):
            continue
        _make(modal.fcc() if name == CRYSTAL else modal.read(sample), name, duration, *pages)


def _make(
    network: modal.Network, name: str, duration: float, wave_page: Path, modes_page: Path
) -> None:
    with TemporaryDirectory() as folder:
        packing, wave, modes = (
            Path(folder) / f"{name}.{kind}.h5" for kind in ("network", "signals", "modes")
        )
        write_network(packing, network)
        write_signals(wave, modal.propagate(network, duration=duration, particles=True).signals)
        watch_page(wave, wave_page, packing)
        write_modes(modes, modal.eigenmodes(network, lowest=MODES, shapes=True))
        watch_page(modes, modes_page, packing)
