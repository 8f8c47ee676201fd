"""Compute the tangent of the contacts of a packing: how forces change under small motions.

The motion of a contact p = (w, theta_i, theta_j) has nine components: w = u_j - u_i, m, with the
displacements u of the two centres, and the two rotations, rad. At a wall w is the displacement of
the wall minus u_i. With n from i to j, l_i and l_j from the centres to the contact point, and the
normal force N and tangential force t on i that the contact already carries, define

    slip     d  = w - theta_i x l_i + theta_j x l_j         springs  kn n n^T + kt (1 - n n^T)
    normal   dn = (w - n (n.w)) / |centre to centre|        0 at a wall, whose normal is fixed
    overlap  a  = -n.w
    twist    s  = n.(theta_i + theta_j) / 2,

Then the force on i changes by the terms that the choice of pre-stress selects:

    springs         k d                                      (Otsubo et al. 2017, section 3)
    normal force    - N dn                                   through both centres: no torque
    shear force     - n (t.dn)                               torque - arm t x dn - n x t a / 2
    twist           + s n x t                                torque - arm s t; in YADE's law
    growing circle  + t a growth                             other laws, in which t ~ contact radius
    moment          with the twist alone: a carried moment M on i changes by
                    (n x dn) x M + s n x M, that on j by its opposite
    lever arms      other laws, whose arms of motion and torque are R minus a share of the overlap
    rolling         a moment -(kr (1 - n n^T) + kw n n^T)(theta_i - theta_j) on i, its opposite on j

The torque on a body is its lever times the force; the lever ends in the middle of the overlap.
Springs, rolling and normal force are symmetric. The other terms are not: the laws behind them are
path-dependent and have no energy.
"""

from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from modal.packing.network import Network
from modal.tools.arrays import Floats
from modal.tools.errors import InputError, refuse_unknown

PreStress = Literal["none", "normal", "full", "law"]
"""Terms that the contact forces add to the stiffness: "none"; "normal", the symmetric term; "full",
those of YADE's law; "law", those of the law of an imported packing."""
Sliding = Literal["elastic", "slip"]
"""Springs of contacts at the friction limit: as for other contacts ("elastic"), or the normal ones
alone ("slip")."""
NORMAL = "normal force"
SHEAR = "shear force"
TWIST = "twist"
GROWTH = "growing circle"
ARMS = "lever arms"
TANGENTS: dict[PreStress, tuple[str, ...]] = {
    "none": (),
    "normal": (NORMAL,),
    "full": (NORMAL, SHEAR, TWIST),
    "law": (NORMAL, SHEAR, GROWTH, ARMS),
}
"""The terms beside the springs, by the choice of pre-stress."""
NEEDS = {
    NORMAL: ("force_normal",),
    SHEAR: ("force_tangential",),
    GROWTH: ("force_tangential", "shear_growth"),
    ARMS: ("overlap", "motion_shortening", "torque_shortening"),
}
"""Columns of a network that a term needs."""
SYMMETRIC: tuple[PreStress, ...] = ("none", "normal")
"""Choices of pre-stress for which the stiffness is symmetric."""
SLIDING: tuple[Sliding, ...] = get_args(Sliding)
"""All choices of `Sliding`."""


def terms_of(pre_stress: PreStress) -> tuple[str, ...]:
    """Return the terms of a choice of pre-stress; raise InputError if it is unknown."""
    refuse_unknown("pre-stress", pre_stress, TANGENTS)
    return TANGENTS[pre_stress]


def cross_matrix(vector: Floats) -> Floats:
    """Return [a]x with [a]x b = a x b for vectors a (m, 3), shape (m, 3, 3)."""
    x, y, z = vector.T
    matrix = np.zeros((len(vector), 3, 3))
    matrix[:, 0, 1] = -z
    matrix[:, 0, 2] = y
    matrix[:, 1, 0] = z
    matrix[:, 1, 2] = -x
    matrix[:, 2, 0] = -y
    matrix[:, 2, 1] = x
    return matrix


def along_and_across(normal: Floats, along: Floats, across: Floats) -> Floats:
    """Return the tensors (m, 3, 3) `along` (m,) n n^T + `across` (m,) (1 - n n^T) of normals n."""
    matrix = (along - across)[:, None, None] * normal[:, :, None] * normal[:, None, :]
    matrix += across[:, None, None] * np.eye(3)
    return matrix


def carried(network: Network, terms: tuple[str, ...]) -> dict[str, Floats]:
    """Return the columns (m, ...) of a network that the `terms` of a pre-stress need, by name.

    Raises InputError if the network lacks a column, or if its bodies are not spheres.
    """
    if terms and network.inertia_tensor is not None:
        raise InputError(
            "pre_stress_of_bodies",
            "pre-stress of bodies that are no spheres",
            "carried forces turn with the spheres in contact, whose centres a network of bodies "
            "does not have",
            "take 'none'",
        )
    purpose = "pre-stress 'normal' (there is 'none')"
    if SHEAR in terms:
        purpose = "pre-stress 'full' (there is 'none')"
    if GROWTH in terms or ARMS in terms:
        purpose = "pre-stress 'law' (of imported packings; there is 'full')"
    columns = {}
    for term in terms:
        for name in NEEDS.get(term, ()):
            columns[name] = network.require(name, purpose)
    return columns


def springs(network: Network) -> Floats:
    """Return the springs kn n n^T + kt (1 - n n^T) of each contact, shape (m, 3, 3), N/m."""
    kn = network.stiffness_normal
    kt = network.stiffness_tangential
    return along_and_across(network.normal, kn, kt)


def slip(network: Network, extension: Floats | float = 0.0) -> Floats:
    """Return the matrices (m, 3, 9) from the motion of a contact to the slip of its two ends.

    Both arms are longer by `extension` (m,), m, along the normal.
    """
    arm_i, arm_j = _arms(network, extension)
    eye = np.broadcast_to(np.eye(3), (len(arm_i), 3, 3))
    return np.concatenate([eye, cross_matrix(arm_i), -cross_matrix(arm_j)], axis=2)


def motion_of_contacts(network: Network, u: Floats) -> Floats:
    """Return the motion (m, 9) of contacts for motions u (n, 6) of the bodies; walls stay put."""
    is_pair = ~network.with_wall[:, None]
    u_i = u[network.particle_i]
    u_j = u[network.partner] * is_pair
    return np.hstack([u_j[:, :3] - u_i[:, :3], u_i[:, 3:], u_j[:, 3:]])


def contact_tangent(network: Network, terms: tuple[str, ...] = ()) -> Floats:
    """Return the tangent (m, 9, 9) of the springs and of the `terms`; N/m, N, N m.

    The module lists the terms. Each row is a change per unit of motion (w, theta_i, theta_j): first
    of the force on i, then of minus the torque on i and of minus the torque on j. At a wall theta_j
    is the rotation of the wall; the displacement that it causes at the contact is part of w. Raises
    InputError if the network lacks a column that the terms need.
    """
    columns = carried(network, terms)
    normal = network.normal
    motion_extension: Floats | float = 0.0
    torque_extension: Floats | float = 0.0
    if ARMS in terms:
        # The levers of this project end in the middle of the overlap.
        motion_extension = (0.5 - columns["motion_shortening"]) * columns["overlap"]
        torque_extension = (0.5 - columns["torque_shortening"]) * columns["overlap"]
    normal_change = np.zeros((network.n_contacts, 3, 9))
    normal_change[:, :, :3] = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    normal_change /= centre_distance(network)[:, None, None]
    overlap_change = np.zeros((network.n_contacts, 9))
    overlap_change[:, :3] = -normal
    force = springs(network) @ slip(network, motion_extension)
    if GROWTH in terms:
        shear_growth = columns["force_tangential"] * columns["shear_growth"][:, None]
        force += _outer(shear_growth, overlap_change)
    arm_i, arm_j = _arms(network, torque_extension)
    K = np.zeros((network.n_contacts, 9, 9))
    K[:, 3:6] = -cross_matrix(arm_i) @ force
    K[:, 6:9] = cross_matrix(arm_j) @ force
    if SHEAR in terms:
        shear_force = columns["force_tangential"]
        twist = np.zeros((network.n_contacts, 9))
        if TWIST in terms:
            twist[:, 3:6] = normal / 2
            twist[:, 6:9] = normal / 2
        share: Floats | float = 0.5
        if ARMS in terms:
            share = columns["torque_shortening"][:, None]
        shortening = _outer(np.cross(normal, shear_force) * share, overlap_change)
        turning = cross_matrix(shear_force) @ normal_change + _outer(shear_force, twist)
        reach_i = np.einsum("ci,ci->c", normal, arm_i)[:, None, None]
        reach_j = np.einsum("ci,ci->c", normal, -arm_j)[:, None, None]
        is_pair = ~network.with_wall[:, None, None]
        K[:, 3:6] += reach_i * turning + shortening
        K[:, 6:9] += reach_j * turning + is_pair * shortening
        if TWIST in terms and network.moment is not None:
            moment_change = _turned_moment(network.moment, normal, normal_change, twist)
            K[:, 3:6] -= moment_change
            K[:, 6:9] += moment_change
        force -= _outer(normal, np.einsum("ci,cij->cj", shear_force, normal_change))
        force += _outer(np.cross(normal, shear_force), twist)
    if NORMAL in terms:
        force -= columns["force_normal"][:, None, None] * normal_change
    K[:, :3] = force
    kr = network.stiffness_rolling
    kw = network.stiffness_twisting
    if kr is not None and kw is not None:
        resistance = along_and_across(normal, kw, kr)
        K[:, 3:6, 3:6] += resistance
        K[:, 3:6, 6:9] -= resistance
        K[:, 6:9, 3:6] -= resistance
        K[:, 6:9, 6:9] += resistance
    return K


def _turned_moment(moment: Floats, normal: Floats, normal_change: Floats, twist: Floats) -> Floats:
    """Return the change (m, 3, 9), N m, of carried moments that turn with their contacts."""
    # (n x dn) x M = dn (n.M) - n (dn.M)
    along = np.einsum("ci,ci->c", normal, moment)[:, None, None]
    turned = along * normal_change
    turned -= _outer(normal, np.einsum("ci,cij->cj", moment, normal_change))
    return turned + _outer(np.cross(normal, moment), twist)


def _arms(network: Network, extension: Floats | float) -> tuple[Floats, Floats]:
    """Return both arms (m, 3), m, longer by `extension` along the normal; zero at the wall."""
    longer = np.asarray(extension)[..., None] * network.normal
    is_pair = ~network.with_wall[:, None]
    return network.lever_i + longer, np.where(is_pair, network.lever_j - longer, 0.0)


def _outer(vector: Floats, form: Floats) -> Floats:
    """Return the products (m, 3, 9) of vectors (m, 3) with linear forms (m, 9)."""
    return vector[:, :, None] * form[:, None, :]


def centre_distance(network: Network) -> Floats:
    """Return the distance (m,), m, of the centres; infinite at a wall, whose normal is fixed."""
    distance = np.linalg.norm(network.branch, axis=1)
    return np.where(network.with_wall, np.inf, distance)


def with_sliding(network: Network, sliding: Sliding) -> Network:
    """Return the network with the springs of `sliding` for contacts at the friction limit.

    Raises InputError if the choice is unknown, or if the network does not contain which contacts
    slip.
    """
    refuse_unknown("sliding", sliding, SLIDING)
    if sliding == "elastic":
        return network

    def compute_slipping() -> Network:
        at_limit = network.require("sliding", "knowing which contacts slip")
        tangential = np.where(at_limit, 0.0, network.stiffness_tangential)
        return replace(network, stiffness_tangential=tangential)

    return network.cached("slipping", compute_slipping)
