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

from dataclasses import replace
from itertools import product

import numpy as np

from modal.packing.network import Network
from modal.tools.arrays import Floats
from modal.tools.errors import InputError, refuse_unknown

NORMAL, SHEAR, TWIST = "normal force", "shear force", "twist"
GROWTH, ARMS = "growing circle", "lever arms"
TANGENTS: dict[str, tuple[str, ...]] = {
    "none": (),
    "normal": (NORMAL,),
    "full": (NORMAL, SHEAR, TWIST),
    "law": (NORMAL, SHEAR, GROWTH, ARMS),
}
"""Terms beside the springs: none; symmetric; YADE's law; of imported packings, their own law."""
NEEDS = {
    NORMAL: ("force_normal",),
    SHEAR: ("force_tangential",),
    GROWTH: ("force_tangential", "shear_growth"),
    ARMS: ("overlap", "motion_shortening", "torque_shortening"),
}
"""Columns of a network that a term needs."""
SYMMETRIC = ("none", "normal")
"""Those whose stiffness is symmetric."""
SLIDING = ("elastic", "slip")
"""Contacts at the friction limit have the springs of the others, or their normal springs alone."""


def terms_of(pre_stress: str) -> tuple[str, ...]:
    """The terms behind a choice of pre-stress; InputError where there is no such choice."""
    refuse_unknown("pre-stress", pre_stress, TANGENTS)
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


def carried(network: Network, terms: tuple[str, ...]) -> dict[str, Floats]:
    """What the terms need of a network, by column; InputError where it does not know it."""
    if terms and network.inertia_tensor is not None:
        raise InputError(
            "input",
            "pre-stress of bodies that are no spheres",
            "carried forces turn with the spheres in "
            "contact, whose centres a network of bodies does not have",
            "take 'none'",
        )
    purpose = f"pre-stress {'full' if SHEAR in terms else 'normal'!r} (there is 'none')"
    if GROWTH in terms or ARMS in terms:
        purpose = "pre-stress 'law' (of imported packings; there is 'full')"
    needs = (name for term in terms for name in NEEDS.get(term, ()))
    return {name: network.require(name, purpose) for name in needs}


def springs(network: Network) -> Floats:
    """Shape (m, 3, 3), N/m: kn n n^T + kt (1 - n n^T)."""
    kn, kt = network.stiffness_normal, network.stiffness_tangential
    return along_and_across(network.normal, kn, kt)


def slip(network: Network, longer: Floats | float = 0.0) -> Floats:
    """Shape (m, 3, 9): from a contact's motion to that of its two ends against each other.

    `longer` (m,), m, is added to both arms, along the normal.
    """
    arm_i, arm_j = _arms(network, longer)
    eye = np.broadcast_to(np.eye(3), (len(arm_i), 3, 3))
    return np.concatenate([eye, cross_matrix(arm_i), -cross_matrix(arm_j)], axis=2)


def _arms(network: Network, longer: Floats | float) -> tuple[Floats, Floats]:
    """Both arms (m, 3), m, made longer along the normal; the one to a wall stays zero."""
    more, pair = np.asarray(longer)[..., None] * network.normal, ~network.with_wall[:, None]
    return network.lever_i + more, np.where(pair, network.lever_j - more, 0.0)


def motion_of_contacts(network: Network, u: Floats) -> Floats:
    """Shape (m, 9): that of the contacts for motions u (n, 6) of the bodies; walls at rest."""
    i, j, pair = network.particle_i, network.partner, ~network.with_wall[:, None]
    return np.hstack([u[j, :3] * pair - u[i, :3], u[i, 3:], u[j, 3:] * pair])


def contact_tangent(network: Network, terms: tuple[str, ...] = ()) -> Floats:
    """Shape (m, 9, 9), N/m, N, N m: minus the forces per motion (w, theta_i, theta_j).

    Of the springs and of the `terms` above. Its rows are minus the force on j, which is the force
    on i, and minus the torques on i and on j. At a wall theta_j is the wall's own turn, whose shift
    of the contact is part of w. InputError where the network does not know what the terms need.
    """
    known, n, m = carried(network, terms), network.normal, network.n_contacts
    # By how much another program's arms are longer than to the middle of the overlap.
    moving, turned = (
        (0.5 - known[f"{arm}_shortening"]) * known["overlap"] if ARMS in terms else 0.0
        for arm in ("motion", "torque")
    )
    dn, deeper = np.zeros((m, 3, 9)), np.zeros((m, 9))
    dn[:, :, :3] = np.eye(3) - n[:, :, None] * n[:, None, :]
    dn /= centre_distance(network)[:, None, None]
    deeper[:, :3] = -n
    force = springs(network) @ slip(network, moving)
    if GROWTH in terms:
        force += _times(known["force_tangential"] * known["shear_growth"][:, None], deeper)
    arms, K = _arms(network, turned), np.zeros((m, 9, 9))
    for at, arm, way in ((3, arms[0], -1.0), (6, arms[1], 1.0)):
        K[:, at : at + 3] = way * cross_matrix(arm) @ force
    if SHEAR in terms:
        t, pair, twist = known["force_tangential"], ~network.with_wall, np.zeros((m, 9))
        if TWIST in terms:
            twist[:, 3:6] = twist[:, 6:9] = n / 2
        shortening = known["torque_shortening"][:, None] if ARMS in terms else 0.5
        common = _times(np.cross(n, t) * shortening, deeper)
        turning = cross_matrix(t) @ dn + _times(t, twist)
        for at, arm, there in ((3, arms[0], np.ones(m)), (6, -arms[1], 1.0 * pair)):
            reach = np.einsum("ci,ci->c", n, arm)[:, None, None]
            K[:, at : at + 3] += reach * turning + there[:, None, None] * common
        force -= _times(n, np.einsum("ci,cij->cj", t, dn))
        force += _times(np.cross(n, t), twist)
    if NORMAL in terms:
        force -= known["force_normal"][:, None, None] * dn
    K[:, :3] = force
    kr, kw = network.stiffness_rolling, network.stiffness_twisting
    if kr is not None and kw is not None:
        resists = along_and_across(n, kw, kr)
        for a, b in product((3, 6), repeat=2):
            K[:, a : a + 3, b : b + 3] += resists if a == b else -resists
    return K


def centre_distance(network: Network) -> Floats:
    """Shape (m,), m: between the centres of a contact; infinite at a wall (its normal is fixed)."""
    distance = np.linalg.norm(network.branch, axis=1)
    return np.where(network.with_wall, np.inf, distance)


def with_sliding(network: Network, sliding: str) -> Network:
    """The network with contacts at the friction limit as one of `SLIDING` holds them."""
    refuse_unknown("sliding", sliding, SLIDING)
    if sliding == "elastic":
        return network

    def slipping() -> Network:
        at_limit = network.require("sliding", "knowing which contacts slip")
        tangential = np.where(at_limit, 0.0, network.stiffness_tangential)
        return replace(network, stiffness_tangential=tangential)

    return network.cached("slipping", slipping)
