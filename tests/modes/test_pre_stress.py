"""Modes, counts and densities with the forces that the contacts carry, by dense matrices."""

from functools import cache

import changes
import numpy as np
import oracles
import packings
import pytest
import scipy.sparse as sp
from refusals import refusal
from scipy.linalg import eigh

import modal
from modal.__main__ import main
from modal.modes.eigenmodes import modes_of
from modal.packing import crystal as gallery
from modal.packing.network import Network, write_network
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.linear_system import Limits, LinearSystem, frequency_of

PACKINGS = {
    "friction": lambda: packings.sheared(),
    "mixture": lambda: packings.polydisperse(),
    "crystal": lambda: gallery.fcc(cells=(3, 3, 8)),
    "random": lambda: packings.slim(),
}


@cache
def packing(name: str) -> Network:
    return PACKINGS[name]()


@cache
def spectrum(name: str, pre_stress: str) -> tuple[np.ndarray, int, int]:
    """Return elastic frequencies, Hz, ascending, and the numbers of zero and of unstable modes.

    They are those of a dense matrix, by LAPACK's solver for general matrices if needed.
    """
    network = packing(name)
    K = stiffness_matrix(network, pre_stress=pre_stress)
    M = mass_diagonal(network)
    A = K.toarray() / np.sqrt(M) / np.sqrt(M)[:, None]
    square = np.linalg.eigvals(A) if pre_stress == "full" else np.linalg.eigvalsh((A + A.T) / 2)
    omega = np.where(square.imag == 0, square.real, np.sqrt(square.astype(complex)).real ** 2)
    omega.sort()
    zero = 1e-11 * A.diagonal().max()
    return frequency_of(omega[omega > zero]), (abs(omega) <= zero).sum(), (omega < -zero).sum()


def exact_to(frequency: np.ndarray, name: str) -> np.ndarray:
    """Return the relative round-off of dense frequencies, and 1e-8 for that of a solver.

    It is size eps |A| / omega^2.
    """
    system = LinearSystem.of(packing(name))
    square = (2 * np.pi * frequency) ** 2
    return 1e-8 + system.size * np.finfo(float).eps * system.row_sum_bound / square


@pytest.mark.parametrize("whole", [True, pytest.param(False, marks=pytest.mark.two_ways)])
@pytest.mark.parametrize("pre_stress", ["normal", "full"])
@pytest.mark.parametrize("name", PACKINGS)
def test_modes_under_pre_stress_are_those_of_dense_matrices(name, pre_stress, whole):
    """Compare the lowest 20, the highest 5 and 1, and an interval with dense matrices.

    There is no certificate where K is not symmetric, unless a dense solver finds all modes.
    """
    # By the searches of larger packings, not by dense spectra.
    limits = Limits(small=300) if whole else Limits(small=300, unsymmetric=0)
    system = LinearSystem.of(packing(name), pre_stress=pre_stress, limits=limits)
    elastic, zero, unstable = spectrum(name, pre_stress)
    middle = elastic[30] * (1 + 1e-5), elastic[60] * (1 - 1e-5)
    inside = (elastic > middle[0]) & (elastic < middle[1])
    for question, expected in (
        ({"lowest": 20}, elastic[:20]),
        ({"highest": 5}, elastic[-5:]),
        ({"highest": 1}, elastic[-1:]),
        ({"between": middle}, elastic[inside]),
    ):
        modes = modes_of(system, **question)
        assert (abs(modes.frequency / expected - 1) <= exact_to(expected, name)).all()
        assert modes.certified == (pre_stress == "normal" or whole or "between" in question)
        if modes.certified:
            assert (modes.floppy_modes, modes.unstable_modes) == (zero, unstable)


@pytest.mark.two_ways
@pytest.mark.parametrize("name", PACKINGS)
def test_counts_and_densities_under_pre_stress(name):
    """Count unstable modes below 0 Hz, and refuse a density of states with such modes."""
    network = packing(name)
    elastic, zero, unstable = spectrum(name, "normal")
    widest = np.argmax(np.diff(elastic[:60])), 60 + np.argmax(np.diff(elastic[60:]))
    frequencies = [0.0, 1e-3, *((elastic[k] + elastic[k + 1]) / 2 for k in widest)]
    expected = [unstable, unstable + zero, *(unstable + zero + k + 1 for k in widest)]
    assert modal.count_modes(network, frequencies, pre_stress="normal").tolist() == expected
    if unstable:
        with refusal("unstable", f"({unstable} "):
            modal.density_of_states(network, pre_stress="normal")
        return
    for tolerance in (1e-3, 0.3):
        states = modal.density_of_states(network, pre_stress="normal", tolerance=tolerance)
        assert states.zero_modes.sum() == pytest.approx(zero, abs=1e-6)
        count, error = states.count_below([0.5 * elastic[-1]])
        exact = zero + (elastic < 0.5 * elastic[-1]).sum()
        assert abs(count[0, 6] - exact) < 4 * error[0, 6] + 5


@pytest.mark.two_ways
def test_the_column_buckles_under_its_own_force():
    """Compare with two spheres without tangential springs, by hand: N / length against kt."""
    column = gallery.column(2)
    free = column.unchecked(stiffness_tangential=np.zeros(3), sliding=np.ones(3, bool))
    # Against each other across the axis: -2 N dn on either, N over the distance of the centres.
    force = column.force_normal[1]
    distance = np.linalg.norm(column.branch[1])
    square = -2 * force / distance / column.mass[0]
    modes = modal.eigenmodes(free, all=True, pre_stress="normal")
    assert modes.unstable_modes == 2
    assert modes.frequency[:2] == pytest.approx(frequency_of(square), rel=1e-9)


def test_counts_refuse_a_stiffness_that_is_not_symmetric():
    with refusal("unsymmetric", "'full'"):
        modal.count_modes(packing("friction"), 1e4, pre_stress="full")


def test_densities_refuse_a_stiffness_that_is_not_symmetric():
    with refusal("unsymmetric", "'full'"):
        modal.density_of_states(packing("friction"), pre_stress="full")


def test_commands_take_pre_stress(tmp_path, printed):
    """Run `modes`, `count` and `density` with the normal forces, and `modes` with all forces."""
    path = tmp_path / "a.network.h5"
    write_network(path, packing("random"))
    elastic, zero, unstable = spectrum("random", "normal")

    modes = printed("modes", path, "--lowest", 3, "--pre-stress", "normal")
    assert modes["frequency_hz"] == pytest.approx(elastic[:3], rel=1e-6)
    assert (modes["floppy_modes"], modes["unstable_modes"]) == (zero, unstable)
    counted = printed("count", path, "--at", 0, "2e4", "--pre-stress", "normal")
    assert counted["count_below"]["0"] == counted["unstable_modes"] == unstable
    everything = printed("modes", path, "--lowest", 3, "--pre-stress", "full")
    assert everything["frequency_hz"] == pytest.approx(spectrum("random", "full")[0][:3], rel=1e-4)
    assert main(["count", str(path), "--at", "1", "--pre-stress", "full"]) == 2
    assert main(["density", str(path), "--pre-stress", "normal"]) == 2 * bool(unstable)


def test_modes_and_counts_of_bonded_bodies_are_those_of_a_loop_over_contacts():
    """Compare with LAPACK on K phi = omega^2 M phi.

    K is summed contact by contact, M has the tensor of inertia of each body.
    """
    network = changes.bonded(packing("friction"))
    blocks = []
    for mass_of_body, inertia in zip(network.mass, network.inertia_tensor, strict=True):
        blocks += [mass_of_body * sp.identity(3), inertia]
    mass = sp.block_diag(blocks).toarray()
    square = eigh(oracles.slow_stiffness(network), mass, eigvals_only=True)
    zero = int((square <= 1e-11 * square[-1]).sum())
    elastic = frequency_of(square[zero:])
    assert LinearSystem.of(network).size > Limits().small
    for question, expected in (({"lowest": 20}, elastic[:20]), ({"highest": 5}, elastic[-5:])):
        modes = modal.eigenmodes(network, **question)
        assert modes.certified
        assert modes.floppy_modes == zero
        assert modes.frequency == pytest.approx(expected, rel=1e-8)
    gaps = np.argsort(np.diff(elastic))[-5:]
    counted = modal.count_modes(network, (elastic[gaps] + elastic[gaps + 1]) / 2)
    assert counted.tolist() == (zero + gaps + 1).tolist()
