"""What faulty exporters write: refused, remarked on by `info`, or of no consequence. Else listed.

Format, types and indices are right; the contents are permuted, in another unit, in another's place
or of another packing. `UNTOLD` lists what no reader can tell from the file alone, with the reason.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import combinations

import changes
import numpy as np
import packings
import pytest
from changes import ENDS, PER_CONTACT, SPRINGS, scaled

from modal.packing import crystal as gallery
from modal.packing.network import Network, read_network, write_network
from modal.packing.plausibility import plausibility
from modal.packing.state import stress_tensor
from modal.packing.summary import summary
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.tools.errors import InputError

PARTICLES = ("position", "radius", "mass", "inertia")
VECTORS = ("normal", "lever_i", "lever_j")

UNTOLD = {
    r".*: stiffness_tangential column times (0|0.1|0.001|1e-09)": (
        "a law may have any tangential stiffness below the normal one"
    ),
    r".*: both stiffnesses and forces times .*": "softer and stiffer materials exist",
    r".*: mass and inertia times (0.1|10)": "light and heavy materials exist",
    r"crystal: sliding negated": "contacts without friction slide without shear",
    r"mixed: sliding first row everywhere": "friction may be more than any contact uses",
    r"mixed: force_tangential (column|one row) times .*": (
        "shear forces have only the balance to be compared with, and this packing is in none"
    ),
}
"""Pattern of a change -> why it cannot be told."""


NETWORKS = {
    "crystal": (lambda: gallery.fcc(cells=(2, 2, 6)), lambda: gallery.fcc(4e6, (2, 2, 6))),
    "sheared": (packings.sheared, lambda: changes.mirrored(packings.sheared())),
    "mixed": (packings.polydisperse, lambda: packings.polydisperse(seed=3)),
}
"""Each a packing, and another of its kind, of nearly as many particles and contacts."""


@cache
def sound(name: str) -> Network:
    """The networks, without the notes that could give a mistake away."""
    return replace(NETWORKS[name][0](), study={}, provenance={})


def fitted(data: np.ndarray, rows: int) -> np.ndarray:
    """As many rows as wanted: cut, or from the start again."""
    return np.resize(data, (rows, *data.shape[1:]))


def of_columns(network: Network) -> dict[str, dict[str, np.ndarray]]:
    """Changes of one column: name -> the column in its place."""
    random, found = np.random.default_rng(7), {}
    for name in (*PARTICLES, *PER_CONTACT):
        data = getattr(network, name)
        order = random.permutation(len(data))
        swapped = np.arange(len(data))
        swapped[[1, -2]] = swapped[[-2, 1]]
        kinds = {
            "rows permuted": data[order],
            "rows backwards": data[::-1],
            "rows one further": np.roll(data, 1, axis=0),
            "two rows exchanged": data[swapped],
            "first row everywhere": np.broadcast_to(data[0], data.shape),
        }
        if data.dtype.kind == "i":
            kinds["from one"] = data + 1
            kinds["zero"] = 0 * data
        if data.dtype.kind == "f":
            for factor in (-1, 0, 0.1, 10, 1e-3, 1e3, 1e-9):
                kinds[f"column times {factor:g}"] = factor * data
            for factor in (0.1, 10, 1e-3, 1e3):
                kinds[f"one row times {factor:g}"] = scaled(data, len(data) // 2, factor)
        if data.ndim == 2:
            for a, b in combinations(range(3), 2):
                axes = [0, 1, 2]
                axes[a], axes[b] = b, a
                kinds[f"axes {a} and {b} exchanged"] = data[:, axes]
            for axis in range(3):
                kinds[f"axis {axis} negative"] = data * np.where(np.arange(3) == axis, -1, 1)
        if data.dtype.kind == "b":
            kinds["negated"] = ~data
        for kind, changed in kinds.items():
            found[f"{name} {kind}"] = {name: changed}
    for name in ("cell_size", "wall_position"):
        data = getattr(network, name)
        for factor in (-1, 0, 0.1, 0.5, 2, 10, 1e3):
            found[f"{name} times {factor:g}"] = {name: factor * data}
        found[f"{name} backwards"] = {name: data[::-1]}
    return found


FORCES = ("force_normal", "force_tangential")
LENGTHS = ("position", "radius", "lever_i", "lever_j", "overlap", "cell_size", "wall_position")
UNITS = {
    "levers": ("lever_i", "lever_j"),
    "levers and radii": ("lever_i", "lever_j", "radius"),
    "lengths of particles": ("position", "radius"),
    "lengths of contacts": ("lever_i", "lever_j", "overlap"),
    "positions and cell": ("position", "cell_size", "wall_position"),
    "lengths but inertia": LENGTHS,
    "mass and inertia": ("mass", "inertia"),
    "stiffnesses": SPRINGS,
    "forces": FORCES,
    "normals and levers": VECTORS,
    "both stiffnesses and forces": (*SPRINGS, *FORCES),
}
"""What may be in another unit together."""
PERMUTED = {
    "normals and levers": VECTORS,
    "ends": ENDS,
    "ends and periods": (*ENDS, "cell_shift"),
    "springs": SPRINGS,
    "forces": FORCES,
    "springs and forces": (*SPRINGS, *FORCES, "overlap"),
    "all": PER_CONTACT,
    "positions and radii": ("position", "radius"),
    "radii, masses, inertias": ("radius", "mass", "inertia"),
    "masses and inertias": ("mass", "inertia"),
}
"""What may be in another order together."""


def of_groups(network: Network, another: Network) -> dict[str, dict[str, np.ndarray]]:
    """Columns exchanged, in other units together, or from another packing."""
    found: dict[str, dict[str, np.ndarray]] = {}

    def get(name: str) -> np.ndarray:
        return getattr(network, name)

    for kind, columns in (("particles", PARTICLES), ("contacts", PER_CONTACT)):
        for a, b in combinations(columns, 2):
            if get(a).shape == get(b).shape and get(a).dtype == get(b).dtype:
                found[f"{a} and {b} exchanged"] = {a: get(b), b: get(a)}
        mixed = {name: fitted(getattr(another, name), len(get(name))) for name in columns}
        found |= {f"{name} of another": {name: data} for name, data in mixed.items()}
        found[f"{kind} of another"] = mixed
    for label, columns in UNITS.items():
        for factor in (0.1, 10, 1e-3, 1e3):
            found[f"{label} times {factor:g}"] = {name: factor * get(name) for name in columns}
    random = np.random.default_rng(8)
    order = {n: random.permutation(n) for n in (network.n_contacts, network.n_particles)}
    for label, columns in PERMUTED.items():
        together = {name: get(name)[order[len(get(name))]] for name in columns}
        found[f"{label} permuted together"] = together
    pair, (i, j) = ~network.with_wall, map(get, ENDS)
    found["i and j exchanged"] = {
        "particle_i": np.where(pair, j, i),
        "particle_j": np.where(pair, i, j),
    }
    found["walls exchanged"] = {"particle_j": np.where(pair, j, -3 - j)}
    found["levers exchanged"] = {"lever_i": network.lever_j, "lever_j": network.lever_i}
    return found


def of_rows(network: Network) -> dict[str, Callable[[Network], Network]]:
    """Contacts that are missing, listed twice, or in other files' order."""
    m, pair = network.n_contacts, ~network.with_wall
    random = np.random.default_rng(9)
    return {
        "a contact missing": lambda net: net.some(np.arange(m) != m // 2),
        "contacts of walls missing": lambda net: net.some(pair),
        "a tenth of the contacts missing": lambda net: net.some(random.random(m) > 0.1),
        "half the contacts missing": lambda net: net.some(np.arange(m) % 2 == 0),
        "a contact twice": lambda net: net.some(np.append(np.arange(m), m // 3)),
        "every contact twice": lambda net: net.some(np.tile(np.arange(m), 2)),
    }


def mistakes(name: str) -> dict[str, Callable[[Network], Network]]:
    """All wrong contents of a network: name -> what makes the wrong one of it."""
    network = sound(name)
    columns = of_columns(network) | of_groups(network, NETWORKS[name][1]())
    found = {change: (lambda net, new=new: net.unchecked(**new)) for change, new in columns.items()}
    return found | of_rows(network)


def answers(network: Network) -> dict[str, np.ndarray]:
    """What the numbers of a network lead to: spectrum, tangents, stresses, densities, fabric."""
    K, M = stiffness_matrix(network).toarray(), mass_diagonal(network)
    full = stiffness_matrix(network, pre_stress="full")
    scale = 1 / np.sqrt(M)
    found = summary(network, 0.5)
    del found["void_ratio"]
    return {
        "spectrum": np.linalg.eigvalsh(scale[:, None] * K * scale),
        "size of the tangent": np.array([np.sqrt((full.data**2).sum()), full.diagonal().sum()]),
        "stress": stress_tensor(network),
        **{key: np.asarray(value, float) for key, value in found.items()},
    }


def agree(first: dict[str, np.ndarray], second: dict[str, np.ndarray]) -> bool:
    """To round-off: 1e-9 of the largest number of each kind, sums of some thousand terms."""
    return first.keys() == second.keys() and all(
        first[key].shape == second[key].shape
        and abs(first[key] - second[key]).max() <= 1e-9 * abs(first[key]).max() + 1e-12
        for key in first
    )


def verdict(network: Network, path, expected: dict[str, np.ndarray], usual: list[str]) -> str:
    """refused, remarked, same, or untold; an exception is a failure of the test."""
    write_network(path, network)
    try:
        read = read_network(path)
    except InputError as error:
        assert "\n" not in str(error)
        return "refused"
    if set(plausibility(read)["remarks"]) - set(usual):
        return "remarked"
    return "same" if agree(expected, answers(read)) else "untold"


def known(change: str) -> bool:
    return any(re.fullmatch(pattern, change) for pattern in UNTOLD)


@pytest.mark.parametrize("every", [25, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", NETWORKS)
def test_wrong_exports(name, every, tmp_path):
    """All of them, or a choice; most are refused."""
    network, path = sound(name), tmp_path / "x.network.h5"
    expected, usual = answers(network), plausibility(network)["remarks"]
    found = {
        f"{name}: {change}": verdict(make(network), path, expected, usual)
        for change, make in list(mistakes(name).items())[::every]
    }
    assert not [
        change for change, result in found.items() if result == "untold" and not known(change)
    ]
    assert [*found.values()].count("refused") >= len(found) / 2
