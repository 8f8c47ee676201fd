"""The public names of `modal`: arguments, examples that run, networks that do not change."""

import ast
import doctest
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

import analysis
import modal
from analysis.measurement import measure
from modal.elasticity.moduli import ElasticModuli
from modal.modes.density import DensityOfStates
from modal.modes.mode_set import ModeSet
from modal.packing.sample import Sample
from modal.system.damping import ContactDamping
from modal.waves.propagate import LinearWave
from modal.waves.response import Response
from modal.waves.signals import Signals
from modal.waves.sources import Point

PUBLIC_NAMES = {
    "FccLattice",
    "InputError",
    "Network",
    "count_modes",
    "density_of_states",
    "describe",
    "eigenmodes",
    "elastic_moduli",
    "fcc",
    "frequency_response",
    "frequency_sensitivity",
    "from_spheres",
    "mass_matrix",
    "moduli_sensitivity",
    "propagate",
    "random_packing",
    "read",
    "stiffness_matrix",
    "velocities_by_depth",
    "write",
}
"""Public functions and classes, each with an example."""
CODES_OF_WALLS = {"SOURCE_WALL", "RECEIVER_WALL"}


def test_public_names_are_these_and_nothing_else():
    assert set(modal.__all__) == PUBLIC_NAMES | CODES_OF_WALLS
    assert all(hasattr(modal, name) for name in modal.__all__)
    assert set(dir(modal)) == set(modal.__all__)
    assert set(dir(analysis)) == set(analysis.__all__)


def test_unknown_name_is_pythons_own_error():
    with pytest.raises(AttributeError, match="no attribute 'magic'"):
        modal.magic  # noqa: B018


COLUMN = modal.fcc(cells=(1, 1, 4))
FUNCTIONS_OF_NETWORKS = [
    modal.eigenmodes,
    modal.describe,
    modal.density_of_states,
    modal.frequency_response,
    modal.elastic_moduli,
]
WRONG_INTERVALS = [
    {"tolerance": -0.5},
    {"tolerance": 0},
    {"tolerance": 1.0},
    {"tolerance": 1.5},
    {"interval": 0.0},
    {"interval": 2e-5},
    {"duration": np.inf},
]
WRONG_CALLS = [
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
    (modal.read, {"path": 3}, "argument", "path"),
    (modal.read, {"path": __file__}, "unknown_file", "test_public_api.py"),
]
"""A call, its arguments, the code of its refusal, and a name in its line."""


@pytest.mark.parametrize(("call", "arguments", "code", "name"), WRONG_CALLS)
def test_wrong_argument_is_refused_in_one_line(call, arguments, code, name):
    """Name arguments of Python, not options of the command line."""
    if "network" in signature(call).parameters:
        arguments = {"network": COLUMN} | arguments
    with refusal(code, name) as raised:
        call(**arguments)
    assert "--" not in str(raised.value)


@pytest.mark.parametrize("arguments", WRONG_INTERVALS, ids=str)
def test_interval_or_tolerance_without_sense_is_refused(arguments):
    with refusal("interval_or_tolerance") as raised:
        modal.propagate(COLUMN, **{"duration": 1e-5} | arguments)
    assert "--" not in str(raised.value)


@pytest.mark.parametrize("function", FUNCTIONS_OF_NETWORKS)
def test_path_in_place_of_a_network_is_refused(function):
    with refusal("argument", "network") as raised:
        function("mine.network.h5")
    assert "--" not in str(raised.value)


def test_names_are_loaded_from_the_modules_that_type_checkers_see():
    """Compare imports for type checkers and at run time, which are written separately."""
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


@pytest.fixture
def network() -> modal.Network:
    """Return a column of eight spheres."""
    return modal.fcc(cells=(1, 1, 8))


def test_field_of_a_network_does_not_change(network):
    with pytest.raises(FrozenInstanceError):
        network.mass = 2 * network.mass


def test_entry_of_a_network_does_not_change(network):
    with pytest.raises(ValueError, match="read-only"):
        network.mass[0] = 1.0
    with pytest.raises(ValueError, match="WRITEABLE"):
        network.mass.flags.writeable = True


def test_network_has_arrays_of_its_own(network):
    mass = network.mass.copy()
    heavy = replace(network, mass=mass)
    mass[0] *= 2
    assert np.array_equal(heavy.mass, network.mass)


def test_replaced_network_has_no_results_of_the_first(network):
    frequency = modal.eigenmodes(network, all=True).frequency
    heavy = replace(network, mass=4 * network.mass, inertia=4 * network.inertia, study={})
    halved = modal.eigenmodes(heavy, all=True).frequency
    assert halved == pytest.approx(frequency / 2, rel=1e-9, abs=1e-6 * frequency[-1])


def test_replaced_network_has_notes_of_its_own(network):
    heavy = replace(network, mass=4 * network.mass, inertia=4 * network.inertia, study={})
    heavy.study["density"] = 1.0
    assert "stress" in network.study


@pytest.fixture(
    params=[copy, deepcopy, lambda network: loads(dumps(network))],
    ids=["copy", "deep copy", "pickle"],
)
def network_and_copy(request, network):
    """Return a network that has results, and a copy of it."""
    modal.eigenmodes(network, lowest=3)
    return network, request.param(network)


def test_copy_of_a_network_does_not_change_either(network_and_copy):
    _, copied = network_and_copy
    with pytest.raises(ValueError, match="read-only"):
        copied.mass[0] = 1.0


def test_copy_of_a_network_makes_its_results_itself(network_and_copy):
    network, copied = network_and_copy
    assert network._cache
    assert not copied._cache
    expected = modal.eigenmodes(network, lowest=3).frequency
    assert np.array_equal(modal.eigenmodes(copied, lowest=3).frequency, expected)


RESULTS = (ModeSet, Signals, Response, DensityOfStates, ElasticModuli, Sample, ContactDamping)


@pytest.mark.parametrize(
    "thing",
    [modal, LinearWave, *(getattr(modal, name) for name in sorted(PUBLIC_NAMES)), *RESULTS],
    ids=lambda thing: thing.__name__,
)
def test_docstring_states_the_defaults(thing):
    stated = re.findall(r"^ *(\w+) : .*, default ([^g,\n]+|\(.*\))$", thing.__doc__, re.M)
    for name, text in stated:
        assert signature(thing).parameters[name].default == eval(text), name


@pytest.mark.parametrize(
    "thing",
    [modal, LinearWave, *(getattr(modal, name) for name in sorted(PUBLIC_NAMES)), *RESULTS],
    ids=lambda thing: thing.__name__,
)
def test_docstring_has_an_example_that_runs_in_a_second(thing):
    home = sys.modules[getattr(thing, "__module__", "modal")]
    (test,) = doctest.DocTestFinder(recurse=False).find(thing, globs=dict(vars(home)))
    assert test.examples
    start = time.process_time()
    failed, _ = doctest.DocTestRunner().run(test)
    # Ten times the second: machines differ, and the first call compiles.
    assert failed == 0
    assert time.process_time() - start < 10


@pytest.fixture(scope="module")
def column_of_six() -> modal.Network:
    """Return six spheres, by numbers of numpy."""
    return modal.fcc(np.float32(1e5), cells=np.array([1, 1, 6]))


def test_frequency_may_be_a_number_of_numpy(column_of_six):
    assert modal.count_modes(column_of_six, np.float64(1e9)) == 36


@pytest.mark.parametrize(
    ("arguments", "count"),
    [
        ({"lowest": np.int64(2)}, 2),
        ({"highest": np.int8(3)}, 3),  # of 36, less than which is no int8
    ],
    ids=["int64", "int8"],
)
def test_number_of_modes_may_be_an_integer_of_numpy(arguments, count, column_of_six):
    assert len(modal.eigenmodes(column_of_six, **arguments).frequency) == count


def test_interval_may_be_a_list(column_of_six):
    assert len(modal.eigenmodes(column_of_six, between=[1e3, 1e5]).frequency) > 0


def test_missing_argument_is_pythons_own_error(column_of_six):
    with pytest.raises(TypeError, match="propagate.. missing 1 required positional argument"):
        modal.propagate(column_of_six)
