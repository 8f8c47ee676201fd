"""Files whose contents have been changed at random: read, or refused in one line, never else.

What stands behind the reader is asked too: the numbers of a packing, the tables and figures of a
study, the drawing of a figure. `tests/formats/test_damaged_files.py` changes bytes.
"""

import json
import shutil
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from fuzz import ended, mangle_h5, mangled_figure, mangled_text, mangled_tree
from matplotlib.backends.backend_agg import FigureCanvasAgg
from places import ROOT

from analysis.case import kind_of
from analysis.figures import OF_ROWS
from analysis.figures.looks import refuse_undrawable
from analysis.figures.picture import read_picture
from analysis.figures.render import STYLE, to_figure
from analysis.frame import frame_of
from analysis.result_file import read_result
from analysis.study.tables import tabulate_all_numbers
from modal.formats.provenance import Provenance, packing_of, read_provenance
from modal.modes.eigenmodes import eigenmodes
from modal.modes.mode_set import read_modes, write_modes
from modal.packing.crystal import fcc
from modal.packing.network import read_network, write_network
from modal.packing.sample import Sample, read_sample, write_sample
from modal.packing.summary import summary
from modal.tools.errors import InputError
from modal.waves.propagate import propagate
from modal.waves.signals import read_signals, write_signals

Work = Callable[[np.random.Generator], str]
"""Makes one mutant and says how its reading ended."""
RESULT = ROOT / "results/study/cases/case02.json"
FIGURES = ("case02/case02.dispersion.csv", "study/fig16_low_pass.csv", "study/fig06_velocity.csv")


def of_hdf5(kind: str) -> Callable[[Path], Work]:
    """Return work on a product of this kind, with its provenance."""

    def begin(folder: Path) -> Work:
        crystal = fcc(cells=(1, 1, 10))
        network = folder / "a.network.h5"
        sound = folder / f"sound.{kind}.h5"
        path = folder / f"b.{kind}.h5"
        write_network(network, crystal)
        provenance = Provenance("pack", {"seed": 1}, packing_of(network))
        if kind == "network":
            write_network(sound, crystal)
        elif kind == "modes":
            write_modes(sound, eigenmodes(crystal, lowest=3, shapes=True), provenance)
        elif kind == "signals":
            write_signals(sound, propagate(crystal, 2e-5).signals, provenance)
        else:
            sphere = np.array([[1e-3, 1e-3, 1e-3]])
            walls = np.array([0.0, 2e-3])
            write_sample(sound, Sample(sphere, np.full(2, 4e-3), walls, 0.1, radius=1.0001e-3))

        def read() -> None:
            read_provenance(path)
            if kind == "network":
                summary(read_network(path))
            elif kind == "sample":
                read_sample(path).network()
            else:
                repr({"modes": read_modes, "signals": read_signals}[kind](path))
            kind_of(path)

        def work(random: np.random.Generator) -> str:
            shutil.copy(sound, path)
            mangle_h5(path, random)
            return ended(read)

        return work

    return begin


def of_results(folder: Path) -> Work:
    """Return work on the result of a case: its line of numbers, and the figures of cases."""
    sound = json.loads(RESULT.read_text())
    path = folder / "case02.json"

    def read() -> None:
        frame = frame_of([read_result(path)])
        tabulate_all_numbers(frame.assign(case=1, name="case02"))
        for figure in OF_ROWS:
            with matplotlib.rc_context(fname=STYLE), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    figure(frame.assign(case=1))
                except InputError:
                    continue

    def work(random: np.random.Generator) -> str:
        if random.random() < 0.8:
            path.write_text(json.dumps(mangled_tree(sound, random)))
        else:
            path.write_text(mangled_text(RESULT.read_text(), random))
        return ended(read)

    return work


def of_figures(folder: Path) -> Work:
    """Return work that draws the CSV of a figure again."""
    path = folder / "figure.csv"
    texts = [(ROOT / "results" / name).read_text() for name in FIGURES]

    def read() -> None:
        picture = read_picture(path)
        refuse_undrawable(picture, path)
        with matplotlib.rc_context(fname=STYLE), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            figure = to_figure(picture)
            figure.set_dpi(20)
            FigureCanvasAgg(figure).draw()

    def work(random: np.random.Generator) -> str:
        text = texts[int(random.integers(len(texts)))]
        path.write_text(mangled_figure(text, random), errors="replace")
        return ended(read)

    return work


KINDS = {
    **{kind: of_hdf5(kind) for kind in ("network", "sample", "modes", "signals")},
    **{"result": of_results, "figure": of_figures},
}


@pytest.mark.parametrize("count", [12, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", KINDS)
def test_a_changed_file_is_read_or_refused(kind, count, tmp_path):
    work = KINDS[kind](tmp_path)
    endings = Counter(work(np.random.default_rng([1, k])) for k in range(count))
    assert endings.keys() <= {"read", "refused"}
    assert endings["refused"] > count / 10
