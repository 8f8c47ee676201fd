"""Measure moduli in a box inside a packing that no uniform strain can be put on as a whole.

The packing may have side walls, or free surfaces. The spheres beyond the box follow a uniform
strain, those inside move and turn into balance. Spheres that follow a strain make a box too stiff
(kinematic uniform boundary conditions, an upper bound: C. Huet, J. Mech. Phys. Solids 38, 813,
1990), above all close to its faces. So stress and strain are measured in a window inside the box,
two diameters away from its faces; the stiffness is stress divided by strain. A narrower window,
one diameter further inside, tells what the faces still change, and how even the packing is.

The windows end softly, as that of a bulk between walls does (`modal.elasticity.slab`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modal.elasticity.box import FADE_IN_DIAMETERS, Window, checked_bounds, cut_out
from modal.elasticity.steady import steady_motion
from modal.elasticity.strain import AXES, UNIT_STRAINS
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.system.contacts import contact_tangent, motion_of_contacts
from modal.system.imposed import Gradients
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError

MARGINS_IN_DIAMETERS = (2.0, 3.0)
"""Distances of the two windows from the faces of the box, in mean diameters."""
MIN_STRAIN_SHARE = 1e-3
"""Least share of the imposed strain that must reach a window."""
SHEAR_FREE_OF_TURNS = Gradients(
    (UNIT_STRAINS.gradient + UNIT_STRAINS.gradient.transpose(0, 2, 1)) / 2
)
"""The six unit strains without a rotation, so that held spheres need not turn."""


class BoxModuli(NamedTuple):
    """Moduli of a box: `stiffness` is (6, 6) Pa and, as measured, not quite symmetric.

    affine: stiffness (6, 6), Pa, if all spheres followed the strain. density: that of the
    force-bearing spheres, kg/m^3. error: relative, from the two windows and from the residual.
    motion: (6n, 6), m and rad, beyond the strain. products, solver: those of the solution. system:
    the box with held spheres around it.
    """

    stiffness: Floats
    affine: Floats
    density: float
    error: float
    motion: Floats
    products: int
    solver: str
    system: LinearSystem


def moduli_inside(
    network: Network, bounds: ArrayLike, tolerance: float, solver: str | None
) -> BoxModuli:
    """Measure the moduli of a box with these `bounds` (3, 2), m: low and high x, y and z.

    Raises InputError for a box that is too small, and UnavailableError for one that is not inside
    the packing.
    """
    box = checked_bounds(network, bounds)
    cut = cut_out(network, box)
    system = LinearSystem.of(cut)
    coupling = system.put_on(SHEAR_FREE_OF_TURNS)
    affine_energy = np.diag(coupling.held)
    least = MIN_STRAIN_SHARE * affine_energy.max()

    def allowed(work: Floats) -> Floats:
        """Return the errors (6,), J, in twice the energies: the square of those of the motion."""
        energy: Floats = np.maximum(affine_energy - work, least)
        return tolerance**2 * energy

    solution, used_solver = steady_motion(system, coupling, allowed, solver)
    diameter = 2 * float(network.radius.mean())
    measured = []
    for margin in MARGINS_IN_DIAMETERS:
        inward = margin * diameter
        window = Window(box[:, 0] + inward, box[:, 1] - inward, FADE_IN_DIAMETERS * diameter)
        measured.append(_measure(cut, window, solution.motion))
    wide, narrow = measured
    by_window = np.linalg.norm(narrow.stiffness - wide.stiffness) / np.linalg.norm(wide.stiffness)
    return BoxModuli(
        stiffness=wide.stiffness,
        affine=wide.affine,
        density=wide.density,
        error=float(np.hypot(by_window, tolerance)),
        motion=solution.motion,
        products=solution.products,
        solver=used_solver,
        system=system,
    )


class _WindowModuli(NamedTuple):
    """Stiffness and affine stiffness (6, 6), Pa, and density, kg/m^3, in a window."""

    stiffness: Floats
    affine: Floats
    density: float


def _measure(cut: Network, window: Window, motion: Floats) -> _WindowModuli:
    """Measure stress and strain in a window; `motion` (6n, 6) is that beyond the strain.

    Raises UnavailableError if a strain does not reach the window.
    """
    tangent = contact_tangent(cut)
    affine_motion = SHEAR_FREE_OF_TURNS.on(cut)
    branch = cut.branch
    volume = window.volume
    share = window.mean_weight(cut.position[cut.particle_i], branch) / volume
    bearing = force_bearing(cut) & ~cut.held
    weight = window.weight(cut.position) * bearing
    middle = (window.low + window.high) / 2
    place = np.column_stack([np.ones(cut.n_particles), cut.position - middle])
    root = np.sqrt(weight)[:, None]
    stress = np.empty((6, 6))
    strain = np.empty((6, 6))
    for case, gradient in enumerate(SHEAR_FREE_OF_TURNS.gradient):
        beyond = motion[:, case].reshape(-1, 6)
        contact_motion = motion_of_contacts(cut, beyond) + affine_motion[case]
        force = np.einsum("cab,cb->ca", tangent[:, :3], contact_motion)
        virial = (force * share[:, None]).T @ branch
        line = np.linalg.lstsq(root * place, root * beyond[:, :3], rcond=None)[0]
        stress[:, case] = _components((virial + virial.T) / 2)
        strain[:, case] = _components(gradient + (line[1:] + line[1:].T) / 2)
    strain[3:] *= 2  # shears as angles
    if np.linalg.svd(strain, compute_uv=False)[-1] < MIN_STRAIN_SHARE:
        raise UnavailableError(
            "no_stiffness", "a strain of the box does not reach its middle", "it is no solid"
        )
    affine_force = np.einsum("cij,scj->sci", tangent, affine_motion)
    affine = np.einsum("aci,bci->ab", affine_motion * share[:, None], affine_force)
    density = float(cut.mass @ weight) / volume
    return _WindowModuli(stress @ np.linalg.inv(strain), affine, density)


def _components(tensor: Floats) -> Floats:
    """Return the components (6,) of a symmetric tensor (3, 3), in the order of the strains."""
    return np.array([tensor[row, column] for row, column in AXES])
