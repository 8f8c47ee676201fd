"""Estimate contacts of spheres whose overlaps are not known, as in a scan by tomography.

A scan measures centres to about a percent of a radius, and overlaps are a hundred times smaller. So
spheres whose gap is below a tolerance count as contacts. The mean stress p of a packing with the
volume V is the mean product of contact forces and branch vectors l, which determines the mean
normal force f (Love; Christoffersen, Mehrabadi and Nemat-Nasser, J. Appl. Mech. 48, 339, 1981):

    sigma = 1/V sum_c f_c (x) l_c,    hence    f = 3 p V / sum_c |l_c|

Single forces are drawn from an exponential distribution about this mean, as packings of spheres
have it (Radjai, Jean, Moreau and Roux, Phys. Rev. Lett. 77, 274, 1996). Stiffnesses follow from
them by the contact law; both of Hertz and Mindlin grow as (R* f)^(1/3). Equal forces, the
mean-field assumption of Digby (J. Appl. Mech. 48, 803, 1981) and Walton (J. Mech. Phys. Solids 35,
213, 1987), make V_P 10 % larger.

Neither the right tolerance nor the force of a single contact is known. Therefore `alternatives`
yields the packing at other tolerances, and with equal forces; the change of a result is its error.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from modal.formats.attributes import number_noted
from modal.packing.columns import RECEIVER_WALL, SOURCE_WALL
from modal.packing.neighbours import ContactList, touching
from modal.packing.network import Network
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError

TOLERANCE_FACTORS = (0.5, 1.5)
"""Factors on the tolerance at which a packing is built again for its error."""
SEED = 1
"""Seed of the forces, so that a packing is the same each time."""
TOLERANCE = "gap_tolerance"
"""Name of the note in a network: the largest gap of a contact, m."""
STRESS = "scan_stress"
"""Name of the note in a network: the mean stress from which stiffnesses follow, Pa."""
COEFFICIENTS = (
    "scan_normal",
    "scan_tangential",
    "scan_wall_normal",
    "scan_wall_tangential",
    "scan_normal_power",
    "scan_tangential_power",
)
"""Names of the notes in a network for the numbers of `ForceLaw`, in their order."""


@dataclass(frozen=True)
class ForceLaw:
    """Stiffness of contacts as a function of the normal force f: k = coefficient (R* f)^power.

    Attributes
    ----------
    normal, tangential : float
        Coefficients between two spheres, in N/m divided by (N m)^power.
    wall_normal, wall_tangential : float
        Coefficients at a wall, where R* is the radius of the sphere.
    normal_power, tangential_power : float
        Powers: 1/3 for Hertz and Mindlin, 0 for linear springs.
    """

    normal: float
    tangential: float
    wall_normal: float
    wall_tangential: float
    normal_power: float
    tangential_power: float

    def stiffnesses(
        self, effective_radius: Floats, force: Floats, at_wall: Bools
    ) -> tuple[Floats, Floats]:
        """Return the normal and the tangential stiffnesses (m,), N/m, under forces (m,), N."""
        moment = effective_radius * force
        normal = np.where(at_wall, self.wall_normal, self.normal)
        tangential = np.where(at_wall, self.wall_tangential, self.tangential)
        return normal * moment**self.normal_power, tangential * moment**self.tangential_power


@dataclass(frozen=True)
class Scan:
    """Assumptions on a packing whose overlaps are not known.

    Attributes
    ----------
    tolerance : float
        Largest gap of a contact, m.
    stress : float
        Mean stress, Pa.
    law : ForceLaw
        Stiffness as a function of the force of a contact.
    """

    tolerance: float
    stress: float
    law: ForceLaw

    @classmethod
    def of(cls, study: Mapping[str, Any]) -> Scan | None:
        """Return the scan that the notes of a network describe; None if it is not from a scan."""
        numbers = []
        for name in (TOLERANCE, STRESS, *COEFFICIENTS):
            number = number_noted(study, name)
            if number is None:
                return None
            numbers.append(number)
        return cls(numbers[0], numbers[1], ForceLaw(*numbers[2:]))

    @property
    def notes(self) -> dict[str, float]:
        """The notes of a network from which `Scan.of` restores the scan."""
        coefficients = zip(COEFFICIENTS, vars(self.law).values(), strict=True)
        return {TOLERANCE: self.tolerance, STRESS: self.stress, **dict(coefficients)}


@dataclass(frozen=True)
class ScannedSpheres:
    """The n spheres of a scan in their cell, as columns of a network.

    Attributes
    ----------
    bodies : mapping
        Columns of the particles by name.
    cell_size, cell_periodic, wall_position : ndarray (3,) m, (3,) bool, (2,) m
        As in `Network`.
    has_wall : ndarray (2,) of bool
        Whether there is a wall at low and at high z.
    """

    bodies: Mapping[str, Any]
    cell_size: Floats
    cell_periodic: Bools
    wall_position: Floats
    has_wall: Bools

    @classmethod
    def of(cls, network: Network) -> ScannedSpheres:
        """Return the spheres of a network; a wall is there if it has contacts."""
        codes = (SOURCE_WALL, RECEIVER_WALL)
        return cls(
            network.bodies(),
            network.cell_size,
            network.cell_periodic,
            network.wall_position,
            np.array([(network.particle_j == code).any() for code in codes]),
        )

    def contacts(self, tolerance: float) -> ContactList:
        """Return the contacts of spheres, and with walls, whose gap is at most a tolerance, m."""
        position = self.bodies["position"]
        periods = np.where(self.cell_periodic, self.cell_size, 0.0)
        walls = np.where(self.has_wall, self.wall_position, np.nan)
        radius = self.bodies["radius"]
        low = position.min(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):  # two in one place are refused later
            return touching(position, low, periods, walls, radius, gap=tolerance)

    def network(
        self, scan: Scan, study: Mapping[str, Any], *, equal_forces: bool = False
    ) -> Network:
        """Return the network at the tolerance and the stress of a scan.

        Overlaps and forces, which are not known, are absent from the network.

        Parameters
        ----------
        scan : Scan
            The assumptions, which are noted in the network together with `study`.
        study : mapping
            Further notes.
        equal_forces : bool
            Whether all normal forces are equal, instead of exponentially distributed.

        Raises
        ------
        InputError
            If no gap is below the tolerance, or if the spheres are invalid.
        """
        contacts = self.contacts(scan.tolerance)
        if len(contacts.overlap) == 0:
            raise InputError(
                "no_contacts",
                f"no gap is below the tolerance of {scan.tolerance:.3g} m",
                remedy="give a larger one, or lengths in the right unit",
            )
        radius = self.bodies["radius"]
        radius_i = radius[contacts.particle_i]
        radius_j = radius[np.maximum(contacts.particle_j, 0)]
        at_wall = contacts.particle_j < 0
        effective_radius = np.where(at_wall, radius_i, radius_i * radius_j / (radius_i + radius_j))
        length = np.where(at_wall, radius_i, radius_i + radius_j) - contacts.overlap
        shares = np.ones(len(length)) if equal_forces else draw_force_shares(len(length))
        volume = float(np.prod(self.cell_size))
        force = shares * mean_contact_force(scan.stress, volume, shares * length)
        normal, tangential = scan.law.stiffnesses(effective_radius, force, at_wall)
        middle = contacts.overlap[:, None] / 2
        lever_j = (middle - radius_j[:, None]) * contacts.normal
        lever_j[at_wall] = 0
        return Network(
            **self.bodies,
            particle_i=contacts.particle_i,
            particle_j=contacts.particle_j,
            cell_shift=contacts.cell_shift,
            normal=contacts.normal,
            lever_i=(radius_i[:, None] - middle) * contacts.normal,
            lever_j=lever_j,
            stiffness_normal=normal,
            stiffness_tangential=tangential,
            cell_size=self.cell_size,
            cell_periodic=self.cell_periodic,
            wall_position=self.wall_position,
            study=dict(study) | scan.notes,
        )


def mean_contact_force(stress: float, volume: float, lengths: Floats) -> float:
    """Return the normal force, N, of contacts with branch vectors of these lengths (m,), m.

    `stress` is the mean stress, Pa, and `volume` that of the packing, m^3. If forces differ,
    multiply each length by its force divided by the mean force.

    >>> round(mean_contact_force(1e5, 1e-6, np.full(100, 2e-3)), 9)
    1.5
    """
    return float(3 * stress * volume / lengths.sum())


def draw_force_shares(count: int) -> Floats:
    """Return forces (count,) divided by their mean: quantiles of exp(-f) in a random order."""
    quantiles = (np.arange(count) + 0.5) / count
    shares = -np.log1p(-quantiles)
    return np.random.default_rng(SEED).permutation(shares)


def alternatives(network: Network) -> Iterator[Network]:
    """Yield a scanned packing under other assumptions.

    The assumptions are smaller and larger tolerances (`TOLERANCE_FACTORS`), and equal forces. None
    is yielded if the network is not from a scan.
    """
    scan = Scan.of(network.study)
    if scan is None:
        return
    spheres = ScannedSpheres.of(network)
    for factor in TOLERANCE_FACTORS:
        other_scan = Scan(factor * scan.tolerance, scan.stress, scan.law)
        yield spheres.network(other_scan, network.study)
    yield spheres.network(scan, network.study, equal_forces=True)
