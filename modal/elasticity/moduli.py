"""The elastic stiffness tensor of a packing, from the static response of its springs.

Under a uniform strain E the spheres first follow it, which stores the affine energy V E C_aff E/2;
then they move and turn until they are in balance, and give back part of it:

    V C_ab = d_a . k d_b - f_a . K^-1 f_b

with d_a what strain a does to the contacts, f_a the forces and torques that it leaves on the
spheres (K. Walton, J. Mech. Phys. Solids 35, 213, 1987, for the affine part; C. S. Maloney and A.
Lemaitre, Phys. Rev. E 74, 016118, 2006, for the rest). It is evaluated as the energy itself, whose
error is the square of that of the motion. The file of it is "granular-moduli"
(`docs/formats.md`).
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from modal.elasticity.few_digits import modulus_error_by_digits
from modal.elasticity.plane_waves import anisotropy, isotropic_mean, plane_waves
from modal.elasticity.slab import MIN_STRAIN_SHARE, Bulk, stiffness_of
from modal.elasticity.steady import steady_motion
from modal.elasticity.strain import STRAINS, UNIT_STRAINS, has_walls, stressed_stiffness
from modal.formats.product import Column, product_of, stored
from modal.formats.provenance import Provenance
from modal.modes.zero_modes import by_structure
from modal.packing.network import Network
from modal.packing.precision import overlap_error
from modal.packing.rattlers import force_bearing
from modal.packing.state import volume_between_walls
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked
from modal.tools.arrays import Floats
from modal.tools.display import Drawn, quantity
from modal.tools.errors import InputError, UnavailableError
from modal.tools.visible import visible

SCHEMA = "granular-moduli"
VERSION = (1, 2)
TENSOR = stored("", "f", 6, 6, unit="Pa")
MOTIONS = {
    "displacement": Column("non_affine/displacement", "f", (6, "n", 3), "m", optional=True),
    "rotation": Column("non_affine/rotation", "f", (6, "n", 3), "rad", optional=True),
}
TOLERANCE = 1e-6
"""Relative error of the moduli that is asked for; mostly they are far more exact."""
COPIES = 2
"""Of the motions under six strains, that are kept for the next question: the residual beside."""
UNEVEN = 0.01
"""Asymmetry of a bulk from which it is said. Of 20 slabs, 20 to 80 D long, cut from repeats of
cells with known moduli, V_P was off by 0.8 times it in the mean square, at most by 1.8 times."""
SOFT = 1e-9
"""Of the largest affine modulus: below this a strain costs no energy. Round-off leaves 1e-15."""


@dataclass(frozen=True, repr=False)
class ElasticModuli(Drawn):
    """Elastic stiffness of a packing; the order is xx, yy, zz, yz, zx, xy, shears as angles.

    Attributes
    ----------
    stiffness : ndarray (6, 6)
        Pa, spheres free to move and turn.
    affine : ndarray (6, 6)
        Pa, if all followed the strain: an upper bound.
    density : float
        Of the force-bearing spheres, kg/m^3.
    region : str
        What these are of: a whole cell, the bulk of a slab, or a slab with its walls.
    whole : ndarray (6, 6)
        Pa, of a slab with its walls, else the same as `stiffness`.
    error : float
        Of the moduli, relative, from the residual of the response; of overlaps that are known to
        few digits also from these (`modal.elasticity.few_digits`).
    asymmetry : float
        Of the measured stiffness of a bulk, |C - C^T| / |C|, which its finite length leaves; 0
        elsewhere.
    products, solver : int, str
        Products with K, and what solved.
    pre_stress, stressed : str, ndarray (3, 3, 3, 3) Pa or None
        With the forces that the contacts carry, by these terms; velocities are then of it, all else
        is of springs.
    non_affine : ndarray (6, n, 6) or None
        What each sphere moves and turns beyond a unit strain, m and rad, if asked.

    Examples
    --------
    >>> import modal
    >>> found = modal.elastic_moduli(modal.fcc(cells=(2, 2, 4), periodic_z=True))
    >>> found.region, found.stiffness.shape
    ('cell', (6, 6))
    """

    stiffness: Annotated[Floats, TENSOR]
    affine: Annotated[Floats, TENSOR]
    density: float
    region: str
    whole: Annotated[Floats, TENSOR]
    error: float
    asymmetry: float
    products: int
    solver: str
    pre_stress: str = "none"
    stressed: Annotated[Floats | None, stored("", "f", 3, 3, 3, 3, unit="Pa", since=2)] = None
    non_affine: Floats | None = None

    def __array__(self, dtype: type | None = None, copy: bool | None = None) -> Floats:
        """The stiffness tensor itself, where an array is expected."""
        return np.array(self.stiffness, dtype=dtype)

    def velocities(self, direction: ArrayLike) -> Floats:
        """Shape (3,), m/s, the fastest first: the longest waves along a direction (3,).

        >>> import modal
        >>> crystal = modal.fcc(cells=(2, 2, 4), periodic_z=True)
        >>> modal.elastic_moduli(crystal).velocities((0, 0, 1)).round(2)
        array([776.38, 548.99, 548.99])
        """
        return self.waves(direction)[0]

    def waves(self, direction: ArrayLike) -> tuple[Floats, Floats]:
        """Velocities (3,), m/s, and unit vectors (3, 3), in rows, along which the spheres move."""
        known = self.stiffness if self.stressed is None else self.stressed
        return plane_waves(known, self.density, direction)

    @property
    def bulk_modulus(self) -> float:
        """K, Pa, of the nearest isotropic solid."""
        return isotropic_mean(self.stiffness)[0]

    @property
    def shear_modulus(self) -> float:
        """G, Pa, of the nearest isotropic solid."""
        return isotropic_mean(self.stiffness)[1]

    @property
    def poisson(self) -> float:
        """Poisson's ratio of the nearest isotropic solid."""
        K, G = isotropic_mean(self.stiffness)
        return (3 * K - 2 * G) / (2 * (3 * K + G))

    @property
    def anisotropy(self) -> float:
        """How far the stiffness is from an isotropic one, 0 to 1; see `plane_waves`."""
        return anisotropy(self.stiffness)

    @property
    def v_p(self) -> float:
        """P-wave velocity of the nearest isotropic solid, m/s."""
        K, G = isotropic_mean(self.stiffness)
        return float(np.sqrt((K + 4 / 3 * G) / self.density))

    @property
    def v_s(self) -> float:
        """S-wave velocity of the nearest isotropic solid, m/s."""
        return float(np.sqrt(self.shear_modulus / self.density))

    @property
    def debye_level(self) -> float:
        """Modes per m^3 and Hz over f^2, 1/(m^3 Hz^3), of the longest waves: 4 pi sum of 1 / V^3.

        The mean of 1 / V^3 over all directions is a Gauss sum of 16 by 32 of them, off by 1e-12
        where the anisotropy is 0.17. InputError where a strain costs no energy.
        """
        if len(self.soft_strains()):
            raise UnavailableError(
                "unstable", "the packing is not stable", "some waves have no velocity, nor a level"
            )
        height, weight = np.polynomial.legendre.leggauss(16)
        total = 0.0
        for z, share in zip(height, weight / 64, strict=True):
            for a in 2 * np.pi * np.arange(32) / 32:
                x, y = np.sqrt(1 - z**2) * np.array([np.cos(a), np.sin(a)])
                total += share * float((1 / self.velocities((x, y, z)) ** 3).sum())
        return 4 * np.pi * total

    def soft_strains(self) -> Floats:
        """Shape (k, 6): unit strains that cost no energy, or give some back: the cell is unstable.

        With springs alone none gives energy back; none at all is what a solid has.
        """
        value, vector = np.linalg.eigh(self.stiffness)
        return vector.T[value <= SOFT * np.linalg.eigvalsh(self.affine)[-1]]

    def remarks(self) -> list[str]:
        """What a reader should know: strains that nothing resists, walls or ends in the result."""
        soft = (STRAINS[int(np.argmax(abs(strain)))] for strain in self.soft_strains())
        said = [f"not stable: a strain, mostly {most}, costs no energy" for most in soft]
        if self.region == "slab with walls":
            said.append(
                "too short for a bulk, or walls that slide: these are moduli of packing and walls "
                "together"
            )
        if self.asymmetry > UNEVEN:
            said.append(
                f"not symmetric by {self.asymmetry:.1%}: the bulk is not even along z; its moduli "
                "may be off by twice that; take a longer packing, or one whose walls hold it firmly"
            )
        return said

    def __repr__(self) -> str:
        return (
            f"<ElasticModuli of the {visible(self.region)}: "
            f"K {quantity(self.bulk_modulus, 'Pa')}, "
            f"G {quantity(self.shear_modulus, 'Pa')}, V_P {self.v_p:.4g}, V_S {self.v_s:.4g} m/s>"
        )

    def draw(self, ax: Any) -> None:
        """Draw the three velocities over the direction in the plane of x and z."""
        angle = np.linspace(0, np.pi, 91)
        along = np.column_stack([np.sin(angle), 0 * angle, np.cos(angle)])
        lines = ax.plot(np.degrees(angle), [self.velocities(n) for n in along])
        for line, name in zip(lines, ("fastest", "second", "slowest"), strict=True):
            line.set_label(name)
        ax.set(xlabel="angle from z towards x, degrees", ylabel="velocity, m/s", ylim=(0, None))
        ax.legend()


FORMAT = product_of(SCHEMA, ElasticModuli, MOTIONS, {"products": int}, versions=VERSION)


@checked
def elastic_moduli(
    network: Network,
    *,
    tolerance: float = TOLERANCE,
    pre_stress: str = "none",
    sliding: str = "elastic",
    solver: str | None = None,
    non_affine: bool = False,
) -> ElasticModuli:
    """The elastic stiffness of a packing against small strains: 21 moduli, and wave velocities.

    Six unit strains are put on the packing, its spheres move and turn into balance on the springs
    of their contacts, and the energy says how stiff the whole is. For cells periodic in all
    directions, and for slabs between walls with periods along x and y: there the moduli are those
    of the bulk, five diameters away from the walls, if there is one and the walls grip. Spheres
    that nothing holds take no part.

    Parameters
    ----------
    network : Network
        The packing, n spheres.
    tolerance : float, default 1e-6
        Relative error of the modulus of each strain.
    pre_stress : str, default "none"
        The forces that contacts carry change stiffnesses by some stress over modulus; with
        "normal", "full" or "law" the velocities of a cell periodic in all directions have that
        change, to first order (`modal.elasticity.strain`).
    sliding : str, default "elastic"
        As of `modal.eigenmodes`.
    solver : str, optional
        "pardiso" or "gradients"; by default what is likely to be faster.
    non_affine : bool, default False
        Keep what the spheres do beyond the strain, motions without energy taken out.

    Returns
    -------
    ElasticModuli
        `C` (6, 6) Pa; `bulk_modulus`, `shear_modulus` Pa, `poisson`; `velocities(direction)` (3,)
        m/s.

    Raises
    ------
    InputError
        For a packing that cannot be strained.

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
            "input", f"tolerance {tolerance:g}", "outside 0 to 1", "it is relative to the moduli"
        )
    whole_network = network
    chosen_solver = solver
    carrying = LinearSystem.of(network, pre_stress=pre_stress, sliding=sliding)
    network, walls = carrying.network, has_walls(carrying)
    volume = volume_between_walls(network)
    density = float(network.mass[force_bearing(network)].sum()) / volume
    if network.with_wall.all() or density == 0:
        raise UnavailableError(
            "no_solid",
            "no sphere bears a force from another one",
            "the packing is no solid, which has moduli",
        )
    system = LinearSystem.of(network)
    coupling = system.put_on(UNIT_STRAINS)
    load, stored = coupling.push.toarray(), np.diag(coupling.held)
    most = stored.max()
    if not most > 0:
        raise UnavailableError(
            "no_stiffness", "no contact resists a strain", "the packing has no stiffness"
        )
    bulk = Bulk.of(network) if walls else None

    def left(work: Floats, least: float) -> Floats:
        """Twice the energies (6,), J, that the motion has left of the affine ones."""
        return np.maximum(stored - work, least * most)

    def allowed(work: Floats) -> Floats:
        """Error of the energies (6,), J; what is measured of the motion is off by its root."""
        if bulk:
            return (tolerance * left(work, MIN_STRAIN_SHARE)) ** 2 / most
        # What is left is a difference, which round-off of the affine energy blurs.
        return np.maximum(tolerance * left(work, SOFT), np.finfo(float).eps * most)

    found, solver = system.cached(
        f"balance under strains to {tolerance!r}, {solver}",
        lambda: steady_motion(system, coupling, allowed, solver),
        COPIES * load.nbytes,
    )
    motion, work = found.motion, np.einsum("ik,ik->k", load, found.motion)
    whole = (coupling.held - load.T @ motion - motion.T @ found.residual) / volume
    measured = whole = (whole + whole.T) / 2
    followed, region = coupling.held / volume, "slab with walls" if walls else "cell"
    error = found.energy_error / left(work, SOFT)
    in_bulk = stiffness_of(network, bulk, motion) if bulk else None
    if bulk and in_bulk:
        measured, followed = in_bulk
        density, region = bulk.density(network), "bulk"
        error = np.sqrt(found.energy_error * most) / left(work, MIN_STRAIN_SHARE)
    beyond, stressed = None, None
    if non_affine or pre_stress != "none":
        beyond = _without_floppy(system, motion)
        stressed = None if pre_stress == "none" else stressed_stiffness(carrying, beyond)
    moduli = ElasticModuli(
        (measured + measured.T) / 2,
        followed,
        density,
        region,
        whole,
        float(error.max()),
        float(np.linalg.norm(measured - measured.T) / np.linalg.norm(measured)),
        found.products,
        solver,
        pre_stress,
        stressed,
        beyond if non_affine else None,
    )
    if not overlap_error(whole_network):
        return moduli

    def measure(perturbed: Network) -> ElasticModuli:
        return elastic_moduli(perturbed, tolerance=tolerance, sliding=sliding, solver=chosen_solver)

    by_digits = modulus_error_by_digits(whole_network, moduli, measure)
    return replace(moduli, error=float(np.hypot(moduli.error, by_digits)))


def _without_floppy(system: LinearSystem, motion: Floats) -> Floats:
    """Shape (6, n, 6): the motions (6n, 6) without what costs no energy."""
    scaled = system.sqrt_mass.times(motion)
    basis = by_structure(system).basis
    scaled -= basis @ (basis.T @ scaled)
    return system.sqrt_mass.over(scaled).T.reshape(6, system.network.n_particles, 6)


def write_moduli(path: str | Path, moduli: ElasticModuli, made: Provenance | None = None) -> None:
    """Write the moduli atomically, and the non-affine motions if there are any."""
    values, beyond = dict(vars(moduli)), moduli.non_affine
    if beyond is not None:
        values |= {"displacement": beyond[:, :, :3], "rotation": beyond[:, :, 3:]}
    FORMAT.write(path, values, made)


def read_moduli(path: str | Path) -> ElasticModuli:
    """Read and validate, without the non-affine motions; InputError for anything wrong."""
    said = FORMAT.read(path, leave=MOTIONS)
    return ElasticModuli(**{name: said[name] for name in said if name not in MOTIONS})
