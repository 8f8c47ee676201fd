"""What `docs/lammps.md` lists as not taken: the code of each refusal, and the notes."""

from __future__ import annotations

import pytest
from places import ROOT
from program_files import COLUMN_PAIR, COLUMN_WALL, column
from refusals import refusal

from modal.exchange.import_result import ImportResult
from modal.exchange.registry import import_packing

STYLE, COEFFICIENTS = COLUMN_PAIR.split(" ", 1)
LAW, _, PLANES = COLUMN_WALL.partition(" zplane ")


def import_column(folder, *, head="", pair="", wall="", more="") -> ImportResult:
    """Import three spheres above each other, with these lines in the log in place of the usual."""
    units = head or "units si"
    pair = pair or f"pair_style {STYLE}\npair_coeff * * {COEFFICIENTS}"
    wall = wall or f"fix wall all wall/gran {COLUMN_WALL}"
    log = folder / "log.lammps"
    log.write_text(
        f"LAMMPS (22 Jul 2025)\n{units}\n{pair}\n{wall}\nfix n all nve/sphere\n{more}\n"
        "Step Atoms\n0 3\nLoop time of 1 on 1 procs for 0 steps with 3 atoms\n"
    )
    return import_packing(column(folder), log=log)


NOT_TAKEN = {
    "`lj/cut`": ("unknown_law", {"pair": "pair_style lj/cut 1\npair_coeff * * 1 1"}),
    "`hybrid`": (
        "unknown_law",
        {"pair": f"pair_style hybrid granular\npair_coeff * * granular {COEFFICIENTS}"},
    ),
    "`bpm/spring`": ("unknown_law", {"pair": "pair_style bpm/spring\npair_coeff * * 1 1 1"}),
    "`mdr`": (
        "unknown_word",
        {"pair": "pair_style granular\npair_coeff * * mdr 5e6 0.4 1.9e5 2 0.5 0.5"},
    ),
    "`heat`": (
        "unknown_word",
        {"pair": f"pair_style granular\npair_coeff * * {COEFFICIENTS} heat area 1"},
    ),
    "`xplane`": ("other_wall", {"wall": f"fix w all wall/gran {LAW} xplane 0 8"}),
    "`zcylinder`": ("other_wall", {"wall": f"fix w all wall/gran {LAW} zcylinder 4"}),
    "`wall/gran/region`": ("other_wall", {"wall": f"fix w all wall/gran/region {LAW} region r"}),
    "`wiggle`": ("moving_wall", {"wall": f"fix w all wall/gran {COLUMN_WALL} wiggle z 1 1"}),
    "`wall/lj93`": ("unknown_fix", {"more": "fix l all wall/lj93 zlo EDGE 1 1 1"}),
    "`wall/reflect`": ("unknown_fix", {"more": "fix l all wall/reflect zlo EDGE"}),
    "`indent`": ("unknown_fix", {"more": "fix i all indent 1 sphere 0 0 0 1"}),
    "`fix adapt ... pair`": (
        "changing_law",
        {"more": "fix a all adapt 1 pair granular kn * * v_x"},
    ),
    "`spring/self`": ("held_bodies", {"more": "fix s all spring/self 10"}),
    "`aveforce`": ("held_bodies", {"more": "fix s all aveforce 0 0 -1"}),
    "`setforce`": ("held_bodies", {"more": "fix s all setforce 0 0 -1"}),
    "`bond_style`": ("bonds", {"head": "units si\nbond_style harmonic"}),
    "`fix rigid single`": ("unknown_bodies", {"more": "fix r all rigid single"}),
    "`dimension 2`": ("two_dimensions", {"head": "units si\ndimension 2"}),
    "`lj`": ("unknown_units", {"head": "units lj"}),
    "`neigh_modify exclude`": ("excluded_pairs", {"more": "neigh_modify exclude type 1 1"}),
}
"""What the page names: the code of the refusal, and lines of a script that have it."""


@pytest.mark.parametrize("name", NOT_TAKEN)
def test_what_the_page_lists_is_refused(tmp_path, name):
    page = (ROOT / "docs/lammps.md").read_text()
    code, lines = NOT_TAKEN[name]
    assert name in page.partition("## 1.")[0]
    with refusal(code):
        import_column(tmp_path, **lines)


def test_usual_lines_have_no_note(tmp_path):
    more = "fix d all viscous 1\nfix a all ave/time 1 1 1 c_x\nfix g all gravity 9 vector 0 0 -1"
    assert import_column(tmp_path, more=more).remarks == import_column(tmp_path).remarks


@pytest.mark.parametrize(
    "style", ["addforce 0 0 -1", "efield 0 0 1", "langevin 1 1 1 1", "foo/bar"]
)
def test_fixes_that_are_not_understood_are_noted(tmp_path, style):
    remarks = import_column(tmp_path, more=f"fix a all {style}").remarks
    assert sum(f"fix {style.split()[0]} (" in remark for remark in remarks) == 1
    unfixed = import_column(tmp_path, more=f"fix a all {style}\nunfix a").remarks
    assert unfixed == import_column(tmp_path).remarks
