"""The split of a difference by cause, on runs whose causes are made up and therefore known."""

from dataclasses import replace

import pytest

from analysis.__main__ import main
from analysis.agreement import OTHER_RUNS, Agreement, over_time, split_by_cause
from analysis.case_files import OTHER_WAVES
from modal.formats.hdf5 import InputError
from modal.packing import examples as gallery
from modal.packing.network_file import write_network
from modal.waves.leapfrog import leapfrog
from modal.waves.signals import Signals, write_signals
from modal.waves.source import Pulse

NETWORK = gallery.fcc(cells=(2, 2, 20))
QUADRATIC, DRIFT = 0.1, 1e-6


def made_up_run(amplitude: float, slip: float = 0.0) -> Signals:
    """The linear wave, plus a quadratic term, a constant drift, and what "slip" adds."""
    run = leapfrog(
        NETWORK, 6e-5, 1e-7, motion=Pulse(1.0), every=5, pre_stress="full", particles=True
    )
    size = abs(run.particle_displacement).max()
    shape = run.particle_displacement
    motion = amplitude * shape + QUADRATIC * amplitude**2 * shape**2 / size
    motion = motion + DRIFT * size + slip * amplitude * shape
    return replace(
        run,
        chain_displacement=motion[:, run.chain_particle],
        particle_displacement=motion,
        layer_displacement=None,
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
    named = {row.cause.split(":")[0].split(" (")[0]: row for row in rows}
    # What is odd in the amplitude and grows with it is the slip alone.
    assert named["odd part to linear"].particles == pytest.approx(0.02, rel=1e-9)
    assert named["opened and slipped contacts"].chain == pytest.approx(0.02, rel=0.1)
    assert named["odd part, small amplitude, to linear"].layers < 1e-9
    # Quadratic term and drift over the linear wave: |u^2| / |u| is below the largest |u|.
    even = named["even part"].particles
    floor = named["noise floor"].particles
    assert 0 < floor < even < 2 * QUADRATIC
    assert named["pre-stress, all of it"].particles > named["pre-stress of shear forces"].particles
    assert named["time step"].median > 0


def test_a_tenth_and_half_the_step_are_told_apart():
    """The quadratic term is a tenth as large; the step's error is that of the linear scheme."""
    run = made_up_run(1.0)
    finer = leapfrog(NETWORK, 6e-5, 5e-8, motion=Pulse(1.0), pre_stress="full", particles=True)
    shape = finer.particle_displacement
    quadratic = QUADRATIC * shape**2 / abs(shape).max()
    finer = replace(
        finer,
        chain_displacement=(shape + quadratic)[:, finer.chain_particle],
        particle_displacement=shape + quadratic,
        layer_displacement=None,
        amplitude=1.0,
    )
    assert len(finer.time) > 2 * len(run.time)  # ten records for each of the first run's
    pair = Agreement(NETWORK, run)
    rows = split_by_cause(pair, tenth=made_up_run(0.1), half_step=finer)
    named = {row.cause: row for row in rows}
    all_of_it = named["YADE to linear, all causes"].particles
    assert named["a tenth of the amplitude to linear"].particles == pytest.approx(
        all_of_it / 10, rel=0.01
    )
    # Leapfrog's error goes with the square of the step: half of it leaves a quarter.
    exact = named["time step (linear leapfrog to exact)"].particles
    assert named["time step (YADE, half of it)"].particles == pytest.approx(0.75 * exact, rel=0.1)


def test_a_run_without_particles_is_compared_by_its_chain_and_layers():
    """The same figures of chain and layers, and none of particles, at a fraction of the memory."""
    run = leapfrog(NETWORK, 6e-5, 1e-7, motion=Pulse(1.0), every=5, pre_stress="full")
    assert run.particle_displacement is None and run.layer_displacement is not None
    row = split_by_cause(Agreement(NETWORK, replace(run, amplitude=1.0)))[0]
    assert row.chain == pytest.approx(0, abs=1e-12) and row.layers == pytest.approx(0, abs=1e-12)
    assert row.particles is None


def test_every_other_run_is_a_known_product():
    of_others = {"100kHz.signals", "shear_yade.signals"}
    assert {f"{name}.signals" for name in OTHER_RUNS} | of_others == set(OTHER_WAVES)


def test_within_leaves_out_what_is_far():
    run = made_up_run(1.0)
    near = Agreement(NETWORK, run, within=0.5 * NETWORK.length)
    motion = near.measured(run)
    assert motion.chain.shape[1] == pytest.approx(10, abs=1)
    assert motion.particles.shape[1] == 4 * motion.chain.shape[1]
    assert over_time(motion, motion) == pytest.approx(0)


def test_runs_that_do_not_belong_together_are_refused():
    run = made_up_run(1.0)
    with pytest.raises(InputError, match="not of this network"):
        Agreement(gallery.fcc(cells=(2, 2, 5)), run)
    with pytest.raises(InputError, match="time steps apart"):
        Agreement(NETWORK, replace(run, time=run.time**1.1))
    with pytest.raises(InputError, match="different times"):
        Agreement(NETWORK, run).measured(replace(run, time=run.time[:-1]))


def test_agreement_on_the_command_line(tmp_path, capsys):
    network, signals = tmp_path / "a.network.h5", tmp_path / "a.signals.h5"
    write_network(network, NETWORK)
    write_signals(signals, made_up_run(1.0, slip=0.02))
    table = tmp_path / "a.md"
    command = ["agreement", str(network), str(signals), "--first", "12", "-o", str(table)]
    assert main(command) == 0
    text = table.read_text()
    assert text == capsys.readouterr().out
    assert "| YADE to linear, all causes |" in text
    assert main([*command[:3], "--first", "99"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
