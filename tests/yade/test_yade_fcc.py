"""Tests of a short FCC column in YADE, driven by a table: sample, export, wave."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from in_yade import error_lines, write_highest
from short_column import LAYERS, STRESS, WIDTH, batch

from modal.__main__ import main
from modal.formats.provenance import Source, read_provenance
from modal.packing import crystal as gallery
from modal.packing.network import read_network, write_network
from modal.system.assembly import stiffness_matrix
from modal.system.damping import ContactDamping
from modal.waves.motions import Pulse, chirp
from modal.waves.propagate import propagate
from modal.waves.signals import read_signals


@pytest.fixture(scope="module")
def products(tmp_path_factory, yade):
    """Return a folder with the network, the highest mode and the signals of the short column."""
    folder = tmp_path_factory.mktemp("products")
    batch("sample_fcc", folder)
    write_highest(folder, "case02")
    batch("wave", folder, WAVE_DURATION="1e-4")
    return folder


def beside(products: Path, folder: Path) -> Path:
    """Copy network and highest mode of the column to a folder, and return it."""
    folder.mkdir(exist_ok=True)
    for kind in ("network", "highest.modes"):
        shutil.copy(products / f"case02.{kind}.h5", folder)
    return folder


@pytest.fixture(scope="module")
def exported(products):
    """Return the network that YADE has exported."""
    return read_network(products / "case02.network.h5")


@pytest.fixture(scope="module")
def generated():
    """Return the network of the same crystal, generated without YADE."""
    return gallery.fcc(STRESS, (WIDTH, WIDTH, LAYERS))


@pytest.mark.parametrize("name", ["stiffness_normal", "stiffness_tangential", "force_normal"])
def test_exported_contacts_equal_those_generated_without_yade(exported, generated, name):
    """Compare in order of size, within 1e-9.

    Overlaps are differences of positions: their relative error is eps * length / overlap = 4e-11.
    """
    assert exported.n_contacts == generated.n_contacts
    expected = np.sort(getattr(generated, name))
    assert np.sort(getattr(exported, name)) == pytest.approx(expected, rel=1e-9)


def test_exported_network_has_the_spectrum_of_the_generated_one(exported, generated):
    """Compare stiffness matrices and masses, which have one order of the spheres."""
    stiffness = stiffness_matrix(generated)
    assert abs(stiffness_matrix(exported) - stiffness).max() < 1e-8 * abs(stiffness).max()
    assert exported.mass == pytest.approx(generated.mass, rel=1e-12)
    assert exported.study["void_ratio"] == pytest.approx(generated.study["void_ratio"], rel=1e-9)


def test_energy_error_has_order_two(products, tmp_path):
    """Halve the time step of a wave in which nothing slides: the change of energy is its error.

    What the wave has after the pulse is the work that the wall has done, from its recorded stress.
    """
    area = float(np.prod(read_network(products / "case02.network.h5").cell_size[:2]))
    drift = []
    for fraction in ("0.4", "0.2"):
        folder = beside(products, tmp_path / fraction)
        # Large enough to stand clear of round-off: 1e-17 J of 2e-8 J.
        settings = {"WAVE_DURATION": "5e-5", "WAVE_AMPLITUDE": "2.5e-8"}
        batch("wave", folder, WAVE_FRACTION=fraction, **settings)
        signals = read_signals(folder / "case02.signals.h5")
        stress = signals.source_stress
        mean_stress = (stress[1:] + stress[:-1]) / 2
        work = area * (np.diff(signals.source_displacement) * mean_stress).sum()
        balance = signals.balance
        # Trapezoids of a record every 0.4 rad at most of the pulse: (omega dt)^2 / 12.
        assert balance.energy == pytest.approx(work, rel=0.02)
        # The run adds a trapezoid a step: only the curvature of the law is left, as in the drift.
        assert balance.energy == pytest.approx(balance.work, rel=1e-3)
        assert abs(balance.gap) < 1e-3
        assert balance.slid == 0
        assert balance.friction == 0
        assert balance.closes
        drift.append(balance.drift)
    assert np.log2(drift[0] / drift[1]) == pytest.approx(2, abs=0.3)


def test_finished_products_are_not_made_again(products):
    for script, kind in (("sample_fcc", "network"), ("wave", "signals")):
        path = products / f"case02.{kind}.h5"
        before = path.stat().st_mtime_ns
        assert "already there" in batch(script, products, WAVE_DURATION="1e-4")
        assert path.stat().st_mtime_ns == before


def test_wave_of_other_settings_is_stale_and_made_again(products, tmp_path):
    """Change settings in table and environment; the log has both values of each."""
    for name in ("network", "highest.modes", "signals"):
        shutil.copy(products / f"case02.{name}.h5", tmp_path)
    columns = {"mu_wave": "0.2", "input_frequency": "2e5", "interval": "1e-6", "amplitude": "1e-9"}
    log = batch("wave", tmp_path, columns=columns, WAVE_FRACTION="0.4")
    assert (
        "stale, amplitude was 2.5e-09, is 1e-09; duration was 0.0001, is absent; fraction was 0.05,"
        " is 0.4; input_frequency was 100000.0, is 200000.0; interval was 5e-07, is 1e-06; "
        "mu_wave was 0.1, is 0.2; making it again"
    ) in log
    signals = read_signals(tmp_path / "case02.signals.h5")
    assert (signals.amplitude, signals.input_frequency) == (1e-9, 2e5)
    assert (tmp_path / "case02.signals.h5.stale").is_file()


def test_highest_modes_of_another_network_are_refused_with_both_names(products, tmp_path):
    shutil.copy(products / "case02.network.h5", tmp_path)
    other_network = tmp_path / "other.network.h5"
    write_network(other_network, gallery.fcc(STRESS, (WIDTH, WIDTH, 4)))
    modes = tmp_path / "case02.highest.modes.h5"
    assert main(["modes", str(other_network), "--highest", "1", "-o", str(modes)]) == 0
    log = batch("wave", tmp_path, WAVE_DURATION="1.2e-5")
    (error,) = error_lines(log)
    assert "other.network.h5" in error
    assert "case02.network.h5" in error
    assert (
        main(["modes", str(tmp_path / "case02.network.h5"), "--lowest", "1", "-o", str(modes)]) == 0
    )
    (error,) = error_lines(batch("wave", tmp_path, WAVE_DURATION="1.2e-5"))
    assert modes.name in error
    assert not (tmp_path / "case02.signals.h5").exists()


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("FRACTION", "1.5"),
        ("DURATION", "0"),
        ("DURATION", "-1e-4"),
        ("DURATION", "inf"),
        ("PASSAGE", "-1"),
        ("PASSAGE", "inf"),
        ("INTERVAL", "-1e-6"),
        ("INTERVAL", "inf"),
        ("PARTICLES", "2"),
    ],
)
def test_numbers_without_sense_are_refused_and_the_product_stays(name, number, products, tmp_path):
    """Check that there is one line, no wave of other numbers, and no file set aside."""
    beside(products, tmp_path)
    shutil.copy(products / "case02.signals.h5", tmp_path)
    log = batch("wave", tmp_path, **{f"WAVE_{name}": number})
    (error,) = error_lines(log)
    assert name.lower() in error.lower()
    assert sorted(path.name for path in tmp_path.glob("*.h5*")) == [
        f"case02.{kind}.h5" for kind in ("highest.modes", "network", "signals")
    ]


CHIRP = chirp(5e-10, 3e4, 1.2e5, 5e-5)
DAMPED = ContactDamping(0.05, 0.03)


@pytest.mark.parametrize(
    ("settings", "linear_settings", "tolerance"),
    [
        # Mindlin's tangential spring is linear: what Hertz adds at 5 nm to a P-wave is missing.
        ({"WAVE_DIRECTION": "x"}, {"direction": "x"}, 0.02),
        # Non-linearity leaves some 2e-3 and the time step less; YADE's viscous force is half a
        # step old, a share of the damping alone.
        (
            {"WAVE_DAMPING": "0.05 0.03", "WAVE_AMPLITUDE": "2.5e-10"},
            {"damping": DAMPED, "motion": Pulse(2.5e-10)},
            0.01,
        ),
        # The motion is a tenth as large as the pulse, so Hertz adds a tenth of its 2 %.
        ({"WAVE_MOTION": "chirp.txt"}, {"motion": CHIRP}, 0.01),
    ],
    ids=["shear", "viscous", "chirp"],
)
def test_waves_follow_the_linear_operator(settings, linear_settings, tolerance, products, tmp_path):
    """Compare waves along x, with dashpots, or of a motion from a file with the linear ones."""
    beside(products, tmp_path)
    motion_path = tmp_path / "chirp.txt"
    np.savetxt(motion_path, np.column_stack([CHIRP.time, CHIRP.value]))
    if "WAVE_MOTION" in settings:
        settings = {**settings, "WAVE_MOTION": str(motion_path)}
    batch("wave", tmp_path, WAVE_DURATION="1e-4", **settings)
    signals = read_signals(tmp_path / "case02.signals.h5")
    network = read_network(tmp_path / "case02.network.h5")
    linear_settings = {"interval": signals.time[1], "motion": Pulse(), **linear_settings}

    def difference(linear, name):
        """Return the difference from a linear record in the norm over all times."""
        expected = getattr(linear, name)
        return np.linalg.norm(getattr(signals, name) - expected) / np.linalg.norm(expected)

    linear = propagate(network, signals.time[-1], **linear_settings).signals
    assert difference(linear, "layer_displacement") < tolerance
    assert difference(linear, "source_stress") < 0.02
    assert difference(linear, "receiver_stress") < 0.02
    assert signals.direction == linear_settings.get("direction", "z")
    if "damping" in linear_settings:
        undamped = linear_settings | {"damping": None}
        elastic = propagate(network, signals.time[-1], **undamped).signals
        assert difference(elastic, "layer_displacement") > 0.2
        assert signals.balance is None
    else:
        assert signals.balance.closes
    # YADE's default pulse, or the motion of these settings.
    wall = linear_settings["motion"].displacement(signals.time)
    assert signals.source_displacement == pytest.approx(wall, abs=1e-20)
    provenance = read_provenance(tmp_path / "case02.signals.h5")
    assert (Source.of("motion", motion_path) in provenance.sources) == ("WAVE_MOTION" in settings)
