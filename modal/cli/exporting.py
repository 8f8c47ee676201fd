"""Packing, modes or wave for ParaView (*.vtu) and OVITO (*.xyz)."""

from pathlib import Path

from modal.cli.options import Option, Options, Result, output
from modal.cli.reading import NETWORK
from modal.exchange import picture
from modal.exchange.registry import read_remarked
from modal.formats.provenance import packing_of, require_same_packing
from modal.modes.mode_set import ModeSet
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError
from modal.waves.signals import DIRECTIONS, TORSION, Signals

EXAMPLE = "export mine.network.h5 mine.modes.h5 --modes 1 -o mine.vtu"
SCALE = "factor on displacements (default: the largest is half a radius)"
OPTIONS = (
    NETWORK,
    Option("product", "", "*.modes.h5 or *.signals.h5", kind=str, more={"nargs": "?"}),
    Option("--modes", "K ...", "which modes, from 1 (default all)", kind=int),
    Option("--frames", "N", "of an animation: a mode's period, a wave's times", kind=int),
    Option("--scale", "X", SCALE),
    output("*.vtu or *.xyz", (".vtu", ".xyz"), required=True),
)


def run(options: Options) -> Result:
    """Write the files; their names."""
    path, count, scale = Path(options.output), options.frames, options.scale
    if count is not None and not 1 <= count <= 10_000:
        raise InputError("input", f"--frames {count}", remedy="give 1 to 10000")
    network = read_remarked(options.network, options.remarks.append)
    fields, motion = picture.sphere_fields(network), picture.Motion()
    if options.product:
        note = require_same_packing(options.product, packing_of(options.network))
        options.remarks += [note] if note else []
        of, moved, numbers = picture.read_sphere_motion(
            options.product, options.modes, any_source=True
        )
        if not isinstance(of, Signals):
            more, motion = _of_modes(of, moved, numbers, count)
            fields |= more
        elif of.direction == TORSION:
            raise InputError(
                "input",
                f"{options.product}: of torsion, turns alone",
                remedy="no picture shows them",
            )
        else:
            axis = DIRECTIONS.index(of.direction)
            motion = picture.animate_wave(of.time, moved, axis, count or 50)
    elif options.modes or count or scale is not None:
        raise InputError("input", "--modes, --frames and --scale need a file of modes or signals")
    frames: picture.Frames = [(0.0, network.position, fields)]
    if motion:
        frames = picture.displace_spheres(network, fields, motion, scale)
    written = picture.WRITERS[path.suffix](path, network, frames, series=bool(motion))
    return {"spheres": network.n_particles, "contacts": network.n_contacts, "written": written}


def _of_modes(
    modes: ModeSet, shapes: Floats, numbers: list[int], frames: int | None
) -> tuple[dict[str, Array], picture.Motion]:
    """Fields of the modes that are chosen, and the motion of the one that is to be animated."""
    fields = dict[str, Array]()
    for k in numbers:
        shape, frequency = shapes[k - 1], float(modes.frequency[k - 1])
        name = f"mode_{k}_{frequency:.6g}_Hz"
        fields |= {name: shape[:, :3].copy(), f"{name}_rotation": shape[:, 3:].copy()}
    if frames is None:
        return fields, []
    if len(fields) != 2:
        raise InputError("input", "--frames", remedy="choose one mode to animate, with --modes K")
    return fields, picture.animate_mode(shape, frequency, frames)
