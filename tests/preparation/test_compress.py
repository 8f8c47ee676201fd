"""The walk of spheres with friction: states, kill and resume, seeds, and what it refuses."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from places import ROOT

from modal.__main__ import main
from modal.packing.contact_law import Elasticity
from modal.packing.sample import read_sample, write_sample
from modal.packing.state import coordination_without_rattlers
from modal.packing.summary import summary
from modal.preparation import frictionless, protocol
from modal.preparation.cloud import cloud
from modal.preparation.compression import compacted, in_motion
from modal.preparation.protocol import CHECKPOINT, OLD_CHECKPOINT, Study
from modal.tools import progress

SHAPE = ["pack", "--spheres", "100", "--aspect", "1.3"]
SMALL = [*SHAPE, "--friction", "0.4"]
PATHS = {"0.4": ["--stress", "1e4", "1e5"], "0": ["--stress", "1e7", "1e6"]}
"""Of packings with friction and without."""
WRITTEN = 0, 3
"""Statuses of a walk whose states are there; so few spheres do not reach each of them."""


def pack(folder, *more):
    """The exit status of a small walk."""
    return main([*SMALL, *more, "-o", str(folder)])


@pytest.fixture(scope="module")
def walk_of(tmp_path_factory):
    """Folder of a walk with a friction, and its command; made once."""

    @cache
    def made(friction):
        folder = tmp_path_factory.mktemp("walk")
        command = [*SHAPE, "--friction", friction, *PATHS[friction]]
        assert main([*command, "--json", "-o", str(folder)]) in WRITTEN
        return folder, command

    return made


@pytest.fixture(params=PATHS)
def walks(request, walk_of):
    return walk_of(request.param)


@pytest.fixture
def walked(walk_of):
    """Folder of a walk to 10 and 100 kPa."""
    return walk_of("0.4")[0]


def test_cloud_of_a_mixture_has_no_contact_and_its_own_sizes():
    """All pairs and images; the solid fraction of the cloud; the walk's step by the smallest."""
    study = Study(spheres=150, width=5.0, seed=3, sizes="two 2 0.5")
    sample = cloud(study)
    assert np.array_equal(np.sort(sample.radii), np.sort(study.mixture.radii))
    assert len(sample.contacts().particle_i) == 0
    branch = sample.position[:, None] - sample.position
    branch[..., :2] -= sample.side * np.round(branch[..., :2] / sample.side)
    gap = np.linalg.norm(branch, axis=2) - np.add.outer(sample.radii, sample.radii)
    assert gap[~np.eye(150, dtype=bool)].min() > 0
    volume = sample.side.prod() * np.ptp(sample.walls)
    solid = (4 / 3 * np.pi * sample.radii**3).sum() / volume
    assert solid == pytest.approx(protocol.CLOUD, rel=1e-12)
    stage = protocol.Stage("approach", study)
    equal = protocol.Stage("approach", Study(spheres=150, width=5.0, seed=3))
    ratio = study.mixture.smallest / equal.study.mixture.smallest
    assert ratio < 0.9 and stage.time_step() == pytest.approx(ratio * equal.time_step())


def test_mixture_goes_on_from_its_checkpoint_alone(tmp_path, one_line):
    """With its materials; the first leg of a walk, and the same folder asked for other sizes."""
    words = {"sizes": "two 2 0.5", "densities": "2500 7800", "walls": "2.1e11 0.3"}
    sample = compacted(Study(spheres=100, width=4.5, **words), in_motion)
    large = sample.radii > sample.radius
    assert np.array_equal(sample.densities, np.where(large, 7800.0, 2500.0)) and large.any()
    assert sample.wall_material == Elasticity(2.1e11, 0.3)
    assert sample.study == sample.study | words
    write_sample(tmp_path / CHECKPOINT, sample)
    command = [*SMALL[:3], *SMALL[5:], "--width", "4.5", "-o", str(tmp_path), "--stress", "1e4"]
    for sizes in ([], ["--sizes", "two", "2", "0.5"]):
        one_line(main, [*command, *sizes], "it belongs to another study")


def test_states_have_their_stress_and_say_whether_they_are_settled(walked):
    """The stress of the file, from its network, against the target."""
    for stress in (1e4, 1e5):
        sample = read_sample(walked / f"{stress:g}Pa.sample.h5")
        study = sample.study
        assert study["stress"] == stress and study["mu_comp"] == sample.friction == 0.4
        assert study["settled"] == (
            study["stress_error"] < protocol.SETTLED[0]
            and study["unbalanced"] < protocol.SETTLED[1]
        )
        found = summary(sample.network())["stress_pa"]
        # The stress of the last control, at most five steps before the file.
        assert found == pytest.approx([stress] * 3, rel=2 * study["stress_error"] + 1e-3)
        assert 0.55 < study["void_ratio"] < 0.85
        assert sample.velocity is None
        shear, force = np.linalg.norm(sample.shear, axis=1), sample.network().force_normal
        assert (shear <= 0.4 * force * (1 + 1e-9)).all() and shear.max() > 0.3 * force.mean()


def test_dilated_packing_is_dense_with_few_contacts(tmp_path):
    """The states A and C of Agnolin and Roux: 6.0 and 4.6 contacts at nearly one density.

    Denser than it was dilated to, looser than without friction; both at 10 kPa.
    """
    command = ["pack", "--spheres", "300", "--aspect", "1", "--periodic", "--friction", "0.3"]
    command += ["--dilate", "0.005", "--stress", "1e4", "-o", str(tmp_path)]
    assert main(command) == 0
    found = [read_sample(tmp_path / way / "10000Pa.sample.h5") for way in ("dense", "")]
    dense, few = (summary(sample.network()) for sample in found)
    loosest = (1 + dense["void_ratio"]) * 1.005**3 - 1
    assert dense["void_ratio"] < few["void_ratio"] < 0.5 * (dense["void_ratio"] + loosest)
    z = [coordination_without_rattlers(sample.network())[0] for sample in found]
    assert z[0] > 5.8 and z[1] < 4.9
    assert found[1].friction == 0.3 and found[1].study["dilate"] == 0.005
    assert main([*command[:-4], "--stress", "1e4", "--dilate", "0.006", "-o", str(tmp_path)]) == 2


def the_same(one, other):
    """Whether the states of two folders are, to the bit."""
    names = [path.name for path in one.glob("*Pa.sample.h5")]
    assert len(names) == 2
    for name in names:
        first, second = read_sample(one / name), read_sample(other / name)
        for column in ("position", "shear"):
            assert np.array_equal(getattr(first, column), getattr(second, column))
    return True


def test_further_stress_is_added_to_a_finished_walk(walks, tmp_path):
    """And it is the one that a single call would have walked to."""
    folder, command = walks
    for stresses in (command[:-1], command):
        assert main([*stresses, "-o", str(tmp_path)]) in WRITTEN
    assert the_same(folder, tmp_path)


def test_killed_walk_goes_on_and_ends_the_same(walks, tmp_path):
    """kill -9 in the middle of legs, at whatever step; the same bits in the end."""
    folder, command = walks
    environment = os.environ | {"NUMBA_NUM_THREADS": "1"}
    checkpoint = tmp_path / CHECKPOINT
    for kill in range(2):
        job = subprocess.Popen(
            [sys.executable, "-m", "modal", *command, "-o", str(tmp_path)],
            cwd=ROOT,
            env=environment,
            stderr=subprocess.DEVNULL,
        )
        before = checkpoint.stat().st_mtime_ns if checkpoint.exists() else 0
        deadline = time.monotonic() + 100
        while time.monotonic() < deadline and job.poll() is None:
            if checkpoint.exists() and checkpoint.stat().st_mtime_ns != before:
                break
            time.sleep(0.01)
        time.sleep(0.1 * kill * ("0.4" in command))
        job.send_signal(signal.SIGKILL)
        job.wait()
    assert not all((tmp_path / path.name).exists() for path in folder.glob("*Pa.sample.h5"))
    assert main([*command, "-o", str(tmp_path)]) in WRITTEN
    assert the_same(folder, tmp_path)


def test_unsettled_state_is_marked(tmp_path, monkeypatch, capsys):
    """With hardly any patience; it is written, with what it has reached, and said.

    A line a minute, here at every look, says what it does and what ends it.
    """
    monkeypatch.setattr(protocol, "PATIENCE", 2 * protocol.CHECK)
    monkeypatch.setattr(progress, "LOG_INTERVAL", 0.0)
    assert pack(tmp_path, "--stress", "1e5", "--json") == 3
    shown = capsys.readouterr()
    path = tmp_path / "100000Pa.sample.h5"
    study = read_sample(path).study
    assert not study["settled"]
    assert study["unbalanced"] > protocol.SETTLED[1] or study["stress_error"] > protocol.SETTLED[0]
    assert json.loads(shown.out)["settled"] == {str(path): False}
    assert "not settled" in shown.err
    told = ("cloud: step 1 of", "cool: .* left")
    told += ("jam: .*ends at unbalanced 1.0e-02 and stresses off by 1.0e-01, at most .* left",)
    assert all(re.search(words, shown.err) for words in told)


WRONG = {
    "--spheres 3": "too few",
    "--aspect 1e-3": "narrower than two",
    "--stress -5": "stress -5 Pa: outside",
    "--residual 2": "between 0 and 1",
    "--stress 1e6 1e7 1e6": "twice",
    "--peak 1e5": "below one of the stresses",
    "--local-damping 0.1": "no meaning without friction",
    "--oedometric": "need friction",
    "--densities 2.23 7.8": "densities 2.23 7.8: give kg/m^3",
    "--walls 2.1e11 0.5": "walls 2.1e11 0.5: give Young's modulus, Pa",
    "--young 6": "Young's modulus",
    "--friction 0.4 --spheres 99": "at least 100",
    "--friction 0.4 --width 60": "width",
    "--friction 0.4 --stress 1e5 1e4": "rising order",
    "--friction 0.4 --time-step-fraction 2": "fraction",
    "--friction 0.4 --peak 1e8": "no meaning with friction",
    "--friction 0.3 --stress-ratio 0": "few packings hold",
    "--friction 0.3 --stress-ratio 0.5 --oedometric": "leave one out",
}
"""What no packing can be, and what is said of it."""


@pytest.mark.parametrize("wrong", WRONG)
def test_bad_input_is_one_line(wrong, tmp_path, one_line):
    command = *SHAPE, "--stress", "1e6", *wrong.split(), "-o", tmp_path / "new"
    one_line(main, command, WRONG[wrong])
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    "wrong, said",
    [
        (["--seed", "2"], "seed is 1, not 2"),
        (["--friction", "0.3"], "mu_comp is 0.4, not 0.3"),
        (["--stress", "5e4", "1e6"], "gone by way of approach; cool; jam; 10000; 100000"),
    ],
)
def test_checkpoint_of_another_walk_is_kept(wrong, said, walked, one_line):
    before = {path.name: path.read_bytes() for path in walked.iterdir()}
    arguments = wrong if "--stress" in wrong else [*wrong, "--stress", "1e4", "1e5"]
    one_line(main, [*SMALL, *arguments, "-o", walked], said)
    assert before == {path.name: path.read_bytes() for path in walked.iterdir()}


def go_on(walked, folder, stage, **state):
    """A copy of the walk, on its way to one more stress."""
    sample = read_sample(walked / CHECKPOINT)
    study = sample.study | {"stage": stage, "stage_time": 0.0}
    study["way"] += f"; {stage}"
    shutil.copytree(walked, folder, dirs_exist_ok=True)
    write_sample(folder / CHECKPOINT, replace(sample, study=study, **state))


def test_walk_on_its_way_elsewhere_is_not_diverted(walked, tmp_path, one_line):
    go_on(walked, tmp_path, "500000")
    # Neither a stress beyond it nor one on the way, which would never be written.
    for asked in (["1e6"], ["2e5", "5e5", "1e6"]):
        command = *SMALL, "--stress", "1e4", "1e5", *asked, "-o", tmp_path
        one_line(main, command, "100000; 500000 (Pa)")


def test_walk_of_another_program_is_not_continued(walked, tmp_path, one_line):
    """YADE's states are not given out as modal's, nor walked on by it."""
    for path in walked.iterdir():
        sample = read_sample(path)
        made = sample.provenance | {"command": "yade_scripts/compress.py"}
        write_sample(tmp_path / path.name, replace(sample, provenance=made))
    one_line(
        main,
        [*SMALL, "--stress", "1e4", "1e5", "-o", tmp_path],
        "made by yade_scripts/compress.py, not by python -m modal pack",
    )


def test_unstable_step_is_one_line_and_loses_nothing(walked, tmp_path, monkeypatch, one_line):
    """A step far beyond the limit: the motion explodes, the checkpoint before it stays."""
    whole = protocol.time_step
    monkeypatch.setattr(protocol, "time_step", lambda *given: 20 * whole(*given))
    go_on(walked, tmp_path, "1e+06", strain_rate=np.full(3, -10.0))
    path = tmp_path / CHECKPOINT
    before = path.read_bytes()
    command = *SMALL, "--stress", "1e4", "1e5", "1e6", "-o", tmp_path
    one_line(main, command, "smaller fraction")
    assert path.read_bytes() == before


def test_full_disk_is_one_line_and_loses_nothing(walked, tmp_path, monkeypatch, capsys):
    """The checkpoint before stays readable, and the walk goes on from it."""
    shutil.copytree(walked, tmp_path, dirs_exist_ok=True)

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        assert pack(tmp_path, "--stress", "1e4", "1e5", "2e5") == 2
    shown = capsys.readouterr().err.splitlines()
    assert len([line for line in shown if line.startswith("error: ")]) == 1
    assert "No space left" in shown[-1]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        path.name for path in walked.iterdir()
    )
    assert pack(tmp_path, "--stress", "1e4", "1e5", "2e5") in WRITTEN


def test_walk_goes_on_from_a_checkpoint_of_before(walked, tmp_path):
    """Under its old name, which is then gone: `measure *.h5` in the folder reads states alone."""
    shutil.copytree(walked, tmp_path, dirs_exist_ok=True)
    (tmp_path / CHECKPOINT).rename(tmp_path / OLD_CHECKPOINT)
    before = (tmp_path / "100000Pa.sample.h5").read_bytes()
    assert pack(tmp_path, "--stress", "1e4", "1e5", "1.2e5") in WRITTEN
    assert (tmp_path / "100000Pa.sample.h5").read_bytes() == before
    states = {"10000Pa.sample.h5", "100000Pa.sample.h5", "120000Pa.sample.h5"}
    assert {path.name for path in tmp_path.glob("*.h5")} == states


def test_states_that_were_not_reached_have_a_status(tmp_path, printed, monkeypatch):
    """They are kept, and say so; an undisturbed path has the status 0 and reaches them."""
    few = ["pack", "--spheres", "40", "--aspect", "1", "--stress", "1e5", "--seed", "2"]
    assert printed(*few, "-o", tmp_path / "reached")["reached"]
    monkeypatch.setattr(frictionless, "DESCENT_STEPS", 60)
    told = printed(*few, "-o", tmp_path / "short", status=3)
    assert not told["reached"]
    assert list(told["settled"].values()) == [False]
    (state,) = told["samples"]
    assert not read_sample(state).study["settled"]
