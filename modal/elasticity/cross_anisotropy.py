"""The five constants of a soil or packing with equal properties in all horizontal directions."""

from typing import NamedTuple

import numpy as np

from modal.elasticity.moduli import ElasticModuli
from modal.tools.arrays import Floats


class Constant(NamedTuple):
    """An elastic constant with its error, both in the same unit."""

    value: float
    error: float


class CrossAnisotropy(NamedTuple):
    """Elastic constants of a solid with the axis z of symmetry; v is vertical, h horizontal.

    young_v, young_h, shear_vh in Pa: Young's moduli, and the shear modulus in vertical planes.
    poisson_vh: horizontal contraction under vertical stress; poisson_hh: horizontal under
    horizontal stress. The shear modulus in horizontal planes is young_h / (2 (1 + poisson_hh)).
    """

    young_v: Constant
    young_h: Constant
    poisson_vh: Constant
    poisson_hh: Constant
    shear_vh: Constant


def cross_anisotropy(moduli: ElasticModuli) -> CrossAnisotropy:
    """Return the five constants of the cross-anisotropic solid nearest to measured moduli.

    The errors combine the error of the moduli with the deviation of the constants along x and along
    y from the mean over all horizontal directions. This deviation is a chance effect of the finite
    width of the packing.

    >>> import modal
    >>> moduli = modal.elastic_moduli(modal.fcc(cells=(2, 2, 4), periodic_z=True))
    >>> constants = cross_anisotropy(moduli)
    >>> constants.young_v.value > constants.shear_vh.value
    True
    """
    return constants_of(moduli.stiffness, moduli.error)


def constants_of(stiffness: Floats, relative_error: float = 0.0) -> CrossAnisotropy:
    """Return the constants of a stiffness (6, 6), Pa, in the order xx yy zz yz zx xy.

    `relative_error` is that of the moduli. The same number is the absolute error of a Poisson's
    ratio, because this is a ratio of compliances.
    """
    mean_compliance = np.linalg.inv(about_z(stiffness)).astype(float)
    mean = _constants_along(mean_compliance, 0)
    compliance = np.linalg.inv(stiffness).astype(float)
    along_x = _constants_along(compliance, 0)
    along_y = _constants_along(compliance, 1)
    spread = np.maximum(abs(along_x - mean), abs(along_y - mean))
    scale = np.array([mean[0], mean[1], 1.0, 1.0, mean[4]])
    error = np.hypot(spread, relative_error * scale)
    pairs = zip(mean.tolist(), error.tolist(), strict=True)
    return CrossAnisotropy(*(Constant(value, size) for value, size in pairs))


def about_z(stiffness: Floats) -> Floats:
    """Return a stiffness (6, 6) averaged over all rotations about z."""
    c = stiffness
    lateral = (c[0, 0] + c[1, 1]) / 2
    c11 = 0.75 * lateral + 0.25 * c[0, 1] + 0.5 * c[5, 5]
    c12 = 0.25 * lateral + 0.75 * c[0, 1] - 0.5 * c[5, 5]
    c44 = (c[3, 3] + c[4, 4]) / 2
    mean = np.diag([c11, c11, c[2, 2], c44, c44, (c11 - c12) / 2])
    mean[0, 1] = c12
    mean[1, 0] = c12
    mean[:2, 2] = (c[0, 2] + c[1, 2]) / 2
    mean[2, :2] = mean[:2, 2]
    return mean


def _constants_along(compliance: Floats, axis: int) -> Floats:
    """Return E_v, E_h, nu_vh, nu_hh, G_vh from a compliance (6, 6), 1/Pa; h is along `axis`."""
    vertical = compliance[2, 2]
    horizontal = compliance[axis, axis]
    # The shear strain in the plane of z and x is the fifth, in that of y and z the fourth.
    return np.array(
        [
            1 / vertical,
            1 / horizontal,
            -compliance[axis, 2] / vertical,
            -compliance[0, 1] / horizontal,
            1 / compliance[4 - axis, 4 - axis],
        ]
    )
