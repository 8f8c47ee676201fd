"""Packing, modes or wave for ParaView (*.vtu) and OVITO (*.xyz)."""

from pathlib import Path

import numpy as np

from modal.cli.options import Given, Option, Result, output
from modal.cli.reading import NETWORK
from modal.exchange import picture
from modal.exchange.registry import read_remarked
from modal.formats.hdf5 import open_h5
from modal.formats.provenance import packing_of, require_same_packing
from modal.modes.mode_set import read_modes
from modal.tools.arrays import Array
from modal.tools.errors import InputError
from modal.waves.signals import DIRECTIONS, PLANE, TORSION, read_signals
from modal.waves.signals import SCHEMA as WAVE

EXAMPLE = "export mine.network.h5 mine.modes.h5 --modes 1 -o mine.vtu"
SCALE = "factor on displacements (default: the largest is half a radius)"
OPTIONS = (
    NETWORK,
    Option("product", "", "*.modes.h5 or *.signals.h5", kind=str, more={"nargs": "?"}),
    Option("--modes", "K ...", "which modes, from 1 (default all)", kind=int),
    Option("--frames", "N", "of an animation: a mode's period, a wave's times", kind=int),
    Option("--scale", "X", SCALE),
    output("*.vtu or *.xyz", required=True),
)


def run(options: Given) -> Result:
    """Write the files; their names."""
    path, count, scale = Path(options.output), options.frames, options.scale
    if path.suffix not in picture.WRITERS:
        raise InputError(f"-o {path}: give a name that ends in .vtu (ParaView) or .xyz (OVITO)")
    if count is not None and not 1 <= count <= 10_000:
        raise InputError(f"--frames {count}: give 1 to 10000")
    if scale is not None and not np.isfinite(scale):
        raise InputError(f"--scale {scale}: give a number")
    network = read_remarked(options.network, options.remarks.append)
    fields, motion = picture.sphere_fields(network), picture.Motion()
    if options.product:
        note = require_same_packing(options.product, packing_of(options.network))
        options.remarks += [note] if note else []
        with open_h5(options.product) as file:
            of_wave = file.attrs.get("schema") in (WAVE, PLANE)
        if of_wave:
            motion = _of_wave(options)
        else:
            more, motion = _of_modes(options)
            fields |= more
    elif options.modes or count or scale is not None:
        raise InputError("--modes, --frames and --scale need a file of modes or signals")
    path.parent.mkdir(parents=True, exist_ok=True)
    frames: picture.Frames = [(0.0, network.position, fields)]
    if motion:
        frames = picture.frames_of(network, fields, motion, scale)
    written = picture.WRITERS[path.suffix](path, network, frames, series=bool(motion))
    return {"spheres": network.n_particles, "contacts": network.n_contacts, "written": written}


def _of_wave(options: Given) -> picture.Motion:
    """The motion of a wave that was recorded of every sphere."""
    if options.modes:
        raise InputError("--modes: the file has a wave; give *.modes.h5")
    signals = read_signals(options.product, of_any_source=True)
    moved = signals.particle_displacement
    if moved is None:
        raise InputError(
            f"{options.product}: without the motion of every sphere; make it again with "
            "wave --particles"
        )
    if signals.direction == TORSION:
        raise InputError(f"{options.product}: of torsion, turns alone; no picture shows them")
    axis = DIRECTIONS.index(signals.direction)
    return picture.motion_of_wave(signals.time, moved, axis, options.frames or 50)


def _of_modes(options: Given) -> tuple[dict[str, Array], picture.Motion]:
    """Fields of the modes that are chosen, and the motion of the one that is to be animated."""
    modes = read_modes(options.product)
    if modes.mode_shape is None or not len(modes.frequency):
        raise InputError(f"{options.product}: without mode shapes; make it again with modes -o")
    chosen, fields = options.modes or range(1, len(modes.frequency) + 1), dict[str, Array]()
    for k in chosen:
        if not 1 <= k <= len(modes.frequency):
            raise InputError(f"--modes {k}: the file has modes 1 to {len(modes.frequency)}")
        shape, frequency = modes.mode_shape[k - 1], float(modes.frequency[k - 1])
        name = f"mode_{k}_{frequency:.6g}_Hz"
        fields |= {name: shape[:, :3].copy(), f"{name}_rotation": shape[:, 3:].copy()}
    if options.frames is None:
        return fields, []
    if len(fields) != 2:
        raise InputError("--frames: choose one mode to animate, with --modes K")
    return fields, picture.motion_of_mode(shape, frequency, options.frames)
