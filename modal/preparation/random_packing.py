"""Make random packings, with friction and without, for the command `pack` and for Python."""

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, RADIUS, Material
from modal.packing.contact_models import acts_across_gaps, laws_of
from modal.packing.network import Network
from modal.packing.sample import read_sample
from modal.packing.shape_remarks import MIN_WIDTH_IN_DIAMETERS
from modal.preparation.compression import WITH_FRICTION, Simulation, compress_to_stresses
from modal.preparation.frictionless import Descent, Pressure
from modal.preparation.mixture import MixtureWords
from modal.preparation.protocol import JAMMING_STRESS
from modal.preparation.stress_path import PRESSURES, StressPath
from modal.preparation.study import NOMINAL_FRACTION, Study
from modal.preparation.unequal_stress import load_further
from modal.tools.arguments import checked
from modal.tools.errors import InputError

ASPECT = 10.05
"""Default length divided by width: 35,201 spheres then reach 141 to 146 diameters, as in the
study."""
WIDTH_SHRINKAGE = 1.08
"""Width at the nominal solid fraction divided by that of a frictionless packing at 10 MPa."""
DENSE_FOLDER = "dense"
"""Folder of the packing without friction that is dilated, within that of the states."""
WITHOUT_FRICTION = Simulation(Descent, Pressure)
"""Spheres without friction, which descend to the least enthalpy."""
COMMAND = "python -m modal pack"
"""Command in the provenance of each packing, which makes it again whoever has called."""


def sound_aspect(spheres: int) -> float:
    """Return the default ratio of length to width: the study's, or less for few spheres.

    With the smaller value, the cell is `MIN_WIDTH_IN_DIAMETERS` wide; it is a cube if the spheres
    are too few for that.
    """
    cube_width = width_of(spheres, 1.0)
    return min(max((cube_width / (WIDTH_SHRINKAGE * MIN_WIDTH_IN_DIAMETERS)) ** 3, 1.0), ASPECT)


def width_of(spheres: int, aspect: float) -> float:
    """Return the width, in diameters, of a cell of given length / width at the nominal fraction.

    Returns zero, which every study refuses, for impossible numbers.
    """
    if not (aspect > 0 and spheres > 0):
        return 0.0
    return float((spheres * math.pi / 6 / NOMINAL_FRACTION / aspect) ** (1 / 3))


def pack(
    folder: Path, study: Study, path: StressPath, say: Callable[[str], None]
) -> list[tuple[float, Path]]:
    """Pack spheres in a folder, and return the (stress, file) pairs of its states.

    If the process is killed, a call with equal arguments continues the path.

    Parameters
    ----------
    folder : Path
        Folder of the checkpoint and of the states.
    study : Study
        Spheres, cell, and numbers of the protocol; a `peak` of the path replaces that of the study.
    path : StressPath
        The stresses of the states.
    say : callable
        Shows lines of progress.

    Raises
    ------
    InputError
        If a stress is outside its range, if arguments exclude each other, or if the folder has
        states of another study.
    """
    targets = path.targets(study)
    hardness = study.mixture.hardness
    if path.peak is not None:
        study = replace(study, peak=path.peak / hardness)
    if study.mu_comp == 0 or study.dilate:
        _refuse_history(study.mixture.material)
    provenance = study.provenance(COMMAND)
    if study.mu_comp == 0:
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
    if path.oedometric:
        isotropic_stresses = [targets[0] / 10]
    files = compress_to_stresses(
        folder, study, isotropic_stresses, provenance, WITH_FRICTION, say, dense
    )
    if path.is_isotropic:
        return files
    ratio = math.nan if path.stress_ratio is None else path.stress_ratio
    return load_further(folder, study, files, targets, ratio, COMMAND, say)


def _refuse_history(material: Material) -> None:
    """Raise InputError for a contact model whose contacts act across gaps once formed."""
    if acts_across_gaps(laws_of(material)[0]):
        raise InputError(
            "history_without_friction",
            f"{material.contact_model} contacts without friction",
            "packings without friction are minima of an energy of the positions alone, and these "
            "contacts depend on which spheres have touched",
            "give a friction above 0 and no dilation, or take dmt",
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

    The command `modal pack` makes the same packing from the same arguments. Without friction the
    energy is minimised, which takes a second for 500 spheres; with friction, a dilute state is
    compressed by the protocol of `modal.preparation.protocol`, which takes some minutes. Equal
    arguments give equal packings, to the bit if the installed packages and the kind of processor
    are equal as well: without numba, sums are rounded differently, which may open a contact and
    lead to another packing of the same kind (the void ratio of 500 spheres then differs by 2e-4). A
    warning is issued if the packing has not settled.

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
        Length divided by width. By default the cell is 8 diameters wide, but never flatter than a
        cube (up to 740 spheres), and never longer than 10.05 times its width (from 7,400 spheres
        on).
    sizes : sequence, optional
        ("lognormal", spread of ln R); ("two", ratio of radii, share of the large ones by volume);
        or (name of a table with a grading curve, *.csv,), whose diameters, m, replace `radius`;
        equal spheres by default.
    densities : sequence of float, optional
        Densities, kg/m^3: one for all spheres, or several. In a mixture of two sizes, two densities
        belong to the small and to the large spheres. Otherwise each density is given to an equal
        number of spheres at random. By default that of the material.
    walls : sequence of 2 float, optional
        Young's modulus, Pa, and Poisson's ratio of the walls; those of the spheres by default.
    periodic : bool, default False
        Whether the cell has a period along z instead of walls.
    material : Material, optional
        Material of the spheres; by default the study's glass.
    radius : float, optional
        Mean radius, m; 1.27e-3 by default.
    rolling, twisting : float, default 0
        Coefficients of rolling and twisting friction, 0 to 1, which model angular grains.

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
    words = MixtureWords(sizes, densities, walls, solid, periodic)
    study = Study(
        friction,
        spheres,
        width_of(spheres, sound_aspect(spheres) if aspect is None else aspect),
        seed,
        rolling=rolling,
        twisting=twisting,
        **words.texts(),
    )
    if stress is None:
        stress = PRESSURES[0] * study.mixture.hardness
    with TemporaryDirectory() as folder:
        [(_, path)] = pack(Path(folder), study, StressPath((stress,)), _ignore_progress)
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
