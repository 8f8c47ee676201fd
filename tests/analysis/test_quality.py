"""Quality factors of viscous contacts: first order and complex modes are of one packing alike."""

import numpy as np
import pytest

import modal
from analysis.__main__ import main
from analysis.belonging import cases_of_files
from analysis.quality import quality_of
from modal.modes import damped
from modal.modes.mode_set import write_modes
from modal.packing.network import write_network
from modal.system.damping import ContactDamping
from modal.tools import progress, workload


def test_table_and_figure_of_elastic_and_of_complex_modes(tmp_path, capsys):
    network = modal.fcc(cells=(1, 1, 20))
    paths = [tmp_path / name for name in ("a.network.h5", "a.modes.h5", "b.network.h5")]
    write_network(paths[0], network)
    write_network(paths[2], modal.random_packing(spheres=60, seed=5))
    write_modes(paths[1], modal.eigenmodes(network, lowest=40))
    stem = tmp_path / "quality"
    files = [str(path) for path in paths]
    shared = ["--damping", "0.01", "0.01", "-o", str(stem)]
    assert main(["quality", *files[:2], *shared]) == 0
    assert stem.with_suffix(".png").is_file()
    rows = stem.with_suffix(".md").read_text().splitlines()[2:]
    assert len(rows) == 5 and all("elastic, first order" in row for row in rows)
    # Dashpots and springs are nearly proportional: Q f changes by less than a third.
    products = [float(row.split("|")[5]) for row in rows]
    assert max(products) / min(products) < 1.3
    assert main(["quality", files[2], "--near", "2e4", "1e5", *shared]) == 0
    rows = stem.with_suffix(".md").read_text().splitlines()[2:]
    assert len(rows) == 2 and all("complex" in row for row in rows)
    assert main(["quality", files[2], *shared]) == 2
    assert "or --near HZ" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ((damped, "MOST", 7), "did not converge in 7 solves"),
        ((workload, "LONGEST", 0.0), "solves for modes near 50000 Hz take"),
    ],
)
def test_a_search_says_how_far_it_is_and_has_an_end(limit, words, monkeypatch, tmp_path, capsys):
    """Each minute a line with what may be left; refused before it starts where that is too much."""
    path = tmp_path / "a.network.h5"
    write_network(path, modal.random_packing(spheres=60, seed=5))
    asked = ["quality", str(path), "--near", "5e4", "--damping", "0.05", "0.03"]
    asked += ["-o", str(tmp_path / "q")]
    monkeypatch.setattr(progress, "LOG_INTERVAL", -1.0)
    assert main(asked) == 0
    assert f"modes near 50000 Hz, at most: step 100 of {damped.MOST}, " in capsys.readouterr().err
    monkeypatch.setattr(progress, "LOG_INTERVAL", 60.0)
    monkeypatch.setattr(*limit)
    assert main(asked) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1


def test_both_rules_agree_where_the_damping_is_small(tmp_path):
    """To first order, and exactly: they part by the square of the ratio."""
    network, path = modal.random_packing(spheres=60, seed=5), tmp_path / "a.network.h5"
    write_network(path, network)
    damping = ContactDamping(1e-4, 1e-4)
    (case,) = cases_of_files([path])
    _, f, exact, residual = quality_of(case, damping, [3e4])
    case.shaped_modes = modal.eigenmodes(network, all=True)
    _, every, first, _ = quality_of(case, damping, [])
    near = [int(np.argmin(abs(every - one))) for one in f]
    assert first[near] == pytest.approx(exact, rel=1e-4) and residual.max() < 1e-6
