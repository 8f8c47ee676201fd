"""Read the spherical DEM particles of a model part of Kratos (*.mdpa).

The blocks that are read: `Nodes` (number, x, y, z), `NodalData RADIUS` (node, fixed, value), and
`Elements` whose name has `Spheric`, each with a number, its properties and a node. Materials are in
other files of Kratos, so that the law must be typed. Clusters, and inlets without elements, are
refused.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Unpack

import numpy as np

from modal.exchange.digits import count_significant_digits
from modal.exchange.import_result import ImportResult
from modal.exchange.lines import Lines
from modal.exchange.refusals import refuse
from modal.exchange.spheres import OPTIONS as SPHERE_OPTIONS
from modal.exchange.spheres import SphereKeywords, SphereOptions, Spheres
from modal.exchange.spheres_to_contacts import import_spheres
from modal.exchange.words import Words
from modal.tools.arrays import Floats

NAME = "Kratos (*.mdpa)"
OPTIONS = SPHERE_OPTIONS
FIRST_WORDS = (b"Begin ModelPartData", b"Begin Properties", b"Begin Nodes")
SPHERE_ELEMENTS = "Spheric"
"""Part of the names of elements that are spheres: SphericParticle3D, SphericContinuumParticle3D."""
REMEDY = "give the *DEM.mdpa with nodes, elements and NodalData RADIUS"


def sniff(path: Path, head: bytes) -> bool:
    """Tell whether a file is a model part, by its first block."""
    return head.lstrip().startswith(FIRST_WORDS)


def read(
    path: Path, scales: Sequence[float] | None = None, **sphere_options: Unpack[SphereKeywords]
) -> ImportResult:
    """Return the packing of a file; `sphere_options` are described at `SphereOptions`.

    Raises InputError if elements are not spheres, or lack a centre or a radius.
    """
    options = SphereOptions(scales=scales, **sphere_options)
    blocks = _read_blocks(path)
    elements = []
    for name, lines in blocks.items():
        if not name.startswith("Elements "):
            continue
        if SPHERE_ELEMENTS not in name:
            problem = f"{name.removeprefix('Elements ')} are no spheres"
            refuse(path, "no_spheres", problem, remedy=REMEDY)
        elements += [line.take_only_numbers("an element", 3) for line in lines]
    centre: dict[float, Floats] = {}
    texts = []
    for line in blocks.get("Nodes", []):
        texts += line.remaining[1:4]
        number, *place = line.take_only_numbers("a node", 4)
        centre[number] = np.array(place)
    radius = {}
    for line in blocks.get("NodalData RADIUS", []):
        number, _, value = line.take_only_numbers("a radius", 3)
        radius[number] = value
    nodes = [int(node) for _, _, node in elements]
    if not nodes or not set(nodes) <= centre.keys() & radius.keys():
        problem = "no sphere, or one without a centre or a radius"
        refuse(path, "no_spheres", problem, remedy=REMEDY)
    spheres = Spheres(
        position=np.array([centre[node] for node in nodes]),
        radius=np.array([radius[node] for node in nodes]),
        number=np.array([number for number, _, _ in elements]),
        digits=count_significant_digits(texts),
    )
    return import_spheres(path, spheres, options)


def _read_blocks(path: Path) -> dict[str, list[Words]]:
    """Return the lines of each block by its name, without comments and blocks inside blocks."""
    blocks: dict[str, list[Words]] = {}
    name = ""
    depth = 0
    for number, text in Lines(path):
        words = text.split("//")[0].split()
        if not words:
            continue
        if words[0] == "Begin":
            depth += 1
            if depth == 1:
                name = " ".join(words[1:])
                blocks.setdefault(name, [])
        elif words[0] == "End":
            depth -= 1
        elif depth == 1:
            blocks[name].append(Words(words, f"{path}, line {number}", REMEDY))
    return blocks
