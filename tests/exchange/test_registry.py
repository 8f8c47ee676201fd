"""One registry of programs: `modal.read`, `import` and every other command ask it."""

from __future__ import annotations

import sys

import program_files
import pytest
from places import PACKINGS
from refusals import refusal

import modal
from modal.__main__ import main
from modal.exchange import programs
from modal.exchange.registry import import_packing
from modal.packing.network import read_network, write_network

RESTART = PACKINGS / "mercury_CubicPacking.restart"
OWN = '''
"""Chains of equal spheres, as a program of one's own may write them."""

from modal import random_packing
from modal.exchange.import_result import ImportResult
from modal.exchange.registry import Option

NAME = "a program of my own"
OPTIONS = {"spheres": Option("how many", "N", int), "log": Option("nothing at all")}


def sniff(path, head):
    return head.startswith(b"own")


def read(path, spheres=30, log=None):
    return ImportResult(random_packing(spheres, stress=1e5, seed=1), sought=True)
'''


def test_a_program_is_one_file(tmp_path, monkeypatch, capsys):
    (tmp_path / "own_program.py").write_text(OWN)
    monkeypatch.setattr(programs, "__path__", [*programs.__path__, str(tmp_path)])
    # The command asks for the programs when it is loaded.
    monkeypatch.delitem(sys.modules, "modal.cli.importing", raising=False)
    (tmp_path / "x.txt").write_text("own format\n")
    result = import_packing(tmp_path / "x.txt")
    assert result.network.n_particles == 30
    assert not any(map(len, (result.laws, result.law, result.told, result.remarks)))
    assert modal.read(tmp_path / "x.txt", spheres=20).n_particles == 20
    files = program_files.PackingFiles(capsys, tmp_path / "x.txt", {"spheres": 20})
    assert files.imported()["spheres"] == read_network(files.out).n_particles == 20


def test_commands_take_a_file_that_needs_no_options(tmp_path, printed, one_line):
    """Recognise products, too: modes of the restart file belong to it, and to no other packing."""
    modes = tmp_path / "x.modes.h5"
    picture = tmp_path / "x.xyz"
    answers = {}
    for command in (
        ["info", RESTART],
        ["count", RESTART, "--at", "13"],
        ["modes", RESTART, "--highest", "3", "-o", modes],
        ["export", RESTART, modes, "--modes", "1", "-o", picture],
    ):
        answers[command[0]] = printed(*command)
    assert answers["info"]["particles"] == answers["export"]["spheres"] == 125
    # 625 motions without energy, and below 13 Hz one of the five modes of each chain.
    assert answers["count"]["count_below"]["13"] == 625 + 25
    write_network(tmp_path / "y.network.h5", modal.fcc(cells=(2, 2, 4)))
    export_of_other = ["export", tmp_path / "y.network.h5", modes, "--modes", "1", "-o", picture]
    one_line(main, export_of_other, "mercury_CubicPacking.restart", code="other_packing")


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ({"log": "log.lammps"}, "unknown_option"),
        ({"colour": "red"}, "unknown_option"),
        ({"scales": (1, 0, 1)}, "scales"),
    ],
    ids=["option of another program", "no option", "scale of zero"],
)
def test_options_that_do_not_belong_are_refused(options, code):
    with refusal(code):
        modal.read(RESTART, **options)
