"""Functions of `modal` give the very digits that the command line prints."""

import re

import numpy as np
import pytest

import modal
from modal.packing.network import Network, write_network


@pytest.fixture(scope="module")
def network() -> Network:
    """Return a packing of 100 spheres with some rattlers."""
    return modal.random_packing(spheres=100, seed=3, aspect=2.5)


@pytest.fixture(scope="module")
def path(network, tmp_path_factory) -> str:
    """Return the file of the packing."""
    path = tmp_path_factory.mktemp("packing") / "random.network.h5"
    write_network(path, network)
    return str(path)


@pytest.mark.parametrize(
    ("options", "arguments"),
    [
        ("--lowest 7", {"lowest": 7}),
        ("--highest 3", {"highest": 3}),
        ("--below 2e4", {"below": 2e4}),
        ("--between 2e4 3e4", {"between": (2e4, 3e4)}),
        ("--all --translations-only", {"all": True, "translations_only": True}),
        ("", {}),
    ],
)
def test_modes(options, arguments, network, path, printed):
    output = printed("modes", path, *options.split())
    modes = modal.eigenmodes(network, **arguments)
    assert output["frequency_hz"] == modes.frequency.tolist()
    assert output["certified"] == modes.certified
    assert output["missing"] == modes.missing
    assert output["floppy_modes"] == modes.floppy_modes > 0
    assert modes.mode_shape.shape == (len(modes.frequency), network.n_particles, 6)
    assert modes.chi_z.shape == modes.frequency.shape


FREQUENCIES = ["1e4", "50000", "1.2e5"]
"""Frequencies, Hz, as a user writes them."""


def test_counts(network, path, printed):
    output = printed("count", path, "--at", *FREQUENCIES)["count_below"]
    counts = modal.count_modes(network, [float(word) for word in FREQUENCIES])
    assert list(output.values()) == counts.tolist()
    assert counts.dtype.kind == "i"


def test_count_at_one_frequency_is_an_integer(network):
    count = modal.count_modes(network, 5e4)
    assert isinstance(count, int)
    assert count == modal.count_modes(network, [5e4])[0]


def test_density_of_states(network, path, printed):
    output = printed("density", path, "--resolution", "1e4", "--at", *FREQUENCIES)
    states = modal.density_of_states(network, resolution=1e4)
    counts, _ = states.count_below([float(word) for word in FREQUENCIES])
    assert list(output["estimated_count_below"].values()) == counts[:, 6].tolist()
    assert output["floppy_modes"] == pytest.approx(states.zero_modes.sum(), rel=1e-12)


@pytest.mark.two_ways
def test_response(network, path, printed):
    output = printed("response", path, "--highest", "3e4")
    response = modal.frequency_response(network, highest=3e4)
    assert output["gain_maxima_hz"] == response.gain_maxima().tolist()


@pytest.mark.two_ways
def test_wave(network, path, printed):
    output = printed("wave", path, "--duration", "5e-5")
    wave = modal.propagate(network, duration=5e-5)
    assert output["largest_displacement_m"] == abs(wave.signals.chain_displacement).max()


def test_lattice(printed):
    output = printed("lattice", "--stress", "3e5")
    assert output["f_low_pass_hz"] == modal.FccLattice(stress=3e5).low_pass_frequency


@pytest.mark.parametrize(
    ("arguments", "options"),
    [
        ({"spheres": 100, "seed": 3}, "--spheres 100 --seed 3 --stress 1e5"),
        (
            {"spheres": 100, "stress": 2e5, "seed": 2, "aspect": 1.3, "friction": 0.4},
            "--spheres 100 --stress 2e5 --seed 2 --aspect 1.3 --friction 0.4",
        ),
        (
            {"spheres": 120, "sizes": ["two", 2, 0.5], "densities": [2230, 7800]},
            "--spheres 120 --sizes two 2 0.5 --densities 2230 7800 --stress 1e5",
        ),
    ],
    ids=["without friction", "with friction", "mixture"],
)
def test_random_packing(arguments, options, tmp_path, printed):
    """Compare bit by bit, with the shear forces of the history and the notes of the file."""
    network = modal.random_packing(**arguments)
    output = printed("pack", *options.split(), "-o", tmp_path)["samples"]
    stress = arguments.get("stress", 1e5)
    (path,) = [path for path, stress_of_file in output.items() if stress_of_file == stress]
    packed = modal.read(path)
    for name in ("position", "particle_i", "force_normal", "force_tangential"):
        assert np.array_equal(getattr(packed, name), getattr(network, name)), name
    for name in packed.study:
        if not name.startswith("seconds"):
            assert np.all(packed.study[name] == network.study[name]), name


def test_description_has_the_numbers_of_info(network, path, printed):
    output = printed("info", path)
    text = modal.describe(network)
    shown = dict(re.findall(r"^(\w.+?)  +([\d.]+)", text, re.MULTILINE))
    for label in ("contacts", "void ratio", "coordination number", "rattlers", "floppy modes"):
        expected = output[label.replace(" ", "_")]
        # The text has three decimals.
        assert float(shown[label]) == pytest.approx(expected, abs=5e-4), label
