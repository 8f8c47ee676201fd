"""Random packings of frictionless spheres between flat walls: from a cloud over a peak pressure.

The study prepares them by a controlled compression (Otsubo et al. 2017, section 2), whose details
are not stated. Here energy is minimised at a peak pressure that fixes the density, then at each
pressure that follows: unloading from 200 MPa gives the study's void ratios.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from modal.formats.provenance import STATE, Provenance, Source, is_current
from modal.packing.neighbours import refuse_more_than_fit
from modal.packing.network import Network
from modal.packing.sample import Sample, read_sample, void_ratio, write_sample
from modal.preparation.frictionless import STRESS_TOLERANCE, Minimum, minimise
from modal.preparation.protocol import CHECKPOINT, by_tens
from modal.preparation.sizes import Mixture, words
from modal.tools.errors import InputError
from modal.tools.progress import Minute

PEAK = 2e8
"""Pressure, Pa, under which the cloud is packed before it is unloaded."""
PEAK_TOLERANCE = 1e-4
"""Residual at the peak: spheres go on rearranging there; at 1e-3 the voids are 0.005 more."""
PRESSURES = (1e5, 1e6, 1e7)
"""Pa, after the peak; lower ones branch off at 100 kPa, in a folder of their own."""
ASPECT = 10.05
"""Length over width: 35,201 spheres then reach 141 to 146 diameters, as in the study."""
CLOUD_FRACTION = 0.5
"""Solid fraction of the cloud, whose overlaps are relaxed before it is compressed."""
TOLERANCE = 1e-3
"""Residual at each pressure, where no other is asked for."""
SPENT = "steps", "seconds"
"""What the notes of a state tell of its cost, over all calls that it took."""


def cloud(spheres: int, aspect: float, seed: int, **of: str) -> Sample:
    """Overlapping random points in a cell of length over width `aspect`, numbered along z.

    Words as of `Mixture`, equal spheres of the study's glass without.
    """
    if spheres < 8 or not 0.2 <= aspect <= 1000:
        raise InputError(
            f"{spheres} spheres at aspect {aspect:g}: no packing; take at least 8, aspect 0.2-1000"
        )
    refuse_more_than_fit(spheres)
    mixture = Mixture.of(spheres, seed, **of)
    radii = np.full(spheres, mixture.radius) if mixture.radii is None else mixture.radii
    solid = np.pi / 6 * float(((2 * radii) ** 3).sum())
    width = (solid / CLOUD_FRACTION / aspect) ** (1 / 3)
    if width < 4 * radii.max():
        raise InputError(
            f"{spheres} spheres at aspect {aspect:g}: the cell is narrower than two diameters; "
            "take more spheres or a smaller aspect"
        )
    lengths = np.array([width, width, aspect * width])
    points = np.random.default_rng(seed).random((spheres, 3))
    return mixture.sample(points[np.argsort(points[:, 2])] * lengths, lengths, 0.0)


def random_sample(
    spheres: int = 500,
    stress: float = 1e5,
    seed: int = 1,
    aspect: float = 2.5,
    tolerance: float = 1e-4,
    **mixture: Sequence[str | float],
) -> Sample:
    """A small frictionless packing at `stress`, Pa, in memory, for tests, by `unload`.

    `mixture`: sizes, densities and walls as in `modal.preparation.sizes`.

    Without numba, whose sums are rounded otherwise, the same but for round-off, or beyond some
    hundred spheres but for a contact that opens for it and what then moves.

    Its notes are left out. InputError where it does not come to rest.
    """
    start = cloud(spheres, aspect, seed, **words(mixture))
    with TemporaryDirectory() as folder:
        files = unload(Path(folder), start, [stress], tolerance, lambda text: None)
        return replace(read_sample(files[-1][1]), study={}, provenance={})


def random_network(
    spheres: int = 500, stress: float = 1e5, seed: int = 1, aspect: float = 2.5
) -> Network:
    """The contact network of `random_sample`, for tests, benchmarks and examples."""
    return random_sample(spheres, stress, seed, aspect).network()


def check_stress(stress: float, hardness: float = 1.0) -> None:
    """Refuse a target that nothing can reach; `hardness` is E* over that of glass."""
    least, most = 10 * hardness, PEAK * hardness
    if not least <= stress <= most:
        raise InputError(
            f"stress {stress:g} Pa: outside {least:g} Pa to {most:g} Pa; give it in Pa"
        )


def unload(
    folder: Path,
    start: Sample,
    stresses: Sequence[float],
    tolerance: float,
    report: Callable[[str], None],
    peak: float = PEAK,
) -> list[tuple[float, Path]]:
    """Pack `start` at the `peak`, then at each stress, Pa; one sample file for each in `folder`.

    From one to the next it goes by way of stresses at most ten times apart, which settle faster.
    States that are there already are kept, or brought nearer to rest where their residual exceeds
    the tolerance or its stresses are off; a state under way goes on from its checkpoint, so a
    killed call is continued by the same call. States that came from another one are stale: that is
    reported, and they are made again. InputError where a state does not come to rest: the
    best one met is then the checkpoint. Returns each stress with its file.
    """
    files: list[tuple[float, Path]] = []
    checkpoint, sample = folder / CHECKPOINT, start
    for number, stress in enumerate((peak, *stresses)):
        path = folder / f"{number:02d}_{stress / 1e3:g}kPa.sample.h5"
        limit = tolerance if files else PEAK_TOLERANCE
        settings = start.study | {"number": number, "stress": float(stress), "peak": peak}
        sources = tuple(Source.of(STATE, before) for _, before in files[-1:])
        made = Provenance("python -m modal pack", settings, sources)
        # The cloud goes to the peak at once, and a state under way where it was heading.
        way = by_tens(files[-1][0], stress) if files else [stress]
        files.append((stress, path))
        done = _saved(path, start, made, report)
        if done and _at_rest(done, stress, limit):
            sample = done
            continue
        if under_way := _saved(checkpoint, start, made, report) or done:
            sample, way = under_way, [stress]
        elif number == 0:
            sample, _ = minimise(sample, None, tolerance=0.1, max_steps=500)
        cost = {name: under_way.study.get(name, 0) if under_way else 0 for name in SPENT}
        study = start.study | {"number": number, "stress": stress, "mu_comp": 0.0} | cost
        sample = replace(sample, study=study, provenance=start.provenance | made.attributes())
        for target in way:
            sample, rest = _brought_to(target, sample, limit, checkpoint, report)
            if not rest.converged:
                write_sample(checkpoint, sample)
                raise InputError(
                    f"no rest at {target:g} Pa after {rest.steps} steps: residual "
                    f"{rest.residual:.1e} ({limit:g} was asked for), stresses off by "
                    f"{rest.stress_error:.1e} ({STRESS_TOLERANCE:g} allowed); the same call goes "
                    "on from there, or take another seed or a larger tolerance"
                )
        write_sample(path, sample)
        checkpoint.unlink(missing_ok=True)
        report(f"{path.name}: {_line(sample, rest)}")
    return files


def _brought_to(
    stress: float, sample: Sample, tolerance: float, checkpoint: Path, report: Callable[[str], None]
) -> tuple[Sample, Minimum]:
    """The sample at rest under a stress, Pa, and how near; its notes tell that and what it took.

    Every minute the state under way is written, with a line of how far from rest it is.
    """
    minute, before = Minute(), sample.study

    def noted(found: Sample, rest: Minimum) -> Sample:
        cost = {name: before[name] + getattr(rest, name) for name in SPENT}
        reached = {"residual": rest.residual, "stresses": rest.stress}
        return replace(found, study=before | reached | cost)

    def watch(best: Sample, rest: Minimum) -> None:
        if minute.passed():
            write_sample(checkpoint, noted(best, rest))
            report(
                f"{stress / 1e3:g} kPa: {_line(best, rest)}; at rest below a stress error of "
                f"{STRESS_TOLERANCE:g} and a residual of {tolerance:g}"
            )

    found, rest = minimise(sample, stress, tolerance=tolerance, watch=watch)
    return noted(found, rest), rest


def _line(sample: Sample, rest: Minimum) -> str:
    length = float(sample.walls[1] - sample.walls[0])
    e = void_ratio(len(sample.position), sample.sizes, sample.side, length)
    return (
        f"e {e:.4f}, stress error {rest.stress_error:.1e}, residual {rest.residual:.1e}, "
        f"{rest.steps} steps, {rest.seconds:.0f} s"
    )


def _at_rest(sample: Sample, stress: float, tolerance: float) -> bool:
    """Whether a finished state says that its forces and its stresses, Pa, are what is asked for."""
    reached = np.asarray(sample.study.get("stresses", np.inf), float)
    off = abs(reached / stress - 1).max()
    return off <= STRESS_TOLERANCE and sample.study.get("residual", np.inf) <= tolerance


def _saved(
    path: Path, start: Sample, wanted: Provenance, report: Callable[[str], None]
) -> Sample | None:
    """The sample in `path` if it is made as wanted; InputError if it is of another study."""
    if not path.exists():
        return None
    found = read_sample(path)
    for key, value in start.study.items():
        if found.study.get(key) != value:
            raise InputError(
                f"{path}: belongs to {key} {found.study.get(key)}, not {value}; "
                "choose another folder"
            )
    if found.study.get("number") != (wanted.settings or {})["number"]:
        return None  # a checkpoint of a state that is still to come, or is over
    return found if is_current(path, wanted, report) else None
