"""What a packing is, before any wave: size, order, state, and what to know of its numbers."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from analysis.case import AbsentError, Case
from analysis.estimators.effective_medium import velocity_of_contacts
from analysis.estimators.layer_lattice import LayerLattice, is_fcc
from analysis.estimators.settled import MARK, why_unsettled
from modal.elasticity.moduli import ElasticModuli, elastic_moduli
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.plausibility import CRYSTALLINE
from modal.packing.state import FORCES, profile, stress_tensor
from modal.packing.summary import crystalline_shares
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError

LINE = 0.005
"""Width of a line of the structure factor and of the density of states, in parts of the highest
frequency: 1 kHz in the study's packings under 100 kPa."""
NARROW = 10.0
"""Diameters: a narrower packing guides its waves at low frequency already."""


class Packing:
    """A contact network, and the files of its `case`."""

    def __init__(self, network: Network, case: Case) -> None:
        self.network, self.case = network, case

    @cached_property
    def crystal(self) -> bool:
        """Whether it is an FCC crystal between walls, of which theory knows the waves."""
        return self.walls and is_fcc(self.network)

    @cached_property
    def lattice(self) -> LayerLattice:
        """The lattice of layers that the theory of a crystal reduces to."""
        self.require_crystal()
        return LayerLattice.of_network(self.network)

    @property
    def diameter(self) -> float:
        """Mean diameter, m."""
        return 2 * float(self.network.radius.mean())

    @property
    def width(self) -> float:
        """The narrower side of the cell, mean diameters."""
        return float(self.network.cell_size[:2].min()) / self.diameter

    @property
    def walls(self) -> bool:
        """Whether walls bound it along z, so that one can push and the other listen."""
        return bool(np.isin([SOURCE_WALL, RECEIVER_WALL], self.network.particle_j).all())

    def require_walls(self) -> None:
        """InputError without them."""
        if not self.walls:
            raise InputError("there are no two walls along z, which a wave here goes between")

    def require_crystal(self) -> None:
        """`AbsentError` for other packings."""
        if not self.crystal:
            raise AbsentError(
                f"{self.case.name}: no FCC crystal between two walls, so it has no theory to "
                "compare with; take another packing"
            )

    @property
    def mu_comp(self) -> float:
        """Friction of the compression; the wave's is 0.1 more (section 2). NaN if unknown."""
        study = self.network.study
        friction = study.get("mu_comp", float(study.get("mu_wave", np.nan)) - 0.1)
        return round(float(friction), 6)

    @property
    def stress(self) -> float:
        """Stress, Pa, that it was made for, as its network says.

        Else the mean that the contacts bear, to three digits; NaN without contact forces.
        """
        stated = float(self.network.study.get("stress", np.nan))
        if np.isfinite(stated) or any(getattr(self.network, name) is None for name in FORCES):
            return stated
        return float(f"{np.trace(stress_tensor(self.network)) / 3:.3g}")

    @cached_property
    def unsettled(self) -> str:
        """Why its state does not count as settled; empty where it does.

        Three stresses that differ, as of a triaxial compression, are no fault.
        """
        study = self.network.study
        equal = not self.crystal and not {"stress_ratio", "oedometric"} & set(study)
        return why_unsettled(self.network, float(study.get("stress", np.nan)) if equal else np.nan)

    @cached_property
    def label(self) -> str:
        """Short name for legends: what it is, and under which stress."""
        kind, mark = "FCC" if self.crystal else "random", f", {MARK}" if self.unsettled else ""
        under = f", {self.stress / 1e3:g} kPa" if np.isfinite(self.stress) else ""
        return f"{kind}{under} ({self.case.short}{mark})"

    @cached_property
    def affine_velocity(self) -> float:
        """Velocity, m/s, of a P-wave that strains the packing evenly: none is faster."""
        return velocity_of_contacts(self.network)

    @property
    def affine_passage(self) -> float:
        """Time from wall to wall, s, of that wave."""
        return self.network.length / self.affine_velocity

    @property
    def affine_frequency(self) -> float:
        """V / D, Hz: V of that wave, D the mean diameter."""
        return self.affine_velocity / self.diameter

    @cached_property
    def line(self) -> float:
        """`LINE` of the highest frequency, Hz, to three digits: an iteration bounds it."""
        top = LinearSystem.of(self.network).top
        return float(f"{LINE * np.sqrt(top) / (2 * np.pi):.3g}")

    @cached_property
    def moduli(self) -> ElasticModuli:
        """Elastic moduli by the springs' static response."""
        return self.case.read("moduli") or elastic_moduli(self.network)

    @cached_property
    def of_one_sample(self) -> tuple[str, ...]:
        """What to know of every quantity of this one packing."""
        if self.crystal:
            return ()
        caveats = ["one sample: how samples differ is not in the error; measure further seeds"]
        if self.unsettled:
            caveats.append(f"not in equilibrium: {self.unsettled}")
        shares = crystalline_shares(self.network, profile(self.network))
        share = shares.get("crystalline_share_of_bulk", shares.get("crystalline_share", 0.0))
        if share > CRYSTALLINE:
            caveats.append(f"crystalline: {100 * share:.0f} % of the bulk; no random packing")
        return tuple(caveats)

    @cached_property
    def of_waves(self) -> tuple[str, ...]:
        """The same of what is read from waves, which a narrow packing guides."""
        if self.crystal or self.width >= NARROW:
            return self.of_one_sample
        text = f"narrow: {self.width:.1f} D wide; waves longer than that feel their images"
        return (*self.of_one_sample, text)
