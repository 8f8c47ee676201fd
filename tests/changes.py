"""Changes of a packing: other units, another numbering or direction, fewer or other columns."""

from dataclasses import replace

import numpy as np

from modal.packing.columns import COLUMNS
from modal.packing.network import SOURCE_WALL, Network
from modal.packing.sample import Sample
from modal.system.contacts import with_sliding


def in_units(network: Network, length: float, mass: float, time: float) -> Network:
    """Return a packing in other units, and without notes, whose units are not recorded."""
    stiffness = mass / time**2
    units = {"m": length, "kg": mass, "kg m^2": mass * length**2}
    units |= {"N/m": stiffness, "N": stiffness * length}
    converted = {}
    for name, column in COLUMNS.items():
        data = getattr(network, name)
        if column.unit in units and data is not None:
            converted[name] = units[column.unit] * data
    return replace(network, study={}, **converted)


def bonded(network: Network) -> Network:
    """Return a packing with rolling and twisting springs, and with tensors of inertia."""
    rng = np.random.default_rng(2)
    axes = np.linalg.qr(rng.standard_normal((network.n_particles, 3, 3)))[0]
    moments = network.inertia[:, None, None] * np.diag([0.8, 1.0, 1.2])
    reach = network.radius.mean() ** 2 * network.stiffness_normal
    return replace(
        network,
        stiffness_rolling=rng.uniform(0, 0.1, network.n_contacts) * reach,
        stiffness_twisting=rng.uniform(0, 0.1, network.n_contacts) * reach,
        inertia_tensor=axes @ moments @ axes.transpose(0, 2, 1),
    )


def levers_of_radii(network: Network) -> Network:
    """Return a packing with levers as long as the radii, and up to the plane of a wall.

    Some programs have such levers.
    """
    pair = ~network.with_wall
    plane = network.wall_position[np.where(network.particle_j == SOURCE_WALL, 0, 1)]
    to_wall = abs(plane - network.position[network.particle_i, 2])
    length = np.where(pair, network.radius[network.particle_i], to_wall)
    length_j = np.where(pair, network.radius[network.particle_j], 0.0)
    return replace(
        network,
        lever_i=length[:, None] * network.normal,
        lever_j=-length_j[:, None] * network.normal,
    )


def scaled(values: np.ndarray, rows: object, factor: float) -> np.ndarray:
    """Return a copy with some rows multiplied by a factor."""
    changed = values.copy()
    changed[rows] *= factor
    return changed


def rounded(network: Network, digits: int = 7) -> Network:
    """Return a packing with all numbers rounded to so many significant digits."""
    columns = {}
    for name, data in vars(network).items():
        if isinstance(data, np.ndarray) and data.dtype.kind == "f":
            numbers = [float(f"{x:.{digits - 1}e}") for x in data.ravel()]
            columns[name] = np.reshape(numbers, data.shape)
    return replace(network, **columns)


OPTIONAL = ("force_normal", "force_tangential", "overlap", "sliding", "cell_shift")


def bare(network: Network, *kept: str) -> Network:
    """Return the network without its optional data, except for those `kept`."""
    return replace(network, **{name: None for name in OPTIONAL if name not in kept})


def turned(network: Network, matrix: np.ndarray, **columns: np.ndarray) -> Network:
    """Return the network with all vectors turned; `columns` replace cell and walls."""
    vectors = ("position", "normal", "lever_i", "lever_j", "force_tangential")
    network = network.unchecked(**{name: getattr(network, name) @ matrix.T for name in vectors})
    return replace(network, **columns)


def mirrored(network: Network) -> Network:
    """Return the mirror image along x: another packing with as many contacts."""
    flip = np.array([-1, 1, 1])
    return turned(network, np.diag(flip), cell_shift=network.cell_shift * flip)


ENDS = ("particle_i", "particle_j")
SPRINGS = ("stiffness_normal", "stiffness_tangential")
PER_CONTACT = (*ENDS, "normal", "lever_i", "lever_j", *SPRINGS, *OPTIONAL)


def from_other_end(network: Network, swapped: np.ndarray) -> Network:
    """Return the network with the contacts `swapped` (m,) bool, of no wall, from the other end."""
    rows = swapped[:, None]
    columns = {
        "particle_i": np.where(swapped, network.particle_j, network.particle_i),
        "particle_j": np.where(swapped, network.particle_i, network.particle_j),
        "lever_i": np.where(rows, network.lever_j, network.lever_i),
        "lever_j": np.where(rows, network.lever_i, network.lever_j),
    }
    for name in ("normal", "force_tangential", "cell_shift"):
        columns[name] = np.where(rows, -1, 1) * getattr(network, name)
    return replace(network, **columns)


def renumbered(network: Network, number: np.ndarray) -> Network:
    """Return the packing with sphere k as number[k], and its contacts in another order."""
    sphere_at = np.argsort(number)
    spheres = {}
    for name in ("position", "radius", "mass", "inertia"):
        spheres[name] = getattr(network, name)[sphere_at]
    order = np.random.default_rng(2).permutation(network.n_contacts)
    shuffled = network.with_contacts(order)
    particle_j = np.where(shuffled.with_wall, shuffled.particle_j, number[shuffled.partner])
    return replace(
        shuffled, **spheres, particle_i=number[shuffled.particle_i], particle_j=particle_j
    )


def changed(network: Network, **columns) -> Network:
    """Return the network with columns replaced by functions of them."""
    return replace(network, **{name: f(getattr(network, name)) for name, f in columns.items()})


def stiffer(network: Network, normal=1.0, tangential=1.0) -> Network:
    """Return the network with springs multiplied by factors, one or (m,); skip its checks."""
    return network.unchecked(
        stiffness_normal=normal * network.stiffness_normal,
        stiffness_tangential=tangential * network.stiffness_tangential,
    )


def slippery(network: Network) -> Network:
    """Return the network with all contacts sliding: no tangential spring is left."""
    return with_sliding(replace(network, sliding=np.ones(network.n_contacts, bool)), "slip")


def in_flight(sample: Sample, velocity: np.ndarray, spin: np.ndarray | None = None) -> Sample:
    """Return the sample with velocities (n, 3), m/s, and spins, rad/s, in a cell at rest."""
    if spin is None:
        spin = np.zeros_like(velocity)
    return replace(sample, velocity=velocity, angular_velocity=spin, strain_rate=np.zeros(3))


def times(factor: float):
    """Return a function that multiplies an array by the factor."""
    return lambda data: factor * data


def permuted(data: np.ndarray) -> np.ndarray:
    """Return the array with its rows in a random order."""
    return np.random.default_rng(1).permutation(data)
