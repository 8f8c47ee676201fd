"""Tests of YADE at its limits: time steps past 2 / omega_max, large waves, repeated runs."""

from __future__ import annotations

import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from in_yade import error_lines, put
from short_column import LAYERS, WIDTH, batch

from benchmarks.harness.yade import in_yades_order
from modal.modes.mode_set import read_modes, write_modes
from modal.packing import crystal as gallery
from modal.packing.network import Network, read_network
from modal.waves.energy_balance import MAX_GAP
from modal.waves.motions import AMPLITUDE
from modal.waves.signals import Signals, read_signals


@pytest.fixture(scope="module")
def products(tmp_path_factory, yade) -> Path:
    """Return a folder with the network and the highest mode of a short column."""
    folder = tmp_path_factory.mktemp("products")
    put(folder, "case02", in_yades_order(gallery.fcc(cells=(WIDTH, WIDTH, LAYERS))))
    return folder


def wave(
    products: Path,
    folder: Path,
    *,
    over: float = 1.0,
    **environment: str,
) -> tuple[Signals | None, str]:
    """Return signals and log of a run whose omega_max is divided by `over`."""
    folder.mkdir(exist_ok=True)
    shutil.copy(products / "case02.network.h5", folder)
    modes = read_modes(products / "case02.highest.modes.h5")
    modes.frequency = modes.frequency / over
    write_modes(folder / "case02.highest.modes.h5", modes)
    log = batch("wave", folder, **{"WAVE_DURATION": "1e-4"} | environment)
    path = folder / "case02.signals.h5"
    return read_signals(path) if path.exists() else None, log


def number(log: str, before: str = "", after: str = "") -> float:
    """Return the number between two texts of a log."""
    return float(re.search(rf"{before}([-+.0-9e]+){after}", log)[1])


def test_step_at_the_limit_keeps_the_energy(products, tmp_path):
    """Take the step omega_max dt = 2 itself; the law is non-linear by 1e-2 at 5 nm."""
    signals, log = wave(products, tmp_path, WAVE_FRACTION="1.0", WAVE_DURATION="4e-4")
    assert signals is not None
    assert abs(signals.balance.drift) < signals.balance.limit < 0.02


PAST = (1.001, 1.01, 1.02, 1.1, 1.2, 1.5, 3.0, 10.0)


def time_to_be_seen(over: float, network: Network, step: float) -> float:
    """Return the time, s, in which the highest mode grows from round-off past the wave.

    At omega dt = 2 k the leapfrog scheme multiplies a mode by (k + sqrt(k^2 - 1))^2 in each step
    `step`, s. Round-off of a position is eps times the length. Only a small part of it is in this
    mode, which in the end must hold most of the energy: three times the steps from the one to the
    other.
    """
    growth = 2 * math.acosh(over)  # = log((k + sqrt(k^2 - 1))^2)
    round_off = np.finfo(float).eps * network.length
    return 3 * math.log(AMPLITUDE / round_off) / growth * step


@pytest.mark.parametrize(
    "over", [1.05, 2.0, *(pytest.param(k, marks=pytest.mark.slow) for k in PAST)]
)
def test_step_past_the_limit_is_refused(over, products, tmp_path):
    network = read_network(products / "case02.network.h5")
    highest = read_modes(products / "case02.highest.modes.h5").frequency[-1]
    duration = max(1e-4, time_to_be_seen(over, network, over / (math.pi * highest)))
    settings = {"WAVE_FRACTION": "1.0", "WAVE_DURATION": str(duration)}
    signals, log = wave(products, tmp_path, over=over, **settings)
    assert signals is None
    (error,) = error_lines(log)
    assert "WAVE_FRACTION" in error


def test_large_wave_opens_and_slides_and_says_so(products, tmp_path):
    """Move the wall by 1 um on overlaps of 0.36 um: contacts open and slide, the energy falls.

    What it falls by is what slip dissipates. A hundred looks see it by trapezoids, of forces that
    vanish and come back between them: the books close to a tenth or so, and the run says it.
    """
    signals, log = wave(products, tmp_path, WAVE_AMPLITUDE="1e-6", WAVE_FRACTION="0.2")
    assert signals is not None
    assert number(log, after=" opened") > 0
    assert number(log, after=" slid") > 0
    balance = signals.balance
    assert balance.opened > 0
    assert balance.slid > 0
    assert -1 < balance.drift < -0.1
    assert balance.drift + balance.friction == pytest.approx(0, abs=0.2)
    assert MAX_GAP < abs(balance.gap) < 0.2
    assert not balance.closes


def test_equal_runs_are_equal_to_the_last_bit(products, tmp_path):
    options = {"WAVE_FRACTION": "0.5", "WAVE_DURATION": "1e-4"}
    first = wave(products, tmp_path / "a", **options)[0]
    second = wave(products, tmp_path / "b", **options)[0]
    for name in ("chain_displacement", "layer_displacement", "source_stress", "receiver_stress"):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name
