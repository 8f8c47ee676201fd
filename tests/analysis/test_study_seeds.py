"""Packings of other seeds in the study: fewer numbers, the same as of the study's own packings."""

from __future__ import annotations

import os

import numpy as np
import pytest

from analysis.__main__ import main
from analysis.case import Case
from analysis.comparable import of_one_producer, scatter_of_samples
from analysis.measures import Measures
from analysis.measures.estimate import Estimate
from analysis.paper import STRESSES
from analysis.rows import Row, row_of
from analysis.study import measuring
from analysis.study.arrangement import OF_ROWS
from analysis.study.measuring import Packing, measure, measure_all
from analysis.study.other_seeds import AT_REST, row_of_seed
from analysis.study.tables import table_1, table_1_seen
from analysis.study.target_rules import crystal_exponent, gain, highest_apart
from analysis.study.targets import answers
from modal.packing.crystal import fcc
from modal.packing.network import write_network
from modal.preparation.random_packing import random_network
from modal.tools.errors import InputError
from modal.waves.propagate import propagate
from modal.waves.signals import write_signals


@pytest.fixture(scope="module")
def slender():
    """A packing long enough for a wave."""
    network = random_network(500, 1e5, seed=5, aspect=12)
    network.study.update(stress=1e5, mu_comp=0.0)
    return network


@pytest.fixture(scope="module", params=["linear", "yade"])
def folder(request, slender, tmp_path_factory):
    """The packing as case 6, with and without a run."""
    folder = tmp_path_factory.mktemp("seed_2")
    write_network(folder / "case06.network.h5", slender)
    if request.param == "yade":
        case = Case("case06", folder)
        run = propagate(slender, 1.3 * case.passage, interval=0.3 * case.interval).signals
        run.producer = "yade"
        write_signals(folder / "case06.signals.h5", run)
    return folder


def test_a_seed_s_numbers_are_those_of_the_long_way(folder):
    """Its wave on one chain alone, the row of all that a case has: the same to round-off."""
    whole = row_of(Measures(Case("case06", folder)))
    seed = row_of_seed("case06", folder)
    assert (seed.number, seed.record, seed.stress) == (6, whole.record, whole.stress)
    known = [name for name in seed.values if np.isfinite(whole.value(name))]
    assert {*AT_REST, "v_p_first_peaks_linear_m_per_s", "f_low_pass_2_linear_khz"} <= set(known)
    assert ("f_low_pass_2_yade_khz" in known) == (whole.record == "yade")
    for name in seed.values:
        assert seed.value(name) == pytest.approx(whole.value(name), rel=1e-9, nan_ok=True)
    # And what Table 1 shows as the scatter with another packing is that of the whole rows.
    other = Row(6, "case06", "", False, 1e5, 0.0, whole.record, "")
    other.values = {name: Estimate(1.1 * found.value) for name, found in whole.values.items()}
    scatters = []
    for twin in (whole, seed):
        other.samples = scatter_of_samples(other, [twin])
        table = table_1([other])
        cells = zip(table.header, table.rows[0], strict=True)
        scatters.append([(name, cell) for name, cell in cells if name.endswith("_sample_error")])
    assert scatters[0] == scatters[1] and sum(bool(cell) for _, cell in scatters[0]) > 5


def test_no_scatter_is_asked_for_that_seeds_do_not_have(folder, monkeypatch):
    """Tables, targets and figures of random packings ask for the spread of known columns alone."""
    seed = row_of_seed("case06", folder)
    asked: set[str] = set()
    spread = Row.spread

    def noted(row, name):
        asked.add(name) if not row.crystal else None
        return spread(row, name)

    monkeypatch.setattr(Row, "spread", noted)
    rows = []
    for number in range(5, 33):
        mu, stress = 0.05 * ((number - 5) // 4), 10.0 ** (4 + (number - 5) % 4)
        row = Row(number, f"case{number:02d}", "", False, stress, mu, seed.record, "")
        row.values = dict(seed.values) | {"void_ratio": Estimate(0.54 + 0.1 * mu)}
        row.values |= {
            f"{name}_{unit}": seed.values[of_one_producer([row], name)[0]]
            for name, unit in (
                ("v_p_first_peaks", "m_per_s"),
                *((f"f_low_pass_{p}", "khz") for p in "123"),
                *((f"lambda_{p}", "over_d") for p in "123"),
            )
        }
        row.curves["gain_orders"] = (np.array([0.5]), np.array([0.5]))
        row.curves["free_held"] = (np.empty(0),)
        rows.append(row)
    table_1_seen(rows)
    answers(rows)
    for name, draw, _ in OF_ROWS:
        if name != "fig19_gain":  # curves alone
            try:
                draw(rows)
            except InputError:
                continue
    own = {name for name in asked if name in rows[0].values}
    assert own and asked - set(rows[0].values) <= {"chi_z_low"}


def test_longest_first_and_in_the_order_that_was_asked_for(tmp_path, monkeypatch):
    """A pool is given the study's own packings by the bytes of their products, then the seeds."""
    seeds = tmp_path / "seed_2"
    seeds.mkdir()
    for name, size in (("case01", 10), ("case02", 30), ("case03", 20)):
        (tmp_path / f"{name}.network.h5").write_bytes(bytes(size))
        (seeds / f"{name}.network.h5").write_bytes(bytes(100 + size))
    given, threads = [], []

    class Pool:
        def __init__(self, jobs, mp_context):
            threads.append(os.environ.get(measuring.THREADS))

        def __enter__(self):
            return self

        def __exit__(self, *_):
            return None

        def submit(self, work, packing):
            given.append((packing.name, packing.other_seed))

            class Future:
                def result(self):
                    if packing.name == "case02":
                        raise InputError("not readable")
                    return packing.name

            return Future()

    monkeypatch.setattr(measuring, "ProcessPoolExecutor", Pool)
    monkeypatch.delenv(measuring.THREADS, raising=False)
    names = ["case01", "case02", "case03"]
    packings = [Packing(tmp_path, name) for name in names]
    packings += [Packing(seeds, name, other_seed=True) for name in names]
    found, failed = measure_all(packings, 2)
    assert given == [(f"case0{k}", seed) for seed in (False, True) for k in (2, 3, 1)]
    assert [(p.folder.name, one) for p, one in found] == [
        *((tmp_path.name, name) for name in ("case01", "case03")),
        *(("seed_2", name) for name in ("case01", "case03")),
    ]
    assert failed == ["case02: not readable", "case02 of seed_2: not readable"]
    cores = len(os.sched_getaffinity(0))
    assert threads == [str(max(1, cores // 2))] and measuring.THREADS not in os.environ
    monkeypatch.setenv(measuring.THREADS, "3")
    measure_all(packings, 2)
    assert threads[1] == "3" and os.environ[measuring.THREADS] == "3"


def test_side_by_side_as_one_after_the_other(tmp_path):
    """The same rows from a pool of processes."""
    for case, stress in (("case02", 1e5), ("case03", 1e6)):
        write_network(tmp_path / f"{case}.network.h5", fcc(stress, (1, 1, 60)))
    packings = [Packing(tmp_path, "case02"), Packing(tmp_path, "case03", other_seed=True)]
    found, failed = measure_all(packings, 2)
    assert not failed and [packing for packing, _ in found] == packings
    for packing, one in found:
        alone = measure(packing)
        for name, value in alone.row.values.items():
            assert one.row.value(name) == pytest.approx(value.value, rel=1e-9, nan_ok=True)
        assert bool(one.provenance) != packing.other_seed


def test_a_case_that_fails_is_named_and_costs_nothing_else(tmp_path, monkeypatch, capsys):
    """Whatever goes wrong in one case: the others' page is written, status 3 and a line say so."""
    for case, stress in (("case01", 1e4), ("case02", 1e5)):
        write_network(tmp_path / f"{case}.network.h5", fcc(stress, (1, 1, 60)))

    def fails(packing):
        if packing.name == "case01":
            raise ZeroDivisionError("by nothing")
        return measure(packing)

    monkeypatch.setattr(measuring, "measure", fails)
    out = tmp_path / "out"
    assert main(["study", "--products", str(tmp_path), "-o", str(out)]) == 3
    assert capsys.readouterr().err == "not measured: case01: ZeroDivisionError: by nothing\n"
    assert "by nothing" in (out / "study.html").read_text()


def test_nothing_is_met_with_a_number_that_is_missing():
    def row(number, stress, crystal=True, mu=0.0, **values):
        found = Row(number, "", "", crystal, stress, mu, "yade", "")
        found.values = {name: Estimate(value) for name, value in values.items()}
        return found

    name = "v_p_first_peaks_yade_m_per_s"
    speeds = {1: 1.0, 2: 10 ** (1 / 6), 3: 100 ** (1 / 6), 4: np.nan}
    rows = {n: row(n, 10.0 ** (3 + n), **{name: v}) for n, v in speeds.items()}
    found = crystal_exponent(rows)
    assert found.value == pytest.approx(1 / 6) and not found.met and "case 4" in found.why
    gains = {n: row(n, 1e5, gain_maximum=3.0) for n in (2, 3, 4, 6, 7, 8)}
    assert gain(gains).met
    gains[7] = row(7, 1e6, gain_maximum=np.nan)
    assert not gain(gains).met
    tops = {}
    for k, stress in enumerate(STRESSES):
        for first, mu in ((1, 0.0), (5, 0.0), (29, 0.4)):
            tops[first + k] = row(first + k, stress, first == 1, mu, f_max_khz=200.0)
    assert highest_apart(tops).met
    tops[30].values["f_max_khz"] = Estimate(np.nan)
    assert not highest_apart(tops).met
