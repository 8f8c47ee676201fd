"""Contacts that roll and twist, bodies with a tensor of inertia: beams, clumps, a plain sum."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from changes import PER_CONTACT
from oracles import slow_stiffness
from packings import polydisperse, random_springs
from refusals import refusal
from scipy.linalg import eigh

import modal
from modal.modes.zero_modes import by_structure
from modal.packing.columns import BOND_COLUMNS
from modal.packing.crystal import column
from modal.packing.network import Network, read_network, write_network
from modal.packing.rigid_bodies import joined
from modal.system.assembly import stiffness_blocks, stiffness_matrix
from modal.system.imposed import TURN, WallMoves, put_on
from modal.system.linear_system import LinearSystem
from modal.system.operator import ContactOperator
from modal.system.root_mass import RootMass

pytestmark = pytest.mark.two_ways

BEAM = {"EA": 8e3, "GA": 3e3, "EI": 2e-3, "GJ": 1.5e-3, "line": 0.7, "turning": 4e-7}
"""Stiffnesses, N, N, N m^2, N m^2, mass and moment of inertia per length, kg/m, kg m."""
LENGTH = 0.1


def bonded_chain(count: int) -> Network:
    """Return a straight endless chain of `count` bonded spheres a period, a discrete BEAM."""
    d = LENGTH / count
    number = np.arange(count)
    up = np.array([0.0, 0.0, 1.0])
    ones = np.ones(count)
    return Network(
        position=(number[:, None] + 0.5) * d * up + [LENGTH / 2, LENGTH / 2, 0],
        radius=d / 2 * ones,
        mass=BEAM["line"] * d * ones,
        inertia=BEAM["turning"] * d * ones,
        # Slices of a beam, which spheres of any radius are not.
        inertia_tensor=BEAM["turning"] * d * np.tile(np.eye(3), (count, 1, 1)),
        particle_i=number,
        particle_j=(number + 1) % count,
        normal=np.tile(up, (count, 1)),
        lever_i=np.tile(d / 2 * up, (count, 1)),
        lever_j=np.tile(-d / 2 * up, (count, 1)),
        stiffness_normal=BEAM["EA"] / d * ones,
        stiffness_tangential=BEAM["GA"] / d * ones,
        stiffness_rolling=BEAM["EI"] / d * ones,
        stiffness_twisting=BEAM["GJ"] / d * ones,
        cell_shift=np.where(number[:, None] == count - 1, [[0, 0, 1]], 0),
        cell_size=np.array([LENGTH, LENGTH, LENGTH]),
        cell_periodic=np.ones(3, bool),
        wall_position=np.array([0.0, LENGTH]),
    )


def timoshenko(periods: int) -> np.ndarray:
    """Return omega^2, 1/s^2, of a beam's waves: bending and shear twice, torsion, length.

    S. P. Timoshenko, Phil. Mag. 41, 744 (1921).
    """
    q = 2 * np.pi * periods / LENGTH
    GA = BEAM["GA"]
    EI = BEAM["EI"]
    line = BEAM["line"]
    turning = BEAM["turning"]
    stiff = np.array([[GA * q * q, -1j * GA * q], [1j * GA * q, EI * q * q + GA]])
    bending = eigh(stiff, np.diag([line, turning]), eigvals_only=True)
    along = BEAM["EA"] * q * q / line, BEAM["GJ"] * q * q / turning
    return np.sort([*bending, *bending, *along])


@pytest.mark.parametrize("periods", [1, 2])
def test_a_chain_of_bonded_spheres_is_a_beam(periods):
    """Check the second order of convergence in the distance of spheres over the wavelength."""
    errors = []
    for count in (24, 48):
        square = (2 * np.pi * modal.eigenmodes(bonded_chain(count), all=True).frequency) ** 2
        exact_squares = timoshenko(periods)
        # Every wave goes up and down.
        deviation = [np.sort(abs(square / exact - 1))[:2].max() for exact in exact_squares]
        errors.append(max(deviation))
    assert errors[1] < 2e-2
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)


ROLLING, TWISTING = np.random.default_rng(1).uniform(0, 1, (2, 40))


# Contacts that no packing has, which roll and twist.
ROLLING_SPRINGS = random_springs(1, 6, 40).unchecked(
    stiffness_rolling=ROLLING, stiffness_twisting=TWISTING
)


@pytest.mark.parametrize(
    "network",
    [
        pytest.param(modal.fcc(cells=(1, 1, 4)), id="one sphere wide"),
        pytest.param(modal.fcc(cells=(2, 2, 4)), id="two spheres wide"),
        pytest.param(column(4), id="column"),
        pytest.param(polydisperse(), id="unequal spheres"),
        pytest.param(ROLLING_SPRINGS, id="rolling springs"),
    ],
)
def test_matrix_equals_a_loop_over_contacts(network):
    K_of_spheres = slow_stiffness(network)
    # Sums of at most some forty products of size max|K|: round-off stays below 1e-13 of it.
    for dof in (6, 3):
        expected = K_of_spheres.reshape(2 * (network.n_particles, 6))[:, :dof, :, :dof]
        matrix = stiffness_matrix(network, dof).toarray().reshape(expected.shape)
        assert abs(matrix - expected).max() <= 1e-13 * abs(expected).max()


def pair_of(seed: int, stiffness: float | None = None) -> Network:
    """Return few spheres that roll and twist, two of which are one body or have a stiff bond.

    The bond is `stiffness` times as stiff as a contact, in each direction; None joins the two
    rigidly.
    """
    network = polydisperse(seed=seed, n=12)
    reach = network.radius.mean() ** 2 * network.stiffness_normal
    ways = "stiffness_rolling", "stiffness_twisting"
    share = np.random.default_rng(seed).uniform(0, 0.1, (2, network.n_contacts))
    network = replace(network, **dict(zip(ways, share * reach, strict=True)))
    inside = ~network.with_wall & ~network.cell_shift.any(axis=1)
    contact = int(np.flatnonzero(inside)[0])
    i = int(network.particle_i[contact])
    j = int(network.particle_j[contact])
    if stiffness is None:
        return joined(network, np.isin(np.arange(network.n_particles), (i, j)).astype(int))
    k = stiffness * network.stiffness_normal.mean()
    stiff = dict.fromkeys(("stiffness_normal", "stiffness_tangential"), k)
    stiff |= dict.fromkeys(ways, k * network.radius.mean() ** 2)
    columns = {name: getattr(network, name) for name in (*PER_CONTACT, *ways)}
    for name, values in columns.items():
        columns[name] = np.concatenate([values, [stiff.get(name, values[contact])]])
    return network.unchecked(**columns)


def dense_matrix(network: Network) -> np.ndarray:
    """Return M^-1/2 K M^-1/2."""
    return RootMass.of(network).around(stiffness_blocks(network)).toarray()


def test_roots_of_tensors_of_inertia():
    """Check M^1/2 twice, its inverse, and A as a matrix and as an operator.

    The tolerances are some hundred roundings.
    """
    clump = pair_of(3)
    mass = np.zeros((6 * clump.n_particles,) * 2)
    for body in range(clump.n_particles):
        row = 6 * body
        mass[row : row + 3, row : row + 3] = clump.mass[body] * np.eye(3)
        mass[row + 3 : row + 6, row + 3 : row + 6] = clump.inertia_tensor[body]
    root = RootMass.of(clump)
    A = dense_matrix(clump)
    motions = np.random.default_rng(5).standard_normal((len(mass), 2))
    for u in (motions, motions[:, 0]):
        twice = root.times(root.times(u))
        assert twice == pytest.approx(mass @ u, rel=1e-12, abs=1e-13 * clump.inertia.max())
        assert root.over(root.times(u)) == pytest.approx(u, rel=1e-12, abs=1e-12)
        product = ContactOperator(clump, mass_scaled=True).apply(np.ascontiguousarray(u))
        assert product == pytest.approx(A @ u, rel=1e-12, abs=1e-12 * abs(A).max())
    # With translations alone a tensor of inertia says nothing.
    product = ContactOperator(clump, 3, mass_scaled=True) @ np.eye(len(mass) // 2)
    moving = np.arange(len(mass)) % 6 < 3
    assert product == pytest.approx(A[moving][:, moving], abs=1e-12 * abs(A).max())


@pytest.mark.parametrize("seed", [1, 2])
def test_a_clump_is_the_limit_of_stiff_bonds(seed):
    """Check that the error of the modes falls as one divided by the stiffness of the bond."""
    limit = np.linalg.eigvalsh(dense_matrix(pair_of(seed)))
    errors = []
    for stiffness in (1e4, 2e4):
        square = np.linalg.eigvalsh(dense_matrix(pair_of(seed, stiffness)))
        errors.append(abs(square[: len(limit)] - limit).max() / limit.max())
    assert errors[1] < 1e-2
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.1)


@pytest.mark.parametrize("contacts", [40, 9])
def test_modes_of_clumps_are_those_of_the_dense_matrices(contacts):
    """Compare all modes, with those without energy if few contacts hold the bodies."""
    clump = pair_of(3).with_contacts(slice(contacts))
    dense = dense_matrix(clump)
    exact = np.linalg.eigvalsh(dense)
    square = (2 * np.pi * modal.eigenmodes(clump, all=True).frequency) ** 2
    # Round-off of the matrix, in omega^2.
    assert square == pytest.approx(exact.clip(0), abs=1e-12 * exact[-1])
    zero = by_structure(LinearSystem.of(clump))
    assert zero.total == (exact < 1e-11 * exact[-1]).sum()
    assert abs(dense @ zero.basis.toarray()).max(initial=0.0) < 1e-12 * exact[-1]


def test_a_turning_wall_twists_a_beam():
    """Compare the torque that holds a chain turned at one end with springs in a row."""
    count = 12
    d = LENGTH / 12
    chain = bonded_chain(count)
    ends = replace(
        chain,
        particle_i=np.array([*range(count - 1), 0, count - 1]),
        particle_j=np.array([*range(1, count), -1, -2]),
        **{
            name: np.concatenate([getattr(chain, name)[:-1], [[0, 0, a], [0, 0, b]]])
            for name, a, b in (
                ("normal", -1.0, 1.0),
                ("lever_i", -d / 2, d / 2),
                ("lever_j", 0, 0),
            )
        },
        **{
            f"stiffness_{kind}": np.append(getattr(chain, f"stiffness_{kind}"), 1e3)
            for kind in ("normal", "tangential", "rolling")
        },
        stiffness_twisting=np.append(chain.stiffness_twisting, chain.stiffness_twisting[0]),
        cell_shift=None,
        cell_periodic=np.array([True, True, False]),
    )
    coupling = put_on(ends, (), WallMoves(-1, TURN))
    u = np.linalg.solve(stiffness_matrix(ends).toarray(), coupling.push.toarray()[:, 0])
    torque = coupling.held[0, 0] - (coupling.pull.T @ u)[0]
    assert torque == pytest.approx(chain.stiffness_twisting[0] / (count + 1), rel=1e-10)


def test_a_file_of_bonds_says_version_2_and_hides_nothing(tmp_path):
    """Read a file of bonds back; refuse a column that the reader does not know, by name."""
    path = tmp_path / "beam.network.h5"
    chain = bonded_chain(6)
    write_network(path, chain)
    again = read_network(path)
    for name in BOND_COLUMNS:
        np.testing.assert_array_equal(getattr(again, name), getattr(chain, name))
    # A straight chain under a strain along it has EA over the area of its cell.
    modulus = modal.elastic_moduli(again).stiffness[2, 2]
    assert modulus * LENGTH**2 == pytest.approx(BEAM["EA"], rel=1e-12)
    with h5py.File(path, "a") as file:
        assert file.attrs["schema_version"] == 2
        file["contacts/stiffness_of_glue"] = np.ones(6)
    with refusal("unknown_column", "contacts/stiffness_of_glue"):
        read_network(path)
