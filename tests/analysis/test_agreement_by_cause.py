"""YADE against the linear wave in a random packing with friction: each cause has its size."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from places import SHEARED

from analysis.agreement import Agreement, Difference, split_by_cause
from benchmarks.harness import yade
from modal.modes.eigenmodes import highest_modes
from modal.modes.mode_set import write_modes
from modal.packing.network import write_network
from modal.packing.sample import read_sample
from modal.system.linear_system import LinearSystem
from modal.waves.signals import Signals, read_signals

NO_SLIP = 10.0
RUNS = {
    "run": (2.5e-9, 0.5),
    "reverse": (-2.5e-9, 0.5),
    "small": (2.5e-11, NO_SLIP),
    "small_reverse": (-2.5e-11, NO_SLIP),
    "no_slip": (2.5e-9, NO_SLIP),
}
"""Amplitude, m, and friction of each run, named as in `analysis.agreement`."""


def wave(folder: Path, amplitude: float, friction: float) -> tuple[Signals, str]:
    """Signals of a run, and what its log says of the contacts."""
    table = f"case mu_wave input_frequency fraction\n30 {friction} 1e5 0.1\n"
    settings = {"WAVE_AMPLITUDE": str(amplitude), "WAVE_DURATION": "1e-4", "WAVE_PARTICLES": "1"}
    written = folder / "case30.signals.h5"
    written.unlink(missing_ok=True)
    yade.run_script("wave", table, folder, **settings)
    log = (folder / "wave.log").read_text()
    return read_signals(written), next(line for line in log.splitlines() if " contacts " in line)


@pytest.mark.slow
def test_each_cause_has_its_size(tmp_path):
    if not yade.available():
        if os.environ.get("CI"):
            pytest.fail("YADE is missing: apt-get install --no-install-recommends yade")
        pytest.skip("YADE is missing")
    network = read_sample(SHEARED).network()
    write_network(tmp_path / "case30.network.h5", network)
    highest = highest_modes(LinearSystem.of(network), 1, certify=False)
    write_modes(tmp_path / "case30.highest.modes.h5", highest)
    found = {name: wave(tmp_path, *setting) for name, setting in RUNS.items()}
    assert all("0 opened; 0 slid" in said for _, said in found.values())
    signals = {name: record for name, (record, _) in found.items()}
    causes = split_by_cause(Agreement(network, signals.pop("run")), **signals)

    def of(start: str) -> Difference:
        return next(row for row in causes if row.cause.startswith(start))

    # No contact slid: another coefficient of friction changes nothing, to the bit.
    assert of("opened and slipped").particles == 0
    # The law's quadratic term is even in the amplitude. So is the sample's own drift, whose share
    # grows as the amplitude falls: of the large runs a hundredth of the small ones' even part.
    even, drift = of("even part"), of("noise floor").particles / 100
    assert drift < 0.1 * even.particles < 1e-3
    # What is odd and not linear is cubic: far smaller, and gone with the amplitude's square.
    odd, small = of("odd part to linear"), of("odd part, small")
    assert odd.particles < 0.1 * even.particles
    assert small.particles < 0.2 * odd.particles
    # Without its quadratic term the law is its tangent, pre-stress included, to 1e-4.
    assert small.particles < 1e-4 < of("pre-stress, all").particles
