"""Which contacts open or slip while a wave passes: what makes a packing's wave non-linear."""

from yade import O

AT_LIMIT = 1 - 1e-9
"""Shear force over its Coulomb limit from which a contact counts as slipping."""
SHOWN = 12
"""Depths that the report names."""


class ContactWatch:
    """Collects contacts that have opened or slipped at any look, and where they are."""

    def __init__(self):
        self.depth = dict(self._now())
        self.opened, self.slid = set(), set()

    @staticmethod
    def _now():
        """(bodies and period, z of the contact point) of each present contact."""
        for contact in O.interactions:
            if contact.isReal:
                key = (contact.id1, contact.id2, tuple(contact.cellDist))
                yield key, contact.geom.contactPoint[2]

    def look(self):
        """Compare the present contacts with those at the start."""
        present = set()
        for contact in O.interactions:
            if not contact.isReal:
                continue
            key, phys = (contact.id1, contact.id2, tuple(contact.cellDist)), contact.phys
            present.add(key)
            limit = phys.tangensOfFrictionAngle * phys.normalForce.norm()
            if phys.shearForce.norm() >= AT_LIMIT * limit:
                self.slid.add(key)
        self.opened |= self.depth.keys() - present

    def report(self):
        """One line: how many of how many, and at which depths, m."""
        parts = []
        for name, keys in (("opened", self.opened), ("slid", self.slid)):
            depths = sorted(1e3 * self.depth[key] for key in keys if key in self.depth)
            shown = ", ".join(f"{z:.1f}" for z in depths[:SHOWN])
            where = f" at z = {shown} mm" if depths else ""
            parts.append(f"{len(keys)} {name}{where}")
        return f"of {len(self.depth)} contacts " + "; ".join(parts)
