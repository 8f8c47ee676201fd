"""The bench of two transducers: the crystal against its theory by all rules, and the command."""

import json
from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal
from shear_lattice import ShearLattice

import analysis
import modal
from analysis.__main__ import main
from analysis.bench import modulus_velocities
from analysis.estimators.arrival_rules import RULES, phase_delays
from modal.packing.network import write_network
from modal.theory.fcc import FccLattice

FREQUENCIES = (8e3, 2e4)
LAYERS = 160


@pytest.fixture(scope="module")
def crystal():
    return modal.fcc(cells=(2, 2, LAYERS))


@pytest.fixture(scope="module")
def benches(crystal):
    """Plane sources: discs wider than the crystal; no wave of a wall is back in the window."""
    heights = (0.3 * crystal.length, 0.6 * crystal.length)
    tests = {}
    for direction in "xz":
        tests[direction] = analysis.transducers(
            crystal, heights, FREQUENCIES, radius=1.0, direction=direction, cycles=2
        )
    return tests


def lattice_phase_velocity(direction: str, frequency: np.ndarray) -> np.ndarray:
    """Phase velocity (nf,), m/s, along [001] by the closed dispersion relations."""
    crystal = FccLattice(1e5)
    wavenumber = np.linspace(1e-3, 0.5, 4000) * np.pi / crystal.layer_distance
    omega = 2 * np.sqrt(crystal.C / crystal.mass) * np.sin(wavenumber * crystal.layer_distance / 2)
    if direction == "x":
        omega = ShearLattice.of_crystal(crystal, LAYERS).branches(wavenumber)[0]
    return 2 * np.pi * frequency / np.interp(2 * np.pi * frequency, omega, wavenumber)


@pytest.mark.parametrize("direction", "xz")
def test_crystal_against_theory(benches, direction):
    """The phase over frequency is the lattice's; the other rules come near to it.

    At these wavelengths (30 layers and more) dispersion is below 1 %. Plane waves have no near
    field: the rules differ by what the lattice does to the corners of the burst.
    """
    test = benches[direction]
    exact = lattice_phase_velocity(direction, np.array(FREQUENCIES))
    for pair in test.pairs:
        delays = phase_delays(pair)
        near = abs(delays.frequency / pair.frequency - 1) < 0.2
        phase_velocity = test.distance / delays.phase[near]
        wanted = lattice_phase_velocity(direction, delays.frequency[near])
        # A plate does not turn, as layers of an S-wave do: it adds a fifth of a layer, 4e-3.
        assert phase_velocity == pytest.approx(wanted, rel=5e-4 if direction == "z" else 6e-3)
    for row in test.rows:
        wanted = exact[FREQUENCIES.index(row.frequency)]
        bound = 0.05 if row.rule == "first_arrival" else 0.02
        assert row.velocity.value == pytest.approx(wanted, rel=bound), row
        assert "side_reflections" not in row.velocity.codes
        known = test.v_p if direction == "z" else test.v_s
        assert row.near_field == pytest.approx(test.distance * row.frequency / known, rel=1e-12)
        assert ("near_field" in row.velocity.codes) == (row.near_field < 2)


def test_velocities_of_the_moduli(crystal):
    """Statically, between walls; of a cell without walls by all moduli."""
    lattice = FccLattice(1e5)
    shear = ShearLattice.of_crystal(lattice).velocity
    for network in (crystal, modal.fcc(cells=(2, 2, 4), periodic_z=True)):
        for direction in "xyz":
            v_p, v_s = modulus_velocities(network, direction)
            assert v_p == pytest.approx(lattice.velocity, rel=5e-3)
            assert v_s == pytest.approx(shear, rel=5e-3)


def test_velocities_do_not_depend_on_the_walls(crystal):
    """Walls without friction, between which a shear as a whole meets no resistance."""
    stiffness = np.where(crystal.with_wall, 0.0, crystal.stiffness_tangential)
    slippery = replace(crystal, stiffness_tangential=stiffness)
    _, v_s = modulus_velocities(slippery, "x")
    assert v_s == pytest.approx(ShearLattice.of_crystal(FccLattice(1e5)).velocity, rel=5e-3)


def test_command(tmp_path, monkeypatch, capsys, printed, one_line):
    monkeypatch.chdir(tmp_path)
    network = modal.fcc(cells=(3, 3, 40))
    write_network("a.network.h5", network)
    low, high = (0.2 * network.length, 0.8 * network.length)
    command = ["transducers", "a.network.h5", "--at", low, high, "--frequency", 2e4, 5e4]
    found = printed(*command, main=main)
    assert set(found) == {"rows", "v_p", "v_s", "distance"}
    assert [row["rule"] for row in found["rows"]] == [*RULES, *RULES]
    keys = ["rule", "frequency_hz", "velocity", "error", "near_field", "caveats", "codes"]
    for row in found["rows"]:
        assert list(row) == keys and row["frequency_hz"] in (2e4, 5e4)
        assert 0.3 * found["v_s"] < row["velocity"] < 3 * found["v_s"] and row["error"] > 0
        assert "side_reflections" in row["codes"] and len(row["codes"]) == len(row["caveats"])
    assert found["distance"] == pytest.approx(high - low, rel=0.1)
    assert main([*map(str, command), "-o", "traces.png"]) == 0
    assert "| frequency |" in capsys.readouterr().out
    assert (tmp_path / "traces.png").is_file() and (tmp_path / "traces.csv").is_file()
    one_line(main, command[:4] + ["--frequency", 1e4], code="command_line")
    one_line(main, [*command, "--radius", 1e-9], code="no_spheres_in_disc")
    one_line(main, [*command[:3], low, low, "--frequency", 1e4], code="discs_overlap")
    one_line(main, [*command[:6], 0.0], code="frequency")
    json.dumps(found, allow_nan=False)


def test_refusals(crystal):
    with refusal("frequency"):
        analysis.transducers(crystal, (0.01, 0.05), [])
    with refusal("disc_outside_cell"):
        analysis.transducers(crystal, (0.01, 5.0), [1e4])


def test_frequencies_by_default():
    """Waves of 25, 12, 8 and 6 diameters, with the velocity of the moduli in the direction."""
    crystal = modal.fcc(cells=(1, 1, 60))
    heights = (0.3 * crystal.length, 0.6 * crystal.length)
    for direction, name in (("x", "v_s"), ("z", "v_p")):
        test = analysis.transducers(crystal, heights, radius=1.0, direction=direction)
        wavelengths = [getattr(test, name) / pair.frequency for pair in test.pairs]
        diameters = 2 * crystal.radius[0] * np.array([25, 12, 8, 6])
        assert wavelengths == pytest.approx(diameters, rel=1e-12)
