"""Random packings, with friction and without, for the command `pack` and for Python."""

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypedDict, Unpack

from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, RADIUS, Material
from modal.packing.contact_models import acts_across_gaps, laws_of
from modal.packing.network import Network
from modal.packing.plausibility import MIN_WIDTH_IN_DIAMETERS
from modal.packing.sample import read_sample
from modal.preparation.compression import WITH_FRICTION, Simulation, compress_to_stresses
from modal.preparation.frictionless import Descent, Pressure
from modal.preparation.protocol import JAMMING_STRESS, NOMINAL_FRACTION, PEAK, STRESSES, Study
from modal.preparation.sizes import (
    NO_WALLS,
    Mixture,
    Words,
    join_words,
    parse_solid,
    sizes_of_file,
)
from modal.preparation.unequal_stress import RATIO_RANGE, load_further
from modal.tools.arguments import checked
from modal.tools.errors import InputError

PRESSURES = (1e5, 1e6, 1e7)
"""Pressures, Pa, of states without friction, after the peak."""
MIN_PRESSURE = 10.0
"""Lowest stress, Pa, of a state of glass spheres: at lower ones round-off hides the overlaps."""
MAX_PEAK_RATIO = 10.0
"""Largest peak pressure that is accepted, divided by the usual peak, `PEAK`."""
ASPECT = 10.05
"""Default length divided by width: 35,201 spheres then reach 141 to 146 diameters, as in the
study."""
WIDTH_SHRINKAGE = 1.08
"""Width at the nominal solid fraction divided by that of a frictionless packing at 10 MPa."""
MAX_SEED = 2**63 - 1
"""Largest seed that an attribute of a file holds."""
DENSE_FOLDER = "dense"
"""Folder of the packing without friction that is dilated, within that of the states."""
WITHOUT_FRICTION = Simulation(Descent, Pressure)
"""Spheres without friction, which descend to the least enthalpy."""
COMMAND = "python -m modal pack"
"""Command in the provenance of each packing, which makes it again whoever has called."""


class ProtocolNumbers(TypedDict, total=False):
    """Numbers of the protocol that a caller may change, by their names in `Study`."""

    approach_rate: float
    agitated_damping: float
    inertial_number: float
    fraction: float
    hot_stress: float
    damping: float
    residual: float
    dilate: float
    rolling: float
    twisting: float
    clump: str


def sound_aspect(spheres: int) -> float:
    """Return the default length divided by width: that of the study, or less for few spheres.

    With the smaller value, the cell is `MIN_WIDTH_IN_DIAMETERS` wide; it is a cube if the spheres
    are too few for that.
    """
    cube_width = width_of(spheres, 1.0)
    return min(max((cube_width / (WIDTH_SHRINKAGE * MIN_WIDTH_IN_DIAMETERS)) ** 3, 1.0), ASPECT)


def width_of(spheres: int, aspect: float) -> float:
    """Return the width, diameters, of a cell of `aspect` (length over width), at nominal fraction.

    Returns zero, which no study accepts, for numbers that no cell can have.
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
    sizes: Words | None = None,
    densities: Words | None = None,
    walls: Words | None = None,
    periodic: bool = False,
    stress_ratio: float | None = None,
    oedometric: bool = False,
    solid: Words | None = None,
    **protocol: Unpack[ProtocolNumbers],
) -> list[tuple[float, Path]]:
    """Pack spheres in a folder, and return the (stress, file) pairs of its states.

    If the process is killed, a call with equal arguments continues the path.

    Parameters
    ----------
    folder : Path
        Folder of the checkpoint and of the states.
    say : callable
        Shows lines of progress.
    spheres : int
        Number of spheres.
    stresses : sequence of float
        Pa; if empty, those of the study, multiplied by the hardness of the spheres.
    friction : float
        Coefficient of friction, 0 to 1.
    seed : int
        Seed of the random numbers.
    aspect, width : float, optional
        Length over width of the cell, or its width in diameters.
    peak : float, optional
        Peak pressure of packings without friction, Pa.
    sizes, densities, walls : sequence, optional
        Words of the mixture, as in `modal.preparation.sizes`.
    periodic : bool
        Whether the cell has a period along z instead of walls.
    stress_ratio : float, optional
        Lateral stress divided by the axial one, to which each isotropic state is loaded further.
    oedometric : bool
        Whether the spheres are compressed along z alone, from a tenth of the first stress to each
        axial stress.
    solid : sequence, optional
        Words of `parse_solid`; the peak and the stresses of the protocol grow with the modulus.
    **protocol : float
        Numbers of the protocol, by their names in `Study`.

    Raises
    ------
    InputError
        If a number is outside its range, if arguments exclude each other, or if the folder has
        states of another study.
    """
    hardness = 1.0
    if solid:
        hardness = Mixture(*parse_solid(solid)).hardness
    targets = list(stresses)
    if not targets:
        usual_stresses = STRESSES if friction else PRESSURES
        targets = [stress * hardness for stress in usual_stresses]
    _refuse_stresses(stresses, hardness)
    relative_peak = PEAK
    if peak is not None:
        _refuse_peak(peak, targets, hardness)
        relative_peak = peak / hardness
    _refuse_unequal_stresses(friction, stress_ratio, oedometric)
    if friction == 0 or protocol.get("dilate"):
        _refuse_history(solid)
    if not 0 <= seed <= MAX_SEED:
        raise InputError("seed", f"seed {seed}", "outside 0 to 2^63 - 1", "give 0, 1, 2 ...")
    if periodic and walls:
        raise InputError(
            "walls_and_periodic",
            "walls of a cell that is periodic along z",
            "it has none",
            "leave one out",
        )
    words = join_words(
        {"sizes": sizes_of_file(sizes), "densities": densities, "walls": walls, "solid": solid}
    )
    if periodic:
        words["walls"] = NO_WALLS
    default_aspect = None
    if width is None:
        if aspect is None:
            default_aspect = sound_aspect(spheres)
        width = width_of(spheres, aspect or default_aspect or 0.0)
    study = Study(
        friction,
        spheres,
        width,
        seed,
        peak=relative_peak,
        sizes=words.get("sizes", ""),
        densities=words.get("densities", ""),
        walls=words.get("walls", ""),
        solid=words.get("solid", ""),
        **protocol,
    )
    if default_aspect:
        say(f"{spheres} spheres: length over width {default_aspect:.3g}")
    provenance = study.provenance(COMMAND)
    if friction == 0:
        return compress_to_stresses(folder, study, targets, provenance, WITHOUT_FRICTION, say)
    dense = None
    if study.dilate:
        frictionless_study = replace(study, mu_comp=0.0, dilate=0.0)
        [(_, dense)] = compress_to_stresses(
            folder / DENSE_FOLDER,
            frictionless_study,
            [JAMMING_STRESS * hardness],
            frictionless_study.provenance(COMMAND),
            WITHOUT_FRICTION,
            say,
        )
    isotropic_stresses = targets
    if oedometric:
        isotropic_stresses = [targets[0] / 10]
    files = compress_to_stresses(
        folder, study, isotropic_stresses, provenance, WITH_FRICTION, say, dense
    )
    if not oedometric and stress_ratio is None:
        return files
    ratio = math.nan if stress_ratio is None else stress_ratio
    return load_further(folder, study, files, targets, ratio, COMMAND, say)


def _refuse_history(solid: Words | None) -> None:
    """Raise InputError for a contact model whose energy depends on which spheres have touched."""
    if not solid:
        return
    material, _ = parse_solid(solid)
    if acts_across_gaps(laws_of(material)[0]):
        raise InputError(
            "history_without_friction",
            f"{material.contact_model} contacts without friction",
            "packings without friction are minima of an energy of the positions alone, and these "
            "contacts depend on which spheres have touched",
            "give a friction above 0 and no dilation, or take dmt",
        )


def _refuse_stresses(stresses: Sequence[float], hardness: float) -> None:
    """Raise InputError for a stress, Pa, outside what spheres of this hardness bear."""
    for stress in stresses:
        if not MIN_PRESSURE * hardness <= stress <= PEAK * hardness:
            raise InputError(
                "stress",
                f"stress {stress:g} Pa",
                f"outside {MIN_PRESSURE * hardness:g} Pa to {PEAK * hardness:g} Pa",
                "give it in Pa",
            )


def _refuse_peak(peak: float, stresses: Sequence[float], hardness: float) -> None:
    """Raise InputError for a peak, Pa, below one of the stresses, or far above the usual one."""
    usual = PEAK * hardness
    if not max(stresses) <= peak <= MAX_PEAK_RATIO * usual:
        raise InputError(
            "peak",
            f"peak {peak:g} Pa",
            f"below one of the stresses, or above {MAX_PEAK_RATIO * usual:g} Pa",
            f"{usual:g} is usual",
        )


def _refuse_unequal_stresses(friction: float, stress_ratio: float | None, oedometric: bool) -> None:
    """Raise InputError for unequal stresses that are contradictory, frictionless or extreme."""
    if oedometric and stress_ratio is not None:
        raise InputError(
            "ratio_and_oedometric",
            "a stress ratio of one-dimensional compression comes about",
            remedy="leave one out",
        )
    if friction == 0 and (oedometric or stress_ratio is not None):
        raise InputError(
            "unequal_stress_without_friction",
            "unequal stresses need friction, without which spheres flow",
            remedy="give some",
        )
    lowest, highest = RATIO_RANGE
    if stress_ratio is not None and not lowest <= stress_ratio <= highest:
        raise InputError(
            "stress_ratio",
            f"stress ratio {stress_ratio:g}",
            f"lateral over axial stress, {lowest:g} to {highest:g}",
            "few packings hold less than 0.3",
        )


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
    rolling: float = 0.0,
    twisting: float = 0.0,
) -> Network:
    """Make a random packing of spheres between two flat walls, at rest under a pressure.

    The command `modal pack` makes the same packing of these arguments. Without friction the energy
    is minimised, which takes a second for 500 spheres; with friction, a dilute state is compressed
    by the protocol of `modal.preparation.protocol`, which takes some minutes. Equal arguments give
    equal packings, to the bit if the installed packages and the kind of processor are equal as
    well: without numba, sums are rounded differently, and a contact that opens for this reason
    leads to another packing of the same kind (the void ratio of 500 spheres then differs by 2e-4).
    A warning is issued if the packing has not settled.

    Parameters
    ----------
    spheres : int, default 500
        Number of spheres.
    stress : float, optional
        Pressure, Pa, equal along all axes; by default 1e5, multiplied by the modulus of the
        `material` divided by that of glass.
    friction : float, default 0
        Coefficient of friction during the compression, 0 to 1.
    seed : int, default 1
        Seed of the random numbers.
    aspect : float, optional
        Length over width; by default such that the cell is 8 diameters wide, at least that of a
        cube (up to 740 spheres) and at most 10.05 (from 7,400 on).
    sizes : sequence, optional
        ("lognormal", spread of ln R); ("two", ratio of radii, share of the large ones by volume);
        or (name of a grading curve, *.csv,), whose diameters, m, replace `radius`; equal spheres by
        default.
    densities : sequence of float, optional
        kg/m^3, one for all or several: two of two sizes are of the small and of the large ones,
        others are dealt out at random in equal numbers. By default that of the material.
    walls : sequence of 2 float, optional
        Young's modulus, Pa, and Poisson's ratio of the walls; those of the spheres by default.
    periodic : bool, default False
        Whether the cell has a period along z instead of walls.
    material : Material, optional
        Material of the spheres; by default the study's glass.
    radius : float, optional
        Mean radius, m; 1.27e-3 by default.
    rolling, twisting : float, default 0
        Coefficients against turns of the contacts, 0 to 1, as those of angular grains.

    Returns
    -------
    Network
        The packing at rest; its `study` has the parameters and the void ratio.

    Raises
    ------
    InputError
        If an argument is outside its range, or the packing is impossible.

    Examples
    --------
    >>> net = random_packing(spheres=100, stress=1e5, seed=3)
    >>> net.n_particles, net.study["void_ratio"] < 0.7
    (100, True)
    """
    solid: list[str | float] | None = None
    if material is not None or radius is not None:
        solid = _solid_words(material or GLASS, RADIUS if radius is None else radius)
    if stress is None:
        stress = PRESSURES[0]
        if solid:
            stress = PRESSURES[0] * Mixture(*parse_solid(solid)).hardness
    with TemporaryDirectory() as folder:
        [(_, path)] = pack(
            Path(folder),
            _ignore_progress,
            spheres,
            [stress],
            friction,
            seed,
            aspect=aspect,
            sizes=sizes,
            densities=densities,
            walls=walls,
            periodic=periodic,
            solid=solid,
            rolling=rolling,
            twisting=twisting,
        )
        sample = read_sample(path)
    attributes = sample.study
    if not attributes.get("settled", True):
        warnings.warn(
            f"the packing has not settled: stresses are off by {attributes['stress_error']:.1e}, "
            f"residual {attributes['unbalanced']:.1e}",
            stacklevel=2,
        )
    return sample.network()


def _solid_words(material: Material, radius: float) -> list[str | float]:
    """Return the words of `parse_solid` for a material and a radius, m."""
    words: list[str | float] = [material.young, material.poisson, material.density, radius]
    if material.contact_model != HERTZ_MINDLIN:
        words += material.contact_model.split()
    return words


def _ignore_progress(line: str) -> None:
    """Do nothing with a line of progress."""
