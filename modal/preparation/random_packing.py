"""Random packings, with friction and without: one way for `modal pack` and `random_packing`."""

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, RADIUS, Material
from modal.packing.network import Network
from modal.packing.plausibility import MIN_WIDTH_IN_DIAMETERS
from modal.packing.sample import read_sample
from modal.preparation.compression import compress_to_stresses, in_motion
from modal.preparation.frictionless import Descent, Pressure
from modal.preparation.protocol import JAMMING_STRESS, NOMINAL_FRACTION, PEAK, STRESSES, Study
from modal.preparation.sizes import NO_WALLS, Mixture, solid_of, words
from modal.preparation.unequal_stress import RATIOS, load_further
from modal.tools.arguments import checked
from modal.tools.errors import InputError

PRESSURES = (1e5, 1e6, 1e7)
"""Pa, of spheres without friction after the peak."""
ASPECT = 10.05
"""Length over width: 35,201 spheres then reach 141 to 146 diameters, as in the study."""
SHRINKS = 1.08
"""Width at the nominal solid fraction over that of a packing without friction at 10 MPa."""
DENSE = "dense"
"""Folder of the packing without friction that is dilated, within that of the states."""
COMMAND = "python -m modal pack"
"""What makes the same packing again, whoever has called."""


def sound_aspect(spheres: int) -> float:
    """Return the default length over width: the study's, or less, so that the cell is wide enough.

    Of so few spheres that a cube is no wider, that of a cube.
    """
    return min(max((width_of(spheres, 1.0) / (SHRINKS * MIN_WIDTH_IN_DIAMETERS)) ** 3, 1.0), ASPECT)


def width_of(spheres: int, aspect: float) -> float:
    """Width in diameters of a cell of `aspect`, length over width, at the nominal solid fraction.

    Zero, which no study accepts, for numbers that no cell can have.
    """
    if not (aspect > 0 and spheres > 0):
        return 0.0
    return float((spheres * math.pi / 6 / NOMINAL_FRACTION / aspect) ** (1 / 3))


def pack(
    folder: Path,
    say: Callable[[str], None],
    spheres: int,
    stresses: Sequence[float],
    friction: float,
    seed: int,
    *,
    aspect: float | None = None,
    width: float | None = None,
    peak: float | None = None,
    sizes: Sequence[str | float] | None = None,
    densities: Sequence[str | float] | None = None,
    walls: Sequence[str | float] | None = None,
    periodic: bool = False,
    stress_ratio: float | None = None,
    oedometric: bool = False,
    solid: Sequence[str | float] | None = None,
    **protocol: Any,
) -> list[tuple[float, Path]]:
    """Pack in `folder`; each stress, Pa, with the file of its state. Killed, the same call goes on.

    Without stresses those of the study, of softer spheres as much less. `width`, in diameters,
    stands in place of `aspect`; numbers of the `protocol` have their names in `Study`, and `peak`,
    Pa, is that of packings without friction. A `periodic` cell has no walls. With friction a state
    may go on from each isotropic one to a `stress_ratio`, lateral over axial stress; or the spheres
    are compressed along z alone (`oedometric`) from a tenth of the first stress to each axial one.
    `say` is told how it goes.
    `solid` as in `modal.preparation.sizes.solid_of`, of the study's glass without: the peak and the
    stresses of the protocol grow with its modulus.
    """
    hardness = Mixture(*solid_of(solid)).hardness if solid else 1.0
    usual_stresses = STRESSES if friction else PRESSURES
    targets = list(stresses) or [stress * hardness for stress in usual_stresses]
    for stress in stresses:
        if not 10 * hardness <= stress <= PEAK * hardness:
            raise InputError(
                "input",
                f"stress {stress:g} Pa",
                f"outside {10 * hardness:g} Pa to {PEAK * hardness:g} Pa",
                "give it in Pa",
            )
    if peak is not None:
        usual = PEAK * hardness
        if not max(targets) <= peak <= 10 * usual:
            raise InputError(
                "input",
                f"peak {peak:g} Pa",
                f"below one of the stresses, or above {10 * usual:g} Pa",
                f"{usual:g} is usual",
            )
        protocol["peak"] = peak / hardness
    if oedometric and stress_ratio is not None:
        raise InputError(
            "input",
            "a stress ratio of one-dimensional compression comes about",
            remedy="leave one out",
        )
    if friction == 0 and (oedometric or stress_ratio is not None):
        raise InputError(
            "input",
            "unequal stresses need friction, without which spheres flow",
            remedy="give some",
        )
    if stress_ratio is not None and not RATIOS[0] <= stress_ratio <= RATIOS[1]:
        raise InputError(
            "input",
            f"stress ratio {stress_ratio:g}",
            f"lateral over axial stress, {RATIOS[0]:g} to {RATIOS[1]:g}",
            "few packings hold less than 0.3",
        )
    if not 0 <= seed < 2**63:  # as an attribute of the file holds it
        raise InputError("input", f"seed {seed}", "outside 0 to 2^63 - 1", "give 0, 1, 2 ...")
    if periodic and walls:
        raise InputError(
            "input", "walls of a cell that is periodic along z", "it has none", "leave one out"
        )
    of = words({"sizes": sizes, "densities": densities, "walls": walls, "solid": solid})
    of |= {"walls": NO_WALLS} if periodic else {}
    sound = sound_aspect(spheres) if aspect is None and width is None else None
    width = width_of(spheres, aspect or sound or 0.0) if width is None else width
    study = Study(friction, spheres, width, seed, **(protocol | of))
    if sound:
        say(f"{spheres} spheres: length over width {sound:.3g}")
    made = study.provenance(COMMAND)
    if friction == 0:
        return compress_to_stresses(folder, study, targets, made, Descent, say, Pressure)
    first = [targets[0] / 10] if oedometric else targets
    dense = None
    if study.dilate:
        bare = replace(study, mu_comp=0.0, dilate=0.0)
        own = folder / DENSE, bare, [JAMMING_STRESS * hardness], bare.provenance(COMMAND)
        [(_, dense)] = compress_to_stresses(*own, Descent, say, Pressure)
    files = compress_to_stresses(folder, study, first, made, in_motion, say, dense=dense)
    if not oedometric and stress_ratio is None:
        return files
    ratio = math.nan if stress_ratio is None else stress_ratio
    return load_further(folder, study, files, targets, ratio, COMMAND, say)


@checked
def random_packing(
    spheres: int = 500,
    stress: float | None = None,
    friction: float = 0.0,
    seed: int = 1,
    *,
    aspect: float | None = None,
    sizes: Sequence[str | float] | None = None,
    densities: Sequence[float] | None = None,
    walls: Sequence[float] | None = None,
    periodic: bool = False,
    material: Material | None = None,
    radius: float | None = None,
) -> Network:
    """A random packing of glass spheres between two flat walls, at rest under a pressure.

    It is the packing that `modal pack` makes of these numbers. Without friction the energy is
    minimised, a second for 500 spheres; with it, a dilute state is compressed as
    `modal.preparation.protocol` says, some minutes. Equal numbers give equal packings, to the bit
    where the installed packages and the kind of processor are equal as well: without numba sums
    are rounded otherwise, and a contact that opens for that makes another packing of the same kind
    (the void ratio of 500 spheres then differs by 2e-4). A warning says where a packing has not
    settled.

    Parameters
    ----------
    spheres : int, default 500
        Their number.
    stress : float, optional
        Pressure, Pa, the same along all axes; by default 1e5, of a softer or harder `material` as
        much less or more.
    friction : float, default 0
        Coefficient of friction while it is compressed, 0 to 1.
    seed : int, default 1
        Of the random numbers.
    aspect : float, optional
        Length over width; by default such that the cell is 8 diameters wide, at least that of a
        cube (up to 740 spheres) and at most 10.05 (from 7,400 on).
    sizes : sequence, optional
        ("lognormal", spread of ln R), or ("two", ratio of radii, share of the large ones by
        volume); equal spheres by default.
    densities : sequence of float, optional
        kg/m^3, one for all or several: two of two sizes are of the small and of the large ones,
        others are dealt out at random in equal numbers. By default that of the material.
    walls : sequence of 2 float, optional
        Young's modulus, Pa, and Poisson's ratio of the walls; those of the spheres by default.
    periodic : bool, default False
        A period along z in place of walls.
    material : Material, optional
        Of the spheres; by default the study's glass.
    radius : float, optional
        m; 1.27e-3 by default.

    Returns
    -------
    Network
        The packing at rest; its `study` has what was asked for, and the void ratio.

    Raises
    ------
    InputError
        Where there is no such packing.

    Examples
    --------
    >>> net = random_packing(spheres=100, stress=1e5, seed=3)
    >>> net.n_particles, net.study["void_ratio"] < 0.7
    (100, True)
    """
    mixture: dict[str, Any] = {"sizes": sizes, "densities": densities, "walls": walls}
    solid: list[str | float] | None = None
    if material is not None or radius is not None:
        own = material or GLASS
        solid = [own.young, own.poisson, own.density, RADIUS if radius is None else radius]
        solid += [] if own.contact_model == HERTZ_MINDLIN else own.contact_model.split()
    if stress is None:
        stress = PRESSURES[0] * (Mixture(*solid_of(solid)).hardness if solid else 1.0)
    with TemporaryDirectory() as folder:
        files = pack(
            Path(folder), lambda _: None, spheres, [stress], friction, seed,
            aspect=aspect, periodic=periodic, solid=solid, **mixture,
        )  # fmt: skip
        sample = read_sample(files[-1][1])
    if not sample.study.get("settled", True):
        warnings.warn(
            f"the packing has not settled: stresses are off by {sample.study['stress_error']:.1e}, "
            f"residual {sample.study['unbalanced']:.1e}",
            stacklevel=2,
        )
    return sample.network()
