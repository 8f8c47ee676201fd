"""What few digits of positions leave: modes are refused, velocities and moduli have an error."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from program_files import PAIR, lines
from refusals import refusal

import modal
from analysis import measure
from analysis.quantities.few_digits import relative_error_by_digits
from modal.__main__ import main
from modal.elasticity.few_digits import modulus_error_by_digits
from modal.elasticity.moduli import ElasticModuli
from modal.exchange.registry import import_packing
from modal.packing.network import read_network, write_network
from modal.packing.precision import OVERLAP_ERROR, overlap_error, with_perturbed_overlaps

DRAWS = 10
LINEAR = "granular hooke 1e5 0 tangential linear_history 8e4 0 0.5"


@cache
def packed() -> modal.Network:
    """Return 150 spheres of glass at 100 kPa, periodic in all directions: overlaps of 5e-4 R."""
    return modal.random_packing(150, 1e5, friction=0.1, seed=3, periodic=True)


def dump(folder: Path, digits: int, draw: int = 0) -> Path:
    """Write the packing, moved through its periods at random, as a dump with so many digits."""
    network = packed()
    random = np.random.default_rng(draw)
    position = (network.position + random.random(3) * network.cell_size) % network.cell_size
    n = network.n_particles
    bounds = lines([[0.0, side] for side in network.cell_size])
    ends = (np.arange(1, n + 1), np.ones(n), network.radius, network.mass)
    rows = lines(np.column_stack(ends)).splitlines()
    places = lines(position, digits).splitlines()
    text = f"ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{n}\nITEM: BOX BOUNDS pp pp pp\n{bounds}"
    text += "ITEM: ATOMS id type radius mass x y z\n"
    text += "".join(f"{row} {xyz}\n" for row, xyz in zip(rows, places, strict=True))
    path = folder / f"{digits}.{draw}.dump"
    path.write_text(text)
    return path


def imported(folder: Path, digits: int, draw: int = 0) -> modal.Network:
    return import_packing(dump(folder, digits, draw), pair=PAIR).network


def pairs(network: modal.Network) -> list[tuple[int, ...]]:
    """Return the two ends of each contact."""
    return list(map(tuple, np.column_stack([network.particle_i, network.particle_j]).tolist()))


def velocities_and_moduli(moduli: ElasticModuli) -> np.ndarray:
    """Return K, G, V_P, V_S."""
    return np.array([moduli.bulk_modulus, moduli.shear_modulus, moduli.v_p, moduli.v_s])


@pytest.mark.parametrize("digits", [pytest.param(7, marks=pytest.mark.slow), 6])
def test_the_stated_error_contains_what_rounding_has_changed(tmp_path, digits):
    """Check nine of ten draws, each with another shift through the periods, of all four numbers.

    The stated error is not far above what rounding has changed in the worst draw.
    """
    exact = velocities_and_moduli(modal.elastic_moduli(imported(tmp_path, 17)))
    contained = np.zeros(4)
    largest_change = 0.0
    smallest_error = np.inf
    for draw in range(DRAWS):
        moduli = modal.elastic_moduli(imported(tmp_path, digits, draw))
        off = abs(velocities_and_moduli(moduli) / exact - 1)
        contained += off <= moduli.error * np.array([1, 1, 0.5, 0.5])
        largest_change = max(largest_change, off.max())
        smallest_error = min(smallest_error, moduli.error)
    assert (contained >= 0.9 * DRAWS).all(), contained
    # Twice a root mean square: some standard deviations of ten draws are within a factor of 5.
    assert smallest_error < 5 * largest_change


def test_the_error_of_overlaps_is_that_of_rounded_places(tmp_path):
    """Compare it with the root mean square change of overlaps, divided by their median."""
    exact = imported(tmp_path, 17)
    blurred = imported(tmp_path, 6)
    assert overlap_error(exact) == 0

    def by_ends(network: modal.Network) -> dict[tuple[int, ...], float]:
        keys = np.column_stack([network.particle_i, network.particle_j]).tolist()
        return dict(zip(map(tuple, keys), network.overlap.tolist(), strict=True))

    exact_overlaps = by_ends(exact)
    blurred_overlaps = by_ends(blurred)
    off = [
        exact_overlaps[key] - blurred_overlaps[key]
        for key in exact_overlaps.keys() & blurred_overlaps.keys()
    ]
    error = float(np.sqrt(np.mean(np.square(off))) / np.median(exact.overlap))
    # Digits of the largest place: those of smaller ones have smaller steps.
    assert 0.4 * overlap_error(blurred) < error < 1.1 * overlap_error(blurred)


def test_single_modes_are_refused_and_all_else_is_not(tmp_path, capsys):
    network = imported(tmp_path, 6)
    path = str(tmp_path / "a.network.h5")
    write_network(path, network)
    assert overlap_error(read_network(path)) == overlap_error(network) > 1e-3
    for options in ({"lowest": 3}, {"highest": 1}, {"below": 1e4}, {"all": True}):
        with refusal("too_few_digits"):
            modal.eigenmodes(network, **options)
    assert main(["modes", path, "--lowest", "3"]) == 2
    for command in (["moduli", path], ["count", path, "--at", "1000"], ["info", path]):
        assert main(command) == 0
    assert main(["density", path]) == 0
    values = measure(network, quantities=["bulk_modulus", "coordination", "void_ratio"])
    assert values["bulk_modulus"].error > 0
    assert values["coordination"].error > 0
    assert values["void_ratio"].error == 0


@pytest.mark.parametrize(("bulk", "shear"), [(1.1, 1.0), (1.0, 1.1), (1.0, 0.9), (0.9, 1.05)])
def test_the_error_is_twice_the_larger_change_of_the_two_moduli(tmp_path, bulk, shear):
    """Perturb packings to both sides: each changes the moduli by the same amount."""
    network = imported(tmp_path, 6)
    moduli = SimpleNamespace(bulk_modulus=2e8, shear_modulus=1e8)
    changed = SimpleNamespace(bulk_modulus=2e8 * bulk, shear_modulus=1e8 * shear)
    error = modulus_error_by_digits(network, moduli, lambda _: changed)
    assert error == pytest.approx(2 * 0.1)


def test_a_velocity_is_off_by_half_as_much_as_its_modulus(tmp_path):
    """Divide the relative error by two, as V is the root of M / density."""
    network = imported(tmp_path, 6)
    modulus = relative_error_by_digits(network, "bulk_modulus", "Pa")
    assert relative_error_by_digits(network, "v_p", "m/s") == pytest.approx(modulus / 2)
    assert modulus > 0


@pytest.mark.parametrize("error", [0.05, 0.3])
def test_a_frequency_is_off_as_a_velocity_or_by_an_eighth_of_the_overlaps(tmp_path, error):
    """Take the larger error: the second one if few digits are lost, the first if many are."""
    network = imported(tmp_path, 12)
    network = replace(network, study={**network.study, OVERLAP_ERROR: error})
    of_velocity = relative_error_by_digits(network, "v_p", "m/s")
    of_frequency = relative_error_by_digits(network, "highest_frequency", "Hz")
    assert of_frequency == pytest.approx(max(of_velocity, error / 8))


def test_digits_that_suffice_change_nothing(tmp_path):
    network = imported(tmp_path, 12)
    assert overlap_error(network) == 0
    assert modal.eigenmodes(network, lowest=3).certified


def test_contacts_without_a_force_keep_their_springs(tmp_path):
    """Keep the tangential spring of a contact without a force: no law relates it to the overlap.

    Keep that of a contact without a normal spring, too.
    """
    network = imported(tmp_path, 6)
    force = network.force_normal.copy()
    force[::3] = 0.0
    normal = network.stiffness_normal.copy()
    normal[1::3] = 0.0
    idle = network.unchecked(force_normal=force, stiffness_normal=normal)
    perturbed = with_perturbed_overlaps(idle, np.random.default_rng(1))
    expected = dict(zip(pairs(idle), idle.stiffness_tangential.tolist(), strict=True))
    stiffness = dict(zip(pairs(perturbed), perturbed.stiffness_tangential.tolist(), strict=True))
    assert np.isfinite(perturbed.stiffness_normal).all()
    for pair in pairs(idle)[::3] + pairs(idle)[1::3]:
        assert stiffness[pair] == expected[pair]
    assert any(stiffness[pair] != expected[pair] for pair in stiffness)


def test_springs_of_one_stiffness_need_contacts_alone(tmp_path):
    """Import columns with overlaps of 1e-3 m and of 1e-6 m, in steps of 1e-6 m.

    With springs of one stiffness only the list of contacts depends on digits.
    """
    heights = ((0.499, 1.497), (0.499999, 1.499994))
    noted = []
    for low, high in heights:
        path = tmp_path / "column.dump"
        path.write_text(
            "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n2\n"
            "ITEM: BOX BOUNDS pp pp ff\n0 4\n0 4\n0 9\n"
            "ITEM: ATOMS id type x y z radius mass\n"
            f"1 1 1.234567 1 {low} 0.5 1\n2 1 1.234567 1 {high} 0.5 1\n"
        )
        network = import_packing(path, pair=LINEAR, wall=f"{LINEAR} zplane 0 NULL").network
        noted.append(overlap_error(network) > 0)
    assert noted == [False, True]
