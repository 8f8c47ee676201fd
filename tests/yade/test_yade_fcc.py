"""Tests of a short FCC column in YADE, driven by a table: sample, export, wave."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from in_yade import error_lines, run, write_highest

from modal.__main__ import main
from modal.formats.provenance import Source, read_provenance
from modal.packing import crystal as gallery
from modal.packing.network import read_network, write_network
from modal.system.assembly import stiffness_matrix
from modal.system.damping import ContactDamping
from modal.waves.motions import Pulse, chirp
from modal.waves.propagate import propagate
from modal.waves.signals import read_signals

WIDTH, LAYERS, STRESS = 3, 30, 1e5
TABLE = {"case": 2, "mu_comp": 0, "mu_wave": 0.1, "stress": STRESS, "input_frequency": 1e5}
TABLE |= {"width": WIDTH, "layers": LAYERS}


def batch(script: str, folder: Path, columns: dict | None = None, **environment: str) -> str:
    """Run a script on the table, with other `columns`, and return its log."""
    values = TABLE | (columns or {})
    table = "".join(" ".join(map(str, line)) + "\n" for line in (values, values.values()))
    return run(script, table, folder, **environment)


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


def test_exported_contacts_equal_the_network_made_without_yade(products):
    exported = read_network(products / "case02.network.h5")
    made = gallery.fcc(STRESS, (WIDTH, WIDTH, LAYERS))
    assert exported.n_contacts == made.n_contacts
    # Overlaps are differences of positions: relative error eps * length / overlap = 4e-11.
    for name in ("stiffness_normal", "stiffness_tangential", "force_normal"):
        theirs, ours = (np.sort(getattr(net, name)) for net in (exported, made))
        assert theirs == pytest.approx(ours, rel=1e-9)
    # Stiffness matrices and masses in one order of the spheres have one spectrum.
    stiffness = stiffness_matrix(made)
    assert abs(stiffness_matrix(exported) - stiffness).max() < 1e-8 * abs(stiffness).max()
    assert exported.mass == pytest.approx(made.mass, rel=1e-12)
    assert exported.study["void_ratio"] == pytest.approx(made.study["void_ratio"], rel=1e-9)


def test_energy_error_has_order_two(products, tmp_path):
    """Halve the time step of a wave in which nothing slides: the change of energy is its error.

    What the wave has after the pulse is the work that the wall has done, from its recorded stress.
    """
    network, drift = products / "case02.network.h5", []
    area = float(np.prod(read_network(network).cell_size[:2]))
    # Large enough to stand clear of round-off: 1e-17 J of 2e-8 J.
    given = {"WAVE_DURATION": "5e-5", "WAVE_AMPLITUDE": "2.5e-8"}
    for fraction in ("0.4", "0.2"):
        there = beside(products, tmp_path / fraction)
        batch("wave", there, WAVE_FRACTION=fraction, **given)
        signals = read_signals(there / "case02.signals.h5")
        books, wall, stress = signals.balance, signals.source_displacement, signals.source_stress
        work = area * (np.diff(wall) * (stress[1:] + stress[:-1]) / 2).sum()
        # Trapezoids of a record every 0.4 rad at most of the pulse: (omega dt)^2 / 12.
        assert books.energy == pytest.approx(work, rel=0.02)
        # The run's own, a trapezoid a step, has only what the bend of the law leaves: the drift's.
        assert books.energy == pytest.approx(books.work, rel=1e-3)
        assert abs(books.gap) < 1e-3
        assert books.slid == 0 and books.friction == 0 and books.closes
        drift.append(books.drift)
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
    other = tmp_path / "other.network.h5"
    write_network(other, gallery.fcc(STRESS, (WIDTH, WIDTH, 4)))
    modes = tmp_path / "case02.highest.modes.h5"
    assert main(["modes", str(other), "--highest", "1", "-o", str(modes)]) == 0
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
    ("settings", "own", "off"),
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
def test_waves_follow_the_linear_operator(settings, own, off, products, tmp_path):
    """Compare waves along x, with dashpots, or of a motion from a file with the linear ones."""
    beside(products, tmp_path)
    file = tmp_path / "chirp.txt"
    np.savetxt(file, np.column_stack([CHIRP.time, CHIRP.value]))
    settings = {name: str(file) if name == "WAVE_MOTION" else of for name, of in settings.items()}
    batch("wave", tmp_path, WAVE_DURATION="1e-4", **settings)
    signals = read_signals(tmp_path / "case02.signals.h5")
    network = read_network(tmp_path / "case02.network.h5")
    given = {"interval": signals.time[1], "motion": Pulse()} | own

    def apart(linear, name):
        ours, theirs = getattr(signals, name), getattr(linear, name)
        return np.linalg.norm(ours - theirs) / np.linalg.norm(theirs)

    linear = propagate(network, signals.time[-1], **given).signals
    assert apart(linear, "layer_displacement") < off
    assert max(apart(linear, f"{wall}_stress") for wall in ("source", "receiver")) < 0.02
    assert signals.direction == own.get("direction", "z")
    if "damping" in own:
        elastic = propagate(network, signals.time[-1], **given | {"damping": None}).signals
        assert apart(elastic, "layer_displacement") > 0.2 and signals.balance is None
    else:
        assert signals.balance.closes
    wall = own.get("motion", Pulse(2.5e-9)).displacement(signals.time)
    assert signals.source_displacement == pytest.approx(wall, abs=1e-20)
    made = read_provenance(tmp_path / "case02.signals.h5")
    assert (Source.of("motion", file) in made.sources) == ("WAVE_MOTION" in settings)
