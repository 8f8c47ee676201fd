"""Packing, modes or wave as a picture (*.vtu, *.xyz), as tables (*.csv), K (*.npz, *.mtx)."""

from pathlib import Path

from modal.cli.options import Option, Options, Result, output
from modal.cli.reading import NETWORK
from modal.exchange import picture, table_files
from modal.exchange.registry import read_remarked
from modal.formats.provenance import packing_of, require_same_packing
from modal.modes.mode_set import ModeSet
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError
from modal.waves.signals import DIRECTIONS, TORSION, Signals

EXAMPLE = "export mine.network.h5 mine.modes.h5 --modes 1 -o mine.vtu"
SCALE_HELP = "factor on displacements (default: the largest is half a radius)"
OUTPUT_HELP = "*.vtu or *.xyz; *.csv (contacts; spheres beside); *.npz or *.mtx (K; M beside)"
OPTIONS = (
    NETWORK,
    Option("product", "", "*.modes.h5 or *.signals.h5", kind=str, more={"nargs": "?"}),
    Option("--modes", "K ...", "which modes, from 1 (default all)", kind=int),
    Option("--frames", "N", "of an animation: a mode's period, a wave's times", kind=int),
    Option("--scale", "X", SCALE_HELP),
    output(OUTPUT_HELP, (*picture.WRITERS, *table_files.WRITERS), required=True),
)
MAX_FRAMES = 10_000
"""Largest number of frames of an animation: more would fill the disk."""
WAVE_FRAMES = 50
"""Default number of frames of a wave's animation: two seconds of a film."""


def run(options: Options) -> Result:
    """Write the files of a picture or an animation; the result has their names."""
    if options.frames is not None and not 1 <= options.frames <= MAX_FRAMES:
        raise InputError("frames", f"--frames {options.frames}", remedy=f"give 1 to {MAX_FRAMES}")
    network = read_remarked(options.network, options.remarks.append)
    fields = picture.sphere_fields(network)
    motion = picture.Motion()
    if options.product:
        further_fields, motion = _read_product(options)
        fields |= further_fields
    elif options.modes or options.frames or options.scale is not None:
        raise InputError(
            "no_product", "--modes, --frames and --scale need a file of modes or signals"
        )
    frames: picture.Frames = [(0.0, network.position, fields)]
    if motion:
        frames = picture.displace_spheres(network, fields, motion, options.scale)
    path = Path(options.output)
    if path.suffix in table_files.WRITERS:
        if options.product:
            problem = f"{path.name} holds no motion"
            raise InputError("no_picture", problem, remedy="leave the modes or signals out")
        files = table_files.WRITERS[path.suffix](path, network)
        return {"spheres": network.n_particles, "contacts": network.n_contacts, "written": files}
    written = picture.WRITERS[path.suffix](path, network, frames, series=bool(motion))
    return {"spheres": network.n_particles, "contacts": network.n_contacts, "written": written}


def _read_product(options: Options) -> tuple[dict[str, Array], picture.Motion]:
    """Return the fields of the spheres, and the motion, from a file of modes or of signals."""
    remark = require_same_packing(options.product, packing_of(options.network))
    if remark:
        options.remarks.append(remark)
    product, motion, numbers = picture.read_sphere_motion(
        options.product, options.modes, any_source=True
    )
    if not isinstance(product, Signals):
        return _mode_fields(product, motion, numbers, options.frames)
    if product.direction == TORSION:
        raise InputError(
            "torsion",
            f"{options.product}: of torsion, turns alone",
            remedy="no picture shows them",
        )
    axis = DIRECTIONS.index(product.direction)
    return {}, picture.animate_wave(product.time, motion, axis, options.frames or WAVE_FRAMES)


def _mode_fields(
    modes: ModeSet, shapes: Floats, numbers: list[int], frames: int | None
) -> tuple[dict[str, Array], picture.Motion]:
    """Return the fields of the chosen modes, and the motion of the mode to be animated.

    `shapes` (k, n, 6) are those of all modes; `numbers`, from 1, are those of the chosen modes.
    Without `frames` no motion is returned.
    """
    fields = dict[str, Array]()
    for number in numbers:
        shape = shapes[number - 1]
        name = f"mode_{number}_{float(modes.frequency[number - 1]):.6g}_Hz"
        fields[name] = shape[:, :3].copy()
        fields[f"{name}_rotation"] = shape[:, 3:].copy()
    if frames is None:
        return fields, []
    if len(fields) != 2:
        raise InputError("frames", "--frames", remedy="choose one mode to animate, with --modes K")
    frequency = float(modes.frequency[numbers[0] - 1])
    return fields, picture.animate_mode(shapes[numbers[0] - 1], frequency, frames)
