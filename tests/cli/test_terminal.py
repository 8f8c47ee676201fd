"""What people see on a terminal: units, columns, groups, examples of the help; pipes that close."""

import doctest
import importlib
import importlib.util
import json
import math
import re
import subprocess
import sys

import program_files
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from places import ROOT

import modal
from modal.cli.main import COMMANDS, main, parser
from modal.cli.terminal import label_and_unit, page
from modal.packing.network import write_network
from modal.tools.display import PREFIXES, quantities

POWER = {prefix: power for power, prefix in PREFIXES.items()}


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # on a busy machine
@given(
    st.lists(st.floats(-1e11, 1e11).filter(lambda x: x == 0 or abs(x) > 1e-8), min_size=1),
    st.integers(3, 8),
)
def test_quantities_say_the_numbers(values, digits):
    """Read back, each differs by at most half of the last decimal, which the largest fixes."""
    *numbers, last = quantities(values, "Pa", digits).split(", ")
    last, unit = last.split(" ")
    scale = 10.0 ** POWER[unit.removesuffix("Pa")]
    largest = max(map(abs, values))
    # Half a unit in the largest number's last digit; a carry, 9.9996 to 10.000, is one more digit.
    tolerance = 0.5001 * 10.0 ** (math.floor(math.log10(largest)) + 2 - digits) if largest else 0
    for text, value in zip([*numbers, last], values, strict=True):
        assert abs(float(text) * scale - value) <= tolerance


def test_examples_of_the_help_run(tmp_path, monkeypatch, capsys):
    """What the help calls mine is small here, and imported before anything is made of it."""
    monkeypatch.chdir(tmp_path)
    network = modal.fcc(cells=(3, 3, 8))  # no pair touches twice, which a table cannot say
    program_files.tables(network, tmp_path)
    first = ["import", "pack", "modes"]
    for name in first + [name for name in COMMANDS if name not in first]:
        example = _example(name, capsys)
        if name == "export" and importlib.util.find_spec("meshio") is None:
            continue
        assert main(example) == 0, (name, capsys.readouterr().err)
        if name == "pack":
            (tmp_path / "dense/100000Pa.sample.h5").rename(tmp_path / "mine.sample.h5")


def _example(name, capsys):
    with pytest.raises(SystemExit):
        parser().parse_args([name, "--help"])
    line = capsys.readouterr().out.rstrip().splitlines()[-1]
    return line.removeprefix("example: python -m modal ").split()


@pytest.fixture
def crystal(tmp_path):
    path = tmp_path / "fcc.network.h5"
    write_network(path, modal.fcc(cells=(2, 2, 8)))
    return str(path)


def test_info_in_groups_has_what_json_has(crystal, capsys):
    assert main(["info", crystal, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert main(["info", crystal]) == 0
    whole = capsys.readouterr().out
    titles = re.findall(r"^(\S.*)$", whole, re.MULTILINE)
    out, notes = whole.split("notes of the file")
    rows = dict(re.findall(r"^ +(\S+(?: \S+)*)  +(.*)$", out, re.MULTILINE))
    assert titles[0] == "packing" and titles[-2] == "notes of the file, in SI units"
    assert rows["particles"] == str(told["particles"])
    assert rows["length"] == f"{told['length_m'] * 1e3:.4g} mm"
    assert rows["stress"].split(" ")[-1] == "kPa"
    shown = [float(text) for text in rows["stress"].removesuffix(" kPa").split(", ")]
    assert shown == pytest.approx([value / 1e3 for value in told["stress_pa"]], rel=1e-3)
    assert re.search("^ +stress +100000", notes, re.MULTILINE)  # that it was made for, as it is
    # Every name of the result is in the page, once.
    for name in set(told) - {"study", "seconds", "peak_memory_bytes"}:
        label = re.escape(label_and_unit(name)[0])
        assert len(re.findall(rf"^ +{label}(?:  |$)", out, re.MULTILINE)) == 1, name


def test_lists_of_modes_stand_in_columns(crystal, capsys):
    assert main(["modes", crystal, "--lowest", "30", "--json"]) == 0
    frequency = json.loads(capsys.readouterr().out)["frequency_hz"]
    assert main(["modes", crystal, "--lowest", "30"]) == 0
    out = capsys.readouterr().out
    assert "frequency, kHz" in out and "... 6 more" in out
    rows = re.findall(r"^ *(\d+) +(\d+\.\d+) +\S+ +\S+e-\d+$", out, re.MULTILINE)
    assert [int(number) for number, _ in rows] == [*range(1, 13), *range(19, 31)]
    for number, text in rows:
        # Three digits before the point or fewer, six in the largest: 0.0005 kHz at most.
        assert float(text) == pytest.approx(frequency[int(number) - 1] / 1e3, abs=5.1e-4)


def test_examples_in_docstrings_run():
    """Of all modules of these rooms."""
    for room in ("cli", "exchange", "tools"):
        for path in (ROOT / "modal" / room).rglob("*.py"):
            if ">>>" in path.read_text():
                name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
                assert doctest.testmod(importlib.import_module(name)).failed == 0, name


def test_velocities_have_no_prefix_and_equal_decimals():
    assert page({"velocity_m_per_s": [782.1, 549.0]}) == "velocity  782.1, 549.0 m/s"


def test_a_reader_that_has_seen_enough_is_no_error():
    """As with `python -m modal lattice | true`: what it read stays, nothing is said."""
    with subprocess.Popen(
        [sys.executable, "-m", "modal", "lattice"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as run:
        run.stdout.close()
        assert run.stderr.read() == b""
    assert run.returncode == 0
