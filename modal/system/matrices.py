"""The stiffness and the mass matrix of a packing, for other programs.

The motion of body i is six rows, 6 i to 6 i + 5: displacements along x, y, z, m, and turns about x,
y, z, rad. With translations only each body has three rows.
"""

import numpy as np
import scipy.sparse as sp

from modal.packing.network import Network
from modal.system.assembly import mass_diagonal
from modal.system.assembly import stiffness_matrix as assemble_stiffness
from modal.system.contacts import PreStress, Sliding
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked


@checked
def stiffness_matrix(
    network: Network,
    *,
    mass_scaled: bool = False,
    pre_stress: PreStress = "none",
    sliding: Sliding = "elastic",
    translations_only: bool = False,
    held: bool = False,
) -> sp.csr_matrix:
    """Assemble the stiffness matrix K of a packing, or M^-1/2 K M^-1/2.

    Parameters
    ----------
    network : Network
        The packing, n bodies.
    mass_scaled : bool, default False
        Whether to return A = M^-1/2 K M^-1/2, 1/s^2, whose eigenvalues are (2 pi f)^2.
    pre_stress, sliding, translations_only
        As in `modal.eigenmodes`.
    held : bool, default False
        Whether to keep the rows and columns of held motions (`Network.fixed`).

    Returns
    -------
    scipy.sparse.csr_matrix (6 n, 6 n)
        K in N/m, N/rad, N m/m and N m/rad. Body i has the rows 6 i to 6 i + 5: displacements along
        x, y, z and turns about them. With translations only each body has three rows. Rows of held
        motions are left out, and the other rows close up.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(1, 1, 4))
    >>> K = modal.stiffness_matrix(crystal)
    >>> K.shape == (6 * crystal.n_particles, 6 * crystal.n_particles)
    True
    """
    system = LinearSystem.of(
        network, pre_stress=pre_stress, sliding=sliding, translations_only=translations_only
    )
    if mass_scaled:
        matrix = system.assemble_dynamical_matrix()
    else:
        matrix = assemble_stiffness(system.network, system.dof, pre_stress)
    return _select_rows(network, matrix, held)


@checked
def mass_matrix(
    network: Network, *, translations_only: bool = False, held: bool = False
) -> sp.csr_matrix:
    """Assemble the mass matrix M of a packing.

    Its rows are those of `stiffness_matrix`.

    Parameters
    ----------
    network : Network
        The packing, n bodies.
    translations_only : bool, default False
        Whether to leave out the rotations.
    held : bool, default False
        As in `stiffness_matrix`.

    Returns
    -------
    scipy.sparse.csr_matrix (6 n, 6 n)
        Masses, kg, and moments of inertia, kg m^2: diagonal, except for blocks of 3 x 3 for bodies
        that are not spheres.

    Examples
    --------
    >>> import modal
    >>> from scipy.sparse.linalg import eigsh
    >>> crystal = modal.fcc(cells=(1, 1, 4))
    >>> K, M = modal.stiffness_matrix(crystal), modal.mass_matrix(crystal)
    >>> square = eigsh(K, 3, M, which="LA", return_eigenvectors=False)
    >>> highest = modal.eigenmodes(crystal, highest=3).frequency
    >>> abs(square**0.5 / 6.283185307179586 / highest - 1).max() < 1e-9
    np.True_
    """
    dof = 3 if translations_only else 6
    diagonal = mass_diagonal(network, dof)
    if network.inertia_tensor is None or translations_only:
        return _select_rows(network, sp.diags(diagonal, format="csr"), held)
    blocks = diagonal.reshape(-1, 6, 1) * np.eye(6)
    blocks[:, 3:, 3:] = network.inertia_tensor
    starts = np.arange(len(blocks) + 1)
    size = 6 * len(blocks)
    matrix = sp.bsr_matrix((blocks, starts[:-1], starts), (size, size)).tocsr()
    return _select_rows(network, matrix, held)


def _select_rows(network: Network, matrix: sp.csr_matrix, held: bool) -> sp.csr_matrix:
    """Return a matrix without the rows and columns of held motions, unless `held`."""
    if held or network.fixed is None:
        return matrix
    dof = matrix.shape[0] // network.n_particles
    rows = np.flatnonzero(network.free_motions[:, :dof])
    return matrix[rows][:, rows]
