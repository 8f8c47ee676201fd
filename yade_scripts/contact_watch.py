"""Watch contacts open or slip while a wave passes, and compute the energy of the slip.

YADE's law stores two shear displacements of a contact, both in the present frame: the total, and
the elastic part, which slip shortens. Their difference is the slip, exactly zero for a contact that
never slipped. Slip dissipates the shear force multiplied by the increment of the slip. The law's
own sum, the force multiplied by the total shear displacement of a sliding step, omits the slip of a
contact that only loses normal force, which is of first order in the wave.
"""

from typing import NamedTuple

from yade import O

MAX_SHOWN_DEPTHS = 12
"""Depths that the report names, so that it stays one line."""


class SlipState(NamedTuple):
    """Slip of a contact after a step, m, with its shear force, N, and its stored energy, J."""

    slip: object
    force: object
    stored_energy: float


class ContactWatch:
    """Record of the contacts that have opened or slipped, and of the energy of the slip.

    Contacts that slip or open when their ends move by the largest displacement of the wave are
    followed at every step; all others are only examined by `check_all`.

    Parameters
    ----------
    reach : float
        Largest displacement of the wave, m.

    Attributes
    ----------
    depth : dict
        z of each contact at the start, m, by the ids of its bodies.
    opened, slid : set
        Contacts that have opened, and that have slipped.
    dissipated : float
        Energy of the slip so far, J, by the trapezoidal rule between steps.
    """

    def __init__(self, reach):
        self.depth = {}
        self.opened = set()
        self.slid = set()
        self.dissipated = 0.0
        self._followed = {}
        self._last_slips = {}
        for key, contact in self._present_contacts():
            self.depth[key] = contact.geom.contactPoint[2]
            phys = contact.phys
            # A state from a file has shear forces, but no displacement that they belong to.
            phys.usElastic = phys.usTotal = phys.shearForce / phys.ks
            least_force = phys.normalForce.norm() - phys.kn * reach
            least_limit = phys.tangensOfFrictionAngle * least_force
            if phys.shearForce.norm() + phys.ks * reach >= least_limit:
                self._followed[key] = contact

    @staticmethod
    def _present_contacts():
        """Yield the ids of both bodies and the contact; YADE has one contact for each pair."""
        for contact in O.interactions.all(onlyReal=True):
            yield (contact.id1, contact.id2), contact

    def follow(self):
        """Add the slip of the last step, and its energy, for the contacts that may slip."""
        before = self._last_slips
        self._last_slips = {}
        for key, contact in self._followed.items():
            if not contact.isReal:
                continue
            phys = contact.phys
            elastic = phys.usElastic
            if elastic == phys.usTotal:
                continue
            slip = phys.usTotal - elastic
            force = phys.shearForce
            slip_before = 0 * slip
            force_before = force
            if key in before:
                slip_before, force_before, _ = before[key]
            self.dissipated += 0.5 * (slip - slip_before).dot(force + force_before)
            self._last_slips[key] = SlipState(slip, force, 0.5 * elastic.dot(force))
        self.slid |= self._last_slips.keys()
        # A contact opens without shear force: what it had stored in shear has slipped away.
        ended = before.keys() - self._last_slips.keys()
        self.dissipated += sum(before[key].stored_energy for key in ended)

    def check_all(self):
        """Compare all present contacts with those of the start, and follow new and slipped ones."""
        present = set()
        for key, contact in self._present_contacts():
            present.add(key)
            if key in self._followed:
                continue
            has_slipped = contact.phys.usElastic != contact.phys.usTotal
            if key not in self.depth or has_slipped:
                self._followed[key] = contact
        self.opened |= self.depth.keys() - present
        for key in self._followed.keys() - present:
            del self._followed[key]

    def report(self):
        """Return a line with the numbers of contacts that opened and slid, and their depths."""
        opened = self._describe("opened", self.opened)
        slid = self._describe("slid", self.slid)
        return f"of {len(self.depth)} contacts {opened}; {slid}"

    def _describe(self, verb, keys):
        """Return the number of contacts in `keys` as text, with the depths of the first, mm."""
        text = f"{len(keys)} {verb}"
        depths = sorted(1e3 * self.depth[key] for key in keys if key in self.depth)
        if depths:
            shown = ", ".join(f"{z:.1f}" for z in depths[:MAX_SHOWN_DEPTHS])
            text += f" at z = {shown} mm"
        return text
