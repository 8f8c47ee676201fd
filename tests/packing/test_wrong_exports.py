"""Tests that files of faulty exporters are refused, remarked on, or of no consequence.

Format, types and indices are right; the contents are permuted, in another unit, in another column
or of another packing. `UNDETECTABLE` lists the mistakes that a file alone cannot show.
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

UNDETECTABLE = {
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
"""Pattern of the name of a change -> why it cannot be detected."""


NETWORKS = {
    "crystal": (lambda: gallery.fcc(cells=(2, 2, 6)), lambda: gallery.fcc(4e6, (2, 2, 6))),
    "sheared": (packings.sheared, lambda: changes.mirrored(packings.sheared())),
    "mixed": (packings.polydisperse, lambda: packings.polydisperse(seed=3)),
}
"""Name -> a packing, and another of its kind with nearly as many particles and contacts."""


@cache
def sound(name: str) -> Network:
    """Return a network without the notes that could show a mistake."""
    make, _ = NETWORKS[name]
    return replace(make(), study={}, provenance={})


def fitted(data: np.ndarray, rows: int) -> np.ndarray:
    """Return data with another number of rows: cut, or repeated from the start."""
    return np.resize(data, (rows, *data.shape[1:]))


def change_columns(network: Network) -> dict[str, dict[str, np.ndarray]]:
    """Return changes of one column: name -> the column in its place."""
    random = np.random.default_rng(7)
    changed_columns = {}
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
                axes[a] = b
                axes[b] = a
                kinds[f"axes {a} and {b} exchanged"] = data[:, axes]
            for axis in range(3):
                kinds[f"axis {axis} negative"] = data * np.where(np.arange(3) == axis, -1, 1)
        if data.dtype.kind == "b":
            kinds["negated"] = ~data
        for kind, changed in kinds.items():
            changed_columns[f"{name} {kind}"] = {name: changed}
    for name in ("cell_size", "wall_position"):
        data = getattr(network, name)
        for factor in (-1, 0, 0.1, 0.5, 2, 10, 1e3):
            changed_columns[f"{name} times {factor:g}"] = {name: factor * data}
        changed_columns[f"{name} backwards"] = {name: data[::-1]}
    return changed_columns


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
"""Name -> columns that may be in another unit together."""
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
"""Name -> columns that may be in another order together."""


def change_groups(network: Network, another: Network) -> dict[str, dict[str, np.ndarray]]:
    """Return changes of several columns: exchanged, in other units, or of another packing."""
    changed_columns: dict[str, dict[str, np.ndarray]] = {}

    def get(name: str) -> np.ndarray:
        return getattr(network, name)

    for kind, columns in (("particles", PARTICLES), ("contacts", PER_CONTACT)):
        for a, b in combinations(columns, 2):
            if get(a).shape == get(b).shape and get(a).dtype == get(b).dtype:
                changed_columns[f"{a} and {b} exchanged"] = {a: get(b), b: get(a)}
        mixed = {name: fitted(getattr(another, name), len(get(name))) for name in columns}
        for name, data in mixed.items():
            changed_columns[f"{name} of another"] = {name: data}
        changed_columns[f"{kind} of another"] = mixed
    for label, columns in UNITS.items():
        for factor in (0.1, 10, 1e-3, 1e3):
            scaled_columns = {name: factor * get(name) for name in columns}
            changed_columns[f"{label} times {factor:g}"] = scaled_columns
    random = np.random.default_rng(8)
    order = {n: random.permutation(n) for n in (network.n_contacts, network.n_particles)}
    for label, columns in PERMUTED.items():
        together = {name: get(name)[order[len(get(name))]] for name in columns}
        changed_columns[f"{label} permuted together"] = together
    pair = ~network.with_wall
    i = network.particle_i
    j = network.particle_j
    changed_columns["i and j exchanged"] = {
        "particle_i": np.where(pair, j, i),
        "particle_j": np.where(pair, i, j),
    }
    changed_columns["walls exchanged"] = {"particle_j": np.where(pair, j, -3 - j)}
    changed_columns["levers exchanged"] = {
        "lever_i": network.lever_j,
        "lever_j": network.lever_i,
    }
    return changed_columns


def change_rows(network: Network) -> dict[str, Callable[[Network], Network]]:
    """Return changes of the list of contacts: missing ones, and ones listed twice."""
    m = network.n_contacts
    pair = ~network.with_wall
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
    """Return all wrong contents of a network: name -> function that makes the wrong network."""
    network = sound(name)
    _, make_another = NETWORKS[name]
    columns = change_columns(network) | change_groups(network, make_another())
    makers = {
        change: (lambda net, new=new: net.unchecked(**new)) for change, new in columns.items()
    }
    return makers | change_rows(network)


def answers(network: Network) -> dict[str, np.ndarray]:
    """Return the results of a network: spectrum, tangents, stresses, densities, fabric."""
    K = stiffness_matrix(network).toarray()
    M = mass_diagonal(network)
    full = stiffness_matrix(network, pre_stress="full")
    scale = 1 / np.sqrt(M)
    numbers = summary(network, 0.5)
    del numbers["void_ratio"]
    return {
        "spectrum": np.linalg.eigvalsh(scale[:, None] * K * scale),
        "size of the tangent": np.array([np.sqrt((full.data**2).sum()), full.diagonal().sum()]),
        "stress": stress_tensor(network),
        **{key: np.asarray(value, float) for key, value in numbers.items()},
    }


def agree(first: dict[str, np.ndarray], second: dict[str, np.ndarray]) -> bool:
    """Return whether results agree to 1e-9 of the largest of each kind, sums of 1000 terms."""
    if first.keys() != second.keys():
        return False
    for key, values in first.items():
        if values.shape != second[key].shape:
            return False
        # Negated, so that NaN does not agree.
        if not abs(values - second[key]).max() <= 1e-9 * abs(values).max() + 1e-12:
            return False
    return True


def verdict(network: Network, path, expected: dict[str, np.ndarray], usual: list[str]) -> str:
    """Return refused, remarked, same, or undetected; an exception is a failure of the test."""
    write_network(path, network)
    try:
        read = read_network(path)
    except InputError as error:
        assert "\n" not in str(error)
        return "refused"
    if set(plausibility(read)["remarks"]) - set(usual):
        return "remarked"
    return "same" if agree(expected, answers(read)) else "undetected"


def is_undetectable(change: str) -> bool:
    """Return whether a change is listed."""
    return any(re.fullmatch(pattern, change) for pattern in UNDETECTABLE)


@pytest.mark.parametrize("every", [25, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", NETWORKS)
def test_wrong_exports(name, every, tmp_path):
    """Detect all mistakes, or a selection of them; most are refused."""
    network = sound(name)
    path = tmp_path / "x.network.h5"
    expected = answers(network)
    usual = plausibility(network)["remarks"]
    verdicts = {}
    for change, make in list(mistakes(name).items())[::every]:
        verdicts[f"{name}: {change}"] = verdict(make(network), path, expected, usual)
    undetected = [change for change, result in verdicts.items() if result == "undetected"]
    assert not [change for change in undetected if not is_undetectable(change)]
    assert list(verdicts.values()).count("refused") >= len(verdicts) / 2
