"""Waves on the tangent of another program's law, against the equations of motion."""

from __future__ import annotations

import numpy as np
import packings
import program_files
import pytest
from oracles import asymmetry, stepped, wall_pattern
from scipy.integrate import solve_ivp

import modal
from modal.__main__ import main
from modal.modes.eigenmodes import eigenmodes
from modal.modes.first_order import shift_by_law
from modal.packing.network import Network, read_network, write_network
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.operator import ContactOperator
from modal.tools.errors import InputError
from modal.waves.propagate import propagate
from modal.waves.source import Pulse


def imported(tmp_path) -> Network:
    """60 spheres of radii 1:3 between walls, shear forces, law mindlin of LAMMPS."""
    atoms, contacts, log = program_files.lammps(packings.polydisperse(False), tmp_path)
    log.write_text(log.read_text().replace("mindlin/force", "mindlin"))
    return modal.read(atoms, contacts=contacts, log=log)


def test_operator_is_the_matrix_of_the_law_and_survives_a_file(tmp_path):
    write_network(tmp_path / "x.network.h5", imported(tmp_path))
    network = read_network(tmp_path / "x.network.h5")
    K = stiffness_matrix(network, pre_stress="law")
    u = np.random.default_rng(1).standard_normal((K.shape[0], 3))
    found = ContactOperator(network, pre_stress="law").apply(u)
    np.testing.assert_allclose(found, K @ u, atol=1e-13 * abs(K @ u).max())
    # It is not symmetric: the shear forces of the made packing are a tenth of the normal ones.
    assert asymmetry(K) > 1e-3 > asymmetry(stiffness_matrix(network, pre_stress="full"))


def test_wave_on_the_law_is_that_of_the_equations_of_motion(tmp_path):
    """Runge-Kutta of order 8 to 1e-10; the step of the leapfrog makes an error of its square."""
    network = imported(tmp_path)
    duration, interval = 2e-5, 1e-6
    K = stiffness_matrix(network, pre_stress="law")
    mass, size = mass_diagonal(network), 6 * network.n_particles
    source, row, _ = wall_pattern(network, -1, "law")
    assert abs(source - row).max() > 1e-4 * abs(source).max()
    pulse = Pulse()

    def change(t: float, state: np.ndarray) -> np.ndarray:
        u, velocity = state[:size], state[size:]
        pull = source * pulse.displacement(np.array([t]))[0] - K @ u
        return np.concatenate([velocity, pull / mass])

    times = np.arange(21) * interval
    exact = solve_ivp(
        change, (0, duration), np.zeros(2 * size), "DOP853", times, rtol=1e-10, atol=1e-22
    )
    wanted = exact.y[2:size:6].T
    scale = abs(wanted).max()
    wave = propagate(network, duration, interval=interval, pre_stress="law", particles=True)
    assert abs(wave.signals.particle_displacement - wanted).max() < 1e-7 * scale
    errors = []
    for every in (20, 40):
        slow = stepped(
            network, duration, interval / every, every=every, pre_stress="law", particles=True
        )
        errors.append(abs(slow.particle_displacement - wanted).max())
    assert errors[0] < 1e-3 * scale
    assert 3.5 < errors[0] / errors[1] < 4.5


def test_law_is_refused_where_the_network_does_not_know_it(tmp_path, one_line):
    network = packings.polydisperse(False)
    with pytest.raises(InputError, match="pre-stress 'law' .of imported packings; there is 'full'"):
        stiffness_matrix(network, pre_stress="law")
    write_network(tmp_path / "x.network.h5", network)
    wave = ["wave", tmp_path / "x.network.h5", "--pre-stress", "law"]
    one_line(main, wave, "no contacts/shear_growth")


def test_shift_of_modes_is_the_law_to_first_order(tmp_path):
    """Against all eigenvalues of the tangent, which is not symmetric, at forces x 1 and x 1/2.

    The error is of second order: a quarter at half the difference. Rigid, well separated modes.
    """
    network = imported(tmp_path)
    modes = eigenmodes(network, all=True)
    scale = np.sqrt(np.outer(*[mass_diagonal(network)] * 2))
    own, springs = (
        stiffness_matrix(network, pre_stress=which).toarray() / scale for which in ("law", "none")
    )
    errors = []
    for share in (0.02, 0.01):
        weak = springs + share * (own - springs)
        exact = np.sort(np.sqrt(np.maximum(np.linalg.eigvals(weak).real, 0))) / (2 * np.pi)
        moved = modes.frequency**2 + share * (
            (modes.frequency + shift_by_law(network, modes)) ** 2 - modes.frequency**2
        )
        found = np.sort(np.sqrt(moved))
        firm = slice(len(exact) // 2, None)
        errors.append(np.linalg.norm((found - exact)[firm] / exact[firm]))
        assert errors[-1] < 0.05 * np.linalg.norm((modes.frequency - exact)[firm] / exact[firm])
    assert 3 < errors[0] / errors[1] < 5
