"""Means over files: of samples of one state alone; which files are measured; the exit status."""

import json
from dataclasses import replace

import numpy as np
import pytest
from changes import from_other_end, in_units, mirrored, renumbered
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
    """Normal forces that are the larger, the more a contact lies along z."""
    share = 1 + 2 * network.normal[:, 2] ** 2
    return replace(network, force_normal=share * network.force_normal)


def times(factor: float, *names: str):
    """A change that multiplies columns."""
    return lambda net: replace(net, **{name: factor * getattr(net, name) for name in names})


def not_periodic_along_y(network: Network) -> Network:
    """Walls nobody knows of in the place of periods along y."""
    inside = network.with_contacts(network.cell_shift[:, 1] == 0)
    return replace(inside, cell_periodic=np.array([True, False, False]))


def unequal(network: Network) -> Network:
    """Radii 1:3 of the same mean."""
    other = polydisperse()
    share = float(network.radius.mean() / other.radius.mean())
    return in_units(other, share, share**3, share)


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
    return {each.code for each in differences([state_of(net) for net in networks])}


@pytest.mark.parametrize("code", CHANGES)
def test_unlike_packings_are_told_apart(code):
    """Each by a property that is measured on the network, the wave's friction by its note."""
    network = replace(slender(), study={"mu_wave": 0.2})
    assert code in codes(network, CHANGES[code](network))


def test_samples_of_one_state_are_alike():
    """Seeds, and one packing in other numberings and mirrored."""
    one = slender()
    others = [slender(seed=1), mirrored(one), from_other_end(one, ~one.with_wall)]
    numbers = np.random.default_rng(1).permutation(one.n_particles)
    assert codes(one, *others, renumbered(one, numbers)) == set()


def test_stress_needs_no_side_of_the_cell_along_z():
    """Walls bound the packing there: files may say 0, as formats.md has it."""
    network = slender()
    flat = replace(network, cell_size=network.cell_size * np.array([1, 1, 0]), study={})
    stress = state_of(flat)["stress"].value
    assert stress == pytest.approx(state_of(network)["stress"].value)


def test_periods_are_told_axis_by_axis():
    """The digits of the number that is shown are the axes: periods along x and y, along x alone."""
    network = slender()
    states = [state_of(network), state_of(not_periodic_along_y(network))]
    (found,) = [each for each in differences(states) if each.code == "periods"]
    assert (found.smallest, found.largest) == (100, 110)


def test_walls_of_another_stiffness_leave_the_state_as_it_is():
    """The stiffness of a state is that between spheres, whatever its walls are made of."""
    network = slender()
    hard_walls = np.where(network.with_wall, 10.0, 1.0)
    names = ("stiffness_normal", "stiffness_tangential")
    other = replace(network, **{name: hard_walls * getattr(network, name) for name in names})
    assert not codes(network, other) & {"stiffness", "stiffness_ratio"}


def test_what_one_packing_does_not_know_is_compared_among_the_others():
    one = slender()
    unknown = replace(one, force_normal=None, force_tangential=None, overlap=None, sliding=None)
    assert codes(one, unknown) == set()
    assert "stress" in codes(one, unknown, CHANGES["stress"](one))


def test_the_mean_of_two_errors_is_that_of_their_squares_and_the_common_part_stays():
    """sqrt(3^2 + 4^2) / 2 of what is each one's own, beside 12 that both share."""
    each = [Value(10.0, "m/s", {"fit": 3.0, "length": 12.0}), Value(10.0, "m/s", {"fit": 4.0})]
    mean = mean_of([Measurement({"v": one}) for one in each])["v"]
    assert mean.error == pytest.approx(np.hypot(2.5, 12.0))


@pytest.fixture
def files(tmp_path):
    """Two samples of one state, the second also under three times its stress."""
    networks = {"a": slender(), "b": slender(seed=1), "c": CHANGES["stress"](slender(seed=1))}
    paths = {}
    for name, network in networks.items():
        paths[name] = str(tmp_path / f"{name}.network.h5")
        write_network(paths[name], network)
    return paths


def test_no_mean_of_unlike_packings_but_the_reason(files, printed, capsys):
    asked = "--quantities", "void_ratio", "coordination"
    alike = printed("measure", files["a"], files["b"], *asked, main=main)
    each = [alike[files[name]]["void_ratio"]["value"] for name in "ab"]
    assert alike["mean"]["void_ratio"]["value"] == pytest.approx(np.mean(each))
    assert "differences" not in alike
    unlike = printed("measure", *files.values(), *asked, main=main)
    assert set(unlike["mean"]) == {"void_ratio", "coordination"}
    assert all(value["value"] is None for value in unlike["mean"].values())
    (found,) = (one for one in unlike["differences"] if one["code"] == "stress")
    assert found["largest"] == pytest.approx(3 * found["smallest"], rel=1e-2)
    capsys.readouterr()
    assert main(["measure", *files.values(), *asked]) == 0
    told = capsys.readouterr()
    assert told.out.count("void_ratio") == 3 and told.err


def test_a_file_that_is_no_packing_does_not_keep_the_others_from_being_measured(
    files, tmp_path, printed, one_line, capsys
):
    """Measured, named, status 3; of nothing else but such files status 2."""
    (tmp_path / "text.h5").write_text("none")
    bad = str(tmp_path / "text.h5")
    (tmp_path / "cut.network.h5").write_bytes((tmp_path / "b.network.h5").read_bytes()[:9000])
    cut = str(tmp_path / "cut.network.h5")
    asked = "--quantities", "void_ratio"
    told = printed("measure", files["a"], bad, cut, *asked, main=main, status=3)
    assert told[files["a"]]["void_ratio"]["value"] > 0
    assert set(told["refused"]) == {bad, cut} and "mean" not in told
    several = printed("measure", bad, files["a"], files["b"], *asked, main=main, status=3)
    assert several["mean"]["void_ratio"]["value"] > 0
    capsys.readouterr()
    assert main(["measure", files["a"], bad, *asked]) == 3
    assert bad in capsys.readouterr().err
    one_line(main, ["measure", bad, *asked])
    one_line(main, ["measure", bad, cut, *asked])


def test_the_status_is_3_where_nothing_was_measured(tmp_path, printed):
    """One crystal of three layers: no wave, no modes that say anything of those that are named."""
    path = tmp_path / "a.network.h5"
    write_network(path, modal.fcc(cells=(1, 1, 3)))
    told = printed("measure", path, "--quantities", "v_p", "ioffe_regel", main=main, status=3)
    assert json.dumps(told).count('"value": null') == 2


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
    """What the packing bears is then measured on its contacts; nothing is refused."""
    packing = PackingData(replace(slender(), study={name: note}))
    assert packing.stress == pytest.approx(1e5, rel=5e-3)
    assert np.isnan(packing.mu_comp) and packing.unsettled == "" and packing.label
    assert packing.of_one_sample and not codes(packing.network, slender())
