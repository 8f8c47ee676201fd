"""A short FCC column in YADE itself, driven by yade-batch: sample, export, wave."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from modal import gallery
from modal.__main__ import main
from modal.eigenproblem import Eigenproblem
from modal.modes import all_modes
from modal.network import read_network
from modal.signals import read_signals, source_pulse
from modal.source import Pulse
from modal.wave import propagate

ROOT = Path(__file__).resolve().parents[1]
WIDTH, LAYERS, STRESS = 3, 30, 1e5
TABLE = f"""case mu_comp mu_wave stress input_frequency width layers
2 0 0.1 {STRESS} 1e5 {WIDTH} {LAYERS}
"""


def batch(script: str, folder: Path, *, threads: str = "1", **environment: str) -> str:
    """Run one script through yade-batch as a user does; returns its log."""
    table, log = folder / "short.table", folder / f"{script}.log"
    table.write_text(TABLE)
    options = ["-j", threads, "--job-threads", threads, "--log", str(log)]
    command = ["yade-batch", *options, str(table)]
    subprocess.run(
        [*command, str(ROOT / "yade_scripts" / f"{script}.py")],
        cwd=folder,
        env=os.environ | {"WAVE_PRODUCTS": str(folder)} | environment,
        timeout=300,
        check=True,
        capture_output=True,
    )
    return log.read_text()


@pytest.fixture(scope="module")
def products(tmp_path_factory, yade):
    """Folder with the network, the highest mode and the signals of the short column."""
    folder = tmp_path_factory.mktemp("products")
    batch("sample_fcc", folder)
    network, highest = folder / "case02.network.h5", folder / "case02.highest.modes.h5"
    assert main(["modes", str(network), "--highest", "1", "-o", str(highest)]) == 0
    batch("wave", folder, WAVE_DURATION="1e-4")
    return folder


def test_exported_contacts_equal_the_network_made_without_yade(products):
    exported = read_network(products / "case02.network.h5")
    made = gallery.fcc(WIDTH, LAYERS, STRESS)
    assert exported.n_contacts == made.n_contacts
    # Overlaps are differences of positions: relative error eps * length / overlap = 4e-11.
    for name in ("stiffness_normal", "stiffness_tangential", "force_normal"):
        assert np.sort(getattr(exported, name)) == pytest.approx(
            np.sort(getattr(made, name)), rel=1e-9
        )
    found = all_modes(Eigenproblem.of(exported)).frequency
    assert found == pytest.approx(all_modes(Eigenproblem.of(made)).frequency, rel=1e-6)
    assert exported.study["void_ratio"] == pytest.approx(made.study["void_ratio"], rel=1e-9)


def test_wave_follows_the_pulse_and_the_linear_operator(products):
    signals = read_signals(products / "case02.signals.h5")
    pulse = source_pulse(signals.time, 2.5e-9, 1e5)
    assert signals.source_displacement == pytest.approx(pulse, abs=1e-20)
    interval = signals.time[1]
    linear = propagate(
        read_network(products / "case02.network.h5"), signals.time[-1], interval=interval
    ).signals
    # Hertz at 5 nm on an overlap of 360 nm: the quadratic term is some 1e-2 of the linear one;
    # the time step (0.1 of the limit) adds (omega dt)^2 / 24 of the travelled phase, below that.
    along = linear.chain_displacement
    chain = dict(zip(linear.chain_particle // WIDTH**2, along.T, strict=True))
    difference = [
        np.linalg.norm(signals.chain_displacement[:, layer] - chain[layer])
        for layer in range(LAYERS)
    ]
    assert np.linalg.norm(difference) < 0.02 * np.linalg.norm(along)


def test_a_smaller_wave_is_closer_to_linear(products, tmp_path):
    for name in ("case02.network.h5", "case02.highest.modes.h5"):
        shutil.copy(products / name, tmp_path)
    batch("wave", tmp_path, WAVE_DURATION="1e-4", WAVE_AMPLITUDE="2.5e-10")
    large = read_signals(products / "case02.signals.h5").chain_displacement
    small = read_signals(tmp_path / "case02.signals.h5").chain_displacement
    # The quadratic term of the law: ten times the amplitude, a relative change below 1.5 %.
    assert 0 < np.linalg.norm(large - 10 * small) / np.linalg.norm(large) < 0.015


def test_energy_of_the_undamped_run(products):
    log = next(products.glob("wave.log")).read_text()
    assert float(log.split("energy drift ")[1].split()[0]) < 1e-4


def test_unstable_time_step_is_refused_without_a_product(products, tmp_path):
    for name in ("case02.network.h5", "case02.highest.modes.h5"):
        shutil.copy(products / name, tmp_path)
    log = batch("wave", tmp_path, WAVE_DURATION="1e-3", WAVE_FRACTION="1.5")
    assert "error: WAVE_FRACTION 1.5" in log
    assert not (tmp_path / "case02.signals.h5").exists()


def test_finished_products_are_not_made_again(products):
    path = products / "case02.signals.h5"
    before = path.stat().st_mtime_ns
    assert "already there" in batch("wave", products, WAVE_DURATION="1e-4")
    assert path.stat().st_mtime_ns == before


def test_time_step_error_has_order_two(products, tmp_path):
    """Against the exact linear wave; amplitude 0.05 nm, so that the contact law is linear."""
    amplitude, errors = 2.5e-11, []
    for fraction in ("0.4", "0.2"):
        folder = tmp_path / fraction
        folder.mkdir()
        for name in ("case02.network.h5", "case02.highest.modes.h5"):
            shutil.copy(products / name, folder)
        batch(
            "wave",
            folder,
            WAVE_DURATION="7e-5",
            WAVE_AMPLITUDE=str(amplitude),
            WAVE_FRACTION=fraction,
        )
        signals = read_signals(folder / "case02.signals.h5")
        linear = propagate(
            read_network(folder / "case02.network.h5"),
            signals.time[-1],
            motion=Pulse(amplitude),
            interval=signals.time[1],
        ).signals
        # Every chain of the crystal carries the same planar wave, layer by layer.
        assert np.array_equal(signals.chain_particle // WIDTH**2, linear.chain_particle // WIDTH**2)
        difference = signals.chain_displacement - linear.chain_displacement
        errors.append(np.linalg.norm(difference) / np.linalg.norm(linear.chain_displacement))
    # Leapfrog: omega (1 + (omega dt)^2 / 24); the next order changes the ratio by some per cent.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.15)
