"""Networks whose parts contradict each other are refused; no sound one is."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import packings
import pytest

from modal.__main__ import main
from modal.packing import examples as gallery
from modal.packing.checks import _check_pairs
from modal.packing.columns import SOURCE_WALL
from modal.packing.network import Network
from modal.packing.network_file import read_network, write_network
from modal.packing.plausibility import plausibility
from modal.tools.errors import InputError

CRYSTAL = gallery.fcc(cells=(2, 2, 8))


@pytest.mark.parametrize("digits", [17, 7])
@pytest.mark.parametrize("name", packings.SOUND)
def test_sound_networks_are_read(name, digits, tmp_path):
    """As they are, in numbers of 7 digits, and without what is optional."""
    network = packings.SOUND[name]()
    network = network if digits == 17 else packings.rounded(network, digits)
    path = tmp_path / "x.network.h5"
    for known in (network, packings.bare(network)):
        write_network(path, known)
        assert read_network(path).n_contacts == network.n_contacts


def changed(network: Network, **columns) -> Network:
    """The network with functions of its columns in their place."""
    return replace(network, **{name: f(getattr(network, name)) for name, f in columns.items()})


def times(factor: float):
    return lambda data: factor * data


def permuted(data: np.ndarray) -> np.ndarray:
    return np.random.default_rng(1).permutation(data)


def first(value):
    """The column with another first row."""

    def change(data: np.ndarray) -> np.ndarray:
        return np.concatenate([np.asarray(value, data.dtype)[None], data[1:]])

    return change


def inner(data: np.ndarray) -> np.ndarray:
    """Walls half a radius inside the packing."""
    return data + np.array([1.5, -1.5]) * CRYSTAL.radius[0]


STUDIED = CRYSTAL
PLAIN = replace(CRYSTAL, study={})
MIXED = packings.polydisperse()
ROUND = packings.polydisperse(periodic_z=True)
WRONG = {
    # Each has the network, what is changed, and what the refusal must say.
    "normals permuted": (PLAIN, {"normal": permuted}, "normal"),
    "normals turned round": (PLAIN, {"normal": times(-1)}, "normal"),
    "normals 2 degrees off": (
        MIXED,
        {"normal": lambda n: _turned(n, np.radians(2))},
        "normal",
    ),
    "levers permuted": (PLAIN, {"lever_i": permuted}, "lever"),
    "levers of 0.7": (PLAIN, {"lever_i": times(0.7), "lever_j": times(0.7)}, "lever"),
    "levers of 0.9": (PLAIN, {"lever_i": times(0.9), "lever_j": times(0.9)}, "lever"),
    "levers changed places": (MIXED, {"lever_i": lambda _: -MIXED.lever_j}, "lever"),
    "no levers": (PLAIN, {"lever_i": times(0), "lever_j": times(0)}, "lever"),
    "lever of a wall": (PLAIN, {"lever_j": lambda _: -PLAIN.lever_i}, "is with a wall"),
    "radii are diameters": (PLAIN, {"radius": times(2), "inertia": times(4)}, "overlap"),
    "diameters are radii": (PLAIN, {"radius": times(0.5), "inertia": times(0.25)}, "touch"),
    "radii permuted": (MIXED, {"radius": permuted}, "particle|contact"),
    "inertia of 1e6": (PLAIN, {"inertia": times(1e6)}, "inertia"),
    "inertia of 10": (PLAIN, {"inertia": times(10)}, "inertia"),
    "inertia of 0.1": (PLAIN, {"inertia": times(0.1)}, "inertia"),
    "inertia from diameters": (PLAIN, {"inertia": times(4)}, "inertia"),
    "inertia permuted": (MIXED, {"inertia": permuted}, "inertia"),
    "one mass in g": (
        PLAIN,
        {
            "mass": first(1e3 * PLAIN.mass[0]),
            "inertia": first(1e3 * PLAIN.inertia[0]),
        },
        "lighter or heavier",
    ),
    "masses in g": (STUDIED, {"mass": times(1e3), "inertia": times(1e3)}, "kg/m"),
    "no periods": (PLAIN, {"cell_shift": times(0)}, "touch|normal"),
    "periods of the other sign": (PLAIN, {"cell_shift": times(-1)}, "touch|normal"),
    "a cell half as wide": (PLAIN, {"cell_size": times(0.5)}, "touch|normal|overlap"),
    "walls in one place": (PLAIN, {"wall_position": times(0)}, "wall"),
    "walls changed places": (PLAIN, {"wall_position": lambda w: w[::-1]}, "wall"),
    "walls inside the packing": (PLAIN, {"wall_position": inner}, "beyond a wall"),
    "walls far away": (
        PLAIN,
        {"wall_position": lambda w: w + [-0.01, 0.01]},
        "touch",
    ),
    "walls of a period": (ROUND, {"wall_position": times(0)}, "bounds of the period"),
    "no period along z": (
        ROUND,
        {"cell_periodic": lambda _: np.array([True, True, False])},
        "not periodic",
    ),
    "negative width": (gallery.column(3), {"cell_size": lambda _: np.array([-1.0, 0, 0])}, "size"),
    "overlaps in mm": (PLAIN, {"overlap": times(1e3)}, "overlap"),
    "stiffness in N/mm": (PLAIN, {"stiffness_normal": times(1e-3)}, "force over stiffness"),
    "force in kN": (PLAIN, {"force_normal": times(1e-3)}, "force over stiffness"),
    "tangential in N/mm": (PLAIN, {"stiffness_tangential": times(1e3)}, "tangential"),
    "shear along normals": (
        MIXED,
        {"force_tangential": lambda _: 0.1 * MIXED.force_normal[:, None] * MIXED.normal},
        "tangential force",
    ),
    "shear forces permuted": (MIXED, {"force_tangential": permuted}, "tangential force"),
    "positions permuted": (PLAIN, {"position": permuted}, "particle|contact"),
    "positions x and y": (MIXED, {"position": lambda p: p[:, [1, 0, 2]]}, "contact"),
    "another packing's particles": (
        MIXED,
        {"position": lambda _: packings.polydisperse(seed=2).position},
        "contact",
    ),
}


def _turned(normal: np.ndarray, angle: float) -> np.ndarray:
    across = np.cross(normal, [0.3, 0.4, 0.5])
    across /= np.linalg.norm(across, axis=1)[:, None]
    return np.cos(angle) * normal + np.sin(angle) * across


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


def part_of(length: int):
    return lambda data: data[:length]


NO_NETWORK = {
    # What is no table of numbers, or no number that a packing can have: a column, what is done.
    "lists of unequal lengths": ("position", lambda x: [[0.0], *x.tolist()[1:]]),
    "a text": ("position", lambda x: "positions"),
    "nothing": ("position", lambda x: None),
    "no spheres": ("position", part_of(0)),
    "a sphere too few": ("position", part_of(-1)),
    "a radius too few": ("radius", part_of(-1)),
    "one radius for all": ("radius", lambda x: 1e-3),
    "positions in a plane": ("position", lambda x: x[:, :2]),
    "positions on their side": ("position", lambda x: x.T),
    "complex positions": ("position", lambda x: x + 0j),
    "a place that is no number": ("position", first([0, np.nan, 0])),
    "a mass that is no number": ("mass", first(np.nan)),
    "a mass of zero": ("mass", first(0.0)),
    "a negative mass": ("mass", times(-1)),
    "an inertia of zero": ("inertia", times(0)),
    "an infinite radius": ("radius", first(np.inf)),
    "a negative radius": ("radius", first(-1e-3)),
    "indices with a point": ("particle_i", lambda x: x + 0.0),
    "indices of halves": ("particle_j", lambda x: x + 0.5),
    "indices that are yes or no": ("particle_i", lambda x: x > 0),
    "indices of one more": ("particle_i", lambda x: x + 1),
    "a third wall": ("particle_j", first(-3)),
    "a partner beyond the last": ("particle_j", first(30_000)),
    "a negative particle": ("particle_i", first(-1)),
    "a contact too few": ("particle_j", part_of(-1)),
    "no contacts but their normals": ("particle_i", part_of(0)),
    "itself without a period": ("particle_j", lambda x: PLAIN.particle_i),
    "normals of length 2": ("normal", times(2)),
    "normals of length 0": ("normal", times(0)),
    "a normal that is no number": ("normal", first([np.nan, 0, 1])),
    "normals too few": ("normal", part_of(-1)),
    "a lever that is no number": ("lever_i", first([0, 0, np.nan])),
    "levers that are numbers": ("lever_i", lambda x: x[:, 0]),
    "negative stiffness": ("stiffness_normal", first(-1.0)),
    "all stiffnesses negative": ("stiffness_normal", times(-1)),
    "no stiffness": ("stiffness_normal", times(0)),
    "infinite stiffness": ("stiffness_normal", first(np.inf)),
    "negative tangential stiffness": ("stiffness_tangential", times(-1)),
    "tangential stiffness of no number": ("stiffness_tangential", first(np.nan)),
    "stiffness of the first alone": ("stiffness_tangential", part_of(1)),
    "a force that is no number": ("force_normal", first(np.nan)),
    "a shear force that is a number": ("force_tangential", lambda x: x[:, 0]),
    "an overlap that is no number": ("overlap", first(np.nan)),
    "sliding as shares": ("sliding", lambda x: 0.3 * x),
    "sliding of the first alone": ("sliding", part_of(1)),
    "halves of periods": ("cell_shift", lambda x: x / 2),
    "periods of two axes": ("cell_shift", lambda x: x[:, :2]),
    "a growth of no number": ("shear_growth", lambda x: np.full(PLAIN.n_contacts, np.nan)),
    "a cell of two widths": ("cell_size", part_of(2)),
    "an infinite cell": ("cell_size", lambda x: x + np.inf),
    "periods that are numbers": ("cell_periodic", lambda x: x * 1.0),
    "no say about periods": ("cell_periodic", lambda x: None),
    "one wall": ("wall_position", part_of(1)),
    "a wall that is nowhere": ("wall_position", first(np.nan)),
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


def test_arrays_that_others_can_write_to_are_copied():
    """Also a locked view of what is not locked."""
    whole = PLAIN.mass.copy()
    view = whole.view()
    view.flags.writeable = False
    made = replace(PLAIN, mass=view)
    whole[:] = 0
    np.testing.assert_array_equal(made.mass, PLAIN.mass)


def test_a_contact_listed_twice_is_refused():
    """In the same or the other direction; a pair that touches through two periods is sound."""
    m = CRYSTAL.n_contacts
    rows = np.append(np.arange(m), 3)
    with pytest.raises(InputError, match=f"contacts 3 and {m} are the same"):
        replace(CRYSTAL.some(rows))
    with pytest.raises(InputError, match="selected twice"):
        CRYSTAL.with_contacts(rows)
    pair = ~CRYSTAL.with_wall
    other = CRYSTAL.unchecked(
        particle_i=CRYSTAL.particle_j,
        particle_j=CRYSTAL.particle_i,
        normal=-CRYSTAL.normal,
        lever_i=CRYSTAL.lever_j,
        lever_j=CRYSTAL.lever_i,
        cell_shift=-CRYSTAL.cell_shift,
        force_tangential=-CRYSTAL.force_tangential,
    ).some(pair)
    other = replace(other)
    columns = ("particle_i", "particle_j", "normal", "lever_i", "lever_j", "cell_shift")
    columns += ("stiffness_normal", "stiffness_tangential", "overlap", "sliding")
    columns += ("force_normal", "force_tangential")
    both = {
        name: np.concatenate([getattr(CRYSTAL, name), getattr(other, name)]) for name in columns
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
    _check_pairs(many)


def test_info_tells_of_what_no_check_can():
    """Law, pulling contacts, balance and densities, in sound and in wrong networks."""
    sound = plausibility(packings.sheared())
    assert sound["law"] == "Hertz" and sound["pulling_contacts"] == 0
    assert all("diameters wide" in remark for remark in sound["remarks"])
    # At rest to 1e-9 in YADE; the compact form keeps forces to the round-off of overlaps.
    assert sound["net_force_over_contact_force"] < 1e-6
    wrong = plausibility(changed(packings.sheared(), stiffness_normal=permuted))
    assert wrong["law"] == "unknown" and "no law" in wrong["remarks"][-1]
    wrong = plausibility(changed(packings.sheared(), force_normal=permuted))
    assert wrong["law"] == "unknown" and wrong["net_force_over_contact_force"] > 0.1
    linear = changed(packings.sheared(), stiffness_normal=times(2 / 3))
    assert plausibility(linear)["law"] == "linear"
    assert plausibility(packings.cohesive())["pulling_contacts"] == 1
    low, _, high = plausibility(MIXED)["density_kg_per_m3"]
    assert (low, high) == pytest.approx((2230, 7850))


def test_depth_of_overlaps_and_the_number_of_what_is_wrong():
    """Two spheres overlap by 0.25 and by 0.35 of a radius: where 0.3 is the limit."""

    def pair(overlap: float) -> Network:
        half = np.array([0, 0, 1 - overlap / 2])
        return Network(
            position=np.array([[2, 2, 2], [2, 2, 4 - overlap]]),
            radius=np.ones(2),
            mass=np.full(2, 4e3),
            inertia=np.full(2, 1.6e3),
            particle_i=np.array([0]),
            particle_j=np.array([1]),
            normal=np.array([[0, 0, 1.0]]),
            lever_i=half[None],
            lever_j=-half[None],
            stiffness_normal=np.ones(1),
            stiffness_tangential=np.ones(1),
            cell_size=np.full(3, 8.0),
            cell_periodic=np.ones(3, bool),
            wall_position=np.array([0, 8.0]),
        )

    assert pair(0.25).n_contacts == 1
    with pytest.raises(InputError, match="overlap by more than 0.3 of the smaller radius"):
        pair(0.35)
    with pytest.raises(InputError, match="^particle 2 has mass <= 0"):
        changed(PLAIN, mass=lambda mass: np.where(np.arange(len(mass)) == 2, 0, mass))
    along = 1e-3 * PLAIN.force_normal.mean() * PLAIN.normal
    with pytest.raises(InputError, match="^contact 5 has a tangential force along its normal"):
        changed(
            PLAIN,
            force_tangential=lambda _: np.where(np.arange(len(along))[:, None] == 5, along, 0),
        )


def test_contacts_that_are_left_out_are_told_with_their_number():
    """Three between spheres and two with the lower wall, of a crystal that has all."""
    crystal = replace(PLAIN, study={})
    pairs = np.flatnonzero(crystal.particle_j >= 0)[:3]
    walls = np.flatnonzero(crystal.particle_j == SOURCE_WALL)[:2]
    left = np.setdiff1d(np.arange(crystal.n_contacts), [*pairs, *walls])
    remarks = plausibility(packings.with_contacts(crystal, left))["remarks"]
    assert any(remark.startswith("5 places where spheres, or wall, overlap") for remark in remarks)
    assert not any("places where" in remark for remark in plausibility(crystal)["remarks"])


@pytest.mark.parametrize("radius", [1e-3, 3.1e-4, 7e-6])
def test_round_off_of_spheres_that_just_touch_is_no_fault(radius):
    """Their overlaps are round-off as well; a millionth of a radius is not."""
    column = gallery.column(10, 1e-30, radius)
    stiff = replace(column, stiffness_normal=np.full(11, 1e6), overlap=None)
    assert not [text for text in plausibility(stiff)["remarks"] if "end in one point" in text]
    longer = plausibility(changed(stiff, lever_i=times(1 + 1e-6)))["remarks"]
    assert [text for text in longer if "end in one point" in text]


def _remark(network, words, waves=False):
    """The numbers in the one remark that has these words, if there is one."""
    told = [r for r in plausibility(network, waves=waves)["remarks"] if words in r]
    return [float(x) for x in re.findall(r"[-+.e\d]+", " ".join(told)) if re.search(r"\d", x)][:1]


def test_shape_and_order_are_remarked_on_with_their_numbers():
    """A crystal of 4 diameters is sound; stirred it is not, nor is half a crystal random."""
    crystal = gallery.fcc(cells=(4, 4, 60))
    diameter, random = 2 * crystal.radius[0], np.random.default_rng(1)
    assert plausibility(crystal, waves=True)["remarks"] == _long(crystal)
    stirred = crystal.position + 0.3 * diameter * random.standard_normal(crystal.position.shape)
    half = np.where(crystal.position[:, 2:] < crystal.length / 2, crystal.position, stirred)
    for position, share in ((half, 50), (stirred, None)):
        network = crystal.unchecked(position=position)
        (width,) = _remark(network, "diameters wide")
        assert width == pytest.approx(crystal.cell_size[0] / diameter, abs=0.05)
        # Of 60 layers two at the edge of the stirred half may count either way.
        found = _remark(network, "crystalline share of the bulk")
        assert found == ([] if share is None else [pytest.approx(share, abs=4)])
        (length,) = _remark(network, "diameters long", waves=True)
        assert length == pytest.approx(crystal.length / diameter, abs=0.05)
        assert not _remark(network, "diameters long")


def _long(network):
    """What is left to say of a crystal for waves."""
    return [r for r in plausibility(network, waves=True)["remarks"] if "diameters long" in r]


@pytest.mark.parametrize("sliding", [True, False])
def test_balance_and_sliding_springs_are_told_with_their_numbers(sliding):
    """A push on one sphere, mean and largest by hand; friction 0 has sliding contacts, and springs
    along them in modes and waves."""
    rest = packings.sheared()
    assert not _remark(rest, "not in balance")
    force = rest.force_normal.copy()
    force[0] *= 2
    pushed = replace(rest, force_normal=force)
    contact = np.hypot(force, np.linalg.norm(rest.force_tangential, axis=1)).mean()
    both = 1 if rest.particle_j[0] < 0 else 2
    (mean,) = _remark(pushed, "not in balance")
    assert mean == pytest.approx(both * force[0] / 2 / rest.n_particles / contact, rel=0.05)
    told = plausibility(replace(rest, sliding=np.full(rest.n_contacts, sliding)))
    assert ("springs_of_sliding_contacts" in told) == sliding
    if sliding:
        ratio = rest.stiffness_tangential[0] / rest.stiffness_normal[0]
        assert f"{ratio:.3g} of the normal" in told["springs_of_sliding_contacts"]


@pytest.mark.parametrize(
    "command",
    [
        "modes --lowest 3",
        "count --at 3e4",
        "density --resolution 5e4 --tolerance 0.5",
        "wave --duration 2e-5",
        "response --highest 2e4 --resolution 1e4",
    ],
)
def test_every_command_passes_the_remarks_on(command, tmp_path, capsys):
    """On standard error, a line each, and nothing about a sound network."""
    name, *options = command.split()
    for network, said in (
        (packings.sheared(), []),
        (changed(packings.sheared(), stiffness_normal=permuted), ["follow no law"]),
    ):
        path = tmp_path / "some.network.h5"
        write_network(path, network)
        assert main([name, str(path), *options, "--json"]) == 0
        lines = capsys.readouterr().err.splitlines()
        shape = ("diameters wide", "diameters long")
        remarks = [line for line in lines if line.startswith(f"{path}: ")]
        remarks = [line for line in remarks if not any(words in line for words in shape)]
        assert bool(remarks) == bool(said)
        assert all(any(text in line for line in remarks) for text in said)


def test_a_column_without_a_cell_has_no_width():
    assert replace(gallery.column(3), cell_size=np.zeros(3)).n_contacts == 4
