"""Logs and dumps as they come from a cluster: atoms that are inserted, jobs that were stopped.

LIGGGHTS' and LAMMPS' own lines around the column of three spheres of `program_files.column`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from program_files import COLUMN_PAIR, COLUMN_WALL, column
from refusals import refusal

import modal
from modal.exchange.registry import import_packing

MASS = 1.3
LIGGGHTS = """LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0)
units si
fix m1 all property/global youngsModulus peratomtype 5.e6
fix m2 all property/global poissonsRatio peratomtype 0.45
fix m4 all property/global coefficientFriction peratomtypepair 1 0.5
pair_style gran model hertz tangential history
pair_coeff * *
fix z1 all wall/gran model hertz tangential history primitive type 1 zplane 0.0
fix z2 all wall/gran model hertz tangential history primitive type 1 zplane 2.99994
"""
LAMMPS = f"""LAMMPS (22 Jul 2025)
units si
pair_style granular
pair_coeff * * {COLUMN_PAIR.removeprefix("granular ")}
fix w all wall/gran {COLUMN_WALL}
"""
FINISH = ", finish time Sat Nov 28 16:03:11 2026"
POUR = "fix ins all pour 3 1 300719 vol 0.13 50 region slab\n"
LOOP = "Loop time of 0.01 on 1 procs for {} steps with {} atoms{}\n"


def network_of(folder: Path, log: str, step: int) -> modal.Network:
    path = folder / "log.x"
    path.write_text(log)
    return import_packing(column(folder, step=step), log=path).network


def inserted(style: str, atoms: int, loop: str, *, column_of_atoms: bool = True) -> str:
    """Return what a run of 100 steps prints, in which all atoms are inserted."""
    head = "Step Atoms KinEng\n" if column_of_atoms else "Step KinEng\n"
    counts = [f" {count}" if column_of_atoms else "" for count in (0, atoms)]
    table = f"{head}0{counts[0]} 0\n100{counts[1]} 0\n"
    return f"fix ins all {style} seed 32452843 particles_in_region 3\nrun 100\n{table}{loop}"


@pytest.mark.parametrize("style", ["insert/pack", "insert/rate/region", "insert/stream"])
@pytest.mark.parametrize("counted", [True, False])
@pytest.mark.parametrize("finish", [FINISH, ""])
def test_liggghts_that_inserts_is_the_log_of_its_dump(tmp_path, style, counted, finish):
    """Compare with Hertz between diameters of 1 m, R* = 1/4 m: k_n = 2 E* sqrt(R* overlap)."""
    loop = LOOP.format(100, 3, finish)
    log = LIGGGHTS + inserted(style, 3, loop, column_of_atoms=counted)
    network = network_of(tmp_path, log, 100)
    assert network.n_particles == 3
    assert network.n_contacts == 4
    modulus = 5e6 / (2 * (1 - 0.45**2))
    expected = 2 * modulus * np.sqrt(0.25 * 2e-5)
    # Overlaps of 2e-5 m are differences of numbers near 1: 1e-16 / 2e-5.
    between = network.stiffness_normal[~network.with_wall]
    np.testing.assert_allclose(between, expected, rtol=1e-10)


KILLED = {
    "no end": inserted("pour", 3, ""),
    "no end, no counts": inserted("pour", 3, "", column_of_atoms=False),
    "a message of the queue": inserted("pour", 3, "slurmstepd: error: *** JOB 7 CANCELLED\n"),
    "more atoms than were printed": inserted("pour", 2, "").replace("100 2", "50 2"),
    "printed before the dump": POUR + "run 1000\nStep Atoms\n0 0\n50 1\n",
    "a line that was cut": POUR + "run 1000\nStep Atoms KinEng\n0 0 0\n50 1 0\n100",
    "nothing was printed": POUR + "run 1000\n",
    "two stages": inserted("pour", 2, LOOP.format(50, 2, "")).replace("100 2", "50 2")
    + "run 500\nStep Atoms\n50 2\n",
    "created in two parts": "Created 2 atoms\nCreated 1 atoms\nrun 1000\nStep Temp\n0 0\n50 0\n",
    "read, then replicated": "1 atoms\nreplicate 1 1 3\n3 atoms\nrun 9\nStep Temp\n0 0\n100 0\n",
    "deleted": "Created 5 atoms\nDeleted 2 atoms, new total = 3\nrun 900\nStep Temp\n0 0\n100 0\n",
}


@pytest.mark.parametrize("lines", KILLED.values(), ids=KILLED)
def test_a_run_that_was_killed_may_have_gone_on(tmp_path, lines):
    """Compare with the chain between walls: frequencies along z sqrt(k/m) sin(j pi / 8) / pi."""
    network = network_of(tmp_path, LAMMPS + lines, 100)
    assert network.n_contacts == 4
    frequency = modal.eigenmodes(network, all=True).frequency
    chain = np.sqrt(1e5 / MASS) * np.sin(np.arange(1, 4) * np.pi / 8) / np.pi
    for expected in chain:
        assert abs(frequency / expected - 1).min() < 1e-9


OTHER = {
    "other steps": inserted("pour", 3, LOOP.format(100, 3, "")).replace("100 3", "90 3"),
    "a later run": POUR + "run 100\nStep Atoms\n200 3\n",
    "other atoms": inserted("pour", 2, LOOP.format(100, 2, "")),
    "fewer atoms of LIGGGHTS": inserted("insert/pack", 2, LOOP.format(100, 2, FINISH)),
    "other atoms, killed": "Created 9 atoms\nrun 1000\nStep Temp\n0 0\n50 0\n",
}


@pytest.mark.parametrize("lines", OTHER.values(), ids=OTHER)
def test_the_log_of_another_run_is_still_refused(tmp_path, lines):
    with refusal("other_log"):
        network_of(tmp_path, LAMMPS + lines, 100)


PARTS = {
    "a group, counted": inserted("pour", 5, LOOP.format(100, 5, "")),
    "a group, counted by LIGGGHTS": inserted("insert/pack", 5, LOOP.format(100, 5, FINISH)),
    "a group, counted at the end": inserted(
        "pour", 5, LOOP.format(100, 5, ""), column_of_atoms=False
    ),
    "a job that was killed": inserted("pour", 5, ""),
}


@pytest.mark.parametrize("lines", PARTS.values(), ids=PARTS)
def test_a_dump_of_a_part_of_the_spheres_is_refused(tmp_path, lines):
    """Accept fewer spheres than at the end, while they are inserted, but not fewer than printed."""
    with refusal("part_of_atoms"):
        network_of(tmp_path, LAMMPS + lines, 100)


@pytest.mark.parametrize(("other_x", "code"), [(4.123, ""), (4.2, "repeated_step")])
def test_a_step_that_stands_twice_is_one_state(tmp_path, other_x, code):
    """Append the first step again, as a job that goes on does; refuse it with other spheres."""
    first = column(tmp_path, step=7).read_text()
    dump = column(tmp_path, step=7, x=other_x)
    dump.write_text(first + dump.read_text())
    options = {"pair": COLUMN_PAIR, "wall": COLUMN_WALL, "step": 7}
    if not code:
        assert import_packing(dump, **options).network.n_contacts == 4
        return
    with refusal(code):
        import_packing(dump, **options)


def test_scales_beside_other_units_of_the_log_are_remarked_on(tmp_path):
    log = tmp_path / "log.lammps"
    log.write_text(LAMMPS)
    scaled = import_packing(column(tmp_path), log=log, scales=(1e-2, 1.0, 1.0))
    assert scaled.network.radius[0] == pytest.approx(5e-3)
    assert any("--scales" in remark for remark in scaled.remarks)
    plain = import_packing(column(tmp_path), log=log, scales=(1.0, 1.0, 1.0))
    assert not any("--scales" in remark for remark in plain.remarks)


def test_a_law_that_changes_during_the_run_is_refused(tmp_path):
    line = "fix a all adapt 10 pair granular kn * * v_kn\n"
    with refusal("changing_law"):
        network_of(tmp_path, LAMMPS + line + inserted("pour", 3, LOOP.format(100, 3, "")), 100)


def test_a_killed_job_and_the_one_that_went_on_are_one_log(tmp_path):
    """Read lines before the table of the second job, which are no rows of the first table."""
    first = LAMMPS + "  3 atoms\nrun 100\nStep Temp Press Volume Lx Ly Lz\n0 0 0 0 0 0 0\n"
    second = "  1 by 1 by 1 MPI processor grid\n3 atoms\nrun 9\nStep Temp\n50 0\n100 0\n"
    log = first + LAMMPS.replace("units", "  1 by 1 by 1 processor grid\nunits") + second
    assert network_of(tmp_path, log + LOOP.format(50, 3, ""), 100).n_contacts == 4
    with refusal("other_log"):
        network_of(tmp_path, log + LOOP.format(50, 3, ""), 101)


def test_spheres_without_types_are_of_one(tmp_path):
    options = {"pair": COLUMN_PAIR, "wall": COLUMN_WALL}
    typed = import_packing(column(tmp_path, types=(1, 1, 1)), **options).network
    untyped = import_packing(column(tmp_path, types=()), **options).network
    assert untyped.n_contacts == 4
    np.testing.assert_array_equal(untyped.stiffness_normal, typed.stiffness_normal)
    liggghts = "gran model hertz tangential history youngsModulus 5e6 poissonsRatio 0.45 "
    pair = f"{liggghts}coefficientFriction 0.5"
    for wall in ("zplane 0 2.99994", "type 1 zplane 0 2.99994"):
        network = import_packing(column(tmp_path, types=()), pair=pair, wall=wall).network
        assert network.n_contacts == 4


@pytest.mark.parametrize("more", ["pair_coeff 2 2 hooke 2e5 0", ""])
def test_laws_of_several_types_need_the_column(tmp_path, more):
    log = tmp_path / "log.lammps"
    log.write_text(f"{LAMMPS}{more}\n")
    if not more:
        assert import_packing(column(tmp_path, types=()), log=log).network.n_contacts == 4
        return
    with refusal("no_column"):
        import_packing(column(tmp_path, types=()), log=log)


@pytest.mark.parametrize("value", ["", COLUMN_PAIR.removeprefix("granular ")])
def test_a_variable_may_be_empty(tmp_path, value):
    """Replace the variable of `pair_coeff * * ${COEFF}` by nothing."""
    style = "gran/hooke/history 1e5 8e4 0 0 0.5 0" if not value else "granular"
    text = f"pair_style {style}\npair_coeff * * ${{COEFF}}\npair_coeff * * {value}\n"
    log = tmp_path / "log.lammps"
    log.write_text(f"LAMMPS (22 Jul 2025)\nunits si\n{text}fix w all wall/gran {COLUMN_WALL}\n")
    network = import_packing(column(tmp_path), log=log).network
    np.testing.assert_array_equal(network.stiffness_normal, 1e5)


def test_a_variable_in_a_short_line_that_does_not_matter_is_passed_over(tmp_path):
    log = tmp_path / "log.lammps"
    log.write_text(f"{LAMMPS}pair_modify mix ${{rule}}\nthermo $n\n")
    assert import_packing(column(tmp_path), log=log).network.n_contacts == 4
