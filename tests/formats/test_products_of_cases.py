"""Products of cases: which belong together, which are stale, what they say of their making."""

from __future__ import annotations

import shutil
from dataclasses import replace
from math import isnan, nan
from pathlib import Path

import h5py
import numpy as np
import pytest
from study_folder import measured

from analysis.__main__ import main as analysis_main
from analysis.case import Case
from analysis.packing_data import PackingData
from analysis.quantities import QUANTITIES
from modal.__main__ import main
from modal.formats.provenance import read_provenance
from modal.formats.whole_file import sha256
from modal.packing import crystal as gallery
from modal.packing.network import write_network
from modal.waves.energy_balance import EnergyBalance
from modal.waves.signals import read_signals, write_signals


@pytest.fixture(scope="module")
def made_once(tmp_path_factory) -> Path:
    """Write networks, modes and linear waves of case 2 at 100 kPa and case 3 at 1 MPa."""
    folder = tmp_path_factory.mktemp("study")
    for case, stress in (("case02", 1e5), ("case03", 1e6)):
        network = folder / f"{case}.network.h5"
        write_network(network, gallery.fcc(stress, (1, 1, 60)))
        assert main(["modes", str(network), "--all", "-o", str(folder / f"{case}.modes.h5")]) == 0
        signals = str(folder / f"{case}.signals.h5")
        assert main(["wave", str(network), "--duration", "2e-4", "-o", signals]) == 0
    return folder


@pytest.fixture
def folder(made_once, tmp_path) -> Path:
    """Return a copy of the folder that a test may change."""
    return Path(shutil.copytree(made_once, tmp_path / "products"))


@pytest.mark.parametrize("kind", ["modes", "signals", "reverse"])
def test_products_of_another_stress_are_refused_with_both_names(kind, folder, one_line):
    """Refuse a product of case 02 as one of case 03, or as another run of an agreement."""
    case = folder / "case03"
    if kind == "reverse":
        product = folder / "case02.signals.h5"
        files = [f"{case}.network.h5", f"{case}.signals.h5", "--reverse", product]
        command = ["agreement", *files]
    else:
        product = folder / f"case03.{kind}.h5"
        shutil.copy(folder / f"case02.{kind}.h5", product)
        figure = "natural_frequencies" if kind == "modes" else "signals"
        command = ["figure", figure, f"{case}.network.h5", product, "-o", folder]
    error = one_line(analysis_main, command, product.name, code="other_packing")
    for name in ("case02.network.h5", "case03.network.h5"):
        assert name in str(error)


def test_what_is_kept_is_made_again_where_its_settings_or_packing_have_changed(
    tmp_path, capsys, monkeypatch
):
    write_network(tmp_path / "case02.network.h5", gallery.fcc(1e5, (1, 1, 60)))
    network = str(tmp_path / "case02.network.h5")
    command = ["measure", network, "--quantities", "gain", "--keep", str(tmp_path)]
    assert analysis_main(command) == 0
    monkeypatch.setattr("analysis.spectra_cache.RESOLUTION", 0.5)
    capsys.readouterr()
    assert analysis_main(command) == 0
    assert "case02.response.h5: stale, resolution was " in capsys.readouterr().out
    assert analysis_main(command) == 0
    assert "stale" not in capsys.readouterr().out
    write_network(tmp_path / "case02.network.h5", gallery.fcc(1.1e5, (1, 1, 60)))
    assert analysis_main(command) == 0
    assert "stale, highest was " in capsys.readouterr().out


def test_result_names_command_and_sources_of_every_file(folder):
    rows = {row[0]: row[2:] for row in measured("case02", folder).provenance}
    command, sources = rows["case02.modes.h5"]
    assert command.startswith("python -m modal modes case02.network.h5 --all")
    assert sources == f"case02.network.h5 ({sha256(folder / 'case02.network.h5')[:8]})"


def books(**changed: float) -> EnergyBalance:
    """Return the balance of a run whose energy drifts by 1e-3, within a limit of 1e-2."""
    sound = {"energy": 2e-10, "drift": 1e-3, "friction": 0.0, "limit": 1e-2}
    sound |= {"work": 2.1e-10, "gap": 2e-4, "contacts": 1200, "opened": 17, "slid": 0}
    return EnergyBalance(**sound | changed)


BOOKS = [
    (books(), 0),
    (books(drift=-0.5), 1),
    (books(drift=-0.5, limit=nan), 0),
    (books(drift=-0.5, limit=nan, gap=2e-3), 1),
    (books(drift=-0.5, limit=nan, gap=nan, work=nan), 0),
]


def test_energy_balance_survives_the_file_and_is_shown(folder):
    """Read files without the wall's work, too: what they lack is unknown."""
    path = folder / "case02.signals.h5"
    provenance = read_provenance(path)
    signals = read_signals(path)
    assert signals.balance is None
    for balance, note in BOOKS:
        write_signals(path, replace(signals, producer="yade", balance=balance), provenance)
        again = read_signals(path).balance
        assert np.array_equal([*vars(again).values()], [*vars(balance).values()], equal_nan=True)
        case = Case("case02", folder)
        m = PackingData.of(case)
        assert QUANTITIES["contacts_opened"].measure(m) == 17
        for name in ("drift", "gap"):
            value = QUANTITIES[f"energy_{name}"].measured(m).value
            assert value == pytest.approx(getattr(balance, name), rel=1e-6, abs=0, nan_ok=True)
        assert sum("do not trust this run" in text for text in case.notes) == note
    write_signals(path, replace(signals, balance=books()), provenance)
    with h5py.File(path, "a") as file:
        for name in ("work", "gap"):
            del file["balance"].attrs[name]
    again = read_signals(path).balance
    assert isnan(again.work)
    assert isnan(again.gap)
    assert again.drift == 1e-3
    assert again.closes
