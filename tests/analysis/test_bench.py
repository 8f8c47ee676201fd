"""Two transducers on a bench: all rules of travel time against theory, and the command."""

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
    """Return tests by plane sources along x and z: discs wider than the crystal.

    No wave comes back from a wall within the window.
    """
    heights = (0.3 * crystal.length, 0.6 * crystal.length)
    tests = {}
    for direction in "xz":
        tests[direction] = analysis.transducers(
            crystal, heights, FREQUENCIES, radius=1.0, direction=direction, cycles=2
        )
    return tests


def lattice_phase_velocity(direction: str, frequency: np.ndarray) -> np.ndarray:
    """Return the phase velocity (nf,), m/s, along [001] by the closed dispersion relations."""
    crystal = FccLattice(1e5)
    wavenumber = np.linspace(1e-3, 0.5, 4000) * np.pi / crystal.layer_distance
    if direction == "x":
        omega = ShearLattice.of_crystal(crystal, LAYERS).branches(wavenumber)[0]
    else:
        sine = np.sin(wavenumber * crystal.layer_distance / 2)
        omega = 2 * np.sqrt(crystal.C / crystal.mass) * sine
    drive = 2 * np.pi * frequency
    return drive / np.interp(drive, omega, wavenumber)


# A plate does not turn, as layers of an S-wave do: it adds a fifth of a layer, 4e-3.
@pytest.mark.parametrize(("direction", "tolerance"), [("x", 6e-3), ("z", 5e-4)])
def test_phase_velocity_is_that_of_the_lattice(benches, direction, tolerance):
    """Compare at all frequencies within a fifth of the burst's."""
    test = benches[direction]
    for pair in test.pairs:
        delays = phase_delays(pair)
        near = abs(delays.frequency / pair.frequency - 1) < 0.2
        expected = lattice_phase_velocity(direction, delays.frequency[near])
        assert test.distance / delays.phase[near] == pytest.approx(expected, rel=tolerance)


@pytest.mark.parametrize("direction", "xz")
def test_all_rules_give_about_the_phase_velocity(benches, direction):
    """Compare at wavelengths of 30 layers and more, where dispersion is below 1 %.

    Plane waves have no near field: the rules differ by what the lattice does to the ends of the
    burst, most of all the first arrival.
    """
    for row in benches[direction].rows:
        expected = lattice_phase_velocity(direction, np.array([row.frequency]))[0]
        tolerance = 0.05 if row.rule == "first_arrival" else 0.02
        assert row.velocity.value == pytest.approx(expected, rel=tolerance), row
        assert "side_reflections" not in row.velocity.codes


@pytest.mark.parametrize("direction", "xz")
def test_near_field_number_is_distance_over_wavelength(benches, direction):
    """Warn below two wavelengths."""
    test = benches[direction]
    velocity = {"x": test.v_s, "z": test.v_p}[direction]
    for row in test.rows:
        assert row.near_field == pytest.approx(test.distance * row.frequency / velocity, rel=1e-12)
        assert ("near_field" in row.velocity.codes) == (row.near_field < 2)


@pytest.mark.parametrize("direction", "xyz")
@pytest.mark.parametrize("walls", [True, False], ids=["between walls", "without walls"])
def test_velocities_of_the_moduli(crystal, walls, direction):
    """Compare with the lattice; 5e-3: the overlap, and walls in place of half a layer."""
    network = crystal if walls else modal.fcc(cells=(2, 2, 4), periodic_z=True)
    lattice = FccLattice(1e5)
    v_p, v_s = modulus_velocities(network, direction)
    assert v_p == pytest.approx(lattice.velocity, rel=5e-3)
    assert v_s == pytest.approx(ShearLattice.of_crystal(lattice).velocity, rel=5e-3)


def test_velocities_do_not_depend_on_the_walls(crystal):
    """Remove the friction of walls, between which a shear as a whole then meets no resistance."""
    stiffness = np.where(crystal.with_wall, 0.0, crystal.stiffness_tangential)
    slippery = replace(crystal, stiffness_tangential=stiffness)
    _, v_s = modulus_velocities(slippery, "x")
    assert v_s == pytest.approx(ShearLattice.of_crystal(FccLattice(1e5)).velocity, rel=5e-3)


@pytest.fixture
def command(tmp_path, monkeypatch):
    """Write a crystal; return the words of a command with two frequencies for it."""
    monkeypatch.chdir(tmp_path)
    network = modal.fcc(cells=(3, 3, 40))
    write_network("a.network.h5", network)
    heights = [0.2 * network.length, 0.8 * network.length]
    return ["transducers", "a.network.h5", "--at", *heights, "--frequency", 2e4, 5e4]


def test_the_command_prints_a_row_for_each_rule_and_frequency(command, printed):
    result = printed(*command, main=main)
    assert set(result) == {"rows", "v_p", "v_s", "distance"}
    assert [row["rule"] for row in result["rows"]] == [*RULES, *RULES]
    keys = ["rule", "frequency_hz", "velocity", "error", "near_field", "caveats", "codes"]
    for row in result["rows"]:
        assert list(row) == keys
        assert row["frequency_hz"] in (2e4, 5e4)
        assert 0.3 * result["v_s"] < row["velocity"] < 3 * result["v_s"]
        assert row["error"] > 0
        assert "side_reflections" in row["codes"]
        assert len(row["codes"]) == len(row["caveats"])
    low, high = command[3:5]
    # Discs are at the heights of layers.
    assert result["distance"] == pytest.approx(high - low, rel=0.1)
    json.dumps(result, allow_nan=False)


def test_the_command_draws_the_traces(command, tmp_path, capsys):
    assert main([*map(str, command), "-o", "traces.png"]) == 0
    assert "| frequency |" in capsys.readouterr().out
    assert (tmp_path / "traces.png").is_file()
    assert (tmp_path / "traces.csv").is_file()


def test_mistakes_in_the_command_are_one_line(command, one_line):
    height = command[3]
    one_line(main, [*command[:4], "--frequency", 1e4], code="command_line")
    one_line(main, [*command, "--radius", 1e-9], code="no_spheres_in_disc")
    one_line(main, [*command[:3], height, height, "--frequency", 1e4], code="discs_overlap")
    one_line(main, [*command[:6], 0.0], code="frequency")


def test_no_frequency_is_refused(crystal):
    with refusal("frequency"):
        analysis.transducers(crystal, (0.01, 0.05), [])


def test_transducers_stand_at_both_ends_by_default(crystal):
    """Compare with the lowest and the highest layer, of which no wave by an end is told.

    Beside a rigid wall a layer follows the strain, a quarter of a period before the displacement.
    """
    test = analysis.transducers(crystal, frequencies_hz=[2e4], radius=1.0, direction="z")
    quarter = test.v_p / 2e4 / 4 / test.distance
    assert test.distance == pytest.approx(np.ptp(crystal.position[:, 2]), rel=1e-4)
    assert test.rows[-1].velocity.value == pytest.approx(test.v_p, rel=quarter)
    assert "end_reflections" not in test.rows[-1].velocity.codes


def test_a_cell_without_ends_needs_places():
    with refusal("no_ends"):
        analysis.transducers(modal.fcc(cells=(1, 1, 4), periodic_z=True))


def test_a_transducer_outside_the_packing_is_refused(crystal):
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
