"""The laws of a packing's contacts: which are different, which one each follows, what it makes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from modal.exchange.law import DISPLACEMENT, MIDDLE, ONE_SIDED, ProgramLaw
from modal.exchange.particles_and_contacts import Contacts, LawOf, Spheres
from modal.tools.arrays import Bools, Floats, Ints

AT_LIMIT = 1e-6
"""Relative: a shear force so near to friction times normal force slides."""


@dataclass(frozen=True)
class Laws:
    """The different laws, none of a table with stiffnesses; `of_each` (m,) is that of a contact."""

    kinds: list[ProgramLaw]
    of_each: Ints

    @classmethod
    def of(cls, contacts: Contacts, spheres: Spheres, law_of: LawOf | None) -> Laws:
        """What `law_of` says of the kinds of spheres that touch each other and walls."""
        if law_of is None:
            return cls([], np.zeros(len(contacts.i), int))
        kind, j = spheres.kind, contacts.j
        ends = np.sort(np.column_stack([kind[contacts.i], np.where(j < 0, j, kind[j])]), axis=1)
        kinds, law = np.unique(ends, axis=0, return_inverse=True)
        return cls([law_of(int(a), int(b)) for a, b in kinds], law.reshape(-1))

    def each(
        self,
        what: Callable[[ProgramLaw, Floats, Floats], Floats | tuple[Floats, Floats]],
        values: Floats,
        effective: Floats,
    ) -> Any:
        """Shape (1, m) or (2, m): what each contact's own law makes of its value."""
        rows = [self.of_each == number for number in range(len(self.kinds))]
        parts = [
            np.atleast_2d(what(law, values[own], effective[own]))
            for law, own in zip(self.kinds, rows, strict=True)
        ]
        result = np.empty((len(parts[0]), len(values)))
        for own, part in zip(rows, parts, strict=True):
            result[:, own] = part
        return result

    def sliding(self, force: Floats | None, shear: Floats | None) -> Bools | None:
        """Shape (m,): contacts at their limit; without friction there is no spring to slip."""
        if shear is None or force is None or not self.kinds:
            return None
        limit = np.array([law.friction for law in self.kinds])[self.of_each] * force
        slides: Bools = np.linalg.norm(shear, axis=1) >= limit * (1 - AT_LIMIT)
        return slides & (limit > 0)

    def columns(self, overlap: Floats) -> dict[str, Any]:
        """What they do otherwise than springs, as a network tells it of each contact (m,)."""
        if not self.kinds:
            return {}

        def per_contact(values: list[float]) -> Floats:
            return np.array(values)[self.of_each]

        kept = (DISPLACEMENT, ONE_SIDED)
        grows = per_contact([float(law.grows and law.keeps in kept) for law in self.kinds])
        return {
            "shear_growth": np.where(grows > 0, 0.5 / overlap, 0.0),
            "motion_shortening": per_contact([0.5 * (law.moves == MIDDLE) for law in self.kinds]),
            "torque_shortening": per_contact([0.5 * (law.turns == MIDDLE) for law in self.kinds]),
        }

    def notes(self) -> dict[str, Any]:
        """The friction, where all contacts have the same."""
        frictions = {law.friction for law in self.kinds}
        return {"mu_wave": float(frictions.pop())} if len(frictions) == 1 else {}
