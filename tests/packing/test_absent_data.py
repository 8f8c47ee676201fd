"""Tests that absent optional data are None, never zeros, and named where they are needed."""

from __future__ import annotations

from dataclasses import replace

import changes
import numpy as np
import pytest

from modal.__main__ import main
from modal.elasticity.slab import static_velocity
from modal.packing import crystal as gallery
from modal.packing.network import read_network, write_network
from modal.packing.rattlers import firmly_held
from modal.packing.sample import Sample, sample_of_network
from modal.packing.state import friction_used, net_forces, stress_tensor, wall_stress
from modal.packing.tiling import repeat
from modal.tools.errors import UnavailableError


def answers(printed, *arguments: object) -> dict:
    """Return what a command prints, without its time and memory."""
    numbers = printed(*arguments).items()
    return {name: value for name, value in numbers if name not in ("seconds", "peak_memory_bytes")}


@pytest.mark.parametrize(
    "present", [(), ("force_normal",), ("overlap", "sliding"), changes.OPTIONAL]
)
def test_round_trip_keeps_what_is_absent(present, tmp_path):
    network = changes.bare(gallery.fcc(cells=(2, 2, 6)), *present)
    path = tmp_path / "x.network.h5"
    write_network(path, network)
    read = read_network(path)
    selected = read.with_contacts(np.arange(5))
    assert read.absent == [name for name in changes.OPTIONAL if name not in present]
    for name in changes.OPTIONAL:
        column = getattr(read, name)
        if name in present:
            np.testing.assert_array_equal(column, getattr(network, name))
            np.testing.assert_array_equal(getattr(selected, name), column[:5])
        else:
            assert column is None
            assert getattr(selected, name) is None


def test_springs_alone_need_none_of_it(tmp_path, printed):
    """Find the numbers of the whole network, to the bit."""
    complete = gallery.fcc(cells=(2, 2, 8))
    commands = (
        ("modes", "--lowest", "5"),
        ("modes", "--all", "--translations-only"),
        ("count", "--at", "3e4"),
        ("density", "--resolution", "2e4"),
        ("wave", "--duration", "3e-5"),
        ("response", "--highest", "3e4"),
    )
    paths = [tmp_path / f"{name}.network.h5" for name in ("whole", "bare")]
    for path, network in zip(paths, (complete, changes.bare(complete)), strict=True):
        write_network(path, network)
    for command, *options in commands:
        first, second = (answers(printed, command, path, *options) for path in paths)
        assert first == second


def test_info_names_what_is_absent_and_leaves_its_numbers_out(tmp_path, printed):
    complete = gallery.fcc(cells=(2, 2, 12))
    path = tmp_path / "x.network.h5"
    write_network(path, complete)
    numbers = answers(printed, "info", path)
    needs_forces = {"stress_pa", "largest_off_diagonal_stress_pa", "stress_deviation_along_z"}
    needs_forces |= {f"{most}net_force_over_contact_force" for most in ("", "largest_")}
    needs_normal_force = {"wall_stress_pa", "pulling_contacts", "law"}
    needs_normal_force |= {"force_over_stiffness_times_overlap"}
    needs_forces |= {"mobilised_contacts_per_particle", "isostatic_coordination_number"}
    needs_forces = (needs_forces | {"sliding_contacts"}) & numbers.keys()
    for columns, missing in (
        (("force_normal", "overlap"), needs_forces),
        ((), needs_forces | needs_normal_force),
    ):
        write_network(path, changes.bare(complete, *columns))
        remaining = answers(printed, "info", path)
        assert remaining["absent"] == [name for name in changes.OPTIONAL if name not in columns]
        assert numbers.keys() - remaining.keys() == missing
        assert all(remaining[name] == numbers[name] for name in remaining if name != "absent")
        table = tmp_path / "layers.csv"
        printed("info", path, "--layers", table)
        names = np.genfromtxt(table, delimiter=",", names=True).dtype.names
        assert "void_ratio" in names
        assert "stress_zz_Pa" not in names


@pytest.mark.parametrize(
    ("kept", "arguments", "missing"),
    [
        ((), ("wave", "--pre-stress", "normal"), "force_normal"),
        (("force_tangential",), ("wave", "--pre-stress", "full"), "force_normal"),
        (("force_normal",), ("wave", "--pre-stress", "full"), "force_tangential"),
        (("force_normal",), ("modes", "--sliding", "slip"), "sliding"),
    ],
)
def test_what_is_needed_is_asked_for_by_name(kept, arguments, missing, tmp_path, one_line):
    path = tmp_path / "x.network.h5"
    write_network(path, changes.bare(gallery.fcc(cells=(2, 2, 6)), *kept))
    command = [arguments[0], path, *arguments[1:]]
    one_line(main, command, f"contacts/{missing},", code="unknown_column")


FUNCTIONS = {
    "stress_tensor": (stress_tensor, "force_normal"),
    "wall_stress": (wall_stress, "force_normal"),
    "net_forces": (net_forces, "force_normal"),
    "friction_used": (lambda network: friction_used(network, 0.3), "force_normal"),
    "sample_of_network": (lambda network: sample_of_network(network, 0.3), "cell_shift"),
    "repeat": (lambda network: repeat(network, 2, 1), "cell_shift"),
}
"""Name -> function, and the column that it needs."""


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_names_the_column_that_it_needs(name):
    function, column = FUNCTIONS[name]
    network = changes.bare(gallery.fcc(cells=(2, 2, 6)))
    with pytest.raises(UnavailableError) as error_info:
        function(network)
    assert error_info.value.code == "unknown_column"
    assert f"contacts/{column}," in error_info.value.problem


def test_without_forces_all_spheres_of_a_crystal_are_firmly_held():
    assert firmly_held(changes.bare(gallery.fcc(cells=(2, 2, 6)))).all()


def test_static_velocity_needs_no_forces():
    crystal = gallery.fcc(cells=(2, 2, 60))
    assert static_velocity(changes.bare(crystal)) == static_velocity(crystal)


COLUMN = gallery.column(4)
FLAT = COLUMN.unchecked(wall_position=np.zeros(2))
"""A column whose walls have one place: they count as none, unless contacts touch them."""
INCOMPLETE = {
    "no area": replace(COLUMN, cell_size=np.zeros(3)),
    "no volume": FLAT.some(~FLAT.with_wall),
}


@pytest.mark.parametrize("kind", INCOMPLETE)
def test_info_and_modes_of_a_network_without_an_area_or_a_length(kind, tmp_path, printed):
    """Leave stresses and void ratio out."""
    path = tmp_path / "x.network.h5"
    write_network(path, INCOMPLETE[kind])
    numbers = printed("info", path)
    assert not {"stress_pa", "wall_stress_pa", "void_ratio"} & numbers.keys()
    assert len(printed("modes", path, "--lowest", 3)["frequency_hz"]) == 3


@pytest.mark.parametrize(
    ("network", "command", "code"),
    [
        pytest.param(INCOMPLETE["no area"], "wave", "no_area", id="wave without an area"),
        pytest.param(INCOMPLETE["no area"], "response", "no_area", id="response without an area"),
        pytest.param(INCOMPLETE["no volume"], "wave", "no_volume", id="wave without a length"),
        pytest.param(
            INCOMPLETE["no volume"],
            "info --layers layers.csv",
            "no_volume",
            id="layers without a length",
        ),
        pytest.param(FLAT, "info", "wall_order", id="info of touching walls in one place"),
        pytest.param(FLAT, "modes", "wall_order", id="modes of touching walls in one place"),
        pytest.param(FLAT, "wave", "wall_order", id="wave between walls in one place"),
    ],
)
def test_commands_refuse_a_network_without_an_area_or_a_length(
    network, command, code, tmp_path, monkeypatch, one_line
):
    monkeypatch.chdir(tmp_path)
    write_network("x.network.h5", network)
    name, *options = command.split()
    one_line(main, [name, "x.network.h5", *options], code=code)


def test_stress_on_walls_needs_an_area():
    with pytest.raises(UnavailableError) as error_info:
        wall_stress(INCOMPLETE["no area"])
    assert error_info.value.code == "no_area"


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_no_shear_forces_and_zero_shear_forces_slide_alike(friction):
    """Find all contacts at their limit without friction, as nothing resists the smallest shear."""
    crystal = gallery.fcc(cells=(3, 3, 6))
    sample = Sample(crystal.position, crystal.cell_size[:2], crystal.wall_position, friction)
    n_contacts = len(sample.contacts().overlap)
    with_zeros = replace(sample, shear=np.zeros((n_contacts, 2)))
    without_shear = sample.network().sliding
    assert np.array_equal(with_zeros.network().sliding, without_shear)
    assert (without_shear == (friction == 0)).all()


@pytest.mark.parametrize("note", ["high", np.nan, [0.1, 0.2], -0.3, 0.0])
def test_notes_that_are_no_friction_are_only_notes(note, tmp_path, printed):
    """Accept free attributes of another program, without a traceback or NaN in JSON."""
    path = tmp_path / "x.network.h5"
    network = gallery.fcc(cells=(2, 2, 6))
    write_network(path, replace(network, study={"mu_wave": note, "density": note}))
    assert "largest_share_of_friction" not in printed("info", path)
    write_network(path, replace(network, study={"mu_wave": 0.3, "density": "2230"}))
    assert printed("info", path)["largest_share_of_friction"] == 0
