"""Elastic moduli: against the crystal in closed form, Bloch waves, least squares, chains."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from changes import bare, levers_of_radii, stiffer
from oracles import kinematics
from packings import polydisperse
from refusals import refusal
from scipy.linalg import lstsq

from modal.elasticity.moduli import elastic_moduli, read_moduli
from modal.elasticity.plane_waves import anisotropy, isotropic_mean, plane_waves
from modal.packing import crystal as gallery
from modal.packing.network import Network, write_network
from modal.packing.state import stress_tensor
from modal.theory.fcc import FccLattice
from modal.tools.errors import InputError

pytestmark = pytest.mark.two_ways

CUBE = {"<100>": (1, 1, 0), "<001>": (0, 0, 1), "<110>": (1, 0, 0), "<111>": (0, 1, np.sqrt(0.5))}
"""Directions of the cube in the axes of the packing, which are turned by 45 degrees about z."""


@pytest.fixture(scope="module")
def cell():
    """250 spheres of radii 1:3, periodic in all directions."""
    return polydisperse(periodic_z=True, n=250)


@pytest.mark.parametrize("known", [("force_normal", "force_tangential", "cell_shift"), ()])
def test_levers_as_long_as_the_radii_leave_stress_and_velocity(known):
    """Where along its levers a contact acts has no weight in a crystal, whose spheres do not turn.

    Its branches are those of the centres, also through periods that only the levers tell.
    """
    crystal, stress = FccLattice(1e8), 1e8
    longer = levers_of_radii(gallery.fcc(stress, (2, 2, 4), periodic_z=True))
    if known:
        assert stress_tensor(longer) == pytest.approx(stress * np.eye(3), abs=1e-9 * stress)
    found = elastic_moduli(bare(longer, *known)).velocities((0, 0, 1))
    assert found[0] == pytest.approx(crystal.velocity, rel=1e-9)


@pytest.mark.parametrize("solver", ["pardiso", "gradients"])
@pytest.mark.parametrize("stress", [1e5, 1e7])
def test_crystal_against_its_closed_form(stress, solver):
    """Nothing but round-off of some 1e4 additions is in between."""
    pytest.importorskip("pypardiso" if solver == "pardiso" else "numpy")
    crystal = FccLattice(stress)
    network = gallery.fcc(stress, (2, 3, 4), periodic_z=True)
    found = elastic_moduli(network, solver=solver)
    assert found.stiffness == pytest.approx(crystal.stiffness, rel=1e-11, abs=1e-9 * crystal.C)
    assert found.affine == pytest.approx(crystal.stiffness, rel=1e-11, abs=1e-9 * crystal.C)
    assert found.region == "cell" and found.asymmetry < 1e-12
    assert found.density == pytest.approx(crystal.mass * np.sqrt(2) / crystal.spacing**3, rel=1e-12)


@pytest.mark.parametrize("direction", CUBE)
def test_velocities_of_the_crystal_are_the_slopes_of_its_bloch_waves(direction):
    """All three waves at kappa d = 1e-3: the branches bend by its square over 24, 4e-8."""
    crystal = FccLattice(1e5)
    found = elastic_moduli(gallery.fcc(cells=(1, 1, 2), periodic_z=True))
    n = np.array(CUBE[direction]) / np.linalg.norm(CUBE[direction])
    kappa = 1e-3 / crystal.spacing
    slopes = 2 * np.pi * crystal.bloch(kappa * n)[0][:3] / kappa
    assert found.velocities(n) == pytest.approx(slopes[::-1], rel=1e-6)


def least_squares_moduli(network: Network) -> np.ndarray:
    """(6, 6), Pa: the oracle. Springs as weighted equations.

    The least energy of strained springs is the least square of root(k) (stretch + B motion): no
    stiffness matrix, no symmetric gradient with sliding planes, no iteration.
    """
    i, j, m = network.particle_i, network.particle_j, network.n_contacts
    kn, kt = np.sqrt([network.stiffness_normal, network.stiffness_tangential])[..., None, None]
    nn = network.normal[:, :, None] * network.normal[:, None]
    root, B = kn * nn + kt * (np.eye(3) - nn), np.zeros((m, 3, network.n_particles, 6))
    for end, side in ((i, slice(6)), (j, slice(6, 12))):
        B[np.arange(m), :, end] += (root @ kinematics(network))[:, :, side]
    branch = network.position[j] + network.cell_shift * network.cell_size - network.position[i]
    E = np.zeros((6, 3, 3))
    for strain, (a, b) in enumerate([(0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1)]):
        E[strain, a, b] += 0.5
        E[strain, b, a] += 0.5
    stretch = np.einsum("cij,sjk,ck->cis", root, E, branch)
    # Rotations as arcs, so that one threshold tells motions without energy from the others.
    B[..., 3:] /= network.radius.mean()
    B, stretch = B.reshape(3 * m, -1), stretch.reshape(3 * m, 6)
    motion = lstsq(B, -stretch, cond=1e-10)[0]
    left = stretch + B @ motion
    return left.T @ left / np.prod(network.cell_size)


def test_random_cell_against_least_squares(cell):
    """1e-8: what least squares of a condition number of some 1e3 leave is far below."""
    wanted = least_squares_moduli(cell)
    scale = abs(wanted).max()
    for solver in ("pardiso", "gradients"):
        if solver == "pardiso":
            pytest.importorskip("pypardiso")
        found = elastic_moduli(cell, tolerance=1e-9, solver=solver)
        assert found.stiffness == pytest.approx(wanted, abs=1e-8 * scale)
        assert found.error < 1e-9
        # The affine energy is an upper bound of every strain's; the free spheres give back some.
        assert np.linalg.eigvalsh(found.affine - found.stiffness).min() > 0.05 * scale


@pytest.mark.parametrize("solver", ["pardiso", "gradients"])
def test_tolerance_is_that_of_the_moduli_not_of_the_affine_ones(solver):
    """Stiffnesses over six decades: motion leaves a hundredth of the affine energy, or less.

    The error is estimated from below; the solution may be some times further off.
    """
    pytest.importorskip("pypardiso" if solver == "pardiso" else "numpy")
    cell = polydisperse(periodic_z=True, n=60)
    factor = 10 ** np.random.default_rng(3).uniform(-6, 0, (2, cell.n_contacts))
    cell = stiffer(cell, *factor)
    wanted = np.diag(least_squares_moduli(cell))
    for tolerance in (1e-3, 1e-6):
        found = elastic_moduli(cell, tolerance=tolerance, solver=solver)
        assert (np.diag(found.affine) > 100 * wanted).all()
        assert np.diag(found.stiffness) == pytest.approx(wanted, rel=3 * tolerance)
        assert found.error <= tolerance


def test_isotropic_solids_have_one_p_and_two_s_waves():
    K, G, rho = 3e8, 1.2e8, 1500.0
    C = np.diag([2 * G] * 3 + [G] * 3)
    C[:3, :3] += K - 2 / 3 * G
    velocity, motion = plane_waves(C, rho, (1, 2, -2))
    assert velocity == pytest.approx(np.sqrt([(K + 4 / 3 * G) / rho, G / rho, G / rho]), rel=1e-12)
    assert abs(motion[0] @ np.array([1, 2, -2]) / 3) == pytest.approx(1, abs=1e-12)
    assert isotropic_mean(C) == pytest.approx((K, G), rel=1e-12)
    assert anisotropy(C) == pytest.approx(0, abs=1e-12)
    # A cubic solid's distance from isotropy, by hand: C44 alone differs, from (C11 - C12) / 2.
    C[3:, 3:] *= 1.5
    beta = G / 2  # of 2 C44 - (C11 - C12) = 2 beta: three shears weigh 4/5 of 3 (2 beta)^2 ...
    mean = 2 * G + 3 / 5 * 2 * beta
    off = 3 * (3 * G - mean) ** 2 + 2 * (2 * G - mean) ** 2
    assert anisotropy(C) == pytest.approx(np.sqrt(off / (off + 9 * K**2 + 5 * mean**2)), rel=1e-12)


def test_spheres_that_nothing_holds_take_no_part(cell):
    """Three more that touch nothing, anywhere: the same moduli, but for no mass either."""
    more = {name: np.concatenate([x, x[:3]]) for name, x in cell.bodies().items()}
    one = elastic_moduli(cell, non_affine=True)
    other = elastic_moduli(replace(cell, **more), non_affine=True)
    assert other.stiffness == pytest.approx(one.stiffness, abs=2e-6 * one.stiffness.max())
    assert other.density == one.density
    assert abs(other.non_affine[:, -3:]).max() < 1e-9 * abs(one.non_affine).max()
    # Rigid motions of the whole are motions without energy: none is left.
    drift = np.einsum("sna,n->sa", one.non_affine[:, :, :3], cell.mass) / cell.mass.sum()
    assert abs(drift).max() < 1e-9 * abs(one.non_affine).max()


def test_non_affine_motion_balances_every_sphere(cell):
    """Forces on spheres under strain plus motion vanish; checked with plain vectors."""
    moduli = elastic_moduli(cell, tolerance=1e-12, non_affine=True)
    motion = moduli.non_affine[5]
    i, j = cell.particle_i, cell.particle_j
    strain = np.array([[0, 0.5, 0], [0.5, 0, 0], [0, 0, 0]])
    ends = np.hstack([motion[i], motion[j]])
    parted = (cell.lever_i - cell.lever_j) @ strain
    parted += np.einsum("cab,cb->ca", kinematics(cell), ends)
    along = np.einsum("ca,ca->c", parted, cell.normal)[:, None] * cell.normal
    kn, kt = cell.stiffness_normal[:, None], cell.stiffness_tangential[:, None]
    force = kn * along + kt * (parted - along)
    total = np.zeros((cell.n_particles, 3))
    np.add.at(total, i, force)
    np.add.at(total, j, -force)
    assert abs(total).max() < 1e-5 * abs(force).max()


@pytest.mark.parametrize("solver", ["pardiso", "gradients"])
def test_a_cell_that_resists_nothing_says_so(solver):
    """Smooth spheres that hardly touch give way to every strain; what is left is round-off."""
    pytest.importorskip("pypardiso" if solver == "pardiso" else "numpy")
    loose = stiffer(polydisperse(periodic_z=True, n=60), 1, 0)
    found = elastic_moduli(loose, solver=solver)
    assert len(found.soft_strains()) == 6
    assert [remark.code for remark in found.remarks()] == ["soft_strain"] * 6


CRYSTAL = gallery.fcc(cells=(2, 2, 6))
WITHOUT_CONTACTS = CRYSTAL.with_contacts(np.arange(0))
NOT_PERIODIC = replace(
    CRYSTAL.with_contacts(CRYSTAL.cell_shift[:, 0] == 0),
    cell_periodic=np.array([False, True, False]),
)


@pytest.mark.parametrize(
    ("network", "code"),
    [
        pytest.param(NOT_PERIODIC, "not_periodic", id="free along x"),
        pytest.param(
            CRYSTAL.with_contacts(CRYSTAL.particle_j != -2), "no_walls", id="one wall is loose"
        ),
        pytest.param(WITHOUT_CONTACTS, "no_walls", id="no contacts between walls"),
        pytest.param(
            replace(WITHOUT_CONTACTS, cell_periodic=np.ones(3, bool)),
            "no_solid",
            id="no contacts in a cell",
        ),
        pytest.param(
            CRYSTAL.with_contacts(CRYSTAL.with_wall), "no_solid", id="contacts with walls alone"
        ),
    ],
)
def test_packing_that_cannot_be_strained_is_refused(network, code):
    with pytest.raises(InputError) as refused:
        elastic_moduli(network)
    assert refused.value.code == code
    assert "\n" not in str(refused.value)


def test_tolerance_of_zero_is_refused():
    with refusal("tolerance"):
        elastic_moduli(CRYSTAL, tolerance=0.0)


@pytest.mark.parametrize("direction", [(0, 0, 0), "z"])
def test_direction_without_length_is_refused(direction):
    with refusal("direction"):
        elastic_moduli(CRYSTAL).velocities(direction)


def test_command_prints_what_the_function_finds(tmp_path, printed, cell):
    path, product = tmp_path / "cell.network.h5", tmp_path / "cell.moduli.h5"
    write_network(path, cell)
    said = printed("moduli", path, "--direction", 1, 1, 0, "-o", product, "--non-affine")
    found = elastic_moduli(cell, non_affine=True)
    assert said["stiffness_pa"] == found.stiffness.tolist()
    assert said["velocity_m_per_s"]["1 1 0"] == found.velocities((1e300, 1e300, 0)).tolist()
    assert said["velocity_m_per_s"]["z"] == found.velocities((0, 0, 1)).tolist()
    assert said["isotropic_velocity_m_per_s"] == [found.v_p, found.v_s]
    assert (read_moduli(product).stiffness == found.stiffness).all()
    with h5py.File(product) as file:
        assert (file["non_affine/rotation"][:] == found.non_affine[:, :, 3:]).all()
