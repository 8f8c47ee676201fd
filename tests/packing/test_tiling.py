"""Tests of repeated packings: every copy has the surroundings of the original."""

from dataclasses import replace

import changes
import numpy as np
import pytest
from places import SHEARED
from refusals import refusal

from modal.__main__ import main
from modal.exchange.registry import read
from modal.formats.provenance import packing_of, require_same_packing
from modal.packing import neighbours
from modal.packing.neighbours import periodic_pairs
from modal.packing.network import write_network
from modal.packing.repeats import lateral_repeats
from modal.packing.sample import Sample, read_sample, write_sample
from modal.packing.tiling import repeat, repeat_sample
from modal.tools import workload


@pytest.fixture(scope="module")
def sample() -> Sample:
    """Return 150 spheres with friction at 100 kPa, with their shear forces."""
    return read_sample(SHEARED)


def test_repeated_sample_has_the_repeated_network(sample):
    """Compare contacts, stiffnesses and forces of the copies with those of the small packing.

    Positions up to 3 cells away are rounded at eps times that, overlaps of 1e-3 R to 1e-11.
    """
    large = repeat_sample(sample, 3, 2)
    assert (np.diff(large.position[:, 2]) >= 0).all()  # the loops over contacts go along z
    network = large.network()
    expected = repeat(sample.network(), 3, 2)
    assert network.n_contacts == expected.n_contacts == 6 * sample.network().n_contacts
    falling = ~expected.with_wall & (expected.particle_i > expected.particle_j)
    expected = changes.from_other_end(expected, falling)
    order = order_of_contacts(network)
    expected_order = order_of_contacts(expected)
    for name in ("particle_i", "particle_j", "cell_shift"):
        column = getattr(expected, name)[expected_order]
        assert np.array_equal(getattr(network, name)[order], column)
    for name in ("normal", "overlap", "stiffness_normal", "force_tangential"):
        column = getattr(expected, name)[expected_order]
        difference = getattr(network, name)[order] - column
        assert abs(difference).max() < 1e-9 * abs(column).max(), name


def order_of_contacts(network):
    """Return the order of contacts by their first body, second body, and period."""
    return np.lexsort((*network.cell_shift.T, network.particle_j, network.particle_i))


@pytest.mark.parametrize("kind", ["sample", "network"])
def test_tile_makes_equal_parts(kind, tmp_path, printed):
    """Repeat twice along y, then thrice along x; overlaps differ by round-off, 1e-11.

    Waves in them are those of the small packing: `tests/waves/test_repeat_units.py`.
    """
    paths = [SHEARED, tmp_path / f"b.{kind}.h5", tmp_path / f"c.{kind}.h5"]
    for path, out, times in zip(paths, paths[1:], ("1 2", "3 1"), strict=False):
        summary = printed("tile", path, "--repeat", *times.split(), "-o", out)
    assert summary["spheres"] == 900
    small = read(paths[0])
    large = read(paths[-1])
    assert large.cell_size == pytest.approx(small.cell_size * [3, 2, 1])
    repeats = lateral_repeats(large)
    assert repeats.count == 6
    assert repeats.part.n_contacts == small.n_contacts
    expected = np.sort(small.stiffness_normal)
    assert np.sort(repeats.part.stiffness_normal) == pytest.approx(expected, rel=1e-8)


def test_tile_remarks_on_a_narrow_cell(tmp_path, capsys):
    """Remark on the width of the cell that is repeated, however wide the result is."""
    path = tmp_path / "b.sample.h5"
    assert main(["tile", str(SHEARED), *["--repeat", "1", "1", "-o"], str(path)]) == 0
    assert "diameters wide" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("--repeat", "0", "1", "-o", "b.sample.h5"), "repeat"),
        (("--repeat", "2", "1", "-o", "b.h5"), "file_ending"),
        (("--repeat", "100000", "100000", "-o", "b.sample.h5"), "too_large"),
        (("--repeat", "100000", "100000", "-o", "b.network.h5"), "too_large"),
    ],
)
def test_mistakes_are_one_line(arguments, code, sample, tmp_path, one_line, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_sample("a.sample.h5", replace(sample, shear=None))
    one_line(main, ["tile", "a.sample.h5", *arguments], code=code)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.sample.h5"]


def test_a_network_gives_no_sample(sample, tmp_path, one_line):
    path = tmp_path / "a.network.h5"
    write_network(path, sample.network())
    command = "tile", path, "--repeat", 2, 1, "-o", tmp_path / "b.sample.h5"
    one_line(main, command, code="not_a_sample")


def test_a_sample_in_motion_is_not_repeated(sample):
    moving = replace(sample, velocity=np.zeros((150, 3)))
    with refusal("in_motion"):
        repeat_sample(moving, 2, 1)


def test_one_large_sphere_among_many_counts_in_the_memory(monkeypatch):
    """Refuse pairs within the largest reach that take more memory than there is."""
    radii = np.full(1000, 1e-4)
    radii[0] = 8e-4
    side = (4 / 3 * np.pi * (radii**3).sum() / 0.6) ** (1 / 3)
    position = np.random.default_rng(1).random((1000, 3)) * side
    ends, _, _ = periodic_pairs(position, np.full(2, side), 2 * radii.max())
    # Half the reach of spheres near a wall is empty.
    needed_bytes = neighbours.BYTES_PER_PAIR * len(ends)
    monkeypatch.setattr(workload, "memory_at_hand", lambda: needed_bytes)
    with refusal("too_large"):
        periodic_pairs(position, np.full(2, side), 2 * radii.max())
    assert len(periodic_pairs(position, np.full(2, side), 2 * radii.min())[0])


def test_two_spheres_in_one_place_are_found_among_many(tmp_path):
    """Find them wherever they are in the list."""
    rng = np.random.default_rng(3)
    position = rng.random((2000, 3)) * 0.01
    sample = Sample(position, np.array([0.01, 0.01]), np.array([0.0, 0.01]), 0.1)
    path = tmp_path / "a.sample.h5"
    position[1700] = position[3]
    write_sample(path, replace(sample, position=position))
    with refusal("same_place"):
        read_sample(path)


def test_tile_is_another_packing_than_its_parent(tmp_path):
    """Refuse the modes of the parent for the tile, which has twice as many spheres."""
    tile = str(tmp_path / "b.sample.h5")
    modes = str(tmp_path / "a.modes.h5")
    assert main(["modes", str(SHEARED), "--highest", "1", "-o", modes]) == 0
    assert main(["tile", str(SHEARED), "--repeat", "2", "1", "-o", tile]) == 0
    require_same_packing(modes, packing_of(SHEARED))
    with refusal("other_packing"):
        require_same_packing(modes, packing_of(tile))
