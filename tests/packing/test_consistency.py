"""Networks whose parts contradict each other are refused; no sound one is."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import changes
import numpy as np
import packings
import pytest
from changes import levers_of_radii, permuted, times

from modal.packing import crystal as gallery
from modal.packing.checks import _of_pairs
from modal.packing.columns import COLUMNS
from modal.packing.network import Network, read_network, write_network
from modal.packing.plausibility import _of_depth
from modal.packing.sample import Sample
from modal.packing.tiling import repeat
from modal.tools.errors import InputError

CRYSTAL = gallery.fcc(cells=(2, 2, 8))


def shells() -> Network:
    """A crystal of hollow spheres."""
    network = gallery.fcc(cells=(3, 3, 4))
    return replace(network, inertia=2 / 3 * network.mass * network.radius**2, study={})


def unwrapped() -> Network:
    """Centres several periods away, with the periods that bring them back."""
    network = gallery.fcc(cells=(2, 2, 5))
    away = np.random.default_rng(1).integers(-3, 4, network.position.shape) * [1, 1, 0]
    pair = ~network.with_wall
    shift = network.cell_shift.copy()
    shift[pair] += (away[network.particle_i] - away[network.particle_j])[pair]
    return replace(network, position=network.position + away * network.cell_size, cell_shift=shift)


SOUND = {
    "crystal": lambda: gallery.fcc(cells=(2, 2, 8)),
    "crystal one sphere wide": lambda: gallery.fcc(cells=(1, 1, 8)),
    "long crystal": lambda: gallery.fcc(cells=(1, 1, 300)),
    "hardly pressed": lambda: gallery.fcc(1e-3, (2, 2, 8)),
    "column": lambda: gallery.column(3),
    "copies side by side": lambda: repeat(gallery.fcc(cells=(1, 1, 5)), 3, 2),
    "sheared": packings.sheared,
    "deep overlaps": packings.deep,
    "levers as long as deep radii": lambda: levers_of_radii(packings.deep()),
    "levers as long as radii": lambda: levers_of_radii(packings.sheared()),
    "radii 1:3": packings.polydisperse,
    "radii 1:3, levers as long": lambda: levers_of_radii(packings.polydisperse()),
    "periodic in all directions": lambda: packings.polydisperse(periodic_z=True),
    "cohesive": packings.cohesive,
    "shells": shells,
    "unwrapped": unwrapped,
}
"""Name -> maker of a network."""


@pytest.mark.parametrize("digits", [17, 7])
@pytest.mark.parametrize("name", SOUND)
def test_sound_networks_are_read(name, digits, tmp_path):
    """As they are, in numbers of 7 digits, and without what is optional."""
    network = SOUND[name]()
    network = network if digits == 17 else changes.rounded(network, digits)
    path = tmp_path / "x.network.h5"
    for known in (network, changes.bare(network)):
        write_network(path, known)
        assert read_network(path).n_contacts == network.n_contacts


def first(value):
    """The column with another first row."""

    def change(data: np.ndarray) -> np.ndarray:
        return np.concatenate([np.asarray(value, data.dtype)[None], data[1:]])

    return change


def inner(data: np.ndarray) -> np.ndarray:
    """Walls half a radius inside the packing."""
    return data + np.array([1.5, -1.5]) * CRYSTAL.radius[0]


def turned(normal: np.ndarray, angle: float) -> np.ndarray:
    across = np.cross(normal, [0.3, 0.4, 0.5])
    across /= np.linalg.norm(across, axis=1)[:, None]
    return np.cos(angle) * normal + np.sin(angle) * across


def one(data: np.ndarray) -> np.ndarray:
    """The first in g."""
    return changes.scaled(data, 0, 1e3)


PLAIN, PILE = replace(CRYSTAL, study={}), gallery.column(3)
MIXED = packings.polydisperse()
ROUND = packings.polydisperse(periodic_z=True)
ALONG = 0.1 * MIXED.force_normal[:, None] * MIXED.normal
WRONG = {
    # Each has the network, what is changed, and what the refusal must say.
    "normals permuted": (PLAIN, {"normal": permuted}, "normal"),
    "normals 2 degrees off": (MIXED, {"normal": lambda n: turned(n, np.radians(2))}, "normal"),
    "levers of 0.9": (PLAIN, {"lever_i": times(0.9), "lever_j": times(0.9)}, "lever"),
    "levers changed places": (MIXED, {"lever_i": lambda _: -MIXED.lever_j}, "lever"),
    "lever of a wall": (PLAIN, {"lever_j": lambda _: -PLAIN.lever_i}, "is with a wall"),
    "radii are diameters": (PLAIN, {"radius": times(2), "inertia": times(4)}, "overlap"),
    "diameters are radii": (PLAIN, {"radius": times(0.5), "inertia": times(0.25)}, "touch"),
    "inertia of 0.1": (PLAIN, {"inertia": times(0.1)}, "inertia"),
    "inertia from diameters": (PLAIN, {"inertia": times(4)}, "inertia"),
    "inertia permuted": (MIXED, {"inertia": permuted}, "inertia"),
    "one mass in g": (PLAIN, {"mass": one, "inertia": one}, "lighter or heavier"),
    "no mass": (PLAIN, {"mass": lambda m: changes.scaled(m, [2, 3], 0)}, "^particle 2 has mass"),
    "masses in g": (CRYSTAL, {"mass": times(1e3), "inertia": times(1e3)}, "kg/m"),
    "no periods": (PLAIN, {"cell_shift": times(0)}, "touch|normal"),
    "periods of the other sign": (PLAIN, {"cell_shift": times(-1)}, "touch|normal"),
    "a cell half as wide": (PLAIN, {"cell_size": times(0.5)}, "touch|normal|overlap"),
    "walls in one place": (PLAIN, {"wall_position": times(0)}, "wall"),
    "walls changed places": (PLAIN, {"wall_position": lambda w: w[::-1]}, "wall"),
    "walls inside the packing": (PLAIN, {"wall_position": inner}, "beyond a wall"),
    "a wall in a sphere": (
        PILE,
        {"wall_position": lambda w: w - [0, PILE.radius[0] / 2]},
        "overlap",
    ),
    "walls far away": (PLAIN, {"wall_position": lambda w: w + [-0.01, 0.01]}, "touch"),
    "walls of a period": (ROUND, {"wall_position": times(0)}, "bounds of the period"),
    "no period along z": (ROUND, {"cell_periodic": lambda _: [True, True, False]}, "not periodic"),
    "negative width": (PILE, {"cell_size": lambda _: np.array([-1.0, 0, 0])}, "size"),
    "overlaps in mm": (PLAIN, {"overlap": times(1e3)}, "overlap"),
    "stiffness in N/mm": (PLAIN, {"stiffness_normal": times(1e-3)}, "force over stiffness"),
    "force in kN": (PLAIN, {"force_normal": times(1e-3)}, "force over stiffness"),
    "tangential in N/mm": (PLAIN, {"stiffness_tangential": times(1e3)}, "tangential"),
    "shear along normals": (MIXED, {"force_tangential": lambda _: ALONG}, "tangential force"),
    "positions x and y": (MIXED, {"position": lambda p: p[:, [1, 0, 2]]}, "contact"),
}


@pytest.mark.parametrize("name", WRONG)
def test_contradictions_are_refused(name, tmp_path):
    """As the network is made, in memory as from a file, whose name is then said."""
    network, columns, says = WRONG[name]
    wrong = {name: f(getattr(network, name)) for name, f in columns.items()}
    with pytest.raises(InputError, match=says) as refusal:
        replace(network, **wrong)
    assert "\n" not in str(refusal.value)
    path = tmp_path / "x.network.h5"
    write_network(path, network.unchecked(**wrong))
    with pytest.raises(InputError) as of_file:
        read_network(path)
    assert str(of_file.value) == f"{path}: {refusal.value}"


SPOILED = {
    "a row less": ("fib", lambda x: x[:-1]),
    "an axis more": ("fib", lambda x: x[..., None]),
    "one number": ("fib", lambda x: np.ravel(x)[0]),
    "a text": ("fib", lambda x: "numbers"),
    "complex": ("fib", lambda x: x + 0j),
    "halves": ("ib", lambda x: x + 0.5),
    "lists of unequal lengths": ("fib", lambda x: [[0.0], *x.tolist()[1:]]),
    "not a number": ("f", lambda x: changes.scaled(x, 0, np.nan)),
    "infinite": ("f", lambda x: np.full_like(x, np.inf)),
}
"""What is no table of numbers, or no number: the kinds of column, what is done."""


@pytest.mark.parametrize("how", SPOILED)
def test_each_column_has_its_kind_its_shape_and_finite_numbers(how):
    """In one line that names it, or where it gives others their length, one of these."""
    pushed = dict.fromkeys(("shear_growth", "motion_shortening", "torque_shortening"), 0.0)
    pushed = {name: np.full(PLAIN.n_contacts, zero) for name, zero in pushed.items()}
    whole = replace(changes.bonded(PLAIN), **pushed)
    kinds, change = SPOILED[how]
    for name, column in COLUMNS.items():
        if column.kind in kinds:
            with pytest.raises(InputError, match="; ") as refusal:
                replace(whole, **{name: change(getattr(whole, name))})
            assert "\n" not in str(refusal.value)
            first = name in ("position", "particle_i") and how == "a row less"
            assert str(refusal.value).startswith(f"{name} ") or first


NO_NETWORK = {
    # No number that a packing can have: a column, what is done.
    "nothing": ("position", lambda x: None),
    "no spheres": ("position", lambda x: x[:0]),
    "positions on their side": ("position", lambda x: x.T),
    "a negative mass": ("mass", times(-1)),
    "a negative radius": ("radius", first(-1e-3)),
    "indices with a point": ("particle_i", lambda x: x + 0.0),
    "indices that are yes or no": ("particle_i", lambda x: x > 0),
    "a third wall": ("particle_j", first(-3)),
    "a partner beyond the last": ("particle_j", first(30_000)),
    "a negative particle": ("particle_i", first(-1)),
    "no contacts but their normals": ("particle_i", lambda x: x[:0]),
    "itself without a period": ("particle_j", lambda x: PLAIN.particle_i),
    "normals of length 2": ("normal", times(2)),
    "negative stiffness": ("stiffness_normal", first(-1.0)),
    "no stiffness": ("stiffness_normal", times(0)),
    "negative tangential stiffness": ("stiffness_tangential", times(-1)),
    "sliding as shares": ("sliding", lambda x: 0.3 * x),
    "no say about periods": ("cell_periodic", lambda x: None),
    "notes that are a text": ("study", lambda x: "glass"),
    "no provenance": ("provenance", lambda x: None),
}


@pytest.mark.parametrize("name", NO_NETWORK)
def test_what_is_no_network_is_refused_when_it_is_made(name):
    """In one line: nothing raw, and nothing that computes with it."""
    column, change = NO_NETWORK[name]
    with pytest.raises(InputError, match="; ") as refusal:
        replace(PLAIN, **{column: change(getattr(PLAIN, column))})
    assert "\n" not in str(refusal.value)


def test_numbers_of_other_widths_are_the_same_network():
    """Lists, 2 bytes, unsigned indices of spheres: what follows does not see how it was given."""
    made = replace(
        PLAIN,
        position=PLAIN.position.tolist(),
        radius=PLAIN.radius.astype(">f8"),
        particle_i=PLAIN.particle_i.astype(np.uint16),
        particle_j=PLAIN.particle_j.astype(np.int16),
        cell_periodic=[1, 1, 0],
    )
    assert made.position.dtype == made.radius.dtype == np.float64
    assert made.particle_i.dtype.kind == "i" and made.cell_periodic.dtype == bool
    np.testing.assert_array_equal(made.branch, PLAIN.branch)


def test_a_contact_listed_twice_is_refused():
    """In the same or the other direction; a pair that touches through two periods is sound."""
    m = CRYSTAL.n_contacts
    rows = np.append(np.arange(m), 3)
    with pytest.raises(InputError, match=f"contacts 3 and {m} are the same"):
        replace(CRYSTAL.some(rows))
    with pytest.raises(InputError, match="selected twice"):
        CRYSTAL.with_contacts(rows)
    pair = ~CRYSTAL.with_wall
    other = changes.from_other_end(CRYSTAL, pair).with_contacts(pair)
    both = {
        name: np.concatenate([getattr(CRYSTAL, name), getattr(other, name)])
        for name in changes.PER_CONTACT
    }
    for columns in (both, both | {"cell_shift": None}):
        with pytest.raises(InputError, match="are the same"):
            replace(CRYSTAL, **columns)


def test_pairs_of_a_hundred_thousand_spheres_are_told_apart():
    """In 32 bits the pairs (0, b) and (2^15, b) of 2^17 - 2 spheres have one number."""
    n, row = 2**17 - 2, np.flatnonzero(~CRYSTAL.with_wall)[[0, 0]]
    position = np.zeros((n, 3))
    position[70_000, 0] = 2 * CRYSTAL.radius[0]
    position[2**15, 1] = 0.5 * CRYSTAL.radius[0]
    many = CRYSTAL.some(row).unchecked(
        position=position,
        radius=np.full(n, CRYSTAL.radius[0]),
        particle_i=np.array([0, 2**15], np.int32),
        particle_j=np.array([70_000, 70_000], np.int32),
        cell_shift=np.zeros((2, 3), np.int8),
    )
    assert not list(_of_pairs(many))


def test_overlaps_above_a_depth_are_refused():
    """Of two spheres: soft ones are taken and remarked on, up to a centre on a surface.

    Diameters in place of radii overlap by 1 and more.
    """

    def pair(overlap: float) -> Network:
        place = np.array([[2, 2, 2], [2, 2, 4 - overlap]])
        return Sample(place, np.full(2, 8.0), np.array([0, 8.0]), 0.1, radius=1.0).network()

    for overlap, soft in ((0.1, 0), (0.25, 1), (0.6, 1)):
        network = pair(overlap)
        assert network.n_contacts == 1
        assert sum(bool(unusual) for unusual, _ in _of_depth(network)) == soft
    with pytest.raises(InputError):
        pair(1.0)


@pytest.mark.parametrize("kept", [10, 100])
def test_shear_that_is_small_beside_the_mean_force_may_point_anywhere(kept):
    """Beside a millionth of it, however many contacts there are."""
    few = CRYSTAL.with_contacts(np.arange(kept))
    for size, refused in ((0.9e-6, False), (3e-6, True)):
        shear = np.zeros((few.n_contacts, 3))
        shear[5] = size * few.force_normal.mean() * few.normal[5]
        refusal = pytest.raises(InputError, match="^contact 5 has a tang")
        with refusal if refused else nullcontext():
            replace(few, force_tangential=shear)
