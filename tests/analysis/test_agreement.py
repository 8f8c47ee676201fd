"""The difference between a run and the linear wave, split by causes that are made up and known."""

from dataclasses import replace

import pytest
from oracles import stepped
from refusals import refusal

from analysis.__main__ import main
from analysis.agreement import Agreement, compare, split_by_cause
from analysis.case import Case
from analysis.packing_data import PackingData
from modal.packing import crystal as gallery
from modal.packing.network import write_network
from modal.waves.motions import Pulse, chirp, step
from modal.waves.propagate import LINEAR_TOLERANCE, propagate
from modal.waves.signals import Signals, write_signals

NETWORK = gallery.fcc(cells=(2, 2, 20))
QUADRATIC = 0.1
"""Quadratic part of the motion, at amplitude 1 and the largest displacement."""
DRIFT = 1e-6
"""Constant displacement, divided by the largest one of amplitude 1."""


def made_up_run(amplitude: float, slip: float = 0.0, step: float = 1e-7, every: int = 5) -> Signals:
    """Return the linear wave u at this amplitude A with known deviations added.

    These are a quadratic term in A u, a constant drift, and a part `slip` of A u, which stands for
    slip of contacts. The wave is that of steps of this length, s, recorded at each `every`-th.
    """
    wave = {"motion": Pulse(1.0), "pre_stress": "full", "particles": True}
    run = stepped(NETWORK, 6e-5, step, every=every, **wave)
    u = run.particle_displacement
    largest = abs(u).max()
    motion = amplitude * u
    motion = motion + QUADRATIC * (amplitude * u) ** 2 / largest
    motion = motion + DRIFT * largest
    motion = motion + slip * amplitude * u
    return replace(
        run,
        chain_displacement=motion[:, run.chain_particle],
        particle_displacement=motion,
        layer_displacement=None,
        source_displacement=amplitude * run.source_displacement,
        amplitude=amplitude,
    )


@pytest.fixture(scope="module")
def run() -> Signals:
    """Return a run of amplitude 1 without slip."""
    return made_up_run(1.0)


@pytest.fixture(scope="module")
def pair(run) -> Agreement:
    """Return the comparison of that run with the linear wave of its network."""
    return Agreement(NETWORK, run)


@pytest.fixture(scope="module")
def differences(run):
    """Return the differences between a run with 2 % of slip and other runs, by their names."""
    slipping = made_up_run(1.0, slip=0.02)
    rows = split_by_cause(
        Agreement(NETWORK, slipping),
        reverse=made_up_run(-1.0, slip=0.02),
        small=made_up_run(1e-2),
        small_reverse=made_up_run(-1e-2),
        no_slip=run,
    )
    return {row.names: row for row in rows}


def test_odd_part_that_grows_with_the_amplitude_is_slip(differences):
    assert differences["odd", "linear"].particles == pytest.approx(0.02, rel=1e-9)
    assert differences["small_odd", "linear"].layers < 1e-9


def test_run_without_slip_shows_the_slip(differences):
    """Allow a tenth, the size of the quadratic term, which both runs have."""
    assert differences["run", "no_slip"].chain == pytest.approx(0.02, rel=0.1)


def test_even_part_is_the_quadratic_term_and_the_drift(differences):
    """Bound the quadratic term divided by the wave: |u^2| / |u| is below the largest |u|.

    At a hundredth of the amplitude the drift alone is left.
    """
    even = differences["run", "odd"].particles
    even_of_small = differences["small", "small_odd"].particles
    assert 0 < even_of_small < even < 2 * QUADRATIC


def test_pre_stress_is_a_cause(differences):
    without_pre_stress = differences["none", "linear"].particles
    normal_forces_only = differences["normal", "linear"].particles
    assert without_pre_stress > normal_forces_only


def test_time_step_is_a_cause(differences):
    assert differences["linear", "exact"].median > 0


@pytest.fixture(scope="module")
def step_differences(pair):
    """Return the differences from runs at a tenth of the amplitude and at half the step.

    The run at half the step records every step, ten times as often as the first run.
    """
    tenth = made_up_run(0.1)
    finer = made_up_run(1.0, step=5e-8, every=1)
    rows = split_by_cause(pair, tenth=tenth, half_step=finer)
    return {row.names: row for row in rows}


def test_quadratic_term_is_a_tenth_at_a_tenth_of_the_amplitude(step_differences):
    """Allow a hundredth for the drift, which is a thousandth of the amplitude."""
    expected = step_differences["run", "linear"].particles / 10
    assert step_differences["tenth", "linear"].particles == pytest.approx(expected, rel=0.01)


def test_half_the_step_shows_three_quarters_of_its_error(step_differences):
    """Leave a quarter of the error of leapfrog, which is of second order, at half the step."""
    whole_error = step_differences["linear", "exact"].particles
    difference = step_differences["run", "half_step"].particles
    assert difference == pytest.approx(0.75 * whole_error, rel=0.1)


def test_a_run_without_particles_is_compared_by_its_chain_and_layers():
    run = stepped(NETWORK, 6e-5, 1e-7, motion=Pulse(1.0), every=5, pre_stress="full")
    assert run.particle_displacement is None
    assert run.layer_displacement is not None
    row = split_by_cause(Agreement(NETWORK, replace(run, amplitude=1.0)))[0]
    assert row.chain == pytest.approx(0, abs=1e-12)
    assert row.layers == pytest.approx(0, abs=1e-12)
    assert row.particles is None


@pytest.mark.parametrize(
    ("network", "power_of_time", "code"),
    [
        pytest.param(gallery.fcc(cells=(2, 2, 5)), 1.0, "other_network", id="network"),
        pytest.param(NETWORK, 1.1, "uneven_times", id="uneven times"),
    ],
)
def test_a_run_that_does_not_belong_to_the_network_is_refused(pair, network, power_of_time, code):
    run = replace(pair.run, time=pair.run.time**power_of_time)
    with refusal(code):
        Agreement(network, run)


def test_a_run_at_other_times_is_refused(pair):
    with refusal("other_times"):
        pair.measured(replace(pair.run, time=pair.run.time[:-1]))


def test_a_run_with_another_motion_of_the_source_is_refused(pair):
    source = pair.run.source_displacement**2
    with refusal("other_source"):
        pair.measured(replace(pair.run, source_displacement=source))


def test_agreement_on_the_command_line(run, tmp_path, capsys, one_line):
    network = tmp_path / "a.network.h5"
    signals = tmp_path / "a.signals.h5"
    table = tmp_path / "a.md"
    write_network(network, NETWORK)
    write_signals(signals, run)
    command = ["agreement", str(network), str(signals), "-o"]
    assert main([*command, str(table)]) == 0
    text = table.read_text()
    assert text == capsys.readouterr().out
    assert "| YADE to linear, all causes |" in text
    one_line(main, [*command, str(tmp_path / "a.csv")])


RECORDED_MOTIONS = [
    # A curve of the fifth order through 12 samples of the chirp's shortest period, and straight
    # pieces of both motions, of which it has 120 and 100: (2 pi / 100)^2 / 12 = 3e-4 at most.
    pytest.param(chirp(1e-9, 5e3, 8e4, 2e-4), 3e-4, id="chirp"),
    pytest.param(step(-1e-9, 2e-5), 3e-4, id="step"),
    pytest.param(Pulse(-1e-9, 7e4), 1e-12, id="pulse"),
]


@pytest.mark.parametrize("producer", ["yade", "linear"])
@pytest.mark.parametrize(("motion", "tolerance"), RECORDED_MOTIONS)
def test_the_recorded_motion_of_the_source_is_sent_again(motion, tolerance, producer, tmp_path):
    """Compare the case's linear wave, sent by the recorded motion, with the recorded wave.

    The two are recorded at other times, so they are other series, each true to its tolerance.
    """
    write_network(tmp_path / "a.network.h5", NETWORK)
    springs = propagate(NETWORK, 3e-4, motion=motion, interval=1e-6).signals
    write_signals(tmp_path / "a.signals.h5", replace(springs, producer=producer))
    again = PackingData.of(Case("a", tmp_path)).linear
    every = round(again.time[1] / 1e-6)
    again = again.chain_displacement[: 1 + 300 // every]
    recorded = springs.chain_displacement[::every][: len(again)]
    bound = max(tolerance, 2 * LINEAR_TOLERANCE)
    assert abs(again - recorded).max() < bound * abs(springs.chain_displacement).max()


@pytest.mark.parametrize(("motion", "tolerance"), RECORDED_MOTIONS)
def test_an_exact_run_agrees_with_the_linear_wave_of_its_source(motion, tolerance):
    wave = propagate(NETWORK, 3e-4, motion=motion, interval=1e-6, pre_stress="full").signals
    pair = Agreement(NETWORK, replace(wave, time_step=1e-6))
    measured = pair.measured(pair.run)
    linear = pair.linear("full", exact_in_time=True)
    assert compare("", measured, linear).chain < tolerance
