"""The split of a difference by cause, on runs whose causes are made up and therefore known."""

from dataclasses import replace

import pytest

from analysis.__main__ import main
from analysis.agreement import Agreement, over_time, split_by_cause
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
