"""Compute the elastic stiffness tensor of a packing from the static response of its springs.

Under a uniform strain E the spheres first follow the strain, which stores the affine energy
V E C_aff E / 2; then they move and turn until they are in balance, and release a part of it:

    V C_ab = d_a . k d_b - f_a . K^-1 f_b

with d_a the motion of the contacts by strain a, and f_a the forces and torques that it leaves on
the spheres (K. Walton, J. Mech. Phys. Solids 35, 213, 1987, for the affine part; C. S. Maloney and
A. Lemaitre, Phys. Rev. E 74, 016118, 2006, for the rest). The sum is evaluated as the energy
itself, whose error is the square of that of the motion.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from modal.elasticity.few_digits import modulus_error_by_digits
from modal.elasticity.inside import moduli_inside
from modal.elasticity.moduli import MAX_SOFT_SHARE, ElasticModuli
from modal.elasticity.slab import MIN_STRAIN_SHARE, Bulk, stiffness_of
from modal.elasticity.steady import steady_motion
from modal.elasticity.strain import UNIT_STRAINS, has_walls, stressed_stiffness
from modal.modes.zero_modes import by_structure
from modal.packing.ends import end_heights
from modal.packing.network import Network
from modal.packing.precision import is_exact
from modal.packing.rattlers import force_bearing
from modal.packing.state import volume_between_walls
from modal.system.contacts import PreStress, Sliding
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked
from modal.tools.arrays import Floats
from modal.tools.errors import InputError, UnavailableError

TOLERANCE = 1e-6
"""Default relative error of the moduli; mostly they are far more exact."""
CACHED_COPIES = 2
"""Number of arrays that a network keeps, each of the size of the motions under six strains: motion
and residual."""


@checked
def elastic_moduli(
    network: Network,
    *,
    tolerance: float = TOLERANCE,
    pre_stress: PreStress = "none",
    sliding: Sliding = "elastic",
    solver: str | None = None,
    non_affine: bool = False,
    inside: ArrayLike | None = None,
) -> ElasticModuli:
    """Compute the elastic stiffness of a packing: 21 moduli, and wave velocities.

    Six small unit strains are put on the packing, its spheres move and turn into balance on the
    springs of their contacts, and the stiffness follows from the energy. The packing is a cell
    periodic in all directions, or a slab between walls with periods along x and y; the moduli of a
    slab are those of the bulk, five diameters away from the walls, if the slab is long enough and
    the walls bear shear. Floppy spheres, which nothing holds, do not contribute.

    Parameters
    ----------
    network : Network
        The packing, n spheres.
    tolerance : float, default 1e-6
        Relative error of the modulus of each strain.
    pre_stress : str, default "none"
        The forces that contacts carry change stiffnesses by about the ratio of stress to modulus;
        with "normal", "full" or "law" the velocities of a cell periodic in all directions include
        this change, to first order (`modal.elasticity.strain`).
    sliding : str, default "elastic"
        As in `modal.eigenmodes`.
    solver : str, optional
        "pardiso" or "gradients"; by default the one that is likely to be faster.
    non_affine : bool, default False
        Keep the motion of the spheres beyond the strain, without motions that cost no energy.
    inside : ndarray (3, 2) or (6,), optional
        Low and high x, y and z, m, of a box inside a packing of any shape, with side walls or free
        surfaces: measure the moduli there (`modal.elasticity.inside`). Its error contains the
        influence of the spheres around the box.

    Returns
    -------
    ElasticModuli
        `stiffness` (6, 6) Pa; `bulk_modulus`, `shear_modulus` Pa, `poisson`;
        `velocities(direction)` (3,) m/s.

    Raises
    ------
    InputError
        If the packing cannot be strained, or does not resist a strain.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(2, 2, 4), periodic_z=True)
    >>> C = modal.elastic_moduli(crystal)
    >>> C.velocities((0, 0, 1)).round(2), round(C.poisson, 3)
    (array([776.38, 548.99, 548.99]), 0.023)
    """
    if not 0 < tolerance < 1:
        raise InputError(
            "tolerance",
            f"tolerance {tolerance:g}",
            "outside 0 to 1",
            "it is relative to the moduli",
        )
    if inside is not None:
        _refuse_beside_box(pre_stress, sliding)
        moduli = _compute_inside(network, inside, tolerance, solver, non_affine)
    else:
        moduli = _compute(
            LinearSystem.of(network, pre_stress=pre_stress, sliding=sliding),
            tolerance,
            solver,
            non_affine,
        )
    if is_exact(network):
        return moduli

    def measure(perturbed: Network) -> ElasticModuli:
        return elastic_moduli(
            perturbed, tolerance=tolerance, sliding=sliding, solver=solver, inside=inside
        )

    error_by_digits = modulus_error_by_digits(network, moduli, measure)
    return replace(moduli, error=float(np.hypot(moduli.error, error_by_digits)))


def _compute(
    stressed_system: LinearSystem, tolerance: float, solver: str | None, non_affine: bool
) -> ElasticModuli:
    """Compute the moduli as `elastic_moduli` does, without the error from few digits."""
    network = stressed_system.network
    walls = has_walls(stressed_system)
    volume = volume_between_walls(network)
    if walls:
        # Rough walls are not strained.
        volume *= float(np.diff(end_heights(network))[0]) / network.length
    density = float(network.mass[force_bearing(network)].sum()) / volume
    if network.with_wall.all() or density == 0:
        raise UnavailableError(
            "no_solid",
            "no sphere bears a force from another one",
            "the packing is no solid, which has moduli",
        )
    system = LinearSystem.of(network)
    coupling = system.put_on(UNIT_STRAINS)
    load = coupling.push.toarray()
    affine_energy = np.diag(coupling.held)
    largest_energy = affine_energy.max()
    if not largest_energy > 0:
        raise UnavailableError(
            "no_stiffness", "no contact resists a strain", "the packing has no stiffness"
        )
    bulk = Bulk.of(network) if walls else None

    def remaining_energy(work: Floats, min_share: float) -> Floats:
        """Return twice the energies (6,), J, that six strains store once the spheres have moved."""
        return np.maximum(affine_energy - work, min_share * largest_energy)

    def allowed_error(work: Floats) -> Floats:
        """Return the allowed errors (6,), J, of twice the energies of the six strains."""
        if bulk:
            # The stiffness of a bulk is measured on the motion, whose error is the square root.
            return (tolerance * remaining_energy(work, MIN_STRAIN_SHARE)) ** 2 / largest_energy
        # The energy that is left is a difference, which round-off of the affine energy blurs.
        round_off = np.finfo(float).eps * largest_energy
        return np.maximum(tolerance * remaining_energy(work, MAX_SOFT_SHARE), round_off)

    solution, used_solver = system.cached(
        f"balance under strains to {tolerance!r}, {solver}",
        lambda: steady_motion(system, coupling, allowed_error, solver),
        CACHED_COPIES * load.nbytes,
    )
    motion = solution.motion
    work = np.einsum("ik,ik->k", load, motion)
    whole = (coupling.held - load.T @ motion - motion.T @ solution.residual) / volume
    whole = (whole + whole.T) / 2
    measured = whole
    affine = coupling.held / volume
    region = "slab with walls" if walls else "cell"
    error = solution.energy_error / remaining_energy(work, MAX_SOFT_SHARE)
    in_bulk = stiffness_of(network, bulk, motion) if bulk else None
    if bulk and in_bulk:
        measured, affine = in_bulk
        density = bulk.density(network)
        region = "bulk"
        motion_error = np.sqrt(solution.energy_error * largest_energy)
        error = motion_error / remaining_energy(work, MIN_STRAIN_SHARE)
    beyond = None
    stressed = None
    if non_affine or stressed_system.pre_stress != "none":
        beyond = _without_floppy(system, motion)
    if beyond is not None and stressed_system.pre_stress != "none":
        stressed = stressed_stiffness(stressed_system, beyond)
    return ElasticModuli(
        stiffness=(measured + measured.T) / 2,
        affine=affine,
        density=density,
        region=region,
        whole=whole,
        error=float(error.max()),
        asymmetry=float(np.linalg.norm(measured - measured.T) / np.linalg.norm(measured)),
        products=solution.products,
        solver=used_solver,
        pre_stress=stressed_system.pre_stress,
        stressed=stressed,
        non_affine=beyond if non_affine else None,
    )


def _refuse_beside_box(pre_stress: PreStress, sliding: Sliding) -> None:
    """Raise InputError for options that a box inside a packing does not have."""
    for name, value, only in (
        ("pre_stress", pre_stress, "none"),
        ("sliding", sliding, "elastic"),
    ):
        if value != only:
            problem = f"{name} {value!r} beside a box (inside)"
            raise InputError(
                name, problem, "in a box the springs alone are known", "leave one of the two out"
            )


def _compute_inside(
    network: Network, bounds: ArrayLike, tolerance: float, solver: str | None, non_affine: bool
) -> ElasticModuli:
    """Compute the moduli of a box inside a packing, without the error from few digits."""
    box = moduli_inside(network, bounds, tolerance, solver)
    measured = box.stiffness
    stiffness = (measured + measured.T) / 2
    return ElasticModuli(
        stiffness=stiffness,
        affine=box.affine,
        density=box.density,
        region="box",
        whole=stiffness,
        error=box.error,
        asymmetry=float(np.linalg.norm(measured - measured.T) / np.linalg.norm(measured)),
        products=box.products,
        solver=box.solver,
        non_affine=_without_floppy(box.system, box.motion) if non_affine else None,
    )


def _without_floppy(system: LinearSystem, motion: Floats) -> Floats:
    """Return motions (6n, 6) without the parts that cost no energy, as an array (6, n, 6)."""
    scaled = system.sqrt_mass.times(motion)
    basis = by_structure(system).basis
    scaled -= basis @ (basis.T @ scaled)
    return system.sqrt_mass.over(scaled).T.reshape(6, system.network.n_particles, 6)
