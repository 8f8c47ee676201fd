"""Damaged files: never a traceback, a crash, a hang, or an answer that differs without a word.

Bytes are damaged as storage and transfer do it; contents as a faulty exporter does it. What is
checked is the reader and a command: status 2 with one line, or the very answer of the sound file.
"""

from __future__ import annotations

import contextlib
import io
import shutil
from collections import Counter
from pathlib import Path

import damage
import h5py
import numpy as np
import pytest
from places import SHEARED

from analysis.__main__ import main as analysis_main
from modal.__main__ import main as modal_main
from modal.formats.hdf5 import open_h5
from modal.formats.provenance import Provenance, packing_of
from modal.modes.eigenmodes import modes_of
from modal.modes.mode_set import read_modes, write_modes
from modal.packing import crystal as gallery
from modal.packing.network import read_network, write_network
from modal.packing.sample import read_sample, write_sample
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError
from modal.waves.propagate import propagate
from modal.waves.signals import read_signals, write_signals

READERS = {
    "network": read_network,
    "sample": read_sample,
    "signals": read_signals,
    "modes": read_modes,
}
FILES = {kind: f"case02.{kind}.h5" for kind in READERS}
COSMETIC = {"case", "producer", "study", "provenance", "creator", "run_time"}
"""What no number depends on: texts, which HDF5 stores without a checksum, and notes."""


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> Path:
    """Return a folder with one sound file of each format; the crystal has 12 layers."""
    folder = tmp_path_factory.mktemp("sound")
    network = gallery.fcc(cells=(2, 2, 12))
    write_network(folder / FILES["network"], network)
    write_sample(folder / FILES["sample"], read_sample(SHEARED))
    provenance = Provenance(sources=packing_of(folder / FILES["network"]))
    write_signals(folder / FILES["signals"], propagate(network, 6e-5).signals, provenance)
    write_modes(folder / FILES["modes"], modes_of(LinearSystem.of(network), all=True))
    return folder


COMMANDS = {
    "network": (
        *("modal info {network}", "modal modes {network} --lowest 3"),
        *("modal count {network} --at 3e4", "modal wave {network} --duration 2e-5"),
        "analysis measure {network} --quantities void_ratio",
    ),
    "sample": (
        *("modal info {sample}", "modal count {sample} --at 3e4"),
        "analysis measure {sample} --quantities rattlers",
    ),
    "signals": ("analysis agreement {network} {signals}",),
    "modes": ("analysis watch {modes} {network} -o {folder}/page.html",),
}
"""The commands that read a file of each kind."""


def answer(command: str, folder: Path) -> tuple[int, str]:
    """Run a command; return its status and its standard error."""
    files = {kind: folder / name for kind, name in FILES.items()}
    program, *words = command.format(folder=folder, **files).split()
    error = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(error):
        status = {"modal": modal_main, "analysis": analysis_main}[program](words)
    return status, error.getvalue()


def same(first, second) -> bool:
    """Tell whether two readings agree in everything that a number depends on."""
    for name, value in vars(first).items():
        second_value = getattr(second, name)
        if name in COSMETIC or name == "attributes":
            continue
        if isinstance(value, np.ndarray):
            if value.dtype != second_value.dtype or not np.array_equal(
                value, second_value, equal_nan=True
            ):
                return False
        elif value != second_value:
            return False
    return True


def verdict(kind: str, folder: Path, reading, number: int) -> str:
    """Return how the reader and one of the commands take the damaged file in `folder`."""
    try:
        read = "same" if same(READERS[kind](folder / FILES[kind]), reading) else "SILENT"
    except InputError as error:
        if "\n" in str(error):
            return "more than one line"
        read = "refused"
    status, error = answer(COMMANDS[kind][number % len(COMMANDS[kind])], folder)
    if status == 2:
        good = error.startswith("error: ") and error.count("\n") == 1
        return "refused" if good else f"more than one line: {error!r}"
    return read if status == 0 and read != "refused" else f"{read}, but status {status}"


def _set(name: str, row: object, value: object):
    """Return a change of a column: another value, or a function of the whole column."""

    def change(file: h5py.File) -> None:
        file[name][row] = value(file[name][()])[row] if callable(value) else value

    return change


def _attribute(name: str, value: object):
    return lambda f: f.attrs.__setitem__(name, value)


def _attributes(names: str, *values: object) -> dict[str, object]:
    return {
        f"{name} {value}": _attribute(name, value) for name in names.split() for value in values
    }


PAIR = [1.0, 2.0]
WRONG = {
    "network": {
        "masses in g": lambda f: f["particles/mass"].attrs.update(units="g"),
        "two schemas": _attribute("schema", ["granular-contact-network"] * 2),
        "half a version": _attribute("schema_version", 1.5),
        "nothing": lambda f: f.clear(),
    },
    "sample": {
        **_attributes("radius young density poisson friction", -1.0, np.nan, np.inf, "much", PAIR),
        "no radius": lambda f: f.attrs.__delitem__("radius"),
        "modulus in GPa": _attribute("young", 60.0),
        "radius in mm": _attribute("radius", 1.27),
        "narrow": _set("cell/side", 0, 1e-300),
        "wide": _set("cell/side", 0, 1.0),
        "all in one place": _set("particles/position", ..., [1e-3, 1e-3, 5e-3]),
        "outside the cell": _set("particles/position", 7, [1.0, 1e-3, 1e-3]),
        "behind the wall": _set("particles/position", 7, [1e-3, 1e-3, -1.0]),
        "walls changed places": _set("walls/position", ..., lambda walls: walls[::-1]),
    },
    "signals": {
        **_attributes("amplitude input_frequency time_step", np.nan, np.inf, "much", PAIR),
        "no producer": lambda f: f.attrs.__delitem__("producer"),
        "uneven": _set("time", 3, lambda time: 1.3 * time),
        "of another network": _attribute("network_sha256", "0" * 64),
        "one particle twice": _set("chain/particle", 0, lambda chain: np.roll(chain, -1)),
        "no particle": _set("chain/particle", 0, -1),
        "backwards": _set("time", ..., lambda time: time[::-1]),
    },
    "modes": {
        "another frequency": _set("frequency", 0, 1e9),
        "backwards": _set("frequency", ..., lambda frequency: frequency[::-1]),
        "no shapes": lambda f: f.__delitem__("chi_z"),
    },
}
"""What a faulty exporter writes, format and checksums being right; of networks see
`tests/packing/test_consistency.py`, of any column `test_product.py`."""


def spoiled(kind: str, sound: Path, folder: Path, seed: int, count: int) -> tuple[Counter, list]:
    """Count the verdicts over `count` damages of one file, and return the wrong ones."""
    for file in sound.glob("*.h5"):
        shutil.copy(file, folder)
    path = folder / FILES[kind]
    sound_bytes = (sound / FILES[kind]).read_bytes()
    reading = READERS[kind](path)
    assert all(answer(command, folder)[0] == 0 for command in COMMANDS[kind])

    def work(number: int) -> str:
        path.write_bytes(damage.mangled(sound_bytes, np.random.default_rng([seed, number]))[1])
        return verdict(kind, folder, reading, number)

    results = list(damage.in_child(work, list(range(count)), folder / "log"))
    faults = [result for result in results if result[1] not in ("refused", "same")]
    return Counter(verdict_text for _, verdict_text in results), faults


@pytest.mark.parametrize("error", [MemoryError, KeyError, OSError, RuntimeError, ValueError])
def test_what_is_raised_while_a_file_is_open_is_no_damage_of_it(error, sound):
    ours = error("ours")
    with pytest.raises(error) as raised, open_h5(sound / FILES["network"]):
        raise ours
    assert raised.value is ours


def test_dataset_that_is_missing_is_a_fault_of_the_file(sound):
    """Turn an exception of HDF5 into a refusal."""
    with pytest.raises(InputError) as refused, open_h5(sound / FILES["network"]) as file:
        file["particles/charge"]
    assert refused.value.code == "unreadable"


@pytest.mark.parametrize("count", [15, pytest.param(500, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", READERS)
def test_damaged_bytes_are_refused_or_change_nothing(kind, count, sound, tmp_path):
    verdicts, faults = spoiled(kind, sound, tmp_path, 1, count)
    assert not faults
    assert verdicts["refused"] > count / 3


@pytest.mark.parametrize(("kind", "how"), [(kind, how) for kind in WRONG for how in WRONG[kind]])
def test_wrong_contents_are_refused_in_one_line(kind, how, sound, tmp_path):
    """Refuse a file in each command that reads it."""
    for file in sound.glob("*.h5"):
        shutil.copy(file, tmp_path)
    with h5py.File(tmp_path / FILES[kind], "r+") as file:
        WRONG[kind][how](file)
    for command in COMMANDS[kind]:
        status, error = answer(command, tmp_path)
        assert status == 2 and error.startswith("error: ") and error.count("\n") == 1, command


@pytest.mark.parametrize("kind", ["signals", "modes"])
def test_zeros_that_became_ones_are_noticed(kind, sound, tmp_path):
    """Notice 0xFFFF in place of zero, which HDF5's own checksum does not."""
    path = tmp_path / FILES[kind]
    sound_bytes = (sound / FILES[kind]).read_bytes()
    reading = READERS[kind](sound / FILES[kind])
    zeros = [
        offset
        for offset in range(0, len(sound_bytes) - 4, 2)
        if sound_bytes[offset : offset + 4] == bytes(4)
    ]
    for offset in np.random.default_rng(5).permutation(zeros)[:100]:
        path.write_bytes(sound_bytes[:offset] + b"\xff" * 4 + sound_bytes[offset + 4 :])
        with contextlib.suppress(InputError):
            assert same(READERS[kind](path), reading), offset
