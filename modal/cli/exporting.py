"""The command `export`: packing, modes or wave for ParaView (VTK) and OVITO (extended XYZ)."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from modal.cli.options import add_output, add_value
from modal.cli.reading import network_command
from modal.exchange import extended_xyz, picture
from modal.exchange.picture import (
    Frame,
    contact_lines,
    mode_frames,
    scale_of,
    sphere_fields,
    wave_frames,
)
from modal.exchange.registry import read_remarked
from modal.formats.hdf5 import open_h5
from modal.formats.provenance import packing_of, require_same_packing
from modal.modes.mode_set import read_modes
from modal.packing.network import Network
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError
from modal.waves.signals import DIRECTIONS, PLANE, TORSION, read_signals
from modal.waves.signals import SCHEMA as WAVE


def add(commands: Any) -> None:
    """The options of `export`."""
    text = "packing, modes or wave for ParaView (*.vtu) and OVITO (*.xyz)"
    example = "export mine.network.h5 mine.modes.h5 --modes 1 -o mine.vtu"
    command = network_command(commands, "export", text, example)
    command.add_argument("product", nargs="?", help="*.modes.h5 or *.signals.h5")
    text = "which modes, from 1 (default all)"
    add_value(command, "--modes", "K", text, kind=int, nargs="+")
    text = "of an animation: a mode's period, a wave's times"
    add_value(command, "--frames", "N", text, kind=int)
    text = "factor on displacements (default: the largest is half a radius)"
    add_value(command, "--scale", "X", text)
    add_output(command, "*.vtu or *.xyz", required=True)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Write the files; their names."""
    path = Path(options.output)
    if path.suffix not in (".vtu", ".xyz"):
        raise InputError(f"-o {path}: give a name that ends in .vtu (ParaView) or .xyz (OVITO)")
    if options.frames is not None and not 1 <= options.frames <= 10_000:
        raise InputError(f"--frames {options.frames}: give 1 to 10000")
    if options.scale is not None and not np.isfinite(options.scale):
        raise InputError(f"--scale {options.scale}: give a number")
    network = read_remarked(options.network, options.remarks.append)
    fields = sphere_fields(network)
    frames: list[Frame] | None = None
    if options.product:
        note = require_same_packing(options.product, packing_of(options.network))
        if note:
            options.remarks.append(note)
        more, moving = _of_product(options)
        fields, frames = fields | more, None if moving is None else list(moving)
    elif options.modes or options.frames or options.scale is not None:
        raise InputError("--modes, --frames and --scale need a file of modes or signals")
    path.parent.mkdir(parents=True, exist_ok=True)
    written = _write(path, network, fields, frames, options.scale)
    return {"spheres": network.n_particles, "contacts": network.n_contacts, "written": written}


def _of_product(options: argparse.Namespace) -> tuple[dict[str, Array], Iterator[Frame] | None]:
    """Fields, and frames if there are any, of modes or of a wave."""
    with open_h5(options.product) as file:
        schema = file.attrs.get("schema")
    if schema in (WAVE, PLANE):
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
        return {}, wave_frames(signals.time, moved, axis, options.frames or 50)
    modes = read_modes(options.product)
    if modes.mode_shape is None or not len(modes.frequency):
        raise InputError(f"{options.product}: without mode shapes; make it again with modes -o")
    chosen = options.modes or range(1, len(modes.frequency) + 1)
    fields: dict[str, Array] = {}
    for k in chosen:
        if not 1 <= k <= len(modes.frequency):
            raise InputError(f"--modes {k}: the file has modes 1 to {len(modes.frequency)}")
        shape, name = modes.mode_shape[k - 1], f"mode_{k}_{modes.frequency[k - 1]:.6g}_Hz"
        fields[name] = np.ascontiguousarray(shape[:, :3])
        fields[f"{name}_rotation"] = np.ascontiguousarray(shape[:, 3:])
    if options.frames is None:
        return fields, None
    if len(fields) != 2:
        raise InputError("--frames: choose one mode to animate, with --modes K")
    k = options.modes[0] if options.modes else 1
    shape = modes.mode_shape[k - 1]
    return fields, mode_frames(shape, float(modes.frequency[k - 1]), options.frames)


def _write(
    path: Path,
    network: Network,
    fields: dict[str, Array],
    frames: list[Frame] | None,
    wanted: float | None,
) -> list[str]:
    """Names of the files of a still picture, or of frames; and of the contacts where it is VTK."""
    sizes = [np.linalg.norm(frame.displacement, axis=1).max() for frame in frames or ()]
    scale = scale_of(network, float(max(sizes, default=0.0)), wanted)
    shown: Iterable[tuple[float, Floats, dict[str, Array]]] = [(0.0, network.position, fields)]
    names = [path]
    if frames is not None:
        shown = (
            (time, network.position + scale * moved, fields | {"displacement": moved})
            for time, moved in frames
        )
        names = [path.with_name(f"{path.stem}_{k:04d}.vtu") for k in range(len(frames))]
    if path.suffix == ".xyz":
        extended_xyz.write_frames(path, network, shown)
        return [str(path)]
    contacts, series = path.with_suffix(".contacts.vtu"), path.with_suffix(".pvd")
    picture.write_lines(contacts, contact_lines(network))
    for name, (_, position, own) in zip(names, shown, strict=True):
        picture.write_spheres(name, position, own)
    if frames is None:
        return [str(path), str(contacts)]
    times = [(frame.time, name.name) for frame, name in zip(frames, names, strict=True)]
    picture.write_series(series, times)
    return [str(series), str(contacts), *map(str, names)]
