"""Frictionless packings: forces, pairs, energy and stress, seeds, kill and resume, bad input."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from places import ROOT

from modal.__main__ import main
from modal.dem import contacts
from modal.dem.contacts import MovingContacts
from modal.dem.forces import forces_by_arrays, forces_by_loop
from modal.exchange.registry import read_packing
from modal.formats.hdf5 import sha256
from modal.formats.provenance import read_provenance
from modal.packing.contact_law import GLASS
from modal.packing.sample import read_sample, write_sample
from modal.packing.state import net_forces, stress_tensor, void_ratio
from modal.packing.summary import summary
from modal.preparation import random_packing
from modal.preparation.frictionless import minimise
from modal.preparation.packings import sound_aspect
from modal.preparation.random_packing import cloud, random_network, random_sample
from modal.preparation.sizes import radii_of, words
from modal.tools import progress
from modal.tools.errors import InputError

pytestmark = pytest.mark.two_ways


def test_forces_are_the_gradient_of_the_energy():
    """Central differences of the energy along a random motion, and along each length."""
    sample = cloud(200, 2.0, 3)
    start = MovingContacts(sample, history=False)

    def rise(change):
        """Of the energy from before a change to after it."""
        energies = []
        for way in (-1, 1):
            contacts = MovingContacts(sample, history=False)
            change(contacts, way)
            contacts.touch()
            energies.append(contacts.elastic_energy)
        return energies[1] - energies[0]

    motion, step = np.random.default_rng(4).standard_normal((200, 3)), 1e-6 * sample.radius

    def move(contacts, way):
        contacts.position += way * step * motion

    def stretch(contacts, way):
        by = np.where(np.arange(3) == axis, (1 + 1e-6) ** way, 1.0)
        contacts.position *= by
        contacts.side *= by[:2]
        contacts.walls *= by[2]

    # Error of order (step / overlap)^2 and of the round-off of the energy over the step.
    assert rise(move) / (2 * step) == pytest.approx(-(start.load * motion).sum(), rel=1e-5)
    for axis in range(3):
        # The walls move with the length, so their work is part of the virial.
        assert rise(stretch) / (2 * np.log1p(1e-6)) == pytest.approx(-start.virial[axis], rel=1e-5)


def test_minimum_has_the_stress_and_lower_enthalpy():
    start = cloud(150, 1.5, 5)
    pressure = 1e7

    def enthalpy(sample):
        there = MovingContacts(sample, history=False)
        return there.elastic_energy + pressure * there.lengths.prod()

    seen = []
    packed, rest = minimise(
        start, pressure, tolerance=1e-5, watch=lambda sample, _: seen.append(enthalpy(sample))
    )
    assert rest.converged and rest.residual < 1e-5
    assert rest.stress == pytest.approx([pressure] * 3, rel=1e-3)
    assert seen[-1] == min(seen) < enthalpy(start)
    network = packed.network()
    area = packed.side.prod()
    for code in (-1, -2):
        on_wall = network.force_normal[network.particle_j == code].sum()
        # Walls and contacts carry the same stress, as far as the spheres are in balance.
        assert on_wall / area == pytest.approx(rest.stress[2], rel=1e-3)
    inside = (packed.position[:, 2] > 0) & (packed.position[:, 2] < packed.walls[1])
    assert inside.all() and (packed.position[:, :2] < packed.side).all()


def test_same_seed_same_packing_and_another_seed_another():
    first, again, other = (random_network(60, 1e7, seed, aspect=1.0) for seed in (1, 1, 2))
    assert np.array_equal(first.position, again.position)
    assert np.array_equal(first.particle_j, again.particle_j)
    assert not np.array_equal(first.position, other.position)


def test_packings_are_isostatic_or_denser_and_uncrystallised():
    """Frictionless spheres need six contacts each but for rattlers; a crystal has e 0.35."""
    sample = random_sample(300, 1e6, seed=9, aspect=2.0, tolerance=1e-3)
    network = sample.network()
    touching = np.bincount(network.particle_i, minlength=300)
    touching += np.bincount(network.particle_j[~network.with_wall], minlength=300)
    held = touching >= 4
    assert touching[held].mean() > 5.8
    assert held.mean() > 0.9
    # Random close packing has e 0.56; walls a few diameters apart add some hundredths.
    found = summary(network)
    assert 0.48 < found["void_ratio"] < 0.64
    # Isotropic: a third along each axis; 900 normals scatter by 0.3 / sqrt(900).
    assert found["fabric_diagonal"] == pytest.approx([1 / 3] * 3, abs=0.03)
    # Contacts and both walls bear the pressure, to some times the tolerance of 1e-3.
    assert found["stress_pa"] == pytest.approx([1e6] * 3, rel=5e-3)
    assert found["wall_stress_pa"] == pytest.approx([1e6] * 2, rel=5e-3)


def _pack(folder, *more):
    arguments = ["--spheres", "80", "--aspect", "1", "--stress", "1e7", "1e6", "-o", str(folder)]
    return ["pack", *arguments, *more]


def test_higher_peak_leaves_a_denser_packing(tmp_path):
    """What a peak has pushed together stays so: at one stress the voids fall with the peak."""
    voids = []
    larger = ["--spheres", "300", "--aspect", "2", "--stress", "1e6"]
    for peak in ("1e7", "3e8"):
        assert main(_pack(tmp_path / peak, *larger, "--peak", peak)) == 0
        (path,) = (tmp_path / peak).glob("01_*")
        sample = read_sample(path)
        assert read_provenance(path).settings["peak"] == float(peak)
        voids.append(sample.network().study["void_ratio"])
    assert voids[1] < voids[0] - 0.005


def test_walk_short_of_rest_leaves_a_checkpoint_that_the_next_call_takes_up(
    tmp_path, capsys, monkeypatch
):
    """So few steps that neither forces nor stresses are there: once 7e8 Pa came back for 1e5."""
    monkeypatch.setattr(random_packing, "minimise", partial(minimise, max_steps=50))
    assert main(_pack(tmp_path)) == 2
    said = "no rest at 2e[+]08 Pa after 50 steps: .* off by .* goes on from there"
    assert re.search(said, capsys.readouterr().err)
    assert [path.name for path in tmp_path.iterdir()] == ["checkpoint.h5"]
    monkeypatch.setattr(random_packing, "minimise", minimise)
    assert main(_pack(tmp_path)) == 0
    study = read_sample(tmp_path / "00_200000kPa.sample.h5").study
    # The steps of both calls, and the stress that was asked for.
    assert study["steps"] > 50
    assert study["stresses"] == pytest.approx([2e8] * 3, rel=1.001e-3)


def test_state_whose_stress_is_off_is_not_kept(tmp_path):
    """At rest, but under another stress than its file is called after."""
    assert main(_pack(tmp_path)) == 0
    path = tmp_path / "01_10000kPa.sample.h5"
    sample = read_sample(path)
    lower, rest = minimise(sample, 8e6, tolerance=1e-4)
    study = sample.study | {"residual": rest.residual, "stresses": rest.stress}
    write_sample(path, replace(lower, study=study))
    assert main(_pack(tmp_path)) == 0
    again = read_sample(path)
    assert again.study["stresses"] == pytest.approx([1e7] * 3, rel=1.001e-3)
    force = again.network().force_normal[again.network().particle_j == -1].sum()
    assert force / again.side.prod() == pytest.approx(1e7, rel=2e-3)


def test_killed_walk_goes_on(tmp_path, capsys):
    """SIGKILL after the first state; the second call keeps it and makes the rest."""
    process = subprocess.Popen(
        [sys.executable, "-m", "modal", *_pack(tmp_path, "--tolerance", "1e-12")],
        cwd=ROOT,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    peak = tmp_path / "00_200000kPa.sample.h5"
    deadline = time.monotonic() + 60
    while not peak.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = peak.read_bytes()
    assert main([*_pack(tmp_path), "--json"]) == 0
    assert peak.read_bytes() == before
    shown = json.loads(capsys.readouterr().out)
    assert list(shown["samples"].values()) == [2e8, 1e7, 1e6]
    for path, stress in shown["samples"].items():
        sample = read_sample(path)
        assert sample.study["stresses"] == pytest.approx([stress] * 3, rel=2e-3)
    assert not list(tmp_path.glob("checkpoint*"))


def test_smaller_tolerance_deepens_what_is_there(tmp_path):
    assert main(_pack(tmp_path, "--tolerance", "1e-2")) == 0
    rough = read_sample(tmp_path / "01_10000kPa.sample.h5").study
    assert main(_pack(tmp_path, "--tolerance", "1e-6")) == 0
    fine = read_sample(tmp_path / "01_10000kPa.sample.h5").study
    assert fine["residual"] <= 1e-6 < rough["residual"]
    assert fine["steps"] > rough["steps"]


def test_state_is_stale_where_the_walk_before_it_was_another(tmp_path, capsys):
    """The second state at 1 MPa came from 10 MPa; asked for from 2 MPa it is another packing."""
    second = tmp_path / "02_1000kPa.sample.h5"
    assert main(_pack(tmp_path)) == 0
    first_digest = sha256(tmp_path / "01_10000kPa.sample.h5")
    before, written = read_sample(second).position, second.stat().st_mtime_ns
    assert [source.sha256 for source in read_provenance(second).sources] == [first_digest]
    assert main(_pack(tmp_path)) == 0
    assert second.stat().st_mtime_ns == written
    capsys.readouterr()
    assert main(_pack(tmp_path, "--stress", "2e6", "1e6")) == 0
    told = capsys.readouterr().err
    assert f"stale, state was 01_10000kPa.sample.h5 ({first_digest[:8]}), is 01_2000kPa" in told
    assert not np.array_equal(read_sample(second).position, before)


def test_checkpoint_of_another_stress_is_not_gone_on_from(tmp_path, capsys):
    """State 2 under way to 10 MPa is no beginning of state 2 at 1 MPa."""
    assert main(_pack(tmp_path, "--stress", "1e7", "2e7")) == 0
    (tmp_path / "02_20000kPa.sample.h5").rename(tmp_path / "checkpoint.h5")
    assert main(_pack(tmp_path)) == 0
    assert "checkpoint.h5: stale, stress was 20000000.0, is 1000000.0" in (capsys.readouterr().err)
    again = tmp_path / "again"
    assert main(_pack(again)) == 0
    found, undisturbed = (read_sample(f / "02_1000kPa.sample.h5") for f in (tmp_path, again))
    assert np.array_equal(found.position, undisturbed.position)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("--spheres 3", "no packing"),
        ("--aspect 1e-3", "no packing"),
        ("--aspect 500", "narrower"),
        ("--stress -5", "outside"),
        ("--stress 1e12", "outside"),
        ("--tolerance 2", "outside 0 to 1"),
        ("--seed -1", "negative"),
        ("--peak 1e6", "below one of the stresses"),
        ("--peak 1e12", "above 2e[+]09 Pa"),
        ("--friction 0.4 --peak 2e8", "no meaning with friction"),
    ],
)
def test_impossible_packings_are_refused_in_one_line(wrong, said, tmp_path, capsys):
    assert main(_pack(tmp_path, *wrong.split())) == 2
    told = capsys.readouterr().err
    assert len(told.splitlines()) == 1 and re.search(said, told)


def test_folder_of_another_study_is_refused(tmp_path, capsys):
    write_sample(
        tmp_path / "00_200000kPa.sample.h5",
        replace(cloud(80, 1.0, 2), study={"spheres": 80, "aspect": 1.0, "seed": 2}),
    )
    assert main(_pack(tmp_path)) == 2
    assert "seed" in capsys.readouterr().err


def test_far_stress_is_reached_by_way_of_others_and_each_minute_tells(
    tmp_path, capsys, monkeypatch
):
    """From 200 MPa to 1 kPa in factors of ten at most; a line tells residual and target."""
    met = []

    def noted(sample, pressure, **options):
        if pressure is not None and (not met or met[-1] != pressure):
            met.append(pressure)
        return minimise(sample, pressure, **options)

    monkeypatch.setattr(random_packing, "minimise", noted)
    monkeypatch.setattr(progress, "LOG_INTERVAL", 0.0)
    assert main(_pack(tmp_path, "--stress", "1e3")) == 0
    assert met[0] == 2e8 and met[-1] == 1e3
    assert all(0.1 <= lower / higher < 1 for higher, lower in pairwise(met))
    told = [line for line in capsys.readouterr().err.splitlines() if line.startswith("20 kPa: ")]
    assert told and "residual" in told[0] and "at rest below" in told[0]
    # The state is that of its own stress, with the steps of the whole way.
    study = read_sample(tmp_path / "01_1kPa.sample.h5").study
    assert study["stresses"] == pytest.approx([1e3] * 3, rel=1.001e-3)
    assert study["steps"] >= 25 * len(told)


@pytest.mark.parametrize("spheres", [300, 2000, 20_000, 35_201])
def test_default_shape_is_sound_for_any_number(spheres):
    """8 diameters wide even as dense as random spheres get, 0.64; a cube or the study's at ends."""
    aspect = sound_aspect(spheres)
    width = (spheres * np.pi / 6 / 0.64 / aspect) ** (1 / 3)
    assert width >= 8 or aspect == 1
    assert aspect == pytest.approx(10.05) if spheres > 7500 else width < 8.5


@pytest.mark.parametrize("sizes", [("lognormal", 0.3), ("two", 2, 0.5)])
def test_mixtures_come_to_rest_and_keep_their_sizes(sizes, tmp_path):
    """Balance, stress and contacts by the network's own sums; the file gives the same network."""
    sample = random_sample(120, stress=1e6, seed=2, aspect=1.5, tolerance=1e-4, sizes=sizes)
    radii = radii_of(120, sizes, seed=2)
    np.testing.assert_array_equal(sample.radii, radii)
    network = sample.network()
    mean = network.force_normal.mean()
    net = np.linalg.norm(net_forces(network)[:, :3], axis=1)
    # The residual at which it stopped, its largest sphere.
    assert net.mean() < 2e-4 * mean
    np.testing.assert_allclose(np.diag(stress_tensor(network)), 1e6, rtol=2e-3)
    i, partner = network.particle_i, network.partner
    a, b = radii[i], np.where(network.with_wall, np.inf, radii[partner])
    effective = 1 / (1 / a + 1 / b)
    kn = 2 * GLASS.effective_young * np.sqrt(effective * network.overlap)
    np.testing.assert_allclose(network.stiffness_normal, kn, rtol=1e-12)
    np.testing.assert_allclose(network.mass, 2230 * 4 / 3 * np.pi * radii**3, rtol=1e-12)
    write_sample(tmp_path / "m.sample.h5", sample)
    again = read_packing(tmp_path / "m.sample.h5")
    np.testing.assert_array_equal(again.stiffness_normal, network.stiffness_normal)
    solid = (4 / 3 * np.pi * radii**3).sum()
    volume = network.cell_size.prod()
    assert void_ratio(network) == pytest.approx(volume / solid - 1, rel=1e-12)
    assert summary(network)["void_ratio"] == pytest.approx(network.study["void_ratio"], rel=1e-12)


@pytest.mark.parametrize("sizes", [None, ("lognormal", 0.4)])
def test_loop_and_arrays_agree(sizes, monkeypatch):
    """The compiled loop against numpy, sphere by sphere, and the list against all pairs."""
    rough = cloud(200, 1.5, 4, **words({"sizes": sizes}))
    results = []
    for compute in (forces_by_loop, forces_by_arrays):
        monkeypatch.setattr(contacts, "forces_by_loop", compute)
        found = MovingContacts(rough, history=False)
        sums = found.elastic_energy, found.mean_force, found.mean_stiffness, *found.virial
        results.append((found.load.copy(), found.stiffness.copy(), *sums, found.touching))
        # Two in the same place have no direction of contact, and no force.
        found.position[11] = found.position[10]
        found.touch()
        assert np.isfinite(found.load).all()
    for one, other in zip(*results, strict=True):
        largest = np.max(np.abs(other), initial=0)
        assert one == pytest.approx(other, rel=1e-12, abs=1e-12 * largest)
    assert results[0][-1] == len(rough.contacts().particle_i)


@pytest.mark.parametrize(
    "sizes", [("two", 2), ("two", 20, 0.5), ("lognormal", "x"), ("three", 1), ("two", 9, 0.01)]
)
def test_unknown_mixtures_are_refused(sizes):
    with pytest.raises(InputError, match="--sizes"):
        radii_of(100, sizes, seed=1)


def test_log_normal_sizes_have_their_moments():
    """Mean ln R and its spread: quantiles at mid-steps miss 1 % of the variance at n = 1,000."""
    logarithm = np.log(radii_of(1000, ("lognormal", 0.25), seed=3))
    assert logarithm.std() == pytest.approx(0.25, rel=0.01)
    skew = ((logarithm - logarithm.mean()) ** 3).mean() / logarithm.std() ** 3
    assert abs(skew) < 1e-9
