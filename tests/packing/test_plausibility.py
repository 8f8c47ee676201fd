"""Tests of the remarks on packings that no check can refuse, and that commands pass them on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import packings
import pytest
from changes import changed, permuted, times

from analysis.measurement import measure
from modal.__main__ import main
from modal.description import describe
from modal.packing import crystal as gallery
from modal.packing.columns import SOURCE_WALL
from modal.packing.neighbours import tangents
from modal.packing.network import Network, write_network
from modal.packing.plausibility import examine, plausibility


def codes(network: Network, waves: bool = False) -> set[str]:
    """Return the codes of the remarks on a network."""
    return {remark.code for remark in examine(network, waves=waves).remarks}


def number(network: Network, code: str, waves: bool = False) -> float | None:
    """Return the number in the remark of this code; None without such a remark."""
    for remark in examine(network, waves=waves).remarks:
        if remark.code == code:
            return remark.number
    return None


def test_a_sheared_packing_at_rest_is_plausible():
    numbers = plausibility(packings.sheared())
    assert numbers["law"] == "Hertz"
    assert numbers["pulling_contacts"] == 0
    assert codes(packings.sheared()) == {"narrow"}
    # At rest to 1e-9 in YADE; the compact form keeps forces to the round-off of overlaps.
    assert numbers["net_force_over_contact_force"] < 1e-6


def test_permuted_stiffnesses_follow_no_law():
    network = changed(packings.sheared(), stiffness_normal=permuted)
    assert plausibility(network)["law"] == "unknown"
    assert "unknown_law" in codes(network)


def test_permuted_forces_follow_no_law_and_do_not_balance():
    numbers = plausibility(changed(packings.sheared(), force_normal=permuted))
    assert numbers["law"] == "unknown"
    assert numbers["net_force_over_contact_force"] > 0.1


def test_linear_springs_are_recognised():
    linear = changed(packings.sheared(), stiffness_normal=times(2 / 3))
    assert plausibility(linear)["law"] == "linear"


def test_contacts_that_pull_are_counted():
    cohesive = changed(packings.cohesive(), force_normal=lambda force: force * (force < force[0]))
    assert plausibility(cohesive)["pulling_contacts"] == 1


def test_densities_have_a_range():
    low, _, high = plausibility(packings.polydisperse())["density_kg_per_m3"]
    assert (low, high) == pytest.approx((2230, 7850))


@pytest.mark.parametrize("factor", [0.9, 1.1])
@pytest.mark.parametrize(("share", "law"), [(0.045, "Hertz"), (0.055, "unknown")])
def test_a_law_is_that_of_nine_contacts_in_ten(share, law, factor):
    """Allow one contact in twenty above the law, and one in twenty below."""
    crystal = gallery.fcc(cells=(3, 3, 10))
    stiffness = crystal.stiffness_normal.copy()
    stiffness[: round(share * len(stiffness))] *= factor
    assert plausibility(replace(crystal, stiffness_normal=stiffness))["law"] == law


def test_contacts_that_are_left_out_are_counted():
    """Leave out three contacts between spheres and two with the lower wall."""
    crystal = gallery.fcc(cells=(2, 2, 8))
    pairs = np.flatnonzero(crystal.particle_j >= 0)[:3]
    walls = np.flatnonzero(crystal.particle_j == SOURCE_WALL)[:2]
    remaining = np.setdiff1d(np.arange(crystal.n_contacts), [*pairs, *walls])
    network = crystal.with_contacts(remaining)
    numbers = plausibility(network)
    assert (numbers["missing_contacts"], numbers["missing_wall_contacts"]) == (3, 2)
    assert number(network, "contacts_missing") == 3
    assert number(network, "wall_contacts_missing") == 2
    assert not codes(crystal) & {"contacts_missing", "wall_contacts_missing"}


@pytest.mark.parametrize("radius", [1e-3, 3.1e-4, 7e-6])
def test_round_off_of_spheres_that_just_touch_is_no_fault(radius):
    """Accept overlaps that are round-off, but not ones of a millionth of a radius."""
    column = gallery.column(10, 1e-30, radius)
    stiff = replace(column, stiffness_normal=np.full(11, 1e6), overlap=None)
    below = changed(stiff, position=lambda x: x - 1, wall_position=lambda z: z - 1)
    assert "levers_too_long" not in codes(stiff)
    assert "levers_too_long" not in codes(below)
    assert "levers_too_long" in codes(changed(stiff, lever_i=times(1 + 1e-6)))


def test_a_crystal_is_too_short_for_waves_and_otherwise_sound():
    crystal = gallery.fcc(cells=(4, 4, 40))
    assert codes(crystal, waves=True) == {"short"}
    assert not codes(crystal)


@pytest.mark.parametrize("stirred_part", ["half", "all"])
def test_shape_and_order_are_remarked_on_with_their_numbers(stirred_part):
    """Stir a crystal 4 diameters wide, or half of it, which leaves half of it crystalline."""
    crystal = gallery.fcc(cells=(4, 4, 60))
    diameter = 2 * crystal.radius[0]
    random = np.random.default_rng(1)
    position = crystal.position + 0.3 * diameter * random.standard_normal(crystal.position.shape)
    if stirred_part == "half":
        is_low = crystal.position[:, 2:] < crystal.length / 2
        position = np.where(is_low, crystal.position, position)
    network = crystal.unchecked(position=position)
    assert number(network, "narrow") == pytest.approx(crystal.cell_size[0] / diameter)
    share = number(network, "crystalline")
    if stirred_part == "half":
        # Of 60 layers two at the edge of the stirred half may count either way.
        assert share == pytest.approx(0.5, abs=0.04)
    else:
        assert share is None
    assert number(network, "short", waves=True) == pytest.approx(crystal.length / diameter)
    assert number(network, "short") is None


@pytest.mark.parametrize(("spread", "is_reported"), [(0.008, False), (0.012, True)])
@pytest.mark.parametrize(
    "code",
    [
        "densities_differ",
        "unequal_friction",
        "stiffness_ratios_differ",
        "stiffer_across",
        "narrow",
    ],
)
def test_numbers_within_a_hundredth_count_as_one(code, spread, is_reported):
    """Vary densities, shares of friction, ratios of stiffnesses, or the springs of a lattice."""
    crystal = gallery.fcc(cells=(2, 2, 8))
    of_spheres = 1 + spread * (np.arange(crystal.n_particles) % 2)
    of_contacts = 1 + spread * (np.arange(crystal.n_contacts) % 2)
    if code == "densities_differ":
        columns = {"mass": of_spheres * crystal.mass}
    elif code == "unequal_friction":
        tangent = tangents(crystal.normal)[0]
        shear = (0.3 * of_contacts * crystal.force_normal)[:, None] * tangent
        sliding = np.ones(crystal.n_contacts, bool)
        columns = {"force_tangential": shear, "sliding": sliding}
    elif code == "stiffness_ratios_differ":
        columns = {"stiffness_tangential": of_contacts * crystal.stiffness_tangential}
    elif code == "stiffer_across":
        columns = {"stiffness_tangential": of_contacts * crystal.stiffness_normal}
    else:
        # Springs differ from their mean by the spread: the packing is then no lattice.
        columns = {"stiffness_normal": (2 * of_contacts - 1) * crystal.stiffness_normal}
    assert (code in codes(crystal.unchecked(**columns))) == is_reported


def test_a_pushed_sphere_is_not_in_balance():
    rest = packings.sheared()
    assert "not_in_balance" not in codes(rest)
    force = rest.force_normal.copy()
    force[0] *= 2
    pushed = replace(rest, force_normal=force)
    spheres = 1 if rest.particle_j[0] < 0 else 2
    mean = spheres * force[0] / 2 / rest.n_particles / force.mean()
    # Net forces of the packing at rest, and the torque on the pushed spheres, are small beside it.
    assert number(pushed, "not_in_balance") == pytest.approx(mean, rel=0.05)


@pytest.mark.parametrize("sliding", [True, False])
def test_springs_of_sliding_contacts_are_reported_with_their_ratio(sliding):
    rest = packings.sheared()
    numbers = plausibility(replace(rest, sliding=np.full(rest.n_contacts, sliding)))
    assert ("springs_of_sliding_contacts" in numbers) == sliding
    if sliding:
        ratio = rest.stiffness_tangential[0] / rest.stiffness_normal[0]
        assert f"{ratio:.3g}" in numbers["springs_of_sliding_contacts"]


NETWORKS = {
    "sound": packings.sheared,
    "permuted": lambda: changed(packings.sheared(), stiffness_normal=permuted),
}


@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize(
    "command",
    [
        "modes --lowest 3",
        "count --at 3e4",
        "density --resolution 5e4 --tolerance 0.5",
        "wave --duration 2e-5",
        "response --highest 2e4 --resolution 1e4",
    ],
)
def test_every_command_passes_the_remarks_on(command, name, tmp_path, capsys):
    """Find each remark on a line of standard error, after the file's name, and no others."""
    network = NETWORKS[name]()
    path = tmp_path / "some.network.h5"
    write_network(path, network)
    subcommand, *options = command.split()
    assert main([subcommand, str(path), *options, "--json"]) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if str(path) in line]
    for remark in examine(network).remarks:
        assert any(remark.text in line for line in lines)
    for line in lines:
        assert any(remark.text in line for remark in examine(network, waves=True).remarks)


@pytest.mark.parametrize("factor", [1e-3, 1e-6, 100.0])
def test_masses_in_other_units_are_remarked_on_wherever_numbers_are_told(factor):
    """Find a caveat and a line of the description for a network in memory, too."""
    sound = gallery.fcc(cells=(2, 2, 12))
    other = replace(sound, mass=factor * sound.mass, inertia=factor * sound.inertia, study={})
    reported = []
    for network in (sound, other):
        caveats = measure(network, quantities=["void_ratio"])["void_ratio"].caveats
        reported.append("no_solid" in {caveat.code for caveat in caveats})
        reported.append("density" in {line.split()[0] for line in describe(network).split("\n")})
    assert reported == [False, False, True, True]
