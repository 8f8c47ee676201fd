"""File formats round trip, bad input is refused in one line, the command line in-process."""

import contextlib
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from places import SHEARED

from modal.__main__ import main
from modal.modes.mode_set import read_modes
from modal.packing import crystal as gallery
from modal.packing.chain import wall_to_wall_chain
from modal.packing.network import read_network, write_network
from modal.tools.errors import InputError
from modal.waves.propagate import propagate
from modal.waves.signals import read_signals, write_signals


@pytest.fixture
def sample_file(tmp_path):
    return Path(shutil.copy(SHEARED, tmp_path / "mine.sample.h5"))


@pytest.fixture
def network_file(tmp_path):
    path = tmp_path / "slab.network.h5"
    write_network(path, gallery.fcc(cells=(2, 2, 6)))
    return path


def test_no_half_file_is_left(network_file, monkeypatch):
    before = network_file.read_bytes()
    broken = gallery.fcc(cells=(2, 2, 6)).unchecked(normal="not an array")
    with pytest.raises(ValueError):
        write_network(network_file, broken)
    assert network_file.read_bytes() == before
    assert [path.name for path in network_file.parent.iterdir()] == [network_file.name]


def test_units_of_si_are_read_in_any_notation(network_file):
    for units in ("", "kg m^2", "-", np.bytes_("kg*m2")):
        with h5py.File(network_file, "r+") as file:
            file["particles/inertia"].attrs["units"] = units
        assert read_network(network_file).n_particles == 24


@pytest.mark.parametrize("settings", ["[1]", "3", "{", "null"])
def test_a_damaged_provenance_is_one_line(settings, network_file, tmp_path, capsys):
    with h5py.File(network_file, "r+") as file:
        file["provenance"].attrs.update(settings=settings, sources="[]")
    out = str(tmp_path / "a.modes.h5")
    status = main(["modes", str(network_file), "--lowest", "2", "-o", out])
    error = capsys.readouterr().err
    assert (status, error.count("\n")) == ((0, 0) if settings == "null" else (2, 1))


def test_who_may_read_a_file_stays_as_it_was(network_file):
    network_file.chmod(0o640)
    write_network(network_file, gallery.fcc(cells=(2, 2, 6)))
    assert network_file.stat().st_mode & 0o777 == 0o640


WRONG = {
    "wrong": "choose from",
    "info absent.h5": "no such file",
    "info a\nb.h5": "no such file",
    f"info {'a' * 300}.h5": "no such file",
    "info ": "an empty text",
    "import {folder} -o {folder}/a.network.h5": "a folder, no file; name the",
    "modes {file} --between 5 1": "give the lower end first",
    "modes {file} --lowest 1000": "ask for 1 to 144",
    "modes {file} --lowest 1.5": "no whole number",
    "modes {file} --hours nan": "no number; give it in SI",
    "modes {file} -o {folder}/result": "must end in .modes.h5",
    "modes {file} -o {folder}/a.signals.h5": "must end in .modes.h5",
    "density {file} -o {folder}/new.sample.h5": "must end in .density.h5",
    "count {file} --at many": "not numbers from 0 on; give Hz",
    "count --at 5 {file}": "files stand before the options",
    "wave {file} --time-step 1e-30": "TB of memory",
    "lattice --stress -1e5": "outside 0 to",
    "pack --stress 1e5 -o {file}": "a file, no folder",
    "pack --spheres 0 --stress 1e5 -o {folder}/a": "too few",
}
"""Command lines of careless users, and what is said of them."""


@pytest.mark.parametrize("command", WRONG)
def test_bad_options_are_one_line_and_status_2(command, network_file, tmp_path, one_line):
    words = [word.format(file=network_file, folder=tmp_path) for word in command.split(" ")]
    one_line(main, words, WRONG[command])
    assert list(tmp_path.iterdir()) == [network_file]


def test_modes_and_count_agree_on_the_command_line(network_file, tmp_path, printed):
    out = tmp_path / "slab.modes.h5"
    result = printed("modes", network_file, "--all", "--no-shapes", "-o", out)
    written = read_modes(out)
    assert result["frequency_hz"] == written.frequency.tolist() and written.mode_shape is None
    assert result["modes_with_chi_z_above_0.999"] == (written.chi_z > 0.999).sum() > 6
    counts = printed("count", network_file, "--at", "1e5")["count_below"]
    assert counts == {"1e5": (written.frequency < 1e5).sum()}


def test_chain_through_contacts_without_length_ends():
    """Such networks are refused; the search for a chain ends by itself, too."""
    network = gallery.column(4)
    flat = network.unchecked(lever_i=0 * network.lever_i, lever_j=0 * network.lever_j)
    with pytest.raises(InputError, match="levers of no length"):
        wall_to_wall_chain(flat)


def test_a_record_that_starts_late_is_refused(tmp_path):
    """Velocities count times from when the source begins to move; an interval is read off them."""
    wave = propagate(gallery.fcc(cells=(1, 1, 4)), 1e-5).signals
    for late, good in ((0.0, True), (1e-10, True), (5e-6, False), (-5e-6, False)):
        write_signals(tmp_path / "a.signals.h5", replace(wave, time=wave.time + late))
        refused = pytest.raises(InputError, match="not evenly spaced from 0 on")
        with contextlib.nullcontext() if good else refused:
            read_signals(tmp_path / "a.signals.h5")


def test_chain_of_the_crystal_takes_one_particle_a_layer():
    network = gallery.fcc(cells=(4, 4, 20))
    chain = wall_to_wall_chain(network)
    assert len(chain) == 20
    assert np.array_equal(chain // 16, np.arange(20))


@pytest.mark.parametrize(
    "command",
    [
        "modes {} --lowest 2 -o {}",
        "relax {} --friction 0.3 -o {}",
        "tile {} --repeat 2 1 -o {}",
        "info {} --layers {}",
    ],
)
def test_what_is_read_is_never_written_over(command, sample_file, tmp_path, one_line):
    """By whatever name: the packing would be lost for a list of its modes."""
    before, other = sample_file.read_bytes(), tmp_path / "linked.sample.h5"
    other.symlink_to(sample_file)
    one_line(main, command.format(sample_file, other).split(), "would be written over")
    assert sample_file.read_bytes() == before
