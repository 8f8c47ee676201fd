"""Tests that networks whose parts contradict each other are refused, and no sound one is."""

from __future__ import annotations

from dataclasses import replace

import changes
import numpy as np
import packings
import pytest
from changes import levers_of_radii, permuted, times
from refusals import refusal

from modal.packing import crystal as gallery
from modal.packing.columns import COLUMNS
from modal.packing.contact_checks import check_pairs
from modal.packing.network import Network, read_network, write_network
from modal.packing.plausibility import examine
from modal.packing.sample import Sample
from modal.packing.tiling import repeat
from modal.tools.errors import InputError

CRYSTAL = gallery.fcc(cells=(2, 2, 8))


def shells() -> Network:
    """Return a crystal of hollow spheres."""
    network = gallery.fcc(cells=(3, 3, 4))
    return replace(network, inertia=2 / 3 * network.mass * network.radius**2, study={})


def unwrapped() -> Network:
    """Return a crystal with centres several periods away, and the periods that bring them back."""
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
    """Read networks with all optional columns and without any."""
    network = SOUND[name]()
    if digits != 17:
        network = changes.rounded(network, digits)
    path = tmp_path / "x.network.h5"
    for written in (network, changes.bare(network)):
        write_network(path, written)
        assert read_network(path).n_contacts == network.n_contacts


def with_first_row(value):
    """Return a change that replaces the first row of a column."""

    def change(data: np.ndarray) -> np.ndarray:
        return np.concatenate([np.asarray(value, data.dtype)[None], data[1:]])

    return change


def half_a_radius_inside(wall_position: np.ndarray) -> np.ndarray:
    """Move the walls half a radius into the packing."""
    return wall_position + np.array([1.5, -1.5]) * CRYSTAL.radius[0]


def tilted(normal: np.ndarray, angle: float) -> np.ndarray:
    """Turn normals by an angle, rad, each about an axis across it."""
    across = np.cross(normal, [0.3, 0.4, 0.5])
    across /= np.linalg.norm(across, axis=1)[:, None]
    return np.cos(angle) * normal + np.sin(angle) * across


def first_in_grams(data: np.ndarray) -> np.ndarray:
    """Give the first row in another unit of mass."""
    return changes.scaled(data, 0, 1e3)


PLAIN = replace(CRYSTAL, study={})
PILE = gallery.column(3)
MIXED = packings.polydisperse()
ROUND = packings.polydisperse(periodic_z=True)
SHEAR_ALONG_NORMAL = 0.1 * MIXED.force_normal[:, None] * MIXED.normal
WRONG = {
    "normals permuted": (PLAIN, {"normal": permuted}, "normal_direction"),
    "normals 2 degrees off": (
        MIXED,
        {"normal": lambda normal: tilted(normal, np.radians(2))},
        "normal_direction",
    ),
    "levers of 0.9": (PLAIN, {"lever_i": times(0.9), "lever_j": times(0.9)}, "lever"),
    "levers changed places": (MIXED, {"lever_i": lambda _: -MIXED.lever_j}, "lever"),
    "lever of a wall": (PLAIN, {"lever_j": lambda _: -PLAIN.lever_i}, "lever_of_wall"),
    "radii are diameters": (PLAIN, {"radius": times(2), "inertia": times(4)}, "deep_overlap"),
    "diameters are radii": (PLAIN, {"radius": times(0.5), "inertia": times(0.25)}, "no_touch"),
    "inertia of 0.1": (PLAIN, {"inertia": times(0.1)}, "inertia"),
    "inertia from diameters": (PLAIN, {"inertia": times(4)}, "inertia"),
    "inertia permuted": (MIXED, {"inertia": permuted}, "inertia"),
    "one mass in g": (
        PLAIN,
        {"mass": first_in_grams, "inertia": first_in_grams},
        "density_of_particle",
    ),
    "no mass": (PLAIN, {"mass": lambda mass: changes.scaled(mass, [2, 3], 0)}, "mass_not_positive"),
    "masses in g": (CRYSTAL, {"mass": times(1e3), "inertia": times(1e3)}, "density_of_study"),
    "no periods": (PLAIN, {"cell_shift": times(0)}, "no_touch"),
    "periods of the other sign": (PLAIN, {"cell_shift": times(-1)}, "no_touch"),
    "a cell half as wide": (PLAIN, {"cell_size": times(0.5)}, "deep_overlap"),
    "walls in one place": (PLAIN, {"wall_position": times(0)}, "wall_order"),
    "walls changed places": (PLAIN, {"wall_position": lambda z: z[::-1]}, "wall_order"),
    "walls inside the packing": (PLAIN, {"wall_position": half_a_radius_inside}, "beyond_wall"),
    "a wall in a sphere": (
        PILE,
        {"wall_position": lambda z: z - [0, PILE.radius[0] / 2]},
        "overlap",
    ),
    "walls far away": (PLAIN, {"wall_position": lambda z: z + [-0.01, 0.01]}, "no_touch"),
    "walls of a period": (ROUND, {"wall_position": times(0)}, "period_bounds"),
    "no period along z": (
        ROUND,
        {"cell_periodic": lambda _: [True, True, False]},
        "shift_without_period",
    ),
    "negative width": (PILE, {"cell_size": lambda _: np.array([-1.0, 0, 0])}, "cell_size"),
    "overlaps in mm": (PLAIN, {"overlap": times(1e3)}, "overlap"),
    "stiffness in N/mm": (PLAIN, {"stiffness_normal": times(1e-3)}, "force_ratio"),
    "force in kN": (PLAIN, {"force_normal": times(1e-3)}, "force_ratio"),
    "tangential in N/mm": (PLAIN, {"stiffness_tangential": times(1e3)}, "stiffness_ratio"),
    "shear along normals": (
        MIXED,
        {"force_tangential": lambda _: SHEAR_ALONG_NORMAL},
        "shear_along_normal",
    ),
    "positions x and y": (
        MIXED,
        {"position": lambda position: position[:, [1, 0, 2]]},
        "no_touch",
    ),
}
"""Name -> network, what is changed in it, and the code of the refusal."""


@pytest.mark.parametrize("name", WRONG)
def test_contradictions_are_refused(name, tmp_path):
    """Refuse a network in memory as from a file, and name the file then."""
    network, changed_columns, code = WRONG[name]
    wrong = {column: change(getattr(network, column)) for column, change in changed_columns.items()}
    with pytest.raises(InputError) as error_info:
        replace(network, **wrong)
    assert error_info.value.code == code
    assert "\n" not in str(error_info.value)
    path = tmp_path / "x.network.h5"
    write_network(path, network.unchecked(**wrong))
    with pytest.raises(InputError) as refusal_of_file:
        read_network(path)
    assert refusal_of_file.value.code == code
    assert str(refusal_of_file.value) == f"{path}: {error_info.value}"


def test_a_refusal_has_the_number_of_the_particle():
    mass = changes.scaled(PLAIN.mass, [2, 3], 0)
    with pytest.raises(InputError) as error_info:
        replace(PLAIN, mass=mass)
    assert error_info.value.problem.startswith("particle 2 ")


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
"""Name -> kinds of column, and a change after which one is no table of numbers or has no number."""


@pytest.mark.parametrize("name", SPOILED)
def test_each_column_has_its_kind_its_shape_and_finite_numbers(name):
    """Refuse each by its name, except the column that sets the length of others."""
    names_of_zeros = ("shear_growth", "motion_shortening", "torque_shortening")
    zeros = {column: np.zeros(PLAIN.n_contacts) for column in names_of_zeros}
    held = np.zeros((PLAIN.n_particles, 6), bool)
    held[0, 2] = True
    cell = np.diag(PLAIN.cell_size)
    cell[1, 0] = 1e-12 * cell[0, 0]  # an angle below what the ends of contacts may be off by
    moment = np.zeros((PLAIN.n_contacts, 3))
    network = replace(changes.bonded(PLAIN), fixed=held, cell_vectors=cell, moment=moment, **zeros)
    kinds, change = SPOILED[name]
    for column_name, column in COLUMNS.items():
        if column.kind not in kinds:
            continue
        with pytest.raises(InputError) as error_info:
            replace(network, **{column_name: change(getattr(network, column_name))})
        error = error_info.value
        assert error.remedy
        assert "\n" not in str(error)
        sets_a_length = column_name in ("position", "particle_i") and name == "a row less"
        assert sets_a_length or error.problem.startswith(f"{column_name} ")


NO_NETWORK = {
    "nothing": ("position", lambda x: None),
    "no spheres": ("position", lambda x: x[:0]),
    "positions on their side": ("position", lambda x: x.T),
    "a negative mass": ("mass", times(-1)),
    "a negative radius": ("radius", with_first_row(-1e-3)),
    "indices with a point": ("particle_i", lambda x: x + 0.0),
    "indices that are yes or no": ("particle_i", lambda x: x > 0),
    "a third wall": ("particle_j", with_first_row(-3)),
    "a partner beyond the last": ("particle_j", with_first_row(30_000)),
    "a negative particle": ("particle_i", with_first_row(-1)),
    "no contacts but their normals": ("particle_i", lambda x: x[:0]),
    "itself without a period": ("particle_j", lambda x: PLAIN.particle_i),
    "normals of length 2": ("normal", times(2)),
    "negative stiffness": ("stiffness_normal", with_first_row(-1.0)),
    "no stiffness": ("stiffness_normal", times(0)),
    "negative tangential stiffness": ("stiffness_tangential", times(-1)),
    "sliding as shares": ("sliding", lambda x: 0.3 * x),
    "no say about periods": ("cell_periodic", lambda x: None),
    "notes that are a text": ("study", lambda x: "glass"),
    "no provenance": ("provenance", lambda x: None),
}
"""Name -> a column and its change, after which no packing can have the numbers."""


@pytest.mark.parametrize("name", NO_NETWORK)
def test_what_is_no_network_is_refused_when_it_is_made(name):
    """Refuse in one line, before anything computes with the numbers."""
    column, change = NO_NETWORK[name]
    with pytest.raises(InputError) as error_info:
        replace(PLAIN, **{column: change(getattr(PLAIN, column))})
    assert error_info.value.remedy
    assert "\n" not in str(error_info.value)


def test_numbers_of_other_widths_are_the_same_network():
    """Convert lists, integers of 2 bytes and unsigned indices of spheres."""
    converted = replace(
        PLAIN,
        position=PLAIN.position.tolist(),
        radius=PLAIN.radius.astype(">f8"),
        particle_i=PLAIN.particle_i.astype(np.uint16),
        particle_j=PLAIN.particle_j.astype(np.int16),
        cell_periodic=[1, 1, 0],
    )
    assert converted.position.dtype == np.float64
    assert converted.radius.dtype == np.float64
    assert converted.particle_i.dtype.kind == "i"
    assert converted.cell_periodic.dtype == bool
    np.testing.assert_array_equal(converted.branch, PLAIN.branch)


def test_a_contact_listed_twice_is_refused():
    m = CRYSTAL.n_contacts
    rows = np.append(np.arange(m), 3)
    with pytest.raises(InputError) as error_info:
        replace(CRYSTAL.some(rows))
    assert error_info.value.code == "contact_twice"
    assert error_info.value.problem.startswith(f"contacts 3 and {m} ")
    with refusal("contact_twice"):
        CRYSTAL.with_contacts(rows)


@pytest.mark.parametrize("periods", ["stated", "from levers"])
def test_a_contact_listed_from_both_ends_is_refused(periods):
    """Refuse that; a pair that touches through two periods, as in this crystal, is sound."""
    pair = ~CRYSTAL.with_wall
    reversed_contacts = changes.from_other_end(CRYSTAL, pair).with_contacts(pair)
    both = {
        name: np.concatenate([getattr(CRYSTAL, name), getattr(reversed_contacts, name)])
        for name in changes.PER_CONTACT
    }
    if periods == "from levers":
        both["cell_shift"] = None
    with refusal("contact_twice"):
        replace(CRYSTAL, **both)


def test_pairs_of_a_hundred_thousand_spheres_are_told_apart():
    """Number pairs in more than 32 bits.

    In 32 bits the pairs (0, b) and (2^15, b) of 2^17 - 2 spheres would have the same number.
    """
    n = 2**17 - 2
    rows = np.flatnonzero(~CRYSTAL.with_wall)[[0, 0]]
    position = np.zeros((n, 3))
    position[70_000, 0] = 2 * CRYSTAL.radius[0]
    position[2**15, 1] = 0.5 * CRYSTAL.radius[0]
    network = CRYSTAL.some(rows).unchecked(
        position=position,
        radius=np.full(n, CRYSTAL.radius[0]),
        particle_i=np.array([0, 2**15], np.int32),
        particle_j=np.array([70_000, 70_000], np.int32),
        cell_shift=np.zeros((2, 3), np.int8),
    )
    assert not list(check_pairs(network))


def two_spheres(overlap: float) -> Network:
    """Return two spheres of radius 1 m that overlap by `overlap`, m."""
    position = np.array([[2, 2, 2], [2, 2, 4 - overlap]])
    return Sample(position, np.full(2, 8.0), np.array([0, 8.0]), 0.1, radius=1.0).network()


@pytest.mark.parametrize(("overlap", "remarks"), [(0.1, 0), (0.25, 1), (0.6, 1)])
def test_soft_spheres_are_taken_and_remarked_on(overlap, remarks):
    network = two_spheres(overlap)
    assert network.n_contacts == 1
    assert [remark.code for remark in examine(network).remarks].count("very_soft") == remarks


def test_a_centre_on_the_surface_of_another_sphere_is_refused():
    """Refuse an overlap of one radius; diameters in place of radii overlap by that and more."""
    with refusal("deep_overlap"):
        two_spheres(1.0)


@pytest.mark.parametrize("n_contacts", [10, 100])
def test_shear_that_is_small_beside_the_mean_force_may_point_anywhere(n_contacts):
    """Check the direction from a millionth of the mean force on, however many contacts exist."""
    network = CRYSTAL.with_contacts(np.arange(n_contacts))
    shear = np.zeros((n_contacts, 3))
    along_normal = network.force_normal.mean() * network.normal[5]
    shear[5] = 0.9e-6 * along_normal
    replace(network, force_tangential=shear)
    shear[5] = 3e-6 * along_normal
    with pytest.raises(InputError) as error_info:
        replace(network, force_tangential=shear)
    assert error_info.value.code == "shear_along_normal"
    assert error_info.value.problem.startswith("contact 5 ")
