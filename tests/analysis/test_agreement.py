"""The split of a difference by cause, on runs whose causes are made up and therefore known."""

from dataclasses import replace

import pytest
from oracles import stepped

from analysis.__main__ import main
from analysis.agreement import Agreement, compare, split_by_cause
from analysis.case import Case
from analysis.packing_data import PackingData
from modal.packing import crystal as gallery
from modal.packing.network import write_network
from modal.tools.errors import InputError
from modal.waves.motions import Pulse, chirp, step
from modal.waves.propagate import LINEAR_TOLERANCE, propagate
from modal.waves.signals import Signals, write_signals

NETWORK = gallery.fcc(cells=(2, 2, 20))
QUADRATIC, DRIFT = 0.1, 1e-6


def made_up_run(amplitude: float, slip: float = 0.0, step: float = 1e-7, every: int = 5) -> Signals:
    """The linear wave, plus a quadratic term, a constant drift, and what "slip" adds."""
    how = {"motion": Pulse(1.0), "pre_stress": "full", "particles": True}
    run = stepped(NETWORK, 6e-5, step, every=every, **how)
    size = abs(run.particle_displacement).max()
    shape = run.particle_displacement
    motion = amplitude * shape + QUADRATIC * amplitude**2 * shape**2 / size
    motion = motion + DRIFT * size + slip * amplitude * shape
    return replace(
        run,
        chain_displacement=motion[:, run.chain_particle],
        particle_displacement=motion,
        layer_displacement=None,
        source_displacement=amplitude * run.source_displacement,
        amplitude=amplitude,
    )


def test_causes_are_told_apart():
    run = made_up_run(1.0, slip=0.02)
    rows = split_by_cause(
        Agreement(NETWORK, run),
        reverse=made_up_run(-1.0, slip=0.02),
        small=made_up_run(1e-2),
        small_reverse=made_up_run(-1e-2),
        no_slip=made_up_run(1.0),
    )
    difference = {row.names: row for row in rows}
    # What is odd in the amplitude and grows with it is the slip alone.
    assert difference["odd", "linear"].particles == pytest.approx(0.02, rel=1e-9)
    assert difference["run", "no_slip"].chain == pytest.approx(0.02, rel=0.1)
    assert difference["small_odd", "linear"].layers < 1e-9
    # Quadratic term and drift over the linear wave: |u^2| / |u| is below the largest |u|.
    even = difference["run", "odd"].particles
    floor = difference["small", "small_odd"].particles
    assert 0 < floor < even < 2 * QUADRATIC
    assert difference["none", "linear"].particles > difference["normal", "linear"].particles
    assert difference["linear", "exact"].median > 0


def test_a_tenth_and_half_the_step_are_told_apart():
    """The quadratic term is a tenth as large; the step's error is that of the linear scheme."""
    run = made_up_run(1.0)
    finer = made_up_run(1.0, step=5e-8, every=1)
    assert len(finer.time) > 2 * len(run.time)  # ten records for each of the first run's
    pair = Agreement(NETWORK, run)
    rows = split_by_cause(pair, tenth=made_up_run(0.1), half_step=finer)
    difference = {row.names: row for row in rows}
    all_of_it = difference["run", "linear"].particles
    tenth = difference["tenth", "linear"].particles
    assert tenth == pytest.approx(all_of_it / 10, rel=0.01)
    # Leapfrog's error goes with the square of the step: half of it leaves a quarter.
    exact = difference["linear", "exact"].particles
    assert difference["run", "half_step"].particles == pytest.approx(0.75 * exact, rel=0.1)


def test_a_run_without_particles_is_compared_by_its_chain_and_layers():
    """The same figures of chain and layers, and none of particles, at a fraction of the memory."""
    run = stepped(NETWORK, 6e-5, 1e-7, motion=Pulse(1.0), every=5, pre_stress="full")
    assert run.particle_displacement is None and run.layer_displacement is not None
    row = split_by_cause(Agreement(NETWORK, replace(run, amplitude=1.0)))[0]
    assert row.chain == pytest.approx(0, abs=1e-12) and row.layers == pytest.approx(0, abs=1e-12)
    assert row.particles is None


@pytest.fixture(scope="module")
def pair():
    return Agreement(NETWORK, made_up_run(1.0))


@pytest.mark.parametrize(
    ("network", "power_of_time", "code"),
    [
        pytest.param(gallery.fcc(cells=(2, 2, 5)), 1.0, "other_network", id="network"),
        pytest.param(NETWORK, 1.1, "uneven_times", id="uneven times"),
    ],
)
def test_a_run_that_does_not_belong_to_the_network_is_refused(pair, network, power_of_time, code):
    run = replace(pair.run, time=pair.run.time**power_of_time)
    with pytest.raises(InputError) as refused:
        Agreement(network, run)
    assert refused.value.code == code


def test_a_run_at_other_times_is_refused(pair):
    with pytest.raises(InputError) as refused:
        pair.measured(replace(pair.run, time=pair.run.time[:-1]))
    assert refused.value.code == "other_times"


def test_a_run_with_another_motion_of_the_source_is_refused(pair):
    source = pair.run.source_displacement**2
    with pytest.raises(InputError) as refused:
        pair.measured(replace(pair.run, source_displacement=source))
    assert refused.value.code == "other_source"


def test_agreement_on_the_command_line(tmp_path, capsys, one_line):
    network, signals = tmp_path / "a.network.h5", tmp_path / "a.signals.h5"
    write_network(network, NETWORK)
    write_signals(signals, made_up_run(1.0, slip=0.02))
    table = tmp_path / "a.md"
    command = ["agreement", str(network), str(signals), "-o"]
    assert main([*command, str(table)]) == 0
    text = table.read_text()
    assert text == capsys.readouterr().out
    assert "| YADE to linear, all causes |" in text
    one_line(main, [*command, str(tmp_path / "a.csv")])


@pytest.mark.parametrize("producer", ["yade", "linear"])
@pytest.mark.parametrize(
    "motion, within",
    [
        # A curve of the fifth order through 12 samples of the chirp's shortest period, and the
        # straight pieces of both motions, 120 and 100 to it: (2 pi / 100)^2 / 12 = 3e-4 at most.
        (chirp(1e-9, 5e3, 8e4, 2e-4), 3e-4),
        (step(-1e-9, 2e-5), 3e-4),
        (Pulse(-1e-9, 7e4), 1e-12),
    ],
)
def test_the_recorded_motion_of_the_source_is_sent_again(motion, within, producer, tmp_path):
    """A wave recorded exactly is the case's own linear wave, and agrees with its network's.

    Recorded at other times the two are other series, each true to its tolerance.
    """
    write_network(tmp_path / "a.network.h5", NETWORK)
    wave = propagate(NETWORK, 3e-4, motion=motion, interval=1e-6, pre_stress="full").signals
    springs = propagate(NETWORK, 3e-4, motion=motion, interval=1e-6).signals
    write_signals(tmp_path / "a.signals.h5", replace(springs, producer=producer))
    again = PackingData.of(Case("a", tmp_path)).linear
    every = round(again.time[1] / 1e-6)
    again = again.chain_displacement[: 1 + 300 // every]
    difference = again - springs.chain_displacement[::every][: len(again)]
    bound = max(within, 2 * LINEAR_TOLERANCE)
    assert abs(difference).max() < bound * abs(springs.chain_displacement).max()
    pair = Agreement(NETWORK, replace(wave, time_step=1e-6))
    found, linear = pair.measured(pair.run), pair.linear("full", exact_in_time=True)
    assert compare("", found, linear).chain < within
