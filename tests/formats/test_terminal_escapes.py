"""Control characters of a file, or of its name, do not reach the terminal."""

from dataclasses import replace

import h5py
import pytest

from modal.__main__ import main
from modal.packing.crystal import fcc
from modal.packing.network import write_network
from modal.tools.errors import InputError
from modal.tools.visible import visible

CLEAR = "\x1b[2J\x1b[1;31mfine\x07\u202e\x9b1A"
"""Clears the screen, writes in red, rings, turns the order of letters round, goes up a line."""


def safe(text: str) -> bool:
    """Tell whether a terminal shows the text and does nothing else."""
    return all(line.isprintable() for line in text.split("\n"))


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_notes_are_shown_as_they_are_written(options, tmp_path, capsys):
    path = tmp_path / "a.network.h5"
    study = {"case": CLEAR, f"name{CLEAR}": "note"}
    write_network(path, replace(fcc(cells=(1, 1, 6)), study=study))
    assert main(["info", str(path), *options]) == 0
    printed = capsys.readouterr()
    assert safe(printed.out)
    assert safe(printed.err)
    assert "fine" in printed.out


def test_names_and_units_in_refusals(tmp_path, capsys):
    path = tmp_path / f"a{CLEAR}.network.h5"
    write_network(path, fcc(cells=(1, 1, 6)))
    with h5py.File(path, "r+") as file:
        file["particles/mass"].attrs["units"] = CLEAR
    assert main(["info", str(path)]) == 2
    printed = capsys.readouterr()
    assert safe(printed.err)
    assert printed.err.count("\n") == 1
    assert safe(str(InputError("input", CLEAR)))


def test_letters_of_all_languages_stay():
    text = "Körnung µ 粒 ±"
    assert visible(text) == text
