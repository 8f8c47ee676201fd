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

from modal.elasticity.moduli import read_moduli
from modal.elasticity.plane_waves import anisotropy, isotropic_mean, plane_waves
from modal.elasticity.static_response import elastic_moduli
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
    """Return 250 spheres of radii 1:3, periodic in all directions."""
    return polydisperse(periodic_z=True, n=250)


@pytest.mark.parametrize("known", [("force_normal", "force_tangential", "cell_shift"), ()])
def test_levers_as_long_as_the_radii_leave_stress_and_velocity(known):
    """Lengthen the levers of a crystal, whose spheres do not turn: nothing changes.

    Its branches are those of the centres, also through periods that only the levers show.
    """
    crystal = FccLattice(1e8)
    stress = 1e8
    longer = levers_of_radii(gallery.fcc(stress, (2, 2, 4), periodic_z=True))
    # A crystal has no non-affine motion: nothing is left but the round-off of sums over contacts,
    # and of the overlap, 3e-2 R, as the difference of two lengths: some hundred eps.
    if known:
        assert stress_tensor(longer) == pytest.approx(stress * np.eye(3), abs=1e-12 * stress)
    velocity = elastic_moduli(bare(longer, *known)).velocities((0, 0, 1))
    assert velocity[0] == pytest.approx(crystal.velocity, rel=1e-12)


@pytest.mark.parametrize("solver", ["pardiso", "gradients"])
@pytest.mark.parametrize("stress", [1e5, 1e7])
def test_crystal_against_its_closed_form(stress, solver):
    """Compare with the closed form; only round-off of some 1e4 additions is in between."""
    pytest.importorskip("pypardiso" if solver == "pardiso" else "numpy")
    crystal = FccLattice(stress)
    network = gallery.fcc(stress, (2, 3, 4), periodic_z=True)
    moduli = elastic_moduli(network, solver=solver)
    assert moduli.stiffness == pytest.approx(crystal.stiffness, rel=1e-11, abs=1e-9 * crystal.C)
    assert moduli.affine == pytest.approx(crystal.stiffness, rel=1e-11, abs=1e-9 * crystal.C)
    assert moduli.region == "cell"
    assert moduli.asymmetry < 1e-12
    assert moduli.density == pytest.approx(
        crystal.mass * np.sqrt(2) / crystal.spacing**3, rel=1e-12
    )


@pytest.mark.parametrize("direction", CUBE)
def test_velocities_of_the_crystal_are_the_slopes_of_its_bloch_waves(direction):
    """Compare all three velocities with Bloch waves at kappa d = 1e-3.

    The branches bend by the square of this divided by 24, 4e-8.
    """
    crystal = FccLattice(1e5)
    moduli = elastic_moduli(gallery.fcc(cells=(1, 1, 2), periodic_z=True))
    n = np.array(CUBE[direction]) / np.linalg.norm(CUBE[direction])
    kappa = 1e-3 / crystal.spacing
    slopes = 2 * np.pi * crystal.bloch(kappa * n)[0][:3] / kappa
    assert moduli.velocities(n) == pytest.approx(slopes[::-1], rel=1e-6)


def least_squares_moduli(network: Network) -> np.ndarray:
    """Return the stiffness (6, 6), Pa, by springs as weighted equations.

    The least energy of strained springs is the least square of root(k) (stretch + B motion). There
    is no stiffness matrix, no symmetric gradient with sliding planes and no iteration.
    """
    i = network.particle_i
    j = network.particle_j
    m = network.n_contacts
    kn, kt = np.sqrt([network.stiffness_normal, network.stiffness_tangential])[..., None, None]
    nn = network.normal[:, :, None] * network.normal[:, None]
    root = kn * nn + kt * (np.eye(3) - nn)
    B = np.zeros((m, 3, network.n_particles, 6))
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
    B = B.reshape(3 * m, -1)
    stretch = stretch.reshape(3 * m, 6)
    motion = lstsq(B, -stretch, cond=1e-10)[0]
    relative_motion = stretch + B @ motion
    return relative_motion.T @ relative_motion / np.prod(network.cell_size)


def test_random_cell_against_least_squares(cell):
    """Compare with least squares, whose error at a condition number of 1e3 is far below 1e-8."""
    exact = least_squares_moduli(cell)
    scale = abs(exact).max()
    for solver in ("pardiso", "gradients"):
        if solver == "pardiso":
            pytest.importorskip("pypardiso")
        moduli = elastic_moduli(cell, tolerance=1e-9, solver=solver)
        assert moduli.stiffness == pytest.approx(exact, abs=1e-8 * scale)
        assert moduli.error < 1e-9
        # The affine energy is an upper bound of every strain's; the free spheres give back some.
        assert np.linalg.eigvalsh(moduli.affine - moduli.stiffness).min() > 0.05 * scale


@pytest.mark.parametrize("solver", ["pardiso", "gradients"])
def test_tolerance_is_that_of_the_moduli_not_of_the_affine_ones(solver):
    """Check the tolerance of moduli that are a hundredth of the affine ones, or less.

    Stiffnesses span six decades. The error is estimated from below; the solution may be some times
    further off.
    """
    pytest.importorskip("pypardiso" if solver == "pardiso" else "numpy")
    cell = polydisperse(periodic_z=True, n=60)
    factor = 10 ** np.random.default_rng(3).uniform(-6, 0, (2, cell.n_contacts))
    cell = stiffer(cell, *factor)
    exact = np.diag(least_squares_moduli(cell))
    for tolerance in (1e-3, 1e-6):
        moduli = elastic_moduli(cell, tolerance=tolerance, solver=solver)
        assert (np.diag(moduli.affine) > 100 * exact).all()
        assert np.diag(moduli.stiffness) == pytest.approx(exact, rel=3 * tolerance)
        assert moduli.error <= tolerance


def test_isotropic_solids_have_one_p_and_two_s_waves():
    K = 3e8
    G = 1.2e8
    rho = 1500.0
    C = np.diag([2 * G] * 3 + [G] * 3)
    C[:3, :3] += K - 2 / 3 * G
    velocity, motion = plane_waves(C, rho, (1, 2, -2))
    # Some hundred operations and the eigenvalues of a 3 x 3 matrix of condition 4: 100 eps.
    round_off = 1e-13
    speeds = np.sqrt([(K + 4 / 3 * G) / rho, G / rho, G / rho])
    assert velocity == pytest.approx(speeds, rel=round_off)
    assert abs(motion[0] @ np.array([1, 2, -2]) / 3) == pytest.approx(1, abs=round_off)
    assert isotropic_mean(C) == pytest.approx((K, G), rel=round_off)
    assert anisotropy(C) == pytest.approx(0, abs=round_off)
    # A cubic solid's distance from isotropy, by hand: C44 alone differs, from (C11 - C12) / 2.
    C[3:, 3:] *= 1.5
    beta = G / 2  # of 2 C44 - (C11 - C12) = 2 beta: three shears weigh 4/5 of 3 (2 beta)^2 ...
    mean = 2 * G + 3 / 5 * 2 * beta
    off = 3 * (3 * G - mean) ** 2 + 2 * (2 * G - mean) ** 2
    assert anisotropy(C) == pytest.approx(
        np.sqrt(off / (off + 9 * K**2 + 5 * mean**2)), rel=round_off
    )


def test_spheres_that_nothing_holds_take_no_part(cell):
    """Add three spheres without contacts: moduli and density stay."""
    bodies = {name: np.concatenate([x, x[:3]]) for name, x in cell.bodies().items()}
    moduli = elastic_moduli(cell, non_affine=True)
    with_loose_spheres = elastic_moduli(replace(cell, **bodies), non_affine=True)
    # Each of the two solutions has the default tolerance, 1e-6.
    assert with_loose_spheres.stiffness == pytest.approx(
        moduli.stiffness, abs=2e-6 * moduli.stiffness.max()
    )
    assert with_loose_spheres.density == moduli.density
    # Without a contact they have no force; taking off rigid motions moves them by round-off.
    assert abs(with_loose_spheres.non_affine[:, -3:]).max() < 1e-9 * abs(moduli.non_affine).max()
    # Rigid motions of the whole are motions without energy: none is left.
    drift = np.einsum("sna,n->sa", moduli.non_affine[:, :, :3], cell.mass) / cell.mass.sum()
    assert abs(drift).max() < 1e-9 * abs(moduli.non_affine).max()


def test_non_affine_motion_balances_every_sphere(cell):
    """Check with plain vectors that forces under strain and motion vanish on every sphere."""
    moduli = elastic_moduli(cell, tolerance=1e-12, non_affine=True)
    motion = moduli.non_affine[5]
    i = cell.particle_i
    j = cell.particle_j
    strain = np.array([[0, 0.5, 0], [0.5, 0, 0], [0, 0, 0]])
    ends = np.hstack([motion[i], motion[j]])
    parted = (cell.lever_i - cell.lever_j) @ strain
    parted += np.einsum("cab,cb->ca", kinematics(cell), ends)
    along = np.einsum("ca,ca->c", parted, cell.normal)[:, None] * cell.normal
    kn = cell.stiffness_normal[:, None]
    kt = cell.stiffness_tangential[:, None]
    force = kn * along + kt * (parted - along)
    total = np.zeros((cell.n_particles, 3))
    np.add.at(total, i, force)
    np.add.at(total, j, -force)
    # The energy is known to 1e-12, the motion to the root of that; the sum over the contacts of a
    # sphere, some ten, has ten times the error of one force.
    assert abs(total).max() < 1e-5 * abs(force).max()


@pytest.mark.parametrize("solver", ["pardiso", "gradients"])
def test_a_cell_that_resists_nothing_says_so(solver):
    """Strain smooth spheres that hardly touch: they give way, and round-off is left."""
    pytest.importorskip("pypardiso" if solver == "pardiso" else "numpy")
    loose = stiffer(polydisperse(periodic_z=True, n=60), 1, 0)
    moduli = elastic_moduli(loose, solver=solver)
    assert len(moduli.soft_strains()) == 6
    assert [remark.code for remark in moduli.remarks()] == ["soft_strain"] * 6


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
    path = tmp_path / "cell.network.h5"
    product = tmp_path / "cell.moduli.h5"
    write_network(path, cell)
    output = printed("moduli", path, "--direction", 1, 1, 0, "-o", product, "--non-affine")
    moduli = elastic_moduli(cell, non_affine=True)
    assert output["stiffness_pa"] == moduli.stiffness.tolist()
    assert output["velocity_m_per_s"]["1 1 0"] == moduli.velocities((1e300, 1e300, 0)).tolist()
    assert output["velocity_m_per_s"]["z"] == moduli.velocities((0, 0, 1)).tolist()
    assert output["isotropic_velocity_m_per_s"] == [moduli.v_p, moduli.v_s]
    assert (read_moduli(product).stiffness == moduli.stiffness).all()
    with h5py.File(product) as file:
        assert (file["non_affine/rotation"][:] == moduli.non_affine[:, :, 3:]).all()
