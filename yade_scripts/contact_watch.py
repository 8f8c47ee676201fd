"""Which contacts open or slip while a wave passes, and what slip dissipates.

YADE's law keeps two shear displacements of a contact, both in the present frame: all of it, and the
elastic part, which slip shortens. Their difference is the slip, and stays exactly zero where there
was none. What slip takes from the wave is the shear force times the increment of the slip. The
law's own count, the force times all shear displacement of a sliding step, misses the slip of a
contact that merely loses normal force, which is of first order in the wave.
"""

from yade import O

SHOWN = 12
"""Depths that the report names."""


class ContactWatch:
    """Collects contacts that have opened or slipped, where they are, and the energy of the slip.

    `reach` (m) is the largest displacement of the wave: contacts that slip or open when their ends
    move by as much are followed at every step, all others are looked at by `look` alone.
    `dissipated` is the energy of the slip so far, J, by the trapezoidal rule between steps.
    """

    def __init__(self, reach):
        self.depth, self.opened, self.slid = {}, set(), set()
        self.dissipated = 0.0
        self._followed, self._last = {}, {}
        for key, contact in self._now():
            self.depth[key] = contact.geom.contactPoint[2]
            phys = contact.phys
            # A state from a file has shear forces, but no displacement that they belong to.
            phys.usElastic = phys.usTotal = phys.shearForce / phys.ks
            least = phys.tangensOfFrictionAngle * (phys.normalForce.norm() - phys.kn * reach)
            if phys.shearForce.norm() + phys.ks * reach >= least:
                self._followed[key] = contact

    @staticmethod
    def _now():
        """(Bodies, contact) of each present contact, of which YADE has one a pair."""
        for contact in O.interactions.all(onlyReal=True):
            yield (contact.id1, contact.id2), contact

    def follow(self):
        """Add what has slipped since the last step, of the contacts that may."""
        before, self._last = self._last, {}
        for key, contact in self._followed.items():
            if not contact.isReal:
                continue
            phys = contact.phys
            elastic, total = phys.usElastic, phys.usTotal
            if elastic == total:
                continue
            slip, force = total - elastic, phys.shearForce
            old_slip, old_force, _ = before.get(key, (0 * slip, force, 0))
            self.dissipated += 0.5 * (slip - old_slip).dot(force + old_force)
            self._last[key] = slip, force, 0.5 * elastic.dot(force)
        self.slid |= self._last.keys()
        # A contact opens without shear force: what it had stored in shear has slipped away.
        self.dissipated += sum(before[key][2] for key in before.keys() - self._last.keys())

    def look(self):
        """Compare all present contacts with those of the start; new ones are followed from now."""
        present = set()
        for key, contact in self._now():
            present.add(key)
            if key not in self._followed and (
                key not in self.depth or contact.phys.usElastic != contact.phys.usTotal
            ):
                self._followed[key] = contact
        self.opened |= self.depth.keys() - present
        for key in self._followed.keys() - present:
            del self._followed[key]

    def report(self):
        """One line: how many of how many, and at which depths, m."""
        parts = []
        for name, keys in (("opened", self.opened), ("slid", self.slid)):
            depths = sorted(1e3 * self.depth[key] for key in keys if key in self.depth)
            shown = ", ".join(f"{z:.1f}" for z in depths[:SHOWN])
            where = f" at z = {shown} mm" if depths else ""
            parts.append(f"{len(keys)} {name}{where}")
        return f"of {len(self.depth)} contacts " + "; ".join(parts)
