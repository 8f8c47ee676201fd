"""The contacts of a packing and their tangent: how their forces answer small motions.

A contact's motion p = (w, theta_i, theta_j) has nine parts: w = u_j - u_i of the centres, m, or of
a wall its own motion less u_i, and the two rotations, rad. With n from i to j, l_i and l_j from the
centres to the contact point, and N, t the normal and tangential force on i that it carries already,

    slip     d  = w - theta_i x l_i + theta_j x l_j         springs  kn n n^T + kt (1 - n n^T)
    normal   dn = (w - n (n.w)) / |centre to centre|        0 at a wall, whose normal is fixed
    overlap  a  = -n.w
    twist    s  = n.(theta_i + theta_j) / 2,

the force on i changes by the terms that are asked for, each by its name:

    springs         k d                                      (Otsubo et al. 2017, section 3)
    normal force    - N dn                                   through both centres: no torque
    shear force     - n (t.dn)                               torque - arm t x dn - n x t a / 2
    twist           + s n x t                                torque - arm s t; of YADE's law
    growing circle  + t a growth                             another law's: t ~ contact radius
    lever arms      another law's own arms of motion and torque, R less a share of the overlap
    rolling         a moment -(kr (1 - n n^T) + kw n n^T)(theta_i - theta_j) on i, and back on j

The torque on a body is its lever times that force; the lever keeps to the middle of the overlap.
Springs, rolling and normal force are symmetric. The other terms are not: the laws behind them are
path-dependent and have no energy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modal.packing.network import Network
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError

NORMAL, SHEAR, TWIST = "normal force", "shear force", "twist"
GROWTH, ARMS = "growing circle", "lever arms"
TANGENTS: dict[str, tuple[str, ...]] = {
    "none": (),
    "normal": (NORMAL,),
    "full": (NORMAL, SHEAR, TWIST),
    "law": (NORMAL, SHEAR, GROWTH, ARMS),
}
"""Terms beside the springs: none; symmetric; YADE's law; of imported packings, their own law."""
SYMMETRIC = ("none", "normal")
"""Those whose stiffness is symmetric."""
SLIDING = ("elastic", "slip")
"""Contacts at the friction limit have the springs of the others, or their normal springs alone."""


def terms_of(pre_stress: str) -> tuple[str, ...]:
    """The terms behind a choice of pre-stress; InputError where there is no such choice."""
    if pre_stress not in TANGENTS:
        raise InputError(f"pre-stress {pre_stress!r}: choose one of {', '.join(TANGENTS)}")
    return TANGENTS[pre_stress]


def cross_matrix(vector: Floats) -> Floats:
    """Shape (m, 3, 3): [a]x with [a]x b = a x b, for `vector` of shape (m, 3)."""
    matrix = np.zeros((len(vector), 3, 3))
    x, y, z = vector.T
    matrix[:, 0, 1], matrix[:, 0, 2], matrix[:, 1, 2] = -z, y, -x
    matrix[:, 1, 0], matrix[:, 2, 0], matrix[:, 2, 1] = z, -y, x
    return matrix


def along_and_across(normal: Floats, along: Floats, across: Floats) -> Floats:
    """Shape (m, 3, 3): `along` (m,) n n^T + `across` (m,) (1 - n n^T)."""
    matrix = (along - across)[:, None, None] * normal[:, :, None] * normal[:, None, :]
    matrix += across[:, None, None] * np.eye(3)
    return matrix


def _times(vector: Floats, form: Floats) -> Floats:
    """Shape (m, 3, 9): vectors (m, 3) times linear forms (m, 9)."""
    return vector[:, :, None] * form[:, None, :]


@dataclass(frozen=True)
class Carried:
    """What contacts carry already, each None where no term asks for it.

    normal (m,), N, compression positive; shear (m, 3), N, on i; growth (m,), 1/m, of the shear
    force per overlap; motion, torque (m,), m, by which another program's arms are longer than to
    the middle of the overlap; shortening (m,), which share of the overlap its torque arm lacks.
    """

    normal: Floats | None = None
    shear: Floats | None = None
    growth: Floats | None = None
    motion: Floats | None = None
    torque: Floats | None = None
    shortening: Floats | None = None

    @classmethod
    def of(cls, network: Network, terms: tuple[str, ...]) -> Carried:
        """What these terms need of a network; InputError where it does not know it."""
        if terms and network.inertia_tensor is not None:
            raise InputError(
                "pre-stress of bodies that are no spheres: carried forces turn with the spheres in "
                "contact, whose centres a network of bodies does not have; take 'none'"
            )
        law = GROWTH in terms or ARMS in terms
        purpose = "pre-stress 'law' (of imported packings; there is 'full')"
        if not law:
            purpose = f"pre-stress {'full' if SHEAR in terms else 'normal'!r} (there is 'none')"

        def asked(name: str, *by: str) -> Floats | None:
            return network.require(name, purpose) if set(by) & set(terms) else None

        carried = {"shortening": asked("torque_shortening", ARMS)}
        if ARMS in terms:
            overlap = network.require("overlap", purpose)
            for name in ("motion", "torque"):
                share = network.require(f"{name}_shortening", purpose)
                carried[name] = (0.5 - share) * overlap
        return cls(
            normal=asked("force_normal", NORMAL),
            shear=asked("force_tangential", SHEAR, GROWTH),
            growth=asked("shear_growth", GROWTH),
            **carried,
        )


@dataclass(frozen=True)
class Contacts:
    """The m contacts of a network with some of the `terms` above beside the springs."""

    network: Network
    terms: tuple[str, ...]
    carried: Carried

    @classmethod
    def of(cls, network: Network, terms: tuple[str, ...] = ()) -> Contacts:
        """Those of a network; InputError where it does not know what the terms need."""
        return cls(network, terms, Carried.of(network, terms))

    @property
    def pair(self) -> Bools:
        """Shape (m,) bool: contacts between two bodies."""
        return ~self.network.with_wall

    def springs(self) -> Floats:
        """Shape (m, 3, 3), N/m: kn n n^T + kt (1 - n n^T)."""
        network = self.network
        kn, kt = network.stiffness_normal, network.stiffness_tangential
        return along_and_across(network.normal, kn, kt)

    def slip(self, longer: Floats | None = None) -> Floats:
        """Shape (m, 3, 9): from a contact's motion to that of its two ends against each other.

        `longer` (m,), m, is added to both arms, along the normal.
        """
        arm_i, arm_j = self._arms(longer)
        eye = np.broadcast_to(np.eye(3), (len(arm_i), 3, 3))
        return np.concatenate([eye, cross_matrix(arm_i), -cross_matrix(arm_j)], axis=2)

    def _arms(self, longer: Floats | None) -> tuple[Floats, Floats]:
        """Both arms (m, 3), m, made longer along the normal; the one to a wall stays zero."""
        more = 0.0 if longer is None else longer[:, None] * self.network.normal
        pair = self.pair[:, None]
        return self.network.lever_i + more, np.where(pair, self.network.lever_j - more, 0.0)

    def motion(self, u: Floats) -> Floats:
        """Shape (m, 9): that of the contacts for motions u (n, 6) of the bodies; walls at rest."""
        i, j, pair = self.network.particle_i, self.network.partner, self.pair[:, None]
        return np.hstack([u[j, :3] * pair - u[i, :3], u[i, 3:], u[j, 3:] * pair])

    def tangent(self) -> Floats:
        """Shape (m, 9, 9), N/m, N, N m: minus the forces per motion (w, theta_i, theta_j).

        Its rows are minus the force on j, which is the force on i, and minus the torques on i and
        on j. At a wall theta_j is the wall's own turn, whose shift of the contact is part of w.
        """
        n, carried, m = self.network.normal, self.carried, self.network.n_contacts
        motion = np.zeros((m, 3, 9))
        motion[:, :, :3] = np.eye(3)
        across = np.eye(3) - n[:, :, None] * n[:, None, :]
        dn = across @ motion / centre_distance(self.network)[:, None, None]
        deeper = np.zeros((m, 9))
        deeper[:, :3] = -n
        force = self.springs() @ self.slip(carried.motion)
        if carried.growth is not None and carried.shear is not None:
            force += _times(carried.shear * carried.growth[:, None], deeper)
        arms = self._arms(carried.torque)
        K = np.zeros((m, 9, 9))
        for at, arm, way in ((3, arms[0], -1.0), (6, arms[1], 1.0)):
            K[:, at : at + 3] = way * cross_matrix(arm) @ force
        if SHEAR in self.terms and carried.shear is not None:
            t, pair = carried.shear, self.pair
            twist = np.zeros((m, 9))
            if TWIST in self.terms:
                twist[:, 3:6] = twist[:, 6:9] = n / 2
            shortening = 0.5 if carried.shortening is None else carried.shortening[:, None]
            common = _times(np.cross(n, t) * shortening, deeper)
            turning = cross_matrix(t) @ dn + _times(t, twist)
            for at, arm, there in ((3, arms[0], np.ones(m)), (6, -arms[1], 1.0 * pair)):
                reach = np.einsum("ci,ci->c", n, arm)[:, None, None]
                K[:, at : at + 3] += reach * turning + there[:, None, None] * common
            force -= _times(n, np.einsum("ci,cij->cj", t, dn))
            force += _times(np.cross(n, t), twist)
        if carried.normal is not None:
            force -= carried.normal[:, None, None] * dn
        K[:, :3] = force
        self._add_rolling(K)
        return K

    def _add_rolling(self, K: Floats) -> None:
        """Add the moments between bodies that turn against each other to tangents (m, 9, 9)."""
        kr, kw = self.network.stiffness_rolling, self.network.stiffness_twisting
        if kr is None or kw is None:
            return
        resists = along_and_across(self.network.normal, kw, kr)
        for a in (3, 6):
            for b in (3, 6):
                K[:, a : a + 3, b : b + 3] += resists if a == b else -resists


def centre_distance(network: Network) -> Floats:
    """Shape (m,), m: between the centres of a contact; infinite at a wall (its normal is fixed)."""
    distance = np.linalg.norm(network.branch, axis=1)
    return np.where(network.with_wall, np.inf, distance)


def with_sliding(network: Network, sliding: str) -> Network:
    """The network with contacts at the friction limit as one of `SLIDING` holds them."""
    if sliding not in SLIDING:
        raise InputError(f"sliding {sliding!r}: choose one of {', '.join(SLIDING)}")
    return (
        network if sliding == "elastic" else network.cached("slipping", lambda: _slipping(network))
    )


def _slipping(network: Network) -> Network:
    sliding = network.require("sliding", "knowing which contacts slip")
    tangential = np.where(sliding, 0.0, network.stiffness_tangential)
    return replace(network, stiffness_tangential=tangential)
