"""Hold the elastic stiffness tensor of a packing, and the moduli and velocities that it gives.

`modal.elasticity.static_response` computes it. The file format is "granular-moduli"
(`docs/formats.md`).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modal.elasticity.plane_waves import anisotropy, isotropic_mean, plane_waves
from modal.elasticity.strain import STRAINS
from modal.formats.column import Column, stored
from modal.formats.product import product_of
from modal.formats.provenance import Provenance
from modal.formats.tables import Tabular, html_table, load_optional
from modal.tools.arrays import Floats
from modal.tools.display import Drawn, quantity
from modal.tools.errors import UnavailableError
from modal.tools.visible import visible

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = "granular-moduli"
VERSION = (1, 2)
TENSOR = stored("", "f", 6, 6, unit="Pa")
MOTIONS = {
    "displacement": Column("non_affine/displacement", "f", (6, "n", 3), "m", optional=True),
    "rotation": Column("non_affine/rotation", "f", (6, "n", 3), "rad", optional=True),
}
UNEVEN_ASYMMETRY = 0.01
"""Asymmetry of a bulk above which a remark is made. Of 20 slabs, 20 to 80 D long, cut from repeats
of cells with known moduli, V_P was off by 0.8 times the asymmetry in the mean square, at most by
1.8 times."""
MAX_SOFT_SHARE = 1e-9
"""Stiffness of a strain, divided by the largest affine stiffness, below which the strain counts as
costing no energy. Round-off leaves 1e-15."""
POLAR_ANGLES = 16
AZIMUTHS = 32
"""Number of directions over which `debye_level` averages; the error is 1e-12 at an anisotropy of
0.17."""


class Remark(NamedTuple):
    """A fact to know before the moduli are quoted: a code for programs and a text for readers.

    The codes are "soft_strain", "walls_in_moduli" and "uneven_bulk".
    """

    code: str
    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, repr=False)
class ElasticModuli(Drawn, Tabular):
    """Elastic stiffness of a packing; the order is xx, yy, zz, yz, zx, xy, shears as angles.

    Attributes
    ----------
    stiffness : ndarray (6, 6)
        Stiffness of the packing, whose spheres move and turn into balance, Pa.
    affine : ndarray (6, 6)
        Stiffness if all spheres followed the strain, Pa; an upper bound.
    density : float
        Density of the force-bearing spheres, kg/m^3.
    region : str
        Region of these numbers: a whole cell, the bulk of a slab, a slab with its walls, or a box.
    whole : ndarray (6, 6)
        Stiffness of a slab with its walls, Pa; otherwise equal to `stiffness`.
    error : float
        Relative error of the moduli: from the residual of the response and, if overlaps are known
        to few digits or not at all, from the change under perturbed overlaps
        (`modal.elasticity.few_digits`).
    asymmetry : float
        |C - C^T| / |C| of the stiffness measured in a bulk or a box of finite length; 0 for other
        regions.
    products, solver : int, str
        Number of products with K, and name of the solver.
    pre_stress : str
        Terms of the carried forces in `stressed` (`modal.system.contacts.PreStress`).
    stressed : ndarray (3, 3, 3, 3), Pa, or None
        Stiffness with the carried forces; velocities follow from it, everything else from the
        springs alone.
    non_affine : ndarray (6, n, 6) or None
        Motion of each sphere beyond a unit strain, m and rad, if requested.

    Examples
    --------
    >>> import modal
    >>> moduli = modal.elastic_moduli(modal.fcc(cells=(2, 2, 4), periodic_z=True))
    >>> moduli.region, moduli.stiffness.shape
    ('cell', (6, 6))
    """

    DIMENSIONS = {6: "strain", 3: "axis", "n": "particle"}

    stiffness: Annotated[Floats, TENSOR]
    affine: Annotated[Floats, TENSOR]
    density: float
    region: str
    whole: Annotated[Floats, TENSOR]
    error: float
    asymmetry: float
    products: int
    solver: str
    pre_stress: str = "none"
    stressed: Annotated[Floats | None, stored("", "f", 3, 3, 3, 3, unit="Pa", since=2)] = None
    non_affine: Floats | None = None

    def __array__(self, dtype: type | None = None, copy: bool | None = None) -> Floats:
        """Return the stiffness tensor, where an array is expected."""
        return np.array(self.stiffness, dtype=dtype)

    def to_pandas(self) -> "pd.DataFrame":
        """Return the stiffness tensor, Pa, as a pandas DataFrame with the names of the strains."""
        pandas = load_optional("pandas", "tables")
        frame: pd.DataFrame = pandas.DataFrame(self.stiffness, index=STRAINS, columns=STRAINS)
        frame.attrs["units"] = "Pa"
        return frame

    def _repr_html_(self) -> str:
        """Return isotropic moduli, velocities and stiffness as tables, for a notebook."""
        error = f"± {100 * self.error:.2g} %"
        velocity_error = f"± {50 * self.error:.2g} %"
        numbers = [
            ["bulk modulus K", quantity(self.bulk_modulus, "Pa"), error],
            ["shear modulus G", quantity(self.shear_modulus, "Pa"), error],
            ["Poisson's ratio", f"{self.poisson:.4g}", ""],
            ["V_P", quantity(self.v_p, "m/s"), velocity_error],
            ["V_S", quantity(self.v_s, "m/s"), velocity_error],
        ]
        rows = []
        for name, row in zip(STRAINS, self.stiffness, strict=True):
            rows.append([name, *(f"{number:.5g}" for number in row)])
        isotropic = html_table(["isotropic mean", "value", "relative error"], numbers)
        return isotropic + html_table(["stiffness, Pa", *STRAINS], rows)

    def velocities(self, direction: ArrayLike) -> Floats:
        """Return the velocities (3,), m/s, of the longest waves along a direction (3,).

        The fastest comes first.

        >>> import modal
        >>> crystal = modal.fcc(cells=(2, 2, 4), periodic_z=True)
        >>> modal.elastic_moduli(crystal).velocities((0, 0, 1)).round(2)
        array([776.38, 548.99, 548.99])
        """
        return self.waves(direction)[0]

    def waves(self, direction: ArrayLike) -> tuple[Floats, Floats]:
        """Return velocities (3,), m/s, of the waves along a direction, and their motions (3, 3).

        The rows of the second array are the unit vectors along which the spheres move.
        """
        stiffness = self.stiffness if self.stressed is None else self.stressed
        return plane_waves(stiffness, self.density, direction)

    @property
    def bulk_modulus(self) -> float:
        """Bulk modulus K of the nearest isotropic solid, Pa."""
        return isotropic_mean(self.stiffness)[0]

    @property
    def shear_modulus(self) -> float:
        """Shear modulus G of the nearest isotropic solid, Pa."""
        return isotropic_mean(self.stiffness)[1]

    @property
    def poisson(self) -> float:
        """Poisson's ratio of the nearest isotropic solid."""
        K, G = isotropic_mean(self.stiffness)
        return (3 * K - 2 * G) / (2 * (3 * K + G))

    @property
    def anisotropy(self) -> float:
        """Distance of the stiffness from an isotropic one, 0 to 1; see `plane_waves`."""
        return anisotropy(self.stiffness)

    @property
    def v_p(self) -> float:
        """P-wave velocity of the nearest isotropic solid, m/s."""
        K, G = isotropic_mean(self.stiffness)
        return float(np.sqrt((K + 4 / 3 * G) / self.density))

    @property
    def v_s(self) -> float:
        """S-wave velocity of the nearest isotropic solid, m/s."""
        return float(np.sqrt(self.shear_modulus / self.density))

    @property
    def debye_level(self) -> float:
        """Level of the Debye density of states: 4 pi times the mean of the sum of 1 / V^3.

        The number of modes per m^3 and Hz, divided by f^2, in 1/(m^3 Hz^3), in the limit of long
        waves. The sum is over the three waves of a direction. The mean over all directions is
        computed by Gauss quadrature. Raises InputError if a strain costs no energy.
        """
        if len(self.soft_strains()):
            raise UnavailableError(
                "unstable", "the packing is not stable", "some waves have no velocity, nor a level"
            )
        cosines, weights = np.polynomial.legendre.leggauss(POLAR_ANGLES)
        azimuths = 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
        total = 0.0
        for z, share in zip(cosines, weights / (2 * AZIMUTHS), strict=True):
            for azimuth in azimuths:
                x, y = np.sqrt(1 - z**2) * np.array([np.cos(azimuth), np.sin(azimuth)])
                total += share * float((1 / self.velocities((x, y, z)) ** 3).sum())
        return 4 * np.pi * total

    def soft_strains(self) -> Floats:
        """Return the unit strains (k, 6) that cost no energy, or that release energy.

        A stable solid has no such strain. Only pre-stress can let a strain release energy, in an
        unstable cell.
        """
        value, vector = np.linalg.eigh(self.stiffness)
        return vector.T[value <= MAX_SOFT_SHARE * np.linalg.eigvalsh(self.affine)[-1]]

    def remarks(self) -> list[Remark]:
        """Return the remarks: on soft strains, and on walls or ends that affect the result."""
        remarks = []
        for strain in self.soft_strains():
            largest = STRAINS[int(np.argmax(abs(strain)))]
            text = f"not stable: a strain, mostly {largest}, costs no energy"
            remarks.append(Remark("soft_strain", text))
        if self.region == "slab with walls":
            text = (
                "too short for a bulk, or walls that slide: these are moduli of packing and walls "
                "together"
            )
            remarks.append(Remark("walls_in_moduli", text))
        if self.asymmetry > UNEVEN_ASYMMETRY and self.region != "box":
            text = (
                f"not symmetric by {self.asymmetry:.1%}: the bulk is not even along z; its moduli "
                "may be off by twice that; take a longer packing, or one whose walls hold it firmly"
            )
            remarks.append(Remark("uneven_bulk", text))
        return remarks

    def __repr__(self) -> str:
        return (
            f"<ElasticModuli of the {visible(self.region)}: "
            f"K {quantity(self.bulk_modulus, 'Pa')}, "
            f"G {quantity(self.shear_modulus, 'Pa')}, V_P {self.v_p:.4g}, V_S {self.v_s:.4g} m/s>"
        )

    def draw(self, ax: Any) -> None:
        """Draw the three velocities against the direction in the plane of x and z."""
        angle = np.linspace(0, np.pi, 91)
        directions = np.column_stack([np.sin(angle), 0 * angle, np.cos(angle)])
        lines = ax.plot(np.degrees(angle), [self.velocities(n) for n in directions])
        for line, name in zip(lines, ("fastest", "second", "slowest"), strict=True):
            line.set_label(name)
        ax.set(xlabel="angle from z towards x, degrees", ylabel="velocity, m/s", ylim=(0, None))
        ax.legend()


FORMAT = product_of(SCHEMA, ElasticModuli, MOTIONS, {"products": int}, versions=VERSION)


def write_moduli(path: str | Path, moduli: ElasticModuli, made: Provenance | None = None) -> None:
    """Write moduli to a file atomically, with the non-affine motions if there are any."""
    values = dict(vars(moduli))
    if moduli.non_affine is not None:
        values["displacement"] = moduli.non_affine[:, :, :3]
        values["rotation"] = moduli.non_affine[:, :, 3:]
    FORMAT.write(path, values, made)


def read_moduli(path: str | Path) -> ElasticModuli:
    """Read moduli without the non-affine motions; raise InputError if the file is not valid."""
    columns = FORMAT.read(path, leave=MOTIONS)
    return ElasticModuli(**{name: columns[name] for name in columns if name not in MOTIONS})
