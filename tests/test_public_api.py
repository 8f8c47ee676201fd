"""What `import modal` offers: the same digits as the command line, pictures, examples that run."""

import ast
import doctest
import hashlib
import re
import sys
import time
from copy import copy, deepcopy
from dataclasses import FrozenInstanceError, replace
from inspect import signature
from pathlib import Path
from pickle import dumps, loads

import numpy as np
import pytest
from refusals import refusal

import modal
from analysis.measurement import measure
from modal.elasticity.moduli import ElasticModuli
from modal.modes.damped import decay_rates
from modal.modes.density import DensityOfStates
from modal.modes.mode_set import ModeSet, read_modes, write_modes
from modal.packing.network import write_network
from modal.packing.sample import Sample
from modal.system.damping import ContactDamping
from modal.waves.propagate import LinearWave
from modal.waves.response import Response
from modal.waves.signals import Signals
from modal.waves.sources import Point

OFFERED = {
    *("InputError", "Network", "read", "fcc", "random_packing", "eigenmodes", "count_modes"),
    *("density_of_states", "propagate", "frequency_response", "FccLattice", "elastic_moduli"),
    *("describe", "frequency_sensitivity", "moduli_sensitivity"),
    *("from_spheres", "write", "stiffness_matrix", "mass_matrix"),
}
CODES_OF_WALLS = {"SOURCE_WALL", "RECEIVER_WALL"}


@pytest.fixture(scope="module")
def packing(tmp_path_factory):
    """A packing of 100 spheres with some rattlers, in memory and as a file."""
    network = modal.random_packing(spheres=100, seed=3, aspect=2.5)
    path = tmp_path_factory.mktemp("packing") / "random.network.h5"
    write_network(path, network)
    return network, str(path)


def test_the_public_names_and_nothing_else():
    assert set(modal.__all__) == OFFERED | CODES_OF_WALLS
    assert all(hasattr(modal, name) for name in modal.__all__) and set(dir(modal)) >= OFFERED
    with pytest.raises(AttributeError, match="no attribute 'magic'"):
        modal.magic  # noqa: B018


@pytest.mark.two_ways
def test_modes_as_the_command_line_prints_them(packing, printed):
    network, path = packing
    for options, asked in (
        (["--lowest", "7"], {"lowest": 7}),
        (["--highest", "3"], {"highest": 3}),
        (["--below", "2e4"], {"below": 2e4}),
        (["--between", "2e4", "3e4"], {"between": (2e4, 3e4)}),
        (["--all", "--translations-only"], {"all": True, "translations_only": True}),
        ([], {}),
    ):
        said, found = printed("modes", path, *options), modal.eigenmodes(network, **asked)
        assert said["frequency_hz"] == found.frequency.tolist(), options
        assert said["certified"] == found.certified and said["missing"] == found.missing
        assert said["floppy_modes"] == found.floppy_modes > 0
        assert found.mode_shape.shape == (len(found.frequency), network.n_particles, 6)
        assert found.chi_z.shape == found.frequency.shape


@pytest.mark.two_ways
def test_numbers_as_the_command_line_prints_them(packing, printed):
    """count, density, response, wave and lattice."""
    network, path = packing
    at = ["1e4", "50000", "1.2e5"]
    counts = printed("count", path, "--at", *at)["count_below"]
    found = modal.count_modes(network, [float(f) for f in at])
    assert list(counts.values()) == found.tolist() and found.dtype.kind == "i"
    one = modal.count_modes(network, 5e4)
    assert one == found[1] and isinstance(one, int)

    said = printed("density", path, "--resolution", "1e4", "--at", *at)
    states = modal.density_of_states(network, resolution=1e4)
    value, _ = states.count_below([float(f) for f in at])
    assert list(said["estimated_count_below"].values()) == value[:, 6].tolist()
    assert said["floppy_modes"] == pytest.approx(states.zero_modes.sum(), rel=1e-12)

    said = printed("response", path, "--highest", "3e4")
    response = modal.frequency_response(network, highest=3e4)
    assert said["gain_maxima_hz"] == response.gain_maxima().tolist()

    said = printed("wave", path, "--duration", "5e-5")
    wave = modal.propagate(network, duration=5e-5)
    assert said["largest_displacement_m"] == abs(wave.signals.chain_displacement).max()

    crystal = modal.FccLattice(stress=3e5)
    assert printed("lattice", "--stress", "3e5")["f_low_pass_hz"] == crystal.low_pass_frequency


@pytest.mark.parametrize(
    "given",
    [
        {"spheres": 100, "seed": 3},
        {"spheres": 100, "stress": 2e5, "seed": 2, "aspect": 1.3, "friction": 0.4},
        {"spheres": 120, "sizes": ["two", 2, 0.5], "densities": [2230, 7800]},
    ],
)
def test_random_packings_as_the_command_line_packs_them(given, tmp_path, printed):
    """Bit by bit, with the shear forces of the history and what the file notes of it."""
    network = modal.random_packing(**given)
    words = [
        word
        for name, value in ({"stress": 1e5} | given).items()
        for word in (f"--{name}", *(value if isinstance(value, list) else [value]))
    ]
    files = printed("pack", *map(str, words), "-o", str(tmp_path))["samples"]
    packed = modal.read([path for path, at in files.items() if at == given.get("stress", 1e5)][0])
    for name in ("position", "particle_i", "force_normal", "force_tangential"):
        assert (getattr(packed, name) == getattr(network, name)).all()
    untimed = [name for name in packed.study if not name.startswith("seconds")]
    assert all(np.all(packed.study[name] == network.study[name]) for name in untimed)


def test_a_packing_says_what_it_is(packing, printed):
    """Each line of `describe` has the number that `info` has."""
    network, path = packing
    said, text = printed("info", path), modal.describe(network)
    shown = dict(re.findall(r"^(\w.+?)  +([\d.]+)", text, re.MULTILINE))
    for line in ("contacts", "void ratio", "coordination number", "rattlers", "floppy modes"):
        assert float(shown[line]) == pytest.approx(said[line.replace(" ", "_")], abs=5e-4), line


def test_products_of_another_packing_are_refused(packing, tmp_path):
    """As many spheres, of the same masses, in other places; files tell it too."""
    network, other = packing[0], modal.random_packing(spheres=100, seed=4)
    modes, path = modal.eigenmodes(network, lowest=3), tmp_path / "a.modes.h5"
    write_modes(path, modes)
    for found in (modes, read_modes(path)):
        for wrong in (other, modal.fcc(cells=(1, 1, 8))):
            refuse_modes(found, wrong)
        assert found.participation(replace(network)).shape == (3,)


def refuse_modes(modes, network):
    """What needs the network of a list of modes refuses this one."""
    with pytest.raises(modal.InputError) as refused:
        modes.participation(network)
    assert refused.value.code == "modes_of_another_network"
    with pytest.raises(modal.InputError) as refused:
        decay_rates(modes, network, ContactDamping(0.1, 0.1))
    assert refused.value.code == "modes_of_another_network"


CHANGED = {
    "stiffness_normal": lambda network: network.stiffness_normal * 1.001,
    "stiffness_tangential": lambda network: network.stiffness_tangential * 0.5,
    "force_normal": lambda network: network.force_normal * 1.001,
    "sliding": lambda network: np.arange(network.n_contacts) == 7,
    "cell_size": lambda network: network.cell_size * (1 + 1e-9),
    "cell_shift": lambda network: None,
    "stiffness_rolling and twisting": None,
    "contacts": None,
}
"""What a network of the same spheres may have otherwise."""


@pytest.mark.parametrize("what", CHANGED)
def test_modes_of_the_same_spheres_with_other_contacts_are_refused(packing, what):
    """Their shapes are other ones, although no sphere has moved."""
    network = packing[0]
    if what == "contacts":
        other = network.with_contacts(slice(1, None))
    elif what == "stiffness_rolling and twisting":
        none = np.zeros(network.n_contacts)
        other = replace(network, stiffness_rolling=none, stiffness_twisting=none)
    else:
        other = replace(network, **{what: CHANGED[what](network)})
    assert other.fingerprint != network.fingerprint
    refuse_modes(modal.eigenmodes(network, lowest=3), other)


def test_modes_of_a_network_are_known_whatever_its_file_and_notes(packing, tmp_path):
    """Written and read, copied, with other notes, and where contacts slide: the same network."""
    network = packing[0]
    write_network(tmp_path / "a.network.h5", network)
    sliding = replace(network, sliding=np.arange(network.n_contacts) % 5 == 0)
    modes = modal.eigenmodes(network, lowest=3)
    for same in (
        modal.read(tmp_path / "a.network.h5"),
        deepcopy(network),
        replace(network, study={"seed": 7}),
        replace(network, particle_i=network.particle_i.astype("i4")),
    ):
        assert modes.participation(same).shape == (3,)
    of_sliding = modal.eigenmodes(sliding, lowest=3, sliding="slip")
    assert of_sliding.participation(sliding).shape == (3,)
    refuse_modes(of_sliding, network)


def test_modes_of_earlier_files_know_their_packing_by_its_spheres(packing):
    """Files of version 0.1.0 hold the digest of position, radius, mass and inertia by rows."""
    network = packing[0]
    rows = np.column_stack([network.position, network.radius, network.mass, network.inertia])
    modes = modal.eigenmodes(network, lowest=3)
    modes.attributes["packing"] = hashlib.sha256(rows.tobytes()).hexdigest()
    assert modes.participation(network).shape == (3,)
    refuse_modes(modes, modal.random_packing(spheres=100, seed=4))


def test_pictures_show_the_numbers_and_draw_where_they_are_told(packing):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    network, _ = packing
    modes = modal.eigenmodes(network)
    states = modal.density_of_states(network, resolution=1e4, tolerance=0.1)
    wave = modal.propagate(network, duration=3e-5)
    gain, crystal = modal.frequency_response(network, highest=3e4), modal.FccLattice()
    for result in (modes, states, wave, wave.signals, gain, crystal):
        _, ax = pyplot.subplots()
        assert result.plot(ax) is ax and ax.get_xlabel() and ax.get_ylabel()
        assert result.plot().figure is not ax.figure
    shown = modes.plot().lines[0].get_xydata() * [1e3, 1]
    assert shown == pytest.approx(np.column_stack([modes.frequency, modes.chi_z]))
    # All, translations, rotations; about them all a band as wide as the error.
    value, error = (1e3 * each for each in states.density(states.grid()))
    kinds, drawn = (value[:, 6], value[:, :3].sum(axis=1), value[:, 3:6].sum(axis=1)), states.plot()
    for line, kind in zip(drawn.lines, kinds, strict=True):
        wanted = np.column_stack([states.grid() / 1e3, kind])
        assert line.get_xydata() == pytest.approx(wanted, rel=1e-12)
    band = drawn.collections[0].get_paths()[0].vertices[:, 1]
    assert error[:, 6].max() > 0
    assert np.array_equal(np.unique(band), np.unique(kinds[0] + np.outer([-1, 1], error[:, 6])))
    assert (gain.plot().lines[0].get_ydata() == gain.gain).all()
    # The last line is Eq. 9, whose end at the zone's edge is f_low-pass, Eq. 10.
    end = crystal.plot().lines[-1].get_ydata()[-1]
    assert end * 1e3 == pytest.approx(crystal.low_pass_frequency, rel=1e-12)
    drawn = np.asarray(wave.plot().collections[0].get_array())
    assert abs(drawn).max() == pytest.approx(1e9 * abs(wave.signals.layer_displacement).max())
    pyplot.close("all")


COLUMN = modal.fcc(cells=(1, 1, 4))
OF_NETWORK = (
    *(modal.eigenmodes, modal.describe, modal.density_of_states, modal.frequency_response),
    modal.elastic_moduli,
)
NO_WAVES = [
    {"tolerance": -0.5},
    {"tolerance": 0},
    {"tolerance": 1.0},
    {"tolerance": 1.5},
    {"interval": 0.0},
    {"interval": 2e-5},
    {"duration": np.inf},
]
WRONG = [
    (modal.eigenmodes, {"lowest": 3, "highest": 3}, "mode_choice", "highest"),
    (modal.eigenmodes, {"lowest": 3, "solver": "magic"}, "unknown_word", "'magic'"),
    (modal.eigenmodes, {"lowest": 10_000}, "mode_count", "10000"),
    (modal.eigenmodes, {"lowest": 2.5}, "argument", "lowest"),
    (modal.eigenmodes, {"between": (1.0, 2.0, 3.0)}, "interval", ""),
    (modal.eigenmodes, {"between": 1e4}, "argument", "between"),
    (modal.eigenmodes, {"all": "no"}, "argument", "'no'"),
    (modal.eigenmodes, {"below": np.inf}, "interval", ""),
    (modal.count_modes, {"frequency": [np.nan]}, "frequency", "nan"),
    (modal.count_modes, {"frequency": [1e3, -5]}, "frequency", "-5"),
    (modal.count_modes, {"frequency": "low"}, "frequency", "'low'"),
    (modal.count_modes, {"frequency": 1e5, "sliding": "yes"}, "unknown_word", "slip"),
    (modal.eigenmodes, {"pre_stress": "some"}, "unknown_word", "'some'"),
    (modal.propagate, {"duration": "long"}, "argument", "duration"),
    (modal.propagate, {"duration": 1e-5, "motion": "pulse"}, "argument", "modal.waves.motions"),
    *((modal.propagate, {"duration": 1e-5} | x, "interval_or_tolerance", "") for x in NO_WAVES),
    (modal.propagate, {"duration": 1e-5, "direction": 5}, "argument", "direction"),
    (modal.propagate, {"duration": 1e-5, "direction": "w"}, "direction", "'w'"),
    (modal.fcc, {"cells": 3}, "argument", "cells"),
    (modal.fcc, {"cells": (1, 1, np.inf)}, "cells", "inf"),
    (modal.fcc, {"cells": (1, 1, 10**9)}, "too_large", "1000000000"),
    (modal.fcc, {"stress": -1.0}, "stress", "-1"),
    (measure, {"packing": COLUMN, "quantities": iter(["v_p"])}, "argument", "quantities"),
    (modal.random_packing, {"sizes": "two"}, "argument", "sizes"),
    (modal.random_packing, {"spheres": 10**9, "friction": 0.3}, "too_large", "1000000000"),
    (modal.propagate, {"duration": 1e-5, "source": Point(1.5)}, "no_such_sphere", "1.5"),
    (modal.random_packing, {"seed": 2**63}, "seed", "9223372036854775808"),
    (modal.random_packing, {"spheres": 100, "sizes": ("two", 2)}, "sizes", ""),
    (modal.random_packing, {"spheres": 100, "sizes": ("two", 20, 0.5)}, "sizes", ""),
    (modal.random_packing, {"spheres": 100, "sizes": ("lognormal", "x")}, "sizes", ""),
    (modal.random_packing, {"spheres": 100, "sizes": ("three", 1)}, "sizes", ""),
    (modal.random_packing, {"spheres": 100, "sizes": ("two", 9, 0.01)}, "single_size", ""),
    (modal.random_packing, {"sizes": np.full(3, np.nan)}, "sizes", ""),
    (modal.fcc, {"radius": 1e-300}, "radius", "1e-300"),
    (modal.random_packing, {"friction": 2.0}, "friction", "2"),
    *((f, {"network": "mine.network.h5"}, "argument", "network") for f in OF_NETWORK),
    (modal.read, {"path": 3}, "argument", "path"),
    (modal.read, {"path": __file__}, "unknown_file", "test_public_api.py"),
]
"""A call, its arguments, the code of its refusal, and a name in its line."""


@pytest.mark.parametrize(("call", "arguments", "code", "name"), WRONG)
def test_a_wrong_argument_is_refused_in_one_line(call, arguments, code, name):
    """The message names arguments of Python, not options of the command line."""
    if "network" in signature(call).parameters:
        arguments = {"network": COLUMN} | arguments
    with refusal(code, name) as raised:
        call(**arguments)
    assert "--" not in str(raised.value)


def test_names_are_loaded_from_the_modules_that_type_checkers_see():
    """The imports for type checkers and those at run time are written separately."""
    (checked_block,) = (
        node for node in ast.parse(Path(modal.__file__).read_text()).body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )  # fmt: skip
    modules = {}
    for node in checked_block.body:
        (alias,) = node.names
        is_renamed = alias.asname != alias.name
        modules[alias.asname] = node.module + f":{alias.name}" * is_renamed
    assert modules == modal._MODULES


def test_a_network_does_not_change():
    """Neither its fields nor their entries; another one by `replace` has no results of it."""
    mass = np.full(8, 2e-5)
    crystal = modal.fcc(cells=(1, 1, 8))
    network = replace(crystal, mass=mass, inertia=0.4 * mass * crystal.radius**2)
    with pytest.raises(FrozenInstanceError):
        network.mass = mass
    with pytest.raises(ValueError, match="read-only"):
        network.mass[0] = 1.0
    with pytest.raises(ValueError, match="WRITEABLE"):
        network.mass.flags.writeable = True
    slow = modal.eigenmodes(network, all=True).frequency
    mass[0] = 3e-5  # whoever made the array may go on with it, the network keeps its own
    assert (network.mass == 2e-5).all()
    heavier = replace(network, mass=4 * network.mass, inertia=4 * network.inertia, study={})
    halved = modal.eigenmodes(heavier, all=True).frequency
    assert halved == pytest.approx(slow / 2, rel=1e-9, abs=1e-6 * slow[-1])
    heavier.study["density"] = 1.0
    assert "stress" in network.study


@pytest.mark.parametrize("copied", [copy, deepcopy, lambda network: loads(dumps(network))])
def test_a_copy_of_a_network_does_not_change_either(copied):
    """It has the same numbers, locked as well, and makes its results itself."""
    network = modal.fcc(cells=(1, 1, 8))
    modes = modal.eigenmodes(network, lowest=3)
    twin = copied(network)
    with pytest.raises(ValueError, match="read-only"):
        twin.mass[0] = 1.0
    assert (twin.mass == network.mass).all() and not twin._cache and network._cache
    assert (modal.eigenmodes(twin, lowest=3).frequency == modes.frequency).all()


RESULTS = (ModeSet, Signals, Response, DensityOfStates, ElasticModuli, Sample, ContactDamping)


@pytest.mark.parametrize(
    "thing",
    [modal, LinearWave, *(getattr(modal, name) for name in sorted(OFFERED)), *RESULTS],
    ids=lambda thing: thing.__name__,
)
def test_examples_in_docstrings(thing):
    """Each public function and class has one, of a second at most; defaults are what they say."""
    home = sys.modules[getattr(thing, "__module__", "modal")]
    for name, said in re.findall(r"^ *(\w+) : .*, default ([^g,\n]+|\(.*\))$", thing.__doc__, re.M):
        assert signature(thing).parameters[name].default == eval(said), name
    (test,) = doctest.DocTestFinder(recurse=False).find(thing, globs=dict(vars(home)))
    assert test.examples
    start = time.perf_counter()
    failed, _ = doctest.DocTestRunner().run(test)
    # Ten times the second: machines differ, and the first call compiles.
    assert failed == 0 and time.perf_counter() - start < 10


def test_numbers_of_any_kind_are_numbers():
    """Of numpy and of other libraries; a number missing is Python's own error."""
    network = modal.fcc(np.float32(1e5), cells=np.array([1, 1, 6]))
    assert modal.count_modes(network, np.float64(1e9)) == 36
    assert len(modal.eigenmodes(network, lowest=np.int64(2)).frequency) == 2
    assert len(modal.eigenmodes(network, highest=np.int8(3)).frequency) == 3  # of 36: 36 - 127 < 0
    assert len(modal.eigenmodes(network, between=[1e3, 1e5]).frequency) > 0
    with pytest.raises(TypeError, match="propagate.. missing 1 required positional argument"):
        modal.propagate(network)
