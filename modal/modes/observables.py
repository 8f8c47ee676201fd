"""What a mode moves: chi_z, rotation share, and the P-wave resonances among the modes."""

from __future__ import annotations

import numpy as np

from modal.packing.network import Network
from modal.system.root_mass import RootMass
from modal.tools.arrays import Array, Floats, Ints

PLANAR = 0.999
"""chi_z above which a mode moves along z only."""


def particle_motion(vector: Array, root: RootMass, dof: int) -> Array:
    """Shape (k, n, 6): mass-normalised shapes from unit vectors of the scaled problem.

    `vector` (n * dof, k) solves M^-1/2 K M^-1/2 v = omega^2 v with |v| = 1; the shape is
    M^-1/2 v. `root` is M^1/2, `dof` 3 or 6; rotations are zero where dof is 3.
    """
    n = len(vector) // dof
    shape = np.zeros((vector.shape[1], n, 6), vector.dtype)
    shape[:, :, :dof] = root.over(vector).T.reshape(-1, n, dof)
    return shape


def chi_z(shape: Array, particles: Ints | slice = slice(None), axis: int = 2) -> Floats:
    """Shape (k,): Eq. 2, the mean over particles of u_z^2 / |u|^2 (translations only).

    With another `axis`, 0 or 1, the share along x or y, which tells S-waves as chi_z does P-waves.

    Each particle's displacement is normalised by its own size, so that 1 means that every
    particle moves along z only. The mean is over the particles that move: a particle at rest (below
    1e-9 of the largest, such as the middle layer of an antisymmetric mode) has no direction.
    """
    u2 = np.abs(shape[:, particles, :3]) ** 2
    total = u2.sum(axis=2)
    floor = 1e-18 * total.max(axis=1, keepdims=True)
    moving = total > floor
    share = np.divide(u2[:, :, axis], total, out=np.zeros_like(total), where=moving)
    return share.sum(axis=1) / np.maximum(moving.sum(axis=1), 1)


def rotation_share(vector: Array, dof: int) -> Floats:
    """Shape (k,): part of the kinetic energy in rotations, from unit vectors (n * dof, k)."""
    if dof == 3:
        return np.zeros(vector.shape[1])
    energy = np.abs(vector.T.reshape(vector.shape[1], -1, 6)) ** 2
    return energy[:, :, 3:].sum(axis=(1, 2)) / energy.sum(axis=(1, 2))


def participation_ratio(shape: Array, root: RootMass) -> Floats:
    """Shape (k,): share of the particles that take part in modes of shapes (k, n, 6).

    (sum e)^2 / (n sum e^2), e each particle's kinetic energy, rotations included: 1 where all move
    alike, 2/3 in a plane standing wave, 1/n where one moves alone (R. J. Bell and P. Dean, Discuss.
    Faraday Soc. 50, 55, 1970). `root` is M^1/2.
    """
    count, n, _ = shape.shape
    scaled = root.times(np.ascontiguousarray(shape.reshape(count, -1).T)).T
    energy = (np.abs(scaled.reshape(count, n, 6)) ** 2).sum(axis=2)
    return energy.sum(axis=1) ** 2 / (n * (energy**2).sum(axis=1))


def resonance_order(shape_z: Floats) -> Ints:
    """Shape (k,): r = 1 + sign changes of the z-shape along the chain (k, nc).

    Exact for planar modes of a layered crystal: they are the eigenvectors of a Jacobi matrix,
    whose r-th eigenvector has r - 1 sign changes (Sturm).
    """
    sign = np.sign(shape_z)
    return 1 + (sign[:, 1:] * sign[:, :-1] < 0).sum(axis=1)


def planar_resonances(
    frequency: Floats, shape: Array, rotations: Floats, chain: Ints, net: Network
) -> tuple[Floats, Floats, Floats]:
    """The pure P-wave modes r = 1, 2, ...: frequency (R,), wave number (R,), z-shape (R, nc).

    `frequency` (k,) Hz, `shape` (k, n, 6) and `rotations` (k,), the rotation share, belong to k
    modes; `chain` (nc,) are particles. A mode is taken where chi_z > `PLANAR` over all particles
    and less than 1e-6 of its energy rotates; of modes with the same r the one with the larger
    amplitude along the chain is kept. The wave number is pi r / L (Eqs. 3 and 4).
    """
    pure = (chi_z(shape) > PLANAR) & (rotations < 1e-6)
    frequency, z = frequency[pure], shape[pure][:, chain, 2].real
    order = resonance_order(z)
    best: dict[int, int] = {}
    for row, r in enumerate(order):
        if r not in best or np.linalg.norm(z[row]) > np.linalg.norm(z[best[r]]):
            best[int(r)] = row
    ordered = sorted(best)
    rows = [best[r] for r in ordered]
    kappa = np.pi * np.array(ordered, float) / net.length
    return frequency[rows], kappa, z[rows].reshape(len(rows), len(chain))
