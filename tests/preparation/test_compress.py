"""Tests of loading paths: clouds, states, refusals."""

import json
import re
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO

import numpy as np
import pytest
from small_path import SHAPE, pack

from modal.__main__ import main
from modal.packing.contact_law import Elasticity
from modal.packing.sample import read_sample, write_sample
from modal.packing.state import coordination_without_rattlers
from modal.packing.summary import summary
from modal.preparation import frictionless, protocol
from modal.preparation.cloud import make_cloud
from modal.preparation.compression import compact_cloud, start_dynamics
from modal.preparation.protocol import CHECKPOINT
from modal.preparation.study import CLOUD_FRACTION, Study
from modal.tools import progress


def test_cloud_of_a_mixture_has_its_sizes_and_solid_fraction():
    study = Study(spheres=150, width=5.0, seed=3, sizes="two 2 0.5")
    sample = make_cloud(study)
    assert np.array_equal(np.sort(sample.radii), np.sort(study.mixture.radii))
    volume = sample.side.prod() * np.ptp(sample.walls)
    solid = (4 / 3 * np.pi * sample.radii**3).sum() / volume
    assert solid == pytest.approx(CLOUD_FRACTION, rel=1e-12)


def test_cloud_of_a_mixture_has_no_contact():
    """Compute the gaps of all pairs, with their lateral images."""
    sample = make_cloud(Study(spheres=150, width=5.0, seed=3, sizes="two 2 0.5"))
    assert len(sample.contacts().particle_i) == 0
    branch = sample.position[:, None] - sample.position
    branch[..., :2] -= sample.side * np.round(branch[..., :2] / sample.side)
    gap = np.linalg.norm(branch, axis=2) - np.add.outer(sample.radii, sample.radii)
    assert gap[~np.eye(150, dtype=bool)].min() > 0


def test_time_step_of_a_mixture_goes_by_its_smallest_sphere():
    mixed = Study(spheres=150, width=5.0, seed=3, sizes="two 2 0.5")
    equal = Study(spheres=150, width=5.0, seed=3)
    ratio = mixed.mixture.smallest / equal.mixture.smallest
    assert ratio < 0.9
    mixed_step = protocol.Stage("approach", mixed).time_step()
    equal_step = protocol.Stage("approach", equal).time_step()
    assert mixed_step == pytest.approx(ratio * equal_step)


@pytest.fixture(scope="module")
def compacted_mixture():
    """Return a compacted cloud of two sizes and densities between walls of steel."""
    words = {"sizes": "two 2 0.5", "densities": "2500 7800", "walls": "2.1e11 0.3"}
    sample = compact_cloud(Study(spheres=100, width=4.5, **words), start_dynamics)
    assert sample.study == sample.study | words
    return sample


def test_compaction_keeps_the_materials_of_a_mixture(compacted_mixture):
    is_large = compacted_mixture.radii > compacted_mixture.radius
    assert is_large.any()
    assert np.array_equal(compacted_mixture.densities, np.where(is_large, 7800.0, 2500.0))
    assert compacted_mixture.wall_material == Elasticity(2.1e11, 0.3)


@pytest.mark.parametrize(
    "options", [[], ["--sizes", "two", "2", "0.5"]], ids=["equal spheres", "other materials"]
)
def test_mixture_goes_on_from_its_own_checkpoint_alone(
    options, compacted_mixture, tmp_path, refusal_code
):
    write_sample(tmp_path / CHECKPOINT, compacted_mixture)
    command = ["pack", "--spheres", "100", "--width", "4.5", "--friction", "0.4"]
    command += ["--stress", "1e4", *options, "-o", tmp_path]
    assert refusal_code(main, command) == "other_study"


@pytest.fixture(params=[1e4, 1e5], ids=["10 kPa", "100 kPa"])
def state(request, finished_path):
    """Return a state of a path, with its stress as the only target."""
    sample = read_sample(finished_path / f"{request.param:g}Pa.sample.h5")
    assert sample.study["stress"] == request.param
    return sample


def test_state_has_its_stress(state):
    """Compute the stress from the network; it was last controlled at most five steps before."""
    target = state.study["stress"]
    tolerance = 2 * state.study["stress_error"] + 1e-3
    assert summary(state.network())["stress_pa"] == pytest.approx([target] * 3, rel=tolerance)


def test_state_says_whether_it_is_settled(state):
    stress_error = state.study["stress_error"]
    residual = state.study["unbalanced"]
    is_settled = (
        stress_error < protocol.SETTLED.stress_error and residual < protocol.SETTLED.residual
    )
    assert state.study["settled"] == is_settled


def test_state_rests_at_a_plausible_density(state):
    assert state.velocity is None
    assert 0.55 < state.study["void_ratio"] < 0.85


def test_state_uses_the_friction_of_its_study(state):
    assert state.study["mu_comp"] == state.friction == 0.4
    shear = np.linalg.norm(state.shear, axis=1)
    force = state.network().force_normal
    assert (shear <= 0.4 * force * (1 + 1e-9)).all()
    assert shear.max() > 0.3 * force.mean()


def test_dilated_packing_is_dense_with_few_contacts(tmp_path, refusal_code):
    """Reproduce states A and C of Agnolin and Roux: 6.0 and 4.6 contacts at nearly one density.

    The dilated packing jams denser than it was dilated to, and looser than without friction; both
    are at 10 kPa.
    """
    command = ["pack", "--spheres", "300", "--aspect", "1", "--periodic", "--friction", "0.3"]
    command += ["--stress", "1e4", "-o", str(tmp_path), "--dilate"]
    assert main([*command, "0.005"]) == 0
    dense = read_sample(tmp_path / "dense" / "10000Pa.sample.h5")
    dilated = read_sample(tmp_path / "10000Pa.sample.h5")
    dense_voids = summary(dense.network())["void_ratio"]
    dilated_voids = summary(dilated.network())["void_ratio"]
    loosest_voids = (1 + dense_voids) * 1.005**3 - 1
    assert dense_voids < dilated_voids < 0.5 * (dense_voids + loosest_voids)
    dense_coordination, _ = coordination_without_rattlers(dense.network())
    dilated_coordination, _ = coordination_without_rattlers(dilated.network())
    assert dense_coordination > 5.8
    assert dilated_coordination < 4.9
    assert dilated.friction == 0.3
    assert dilated.study["dilate"] == 0.005
    assert refusal_code(main, [*command, "0.006"]) == "other_study"


@pytest.fixture(scope="module")
def unsettled_run(tmp_path_factory):
    """Return the file and the output of a path that stops early, with a progress line per check."""
    folder = tmp_path_factory.mktemp("unsettled")
    shown = StringIO()
    errors = StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(shown), redirect_stderr(errors):
        patch.setattr(protocol, "PATIENCE", 2 * protocol.CHECK_INTERVAL)
        patch.setattr(progress, "LOG_INTERVAL", 0.0)
        assert pack(folder, "--stress", "1e5", "--json") == 3
    return folder / "100000Pa.sample.h5", shown.getvalue(), errors.getvalue()


def test_unsettled_state_is_marked(unsettled_run):
    path, shown, _ = unsettled_run
    study = read_sample(path).study
    assert not study["settled"]
    is_unbalanced = study["unbalanced"] > protocol.SETTLED.residual
    assert is_unbalanced or study["stress_error"] > protocol.SETTLED.stress_error
    assert json.loads(shown)["settled"] == {str(path): False}


def test_progress_names_the_stage_and_its_limits(unsettled_run):
    """Check names and numbers of the lines, one a minute, that show how far a stage is."""
    _, _, errors = unsettled_run
    assert re.search(r"cloud: step 1 of", errors)
    assert re.search(r"\bcool: ", errors)
    assert re.search(r"\bjam: .* unbalanced 1\.0e-02 .* 1\.0e-01", errors)


REFUSED_OPTIONS = {
    "--spheres 3": "too_few_spheres",
    "--aspect 1e-3": "narrow_cell",
    "--stress -5": "stress",
    "--residual 2": "hot_stress_or_residual",
    "--stress 1e6 1e7 1e6": "repeated_stress",
    "--peak 1e5": "peak",
    "--oedometric": "unequal_stress_without_friction",
    "--densities 2.23 7.8": "densities",
    "--walls 2.1e11 0.5": "wall_material",
    "--young 6": "solid",
    "--friction 0.4 --spheres 99": "too_few_spheres",
    "--friction 0.4 --stress 1e5 1e4": "stress_order",
    "--friction 0.4 --time-step-fraction 2": "fraction",
    "--friction 0.3 --stress-ratio 0": "stress_ratio",
    "--friction 0.3 --stress-ratio 0.5 --oedometric": "ratio_and_oedometric",
}
"""Options of impossible packings, with the code of each refusal."""


@pytest.mark.parametrize("options", REFUSED_OPTIONS)
def test_impossible_packing_is_refused(options, tmp_path, refusal_code):
    command = *SHAPE, "--stress", "1e6", *options.split(), "-o", tmp_path / "new"
    assert refusal_code(main, command) == REFUSED_OPTIONS[options]
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ("--local-damping 0.1", "unused_option"),
        ("--friction 0.4 --peak 1e8", "unused_option"),
        ("--friction 0.4 --width 60", "command_line"),  # beside the --aspect of SHAPE
    ],
)
def test_option_without_meaning_is_refused(options, code, tmp_path, one_line):
    command = [*SHAPE, "--stress", "1e6", *options.split(), "-o", tmp_path / "new"]
    name = options.split()[-2]
    one_line(main, command, name, code=code)
    assert not (tmp_path / "new").exists()


def test_states_that_were_not_reached_have_a_status(tmp_path, printed, monkeypatch):
    """Check status 3 of a descent that stops early, and status 0 of one that does not."""
    command = ["pack", "--spheres", "40", "--aspect", "1", "--stress", "1e5", "--seed", "2"]
    assert printed(*command, "-o", tmp_path / "reached")["reached"]
    monkeypatch.setattr(frictionless, "DESCENT_STEPS", 60)
    result = printed(*command, "-o", tmp_path / "short", status=3)
    assert not result["reached"]
    assert list(result["settled"].values()) == [False]
    (path,) = result["samples"]
    assert not read_sample(path).study["settled"]
