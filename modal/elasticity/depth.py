"""Measure the velocities of long waves by depth, in a packing whose stiffness changes along z.

Under its own weight a packing becomes stiffer with depth. It may end in a free surface, so that no
uniform strain can be imposed. Therefore a load acts at its top: a force on the topmost spheres or,
if a wall is there, a motion of this wall, along x, y and z in turn. The wall at the bottom is at
rest. In static equilibrium each horizontal plane carries the same traction, and the mean lateral
motion is zero, so that in a layer

    modulus = traction / slope of the displacement along z,    velocity = sqrt(modulus / density):

the P-wave modulus for the load along z, the shear moduli for those along x and y.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import scipy.sparse as sp

from modal.elasticity.slab import MOTION_TOLERANCE
from modal.elasticity.steady import steady_motion
from modal.formats.column import stored
from modal.formats.tables import Tabular, html_table
from modal.packing.ends import bodies_at_end, end_heights, has_two_ends
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.packing.state import (
    SURFACE_ZONE_IN_DIAMETERS,
    Profile,
    profile,
    share_below,
)
from modal.system.imposed import Coupling, end_moves
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import UnavailableError

LAYER_IN_DIAMETERS = 4.0
"""Default thickness of a layer, in mean diameters."""
MIN_SPHERES = 5
"""Least number of force-bearing spheres of a layer whose displacements have a slope."""
MIN_STANDARD_ERRORS = 3.0
"""Least slope of the displacement, in its standard errors, from which a modulus is known."""


@dataclass(frozen=True)
class LayerVelocities(Tabular):
    """Velocities of long waves along z in k layers; NaN for a layer where they are not known.

    Attributes
    ----------
    layers : Profile
        Edges, stress, void ratio and coordination number of the layers.
    z : ndarray (k,)
        Middle of each layer, m.
    density : ndarray (k,)
        Mass of the force-bearing spheres per volume, kg/m^3.
    v_p, v_s : ndarray (k,)
        Velocities of P-waves, and of S-waves in the mean over both directions of motion, m/s.
    v_p_error, v_s_error : ndarray (k,)
        Errors of the velocities from the scatter of the spheres' displacements, m/s.
    """

    DIMENSIONS = {"k": "layer"}
    ROWS = "layer"

    layers: Profile
    z: Annotated[Floats, stored("", "f", "k", unit="m")]
    density: Annotated[Floats, stored("", "f", "k", unit="kg/m^3")]
    v_p: Annotated[Floats, stored("", "f", "k", unit="m/s")]
    v_p_error: Annotated[Floats, stored("", "f", "k", unit="m/s")]
    v_s: Annotated[Floats, stored("", "f", "k", unit="m/s")]
    v_s_error: Annotated[Floats, stored("", "f", "k", unit="m/s")]

    def columns(self) -> dict[str, Floats]:
        """Return the columns of a table of the layers by their names with units."""
        columns = {"density_kg_per_m3": self.density}
        for name in ("v_p", "v_p_error", "v_s", "v_s_error"):
            columns[f"{name}_m_per_s"] = getattr(self, name)
        return columns

    def _repr_html_(self) -> str:
        """Return the layers as a table, for a notebook."""
        names = ("z", "density", "v_p", "v_p_error", "v_s", "v_s_error")
        table = np.column_stack([getattr(self, name) for name in names])
        rows = [[f"{number:.4g}" for number in row] for row in table]
        return html_table(["z, m", "density, kg/m^3", "V_P, m/s", "±", "V_S, m/s", "±"], rows)


@checked
def velocities_by_depth(network: Network, *, thickness: float | None = None) -> LayerVelocities:
    """Measure the velocities of long P- and S-waves along z in the layers of a packing.

    The packing has periods along x and y, and a wall, flat or rough, at one end or at both. Layers
    are about `thickness`, m, thick, by default four mean diameters. Where a load is put on spheres,
    two diameters from a free surface, velocities are not known. The velocities follow from the
    contact springs alone, in the limit of long waves, and assume that each layer is uniform.

    Raises
    ------
    InputError
        If the packing has no wall, no periods along x and y, or carries no load.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(2, 2, 24))
    >>> layers = modal.velocities_by_depth(crystal)
    >>> layers.v_p[1:-1].round(1)
    array([776.1, 776.1])
    """
    if not network.cell_periodic[:2].all():
        raise UnavailableError(
            "not_periodic",
            "layers across the whole packing are not known",
            "it is not periodic along x and y, and its sides carry a part of the load",
            "send a wave: `python -m modal wave` from a wall, or with --plane Z from inside",
        )
    if not thickness:
        thickness = LAYER_IN_DIAMETERS * 2 * float(network.radius.mean())
    layers = profile(network, thickness)
    load = _load_of(network)
    displacement, traction = _displacement_under(network, load)
    bearing = force_bearing(network) & ~load.loaded
    modulus = np.full((3, len(layers.bulk)), np.nan)
    relative_error = np.full((3, len(layers.bulk)), np.nan)
    z = network.position[:, 2]
    low, high = load.ends
    for k in range(len(layers.bulk)):
        lower, upper = layers.edges[k : k + 2]
        inside = bearing & (lower <= z) & (z < upper)
        reaches_out = lower < low - thickness / 2 or upper > high + thickness / 2
        if inside.sum() < MIN_SPHERES or reaches_out:
            continue
        for axis in range(3):
            slope, error = _slope(z[inside], displacement[inside, axis, axis])
            if slope > MIN_STANDARD_ERRORS * error:
                modulus[axis, k] = traction[axis] / slope
                relative_error[axis, k] = error / slope
    density = _density(network, layers)
    velocity = np.sqrt(modulus / density)
    error = velocity * relative_error / 2
    v_s = np.sqrt((velocity[:2] ** 2).mean(axis=0))
    v_s_error = np.sqrt((error[:2] ** 2).mean(axis=0) / 2)
    return LayerVelocities(
        layers=layers,
        z=(layers.edges[1:] + layers.edges[:-1]) / 2,
        density=density,
        v_p=velocity[2],
        v_p_error=error[2],
        v_s=v_s,
        v_s_error=v_s_error,
    )


@dataclass(frozen=True)
class _Load:
    """Three loads along x, y and z, and where they act.

    coupling: forces on the spheres. loaded (n,): spheres on which forces act; none if a wall moves.
    ends (2,): heights, m, between which each plane across z carries the whole load.
    """

    coupling: Coupling
    loaded: Bools
    ends: Floats


def _load_of(network: Network) -> _Load:
    """Return the loads: motions of the upper wall, or 1 N on the spheres of a free surface."""
    system = LinearSystem.of(network)
    bearing = force_bearing(network)
    low, high = end_heights(network)
    if network.cell_periodic[2]:
        raise UnavailableError(
            "no_walls",
            "the packing has no depth",
            "it is periodic along z",
            "its `moduli` are those of the whole cell",
        )
    if has_two_ends(network):
        couplings = [system.put_on(end_moves(network, "receiver", axis)) for axis in range(3)]
        return _Load(_join(couplings), np.zeros(network.n_particles, bool), np.array([low, high]))
    is_on_source = len(bodies_at_end(network, "source")) > 0
    if not is_on_source and not len(bodies_at_end(network, "receiver")):
        raise UnavailableError(
            "no_walls",
            "nothing holds the packing",
            "it touches no wall along z",
            "`python -m modal wave` sends a wave with --plane Z from inside",
        )
    z = network.position[:, 2]
    zone = SURFACE_ZONE_IN_DIAMETERS * 2 * float(network.radius.mean())
    surface = z[bearing].max(initial=low) if is_on_source else z[bearing].min(initial=high)
    depth = surface - z if is_on_source else z - surface
    loaded = bearing & (depth < zone)
    if is_on_source:
        high = surface - zone
    else:
        low = surface + zone
    sign = 1.0 if is_on_source else -1.0
    push = np.zeros((network.n_particles, 6, 3))
    push[loaded, :3] = sign * np.eye(3) / max(int(loaded.sum()), 1)
    columns = sp.csc_matrix(push.reshape(-1, 3))
    nothing = sp.csc_matrix(columns.shape)
    return _Load(Coupling(columns, nothing, np.eye(3), abs(columns)), loaded, np.array([low, high]))


def _join(couplings: list[Coupling]) -> Coupling:
    """Return one coupling for several motions, each of which is imposed alone."""
    return Coupling(
        push=sp.hstack([coupling.push for coupling in couplings], "csc"),
        pull=sp.hstack([coupling.pull for coupling in couplings], "csc"),
        held=np.diag([float(coupling.held[0, 0]) for coupling in couplings]),
        terms=sp.hstack([coupling.terms for coupling in couplings], "csc"),
    )


def _displacement_under(network: Network, load: _Load) -> tuple[Floats, Floats]:
    """Return displacements (n, 3, 3), m, along each axis under each load, and tractions (3,), Pa.

    The last axis is the load. Raises UnavailableError if a load meets no resistance.
    """
    system = LinearSystem.of(network)
    solution, _ = steady_motion(system, load.coupling, lambda work: MOTION_TOLERANCE**2 * work)
    motion = solution.motion
    force = np.diag(load.coupling.held) - np.einsum(
        "rs,rs->s", load.coupling.pull.toarray(), motion
    )
    if not (force > 0).all():
        raise UnavailableError(
            "no_wave", "no force goes through it", remedy="such a packing carries no wave"
        )
    displacement = motion.reshape(-1, 6, 3)[:, :3]
    return displacement, force / network.area


def _slope(z: Floats, displacement: Floats) -> tuple[float, float]:
    """Return the slope of displacements (k,) along z (k,), and its standard error."""
    line, covariance = np.polyfit(z - z.mean(), displacement, 1, cov=True)
    return float(line[0]), float(np.sqrt(covariance[0, 0]))


def _density(network: Network, layers: Profile) -> Floats:
    """Return the mass of the force-bearing spheres in each layer per volume (k,), kg/m^3."""
    bearing = force_bearing(network)
    z = network.position[bearing, 2]
    radius = network.radius[bearing]
    mass = network.mass[bearing]
    below = np.array([float(mass @ share_below(edge - z, radius)) for edge in layers.edges])
    density: Floats = np.diff(below) / (network.area * np.diff(layers.edges))
    return density
