"""Hold a packing at rest: its kind, scales, moduli and caveats, each computed on first use."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from analysis.case import AbsentError, Case
from analysis.caveats import Caveat
from analysis.estimators.effective_medium import velocity_of_contacts
from analysis.estimators.layer_lattice import LayerLattice, is_fcc
from analysis.packing_state import (
    caveats_of_state,
    friction_of_compression,
    target_stress,
    why_unsettled,
)
from analysis.same_state import note
from modal.elasticity.moduli import ElasticModuli
from modal.elasticity.static_response import elastic_moduli
from modal.packing.ends import has_two_ends
from modal.packing.network import Network
from modal.packing.shape_remarks import MIN_WIDTH_IN_DIAMETERS
from modal.packing.summary import crystalline_shares
from modal.system.linear_system import LinearSystem
from modal.tools.errors import UnavailableError

RELATIVE_LINE_WIDTH = 0.005
"""Width of a line of the structure factor and of the density of states, divided by the highest
frequency: 1 kHz in the study's packings under 100 kPa."""
UNSETTLED_MARK = "not settled"
"""Mark in the label of a packing that is not at rest."""


@dataclass(eq=False)
class StaticPacking:
    """A packing at rest; what is known of it without a wave.

    Attributes
    ----------
    network : Network
        The contact network.
    case : Case
        Further files of the packing; without files by default.
    """

    network: Network
    case: Case = field(default_factory=lambda: Case("packing", Path(), {}), kw_only=True)

    @cached_property
    def crystal(self) -> bool:
        """Whether the packing is an FCC crystal between walls."""
        return self.walls and is_fcc(self.network)

    @cached_property
    def lattice(self) -> LayerLattice:
        """Return the lattice of layers to which a crystal reduces in theory."""
        self.require_crystal()
        return LayerLattice.of_network(self.network)

    @property
    def diameter(self) -> float:
        """Return the mean diameter, m."""
        return 2 * float(self.network.radius.mean())

    @property
    def width(self) -> float:
        """Return the narrower side of the cell, in mean diameters."""
        return float(self.network.cell_size[:2].min()) / self.diameter

    @property
    def walls(self) -> bool:
        """Whether there are two walls along z, flat or of held spheres."""
        return has_two_ends(self.network)

    def require_walls(self) -> None:
        """Raise UnavailableError without two walls along z."""
        if not self.walls:
            raise UnavailableError(
                "no_walls",
                "the cell has no two walls along z, from one to the other of which a wave here "
                "goes",
                remedy="`python -m modal moduli --layers FILE.csv` measures velocities by depth "
                "above one wall, `python -m modal wave --plane Z` sends a wave from inside",
            )

    def require_crystal(self) -> None:
        """Raise `AbsentError` unless the packing is an FCC crystal between walls."""
        if not self.crystal:
            raise AbsentError(
                f"{self.case.name}: no FCC crystal between two walls, so it has no theory to "
                "compare with",
                remedy="take another packing",
            )

    @property
    def mu_comp(self) -> float:
        """Return the friction of the compression, NaN if unknown."""
        return friction_of_compression(self.network)

    @property
    def stress(self) -> float:
        """Return the stated target stress, Pa, else the mean stress in the contacts."""
        return target_stress(self.network)

    @cached_property
    def unsettled(self) -> str:
        """Return why the packing does not count as being at rest; empty for a packing at rest.

        Three different stresses are allowed after a triaxial or an oedometric compression.
        """
        stress = np.nan
        anisotropic = {"stress_ratio", "oedometric"} & set(self.network.study)
        if not self.crystal and not anisotropic:
            stress = note(self.network, "stress")
        return why_unsettled(self.network, stress)

    @cached_property
    def label(self) -> str:
        """Return a short name for legends: kind, stress and case."""
        kind = "random"
        if self.crystal:
            kind = "FCC"
        if np.isfinite(self.stress):
            kind += f", {self.stress / 1e3:g} kPa"
        source = self.case.short
        if self.unsettled:
            source += f", {UNSETTLED_MARK}"
        return f"{kind} ({source})"

    @cached_property
    def affine_velocity(self) -> float:
        """Return the velocity, m/s, of a P-wave with affine strain: no P-wave is faster."""
        return velocity_of_contacts(self.network)

    @property
    def affine_passage(self) -> float:
        """Return the time, s, that a P-wave with affine strain takes from wall to wall."""
        return self.network.length / self.affine_velocity

    @property
    def affine_frequency(self) -> float:
        """Return V / D, Hz, with the velocity V of an affine P-wave and the mean diameter D."""
        return self.affine_velocity / self.diameter

    @cached_property
    def line(self) -> float:
        """Return the full width of a single mode's line in spectra, Hz, rounded to three digits.

        The width is proportional to the highest frequency, which an iteration bounds: further
        digits would mean nothing.
        """
        bound = LinearSystem.of(self.network).spectral_bound
        if not bound > 0:
            raise UnavailableError("no_stiffness", "the network has no stiffness")
        return float(f"{RELATIVE_LINE_WIDTH * np.sqrt(bound) / (2 * np.pi):.3g}")

    @cached_property
    def moduli(self) -> ElasticModuli:
        """Return the elastic moduli from the static response of the contacts."""
        return self.case.read("moduli") or elastic_moduli(self.network)

    @cached_property
    def crystalline(self) -> dict[str, float]:
        """Return the share of spheres in crystalline surroundings, of all and of the bulk.

        Empty if it cannot be computed.
        """
        return crystalline_shares(self.network)

    @cached_property
    def of_one_sample(self) -> tuple[Caveat, ...]:
        """Return the caveats that apply to every quantity of this single packing."""
        if self.crystal:
            return ()
        return caveats_of_state(self.network, self.unsettled)

    @cached_property
    def of_waves(self) -> tuple[Caveat, ...]:
        """Return the caveats of quantities read from waves: a narrow packing guides waves."""
        if self.crystal or self.width >= MIN_WIDTH_IN_DIAMETERS:
            return self.of_one_sample
        return (*self.of_one_sample, Caveat("narrow", {"width": self.width}))
