"""Defaults follow from the packing: results of a scaled packing are scaled."""

from dataclasses import replace

import numpy as np
import packings
import pytest

import modal
from modal.packing.contact_law import GLASS
from modal.packing.network import Network, write_network
from modal.packing.state import stress_tensor
from modal.preparation.random_packing import random_packing
from modal.waves.motions import Pulse
from modal.waves.signals import read_signals
from modal.waves.sources import Point

COMMANDS = (
    "info",
    "modes --lowest 9",
    "density",
    "response",
    "response --highest {frequency}",
    "moduli",
    "wave",
    "wave --direction x",
    "wave --point 3",
    "wave --motion step --sweep {time}",
)
"""Commands with the usual numbers, but for the frequency and the time that are scaled."""
LENGTHS_AND_STIFFNESSES = [(1e-3, 1.0), (1e3, 1.0), (1.0, 1e-6), (1e-3, 1e-6)]
ROUND_OFF = 1e-6
"""Of the results: residuals and iterations are cut off at 1e-9 of them, at different places."""
COST = ("seconds", "peak_memory_bytes")
OF_ROUND_OFF = (
    "residual",
    "truncation",
    "relative_error",
    "asymmetry",
    "net_force_over_contact_force",
    "largest_net_force_over_contact_force",
    "largest_off_diagonal_stress_pa",
    "products_with_k",
)
"""Numbers that depend on round-off."""
LENGTHS = ("position", "radius", "overlap", "lever_i", "lever_j", "cell_size", "wall_position")


def scaled(network: Network, length: float, stiffness: float) -> Network:
    """Return a packing `length` times as large, of the same density, with softer springs."""
    force = stiffness * length
    return replace(
        network,
        **{name: length * getattr(network, name) for name in LENGTHS},
        mass=length**3 * network.mass,
        inertia=length**5 * network.inertia,
        stiffness_normal=stiffness * network.stiffness_normal,
        stiffness_tangential=stiffness * network.stiffness_tangential,
        force_normal=force * network.force_normal,
        force_tangential=force * network.force_tangential,
        study={},
    )


def factor_of(name: str, length: float, stiffness: float) -> float:
    """Return by what a number of this name grows: the end of the name is its unit."""
    frequency = np.sqrt(stiffness / length**3)
    factors = {
        "_kg_per_m3": 1.0,
        "_m_per_s": length * frequency,
        "_hz": frequency,
        "_pa": stiffness / length,
        "_m": length,
        "_s": 1 / frequency,
    }
    for ending, factor in factors.items():
        if name.endswith(ending):
            return factor
    return 1.0


def compare(name, before, after, scale):
    """Compare numbers, or lists and named values of numbers, whose unit their names end with.

    Named values have the unit of their own names, or else that of the name above them.
    """
    factor = factor_of(name, *scale)
    if isinstance(before, dict):
        for key, value in before.items():
            has_unit = factor_of(key, *scale) != 1
            compare(key if has_unit else name, value, after[key], scale)
    elif isinstance(before, list) and before and not isinstance(before[0], str):
        expected = factor * np.array(before, float)
        tolerance = ROUND_OFF * abs(expected).max()
        assert np.array(after) == pytest.approx(expected, rel=1e-6, abs=tolerance), name
    elif isinstance(before, float):
        assert after == pytest.approx(factor * before, rel=1e-6, abs=0), name
    elif not isinstance(before, list | str):
        assert after == before, name


@pytest.mark.parametrize("command", COMMANDS)
def test_defaults_scale_with_the_packing(command, tmp_path, printed, monkeypatch):
    monkeypatch.chdir(tmp_path)
    network = modal.fcc(cells=(1, 1, 14))

    def result(length, stiffness):
        """Return the numbers that the command prints for the packing in these scales."""
        write_network("a.network.h5", scaled(network, length, stiffness))
        frequency = factor_of("_hz", length, stiffness) * 2e4
        time = factor_of("_s", length, stiffness) * 1e-5
        name, *options = command.format(frequency=frequency, time=time).split()
        return printed(name, "a.network.h5", *options)

    unscaled = result(1.0, 1.0)
    for scale in LENGTHS_AND_STIFFNESSES:
        scaled_result = result(*scale)
        for name, value in unscaled.items():
            if name not in (*COST, *OF_ROUND_OFF):
                compare(name, value, scaled_result[name], scale)


def test_density_of_a_soft_packing_shows_its_modes():
    """Make springs a millionth as stiff: frequencies are a thousandth, and quartiles not 0."""
    network = modal.fcc(stress=1e5, cells=(2, 2, 10))
    soft = scaled(network, 1.0, 1e-6)
    states = modal.density_of_states(soft)
    frequency = modal.eigenmodes(soft, all=True).frequency
    count, _ = states.count_below(states.grid())
    median = np.interp(0.5 * len(frequency), count[:, 6], states.grid())
    assert states.resolution < 0.02 * frequency.max()
    assert median == pytest.approx(np.median(frequency), abs=states.resolution)


def test_usual_numbers_of_the_study(printed, tmp_path):
    """Find defaults near the paper's in its crystal: 2.5 nm, 100 kHz, each microsecond."""
    path = tmp_path / "a.network.h5"
    write_network(path, modal.fcc(cells=(1, 1, 60)))
    printed("wave", path, "-o", tmp_path / "a.signals.h5")
    signals = read_signals(tmp_path / "a.signals.h5")
    assert signals.amplitude == pytest.approx(2.5e-9, rel=0.03)
    assert signals.input_frequency == pytest.approx(1e5, rel=0.03)
    assert signals.time[1] == pytest.approx(1e-6, rel=0.03)
    density = printed("density", path)
    assert density["resolution_hz"] == pytest.approx(2e3, rel=0.1)
    response = printed("response", path, "--highest", "3e4")
    assert response["resolution_hz"] == pytest.approx(1e3, rel=0.1)


@pytest.mark.parametrize("direction", ["z", "x"])
def test_wave_arrives_within_the_default_record(direction, tmp_path, printed):
    """Send P- and S-waves from wall to wall of a random packing.

    There is nothing in the first tenth of the record, so the largest stress comes later.
    """
    path = tmp_path / "a.network.h5"
    write_network(path, packings.slender())
    printed("wave", path, "--direction", direction, "-o", tmp_path / "a.signals.h5")
    signals = read_signals(tmp_path / "a.signals.h5")
    stress = abs(signals.receiver_stress)
    assert stress[: len(stress) // 10].max() < 0.01 * stress.max()


def test_pulse_is_small_beside_the_overlaps():
    """Compare under little stress, too, where 1e-6 of a diameter is half of an overlap."""
    network = modal.fcc(stress=10.0, cells=(1, 1, 8))
    signals = modal.propagate(network, 1e-4).signals
    assert 0 < signals.amplitude < 0.02 * network.overlap.mean()


def test_torsion_and_forces_have_amplitudes_of_their_own():
    network = replace(modal.fcc(cells=(1, 1, 8)), cell_shift=None)
    stiffness = network.stiffness_normal.mean()
    pushed = modal.propagate(network, 1e-5, source=Point(3)).signals
    assert pushed.amplitude == pytest.approx(1e-6 * 2 * network.radius[0] * stiffness)


def test_default_stress_is_as_soft_as_the_spheres(tmp_path):
    soft = replace(GLASS, young=1e-4 * GLASS.young)
    network = random_packing(60, material=soft, seed=2)
    stress = np.trace(stress_tensor(network)) / 3
    assert stress == pytest.approx(10.0, rel=0.01)


def test_a_pulse_that_is_given_is_taken():
    motion = Pulse(1e-8, 3e4)
    signals = modal.propagate(modal.fcc(cells=(1, 1, 8)), 1e-5, motion=motion).signals
    assert (signals.amplitude, signals.input_frequency) == (1e-8, 3e4)
