"""The command line of analysis, in-process: products in, table and figures out, errors."""

import os
import subprocess
import sys
from importlib import import_module

import numpy as np
import pytest
from places import ROOT
from study_folder import measured

from analysis.__main__ import main
from analysis.cli.main import COMMANDS, parser
from analysis.estimators.layer_lattice import LayerLattice, lattice_signals
from modal.modes.mode_set import ModeSet, write_modes
from modal.packing.crystal import fcc
from modal.packing.network import write_network
from modal.waves.signals import write_signals

EXAMPLES = {name: import_module(f"analysis.cli.{name}").EXAMPLE for name in COMMANDS}


@pytest.fixture(scope="module")
def products(tmp_path_factory):
    """Cases 1 to 3: all products, no modes, only the network."""
    folder = tmp_path_factory.mktemp("products")
    for number, stress in ((1, 1e4), (2, 1e5), (3, 1e6)):
        network = fcc(stress, (1, 1, 100 if number == 1 else 200))
        write_network(folder / f"case{number:02d}.network.h5", network)
        chain = LayerLattice.of_network(network)
        if number < 3:
            signals = lattice_signals(chain, np.arange(0, network.length / chain.velocity, 2e-7))
            write_signals(folder / f"case{number:02d}.signals.h5", signals)
        if number == 1:
            omega, shape = chain.eigenmodes()
            f, one = omega / (2 * np.pi), np.ones(chain.layers)
            modes = ModeSet(
                frequency=f,
                residual=0 * f,
                chi_z=one,
                chi_z_chain=one,
                rotation_share=0 * f,
                resonance_frequency=f,
                resonance_shape=shape.T,
                resonance_wavenumber=np.pi * np.arange(1, 101) / network.length,
            )
            write_modes(folder / "case01.modes.h5", modes)
            write_modes(folder / "case01.translations.modes.h5", modes)
    return folder


def compared(products, name):
    """The comparison of a crystal, by quantity."""
    lines = measured(name, products).tables["comparison"]
    head = ("theory", "modal", "linear", "yade", "note")
    return {line[1]: dict(zip(head, line[3:], strict=True)) for line in lines}


def test_a_crystal_beside_its_theory(products):
    row = compared(products, "case01")["f_low-pass"]
    assert float(row["modal"]) == pytest.approx(float(row["theory"]), rel=5e-4)
    assert float(row["yade"]) == pytest.approx(float(row["theory"]), rel=2e-3)


def test_linear_is_one_thing_and_its_pre_stress_has_its_own_row(products):
    """Without pre-stress the linear wave's V_P is theory's; the pre-stress row may differ from it.

    By the ratio of normal force to stiffness and distance, N / (kn D) = 2/3 overlap / D, at most.
    The damped transform's own bias is below 1e-5.
    """
    rows = compared(products, "case02")
    assert rows["f_low-pass"]["modal"] == ""
    theory = float(rows["V_P, long waves"]["theory"])
    full = rows["V_P, long waves, with pre-stress"]
    crystal = fcc(cells=(1, 1, 4))
    overlap = crystal.overlap.max() / (2 * crystal.radius[0])
    assert float(rows["V_P, long waves"]["linear"]) == pytest.approx(theory, rel=1e-5)
    assert 0 < abs(float(full["linear"]) / theory - 1) < 2 / 3 * overlap
    assert full["theory"] == full["yade"] == "" and "tangent" in full["note"]
    void = rows["void ratio, wall to wall"]
    assert void["yade"] == "" and void["modal"]  # a property of the packing, with or without a run


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["figure"], "required"),
        (["figure", "gain", "x"], "no such file"),
        (["figure", "gain", "9"], "run the case first"),
        (["figure", "nothing", "1"], "choose one of"),
        (["figure", "chi_z"], "no case given"),
        (["figure", "absent.csv"], "cannot be read"),
        (["figure", "chi_z", "2"], "make it before"),
        ([], "required"),
    ],
)
def test_bad_input_is_one_line(products, tmp_path, capsys, arguments, words):
    if len(arguments) > 1:
        arguments = [*arguments, "--products", str(products), "-o", str(tmp_path)]
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert words in captured.err
    assert captured.err.count("\n") == 1


def test_broken_file_is_one_line(tmp_path, capsys):
    (tmp_path / "case02.network.h5").write_bytes(b"not HDF5")
    assert main(["figure", "gain", "2", "--products", str(tmp_path), "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("name", EXAMPLES)
def test_help_ends_in_an_example_that_parses(name, capsys):
    with pytest.raises(SystemExit):
        main([name, "--help"])
    last = capsys.readouterr().out.rstrip().splitlines()[-1]
    assert last == f"example: python -m analysis {EXAMPLES[name]}"
    assert parser(name).parse_args(EXAMPLES[name].split()).command == name


def test_a_reader_that_has_seen_enough_stops_nothing(products, tmp_path):
    """As `python -m analysis figure gain 2 | head`: no traceback, and the figure is written."""
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "analysis", "figure", "gain", "2"]
    done = subprocess.run(
        [*command, "--products", str(products), "-o", str(tmp_path)],
        cwd=ROOT,
        stdout=write,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(write)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "case02.gain.csv").exists()


def test_help_needs_no_package_that_draws():
    """Nor does a measurement; a figure says what is absent, in one line."""
    hidden = "import sys; sys.modules['matplotlib'] = None; from analysis.__main__ import main; "
    for words, status in (
        (["--help"], 0),
        (["measure", "none.h5"], 2),
        (["figure", "gain", "2"], 2),
    ):
        code = f"{hidden}sys.exit(main({words!r}))"
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True
        )
        assert done.returncode == status and "Traceback" not in done.stderr
    assert "matplotlib is absent" in done.stderr
