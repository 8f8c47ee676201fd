"""File formats round trip, bad input is refused in one line, the command line in-process."""

import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from places import SHEARED
from refusals import refusal

from modal.__main__ import main
from modal.cli.main import COMMANDS, command_of
from modal.cli.options import Group, NewFile
from modal.modes.mode_set import read_modes
from modal.packing import crystal as gallery
from modal.packing.chain import wall_to_wall_chain
from modal.packing.network import read_network, write_network
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


@pytest.mark.parametrize("units", ["", "kg m^2", "-", np.bytes_("kg*m2")])
def test_units_of_si_are_read_in_any_notation(units, network_file):
    with h5py.File(network_file, "r+") as file:
        file["particles/inertia"].attrs["units"] = units
    assert read_network(network_file).n_particles == 24


def find_modes_with_provenance(settings, network_file):
    """Return the exit status of `modes` on a network with these settings in its provenance."""
    with h5py.File(network_file, "r+") as file:
        file["provenance"].attrs.update(settings=settings, sources="[]")
    out = network_file.with_name("a.modes.h5")
    return main(["modes", str(network_file), "--lowest", "2", "-o", str(out)])


@pytest.mark.parametrize("settings", ["[1]", "3", "{"])
def test_damaged_provenance_is_one_line(settings, network_file, capsys):
    assert find_modes_with_provenance(settings, network_file) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_provenance_without_settings_is_read(network_file, capsys):
    assert find_modes_with_provenance("null", network_file) == 0
    assert capsys.readouterr().err == ""


def test_rights_of_a_file_stay_when_it_is_written_again(network_file):
    network_file.chmod(0o640)
    write_network(network_file, gallery.fcc(cells=(2, 2, 6)))
    assert network_file.stat().st_mode & 0o777 == 0o640


WRONG = {
    "wrong": ("command_line", "modes"),
    "info absent.h5": ("no_file", "absent.h5"),
    "info a\nb.h5": ("no_file", r"a\nb.h5"),
    f"info {'a' * 300}.h5": ("no_file", ""),
    "info ": ("empty_text", "network"),
    "import {folder} -o {folder}/a.network.h5": ("folder", ""),
    "modes {file} --between 5 1": ("interval", ""),
    "modes {file} --lowest 1000": ("mode_count", "144"),
    "modes {file} --lowest 1.5": ("command_line", "1.5"),
    "modes {file} --hours nan": ("command_line", "nan"),
    "modes {file} -o {folder}/result": ("file_ending", ".modes.h5"),
    "modes {file} -o {folder}/a.signals.h5": ("file_ending", ".modes.h5"),
    "density {file} -o {folder}/new.sample.h5": ("file_ending", ".density.h5"),
    "export {file} -o {folder}/a": ("file_ending", ".vtu"),
    "info {file} --layers {folder}/a.txt": ("file_ending", ".csv"),
    "count {file} --at many": ("frequency", "many"),
    "count --at 5 {file}": ("command_line", "files"),
    "wave {file} --time-step 1e-30": ("too_large", "TB"),
    "lattice --stress -1e5": ("stress", ""),
    "pack --stress 1e5 -o {file}": ("not_a_folder", ""),
    "pack --spheres 0 --stress 1e5 -o {folder}/a": ("too_few_spheres", ""),
}
"""Command lines of careless users: code of the refusal, and a name in its line."""


@pytest.mark.parametrize("command", WRONG)
def test_bad_option_is_one_line_and_status_2(command, network_file, tmp_path, one_line):
    words = [word.format(file=network_file, folder=tmp_path) for word in command.split(" ")]
    code, name = WRONG[command]
    one_line(main, words, name, code=code)
    assert list(tmp_path.iterdir()) == [network_file]


def new_files(options):
    """Return the options for files to be written, inside groups too."""
    new_file_options = []
    for option in options:
        if isinstance(option, Group):
            new_file_options += new_files(option.options)
        elif option.kind is NewFile:
            new_file_options.append(option)
    return new_file_options


@pytest.mark.parametrize("command", COMMANDS)
def test_help_names_the_endings_of_new_files(command):
    for option in new_files(command_of(command).OPTIONS):
        assert option.endings
        assert all(f"*{ending}" in option.text for ending in option.endings)


def test_modes_and_count_agree_on_the_command_line(network_file, tmp_path, printed):
    out = tmp_path / "slab.modes.h5"
    result = printed("modes", network_file, "--all", "--no-shapes", "-o", out)
    written = read_modes(out)
    assert result["frequency_hz"] == written.frequency.tolist()
    assert written.mode_shape is None
    assert result["modes_with_chi_z_above_0.999"] == (written.chi_z > 0.999).sum() > 6
    counts = printed("count", network_file, "--at", "1e5")["count_below"]
    assert counts == {"1e5": (written.frequency < 1e5).sum()}


def test_chain_through_contacts_without_length_ends():
    """Refuse such networks; the search for a chain also ends by itself."""
    network = gallery.column(4)
    flat = network.unchecked(lever_i=0 * network.lever_i, lever_j=0 * network.lever_j)
    with refusal("no_levers"):
        wall_to_wall_chain(flat)


@pytest.mark.parametrize("delay", [5e-6, -5e-6])
def test_record_that_starts_late_is_refused(delay, tmp_path):
    """Count times of velocities from when the source begins to move."""
    write_late_record(tmp_path / "a.signals.h5", delay)
    with refusal("uneven_times"):
        read_signals(tmp_path / "a.signals.h5")


@pytest.mark.parametrize("delay", [0.0, 1e-10])
def test_record_may_start_late_by_round_off(delay, tmp_path):
    write_late_record(tmp_path / "a.signals.h5", delay)
    assert len(read_signals(tmp_path / "a.signals.h5").time) > 2


def write_late_record(path, delay):
    wave = propagate(gallery.fcc(cells=(1, 1, 4)), 1e-5).signals
    write_signals(path, replace(wave, time=wave.time + delay))


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
def test_source_is_never_written_over(command, sample_file, tmp_path, one_line):
    """Notice the source by any name; its packing would be lost for a list of its modes."""
    before = sample_file.read_bytes()
    link = tmp_path / "linked.sample.h5"
    link.symlink_to(sample_file)
    one_line(main, command.format(sample_file, link).split(), code="overwrites_source")
    assert sample_file.read_bytes() == before
