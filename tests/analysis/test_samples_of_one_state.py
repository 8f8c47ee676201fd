"""Means over files that are samples of one state; which files are measured; the exit status."""

import json
from dataclasses import replace

import numpy as np
import pytest
from changes import from_other_end, in_units, mirrored, renumbered, stiffer
from packings import polydisperse, slender

import modal
from analysis.__main__ import main
from analysis.measurement import Measurement, mean_of
from analysis.packing_data import PackingData
from analysis.same_state import differences, state_of
from analysis.value import Value
from modal.packing.network import Network, write_network
from modal.packing.tiling import repeat


def pushed_along_z(network: Network) -> Network:
    """Return a network whose normal forces are larger, the closer a contact lies to z."""
    share = 1 + 2 * network.normal[:, 2] ** 2
    return replace(network, force_normal=share * network.force_normal)


def times(factor: float, *names: str):
    """Return a function that multiplies these columns of a network by a factor."""
    return lambda net: replace(net, **{name: factor * getattr(net, name) for name in names})


def not_periodic_along_y(network: Network) -> Network:
    """Return a network without its period along y, and without the contacts across it."""
    inside = network.with_contacts(network.cell_shift[:, 1] == 0)
    return replace(inside, cell_periodic=np.array([True, False, False]))


def unequal(network: Network) -> Network:
    """Return a packing with radii 1:3, of the same mean radius as the network's."""
    unequal_spheres = polydisperse()
    factor = float(network.radius.mean() / unequal_spheres.radius.mean())
    return in_units(unequal_spheres, length=factor, mass=factor**3, time=factor)


CHANGES = {
    "stress": times(3.0, "force_normal", "force_tangential"),
    "stress_zz": pushed_along_z,
    "density": times(1.5, "mass", "inertia"),
    "stiffness": times(2.0, "stiffness_normal", "stiffness_tangential"),
    "law": times(1.5, "force_normal", "force_tangential"),
    "stiffness_ratio": times(0.5, "stiffness_tangential"),
    "diameter": lambda net: polydisperse(),
    "large_spheres": unequal,
    "coordination": lambda net: net.with_contacts(slice(0, None, 2)),
    "periods": not_periodic_along_y,
    "width": lambda net: repeat(net, 2, 2),
    "mu_wave": lambda net: replace(net, study={"mu_wave": 0.7}),
}


def codes(*networks: Network) -> set[str]:
    """Return the codes of the properties in which the states of packings differ."""
    states = [state_of(network) for network in networks]
    return {difference.code for difference in differences(states)}


@pytest.mark.parametrize("code", CHANGES)
def test_a_changed_packing_differs_by_its_property(code):
    """Measure each property on the network, but the friction of the wave, which is a note."""
    network = replace(slender(), study={"mu_wave": 0.2})
    assert code in codes(network, CHANGES[code](network))


def test_samples_of_one_state_are_alike():
    """Compare another seed, and the same packing mirrored, renumbered, and from its other ends."""
    network = slender()
    numbers = np.random.default_rng(1).permutation(network.n_particles)
    samples = [
        network,
        slender(seed=1),
        mirrored(network),
        from_other_end(network, ~network.with_wall),
        renumbered(network, numbers),
    ]
    assert codes(*samples) == set()


def test_stress_needs_no_side_of_the_cell_along_z():
    """Take the height from the walls: files may say 0 for the cell, as formats.md has it."""
    network = slender()
    flat = replace(network, cell_size=network.cell_size * np.array([1, 1, 0]), study={})
    stress = state_of(flat)["stress"].value
    assert stress == pytest.approx(state_of(network)["stress"].value)


def test_periods_are_compared_axis_by_axis():
    """Show one digit an axis: periods along x and y are 110, along x alone 100."""
    network = slender()
    states = [state_of(network), state_of(not_periodic_along_y(network))]
    (periods,) = [difference for difference in differences(states) if difference.code == "periods"]
    assert periods.smallest == 100
    assert periods.largest == 110


def test_walls_of_another_stiffness_leave_the_state_as_it_is():
    """Take the stiffness of a state between spheres, whatever its walls are made of."""
    network = slender()
    hard_walls = np.where(network.with_wall, 10.0, 1.0)
    hardened = stiffer(network, hard_walls, hard_walls)
    assert not codes(network, hardened) & {"stiffness", "stiffness_ratio"}


def without_forces(network: Network) -> Network:
    """Return a network whose forces, overlaps and sliding contacts are unknown."""
    return replace(network, force_normal=None, force_tangential=None, overlap=None, sliding=None)


def test_an_unknown_property_is_no_difference():
    assert codes(slender(), without_forces(slender())) == set()


def test_a_property_unknown_of_one_packing_is_compared_among_the_others():
    network = slender()
    assert "stress" in codes(network, without_forces(network), CHANGES["stress"](network))


def test_errors_of_a_mean_are_added_as_squares_and_common_errors_remain():
    """Find sqrt(3^2 + 4^2) / 2 for the separate fits, and 12 of the length, which both share."""
    values = [Value(10.0, "m/s", {"fit": 3.0, "length": 12.0}), Value(10.0, "m/s", {"fit": 4.0})]
    mean = mean_of([Measurement({"v": value}) for value in values])["v"]
    assert mean.error == pytest.approx(np.hypot(2.5, 12.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with two samples of one state, and with files that are no packings.

    Files a and b are samples of one state, c is b under three times its stress; the file "text" is
    no HDF5, and "cut" ends early.
    """
    path = tmp_path_factory.mktemp("samples")
    write_network(path / "a.network.h5", slender())
    write_network(path / "b.network.h5", slender(seed=1))
    write_network(path / "c.network.h5", CHANGES["stress"](slender(seed=1)))
    (path / "text.h5").write_text("none")
    (path / "cut.network.h5").write_bytes((path / "b.network.h5").read_bytes()[:9000])
    return path


@pytest.fixture(scope="module")
def files(folder):
    """Return the paths of the packings a, b and c."""
    return {name: str(folder / f"{name}.network.h5") for name in "abc"}


@pytest.fixture(scope="module")
def unreadable(folder):
    """Return the paths of the files that are no packings."""
    return [str(folder / "text.h5"), str(folder / "cut.network.h5")]


VOID_RATIO = ["--quantities", "void_ratio"]


def test_samples_of_one_state_have_a_mean(files, printed):
    result = printed("measure", files["a"], files["b"], *VOID_RATIO, main=main)
    values = [result[files[name]]["void_ratio"]["value"] for name in "ab"]
    assert result["mean"]["void_ratio"]["value"] == pytest.approx(np.mean(values))
    assert "differences" not in result


def test_unlike_packings_have_no_mean_but_a_reason(files, printed):
    quantities = ["--quantities", "void_ratio", "coordination"]
    result = printed("measure", *files.values(), *quantities, main=main)
    assert set(result["mean"]) == {"void_ratio", "coordination"}
    assert all(value["value"] is None for value in result["mean"].values())
    (stress,) = [reason for reason in result["differences"] if reason["code"] == "stress"]
    # Samples of one state may have stresses 1 % apart.
    assert stress["largest"] == pytest.approx(3 * stress["smallest"], rel=1e-2)


def test_the_reason_for_no_mean_goes_to_standard_error(files, capsys):
    assert main(["measure", *files.values(), *VOID_RATIO]) == 0
    output = capsys.readouterr()
    assert output.out.count("void_ratio") == 3
    assert output.err


def test_a_file_that_is_no_packing_does_not_keep_another_from_being_measured(
    files, unreadable, printed
):
    """Measure the packing, name the files that are none, and end with status 3."""
    result = printed("measure", files["a"], *unreadable, *VOID_RATIO, main=main, status=3)
    assert result[files["a"]]["void_ratio"]["value"] > 0
    assert set(result["refused"]) == set(unreadable)
    assert "mean" not in result


def test_a_mean_leaves_out_a_file_that_is_no_packing(files, unreadable, printed):
    paths = [unreadable[0], files["a"], files["b"]]
    result = printed("measure", *paths, *VOID_RATIO, main=main, status=3)
    assert result["mean"]["void_ratio"]["value"] > 0


def test_a_file_that_is_no_packing_is_named_on_standard_error(files, unreadable, capsys):
    assert main(["measure", files["a"], unreadable[0], *VOID_RATIO]) == 3
    assert unreadable[0] in capsys.readouterr().err


@pytest.mark.parametrize("count", [1, 2])
def test_files_of_which_none_is_a_packing_are_refused(unreadable, one_line, count):
    """End with status 2."""
    one_line(main, ["measure", *unreadable[:count], *VOID_RATIO])


def test_the_status_is_3_where_nothing_was_measured(tmp_path, printed):
    """Measure a crystal of three layers, too short for the velocity and for Ioffe-Regel's limit."""
    path = tmp_path / "a.network.h5"
    write_network(path, modal.fcc(cells=(1, 1, 3)))
    quantities = ["--quantities", "v_p", "ioffe_regel"]
    result = printed("measure", path, *quantities, main=main, status=3)
    assert json.dumps(result).count('"value": null') == 2


NOTES = {
    "a text": "100 kPa",
    "a vector": [1e5, 1e5, 1e5],
    "nothing": None,
    "a truth": True,
    "an array": np.array([[1.0, 2.0]]),
}


@pytest.mark.parametrize("name", ["stress", "mu_comp", "mu_wave"])
@pytest.mark.parametrize("note", NOTES.values(), ids=NOTES)
def test_a_note_that_is_no_number_counts_as_none(note, name):
    """Measure the stress on the contacts instead, and refuse nothing."""
    packing = PackingData(replace(slender(), study={name: note}))
    # The packing was compressed to 100 kPa, and its stress is that within 0.5 %.
    assert packing.stress == pytest.approx(1e5, rel=5e-3)
    assert np.isnan(packing.mu_comp)
    assert packing.unsettled == ""
    assert packing.label
    assert packing.of_one_sample
    assert not codes(packing.network, slender())
