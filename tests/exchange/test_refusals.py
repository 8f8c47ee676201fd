"""What users do to the files of a program, and the one line that names file, line and column."""

from __future__ import annotations

import warnings
from typing import NamedTuple

import pytest
from program_files import PackingFiles

END = r"\Z"
CGS = "ITEM: UNITS\ncgs\n"
FORCES = "force p1 p2 p3 fx fy fz"
SPRINGS = "hertz/material 6e10 0 0.2 tangential mindlin/force NULL"
HERTZ = "granular hertz 4e10 0 zplane 0 1"
LINEAR = "LinearViscoelastic"
FIX = "fix m1 all property/global youngsModulus peratomtype 6e10 2.1e11"
PERIODS = "# periodic x y\n"


class Respelled(NamedTuple):
    """Other words in a line: the line, from 1, the column, from 0, or a slice of columns."""

    file: str
    line: int
    column: int | slice
    words: object

    def apply(self, files: PackingFiles) -> None:
        files.respell(self.file, self.line, self.column, self.words)


class Replaced(NamedTuple):
    """Another text in place of the first match of a pattern."""

    file: str
    pattern: str
    text: str

    def apply(self, files: PackingFiles) -> None:
        files.spoil(self.file, self.pattern, self.text)


LAMMPS = [
    (Respelled("spheres", 14, 3, "1.2e"), "not_a_number", "x.atoms, line 14, column y:"),
    (Respelled("contacts", 12, 4, "nan"), "not_finite", "x.contacts, line 12, column c_f[2]:"),
    (Respelled("spheres", 69, slice(8, 11), []), "short_row", "x.atoms, line 69, column f_w[2]:"),
    (Respelled("spheres", 20, 0, "60"), "repeated_row", "x.atoms, line 20, column id:", "line 10"),
    (Respelled("contacts", 13, 2, "777"), "unknown_sphere", "line 13, column c_p[2]:", "777"),
    (Respelled("spheres", 16, 4, "1.5"), "outside_cell", "x.atoms: sphere 54"),
    (Replaced("spheres", "radius", "vx"), "no_column", "x.atoms, line 9, column radius:"),
    (Replaced("contacts", r"(.*\n){3}\Z", ""), "cut_off", "x.contacts, line 149: 139 rows of 142"),
    (Replaced("spheres", "mass", "mass shapex"), "no_spheres", "line 9, column shapex:"),
    (Replaced("spheres", "mass", "mass id_multisphere"), "no_spheres", "column id_multisphere:"),
    (Replaced("spheres", r"\A", CGS), "other_units", "x.atoms:", "cgs", "log.lammps", "si"),
    (
        Replaced("spheres", r"(?s)\A(.*)\Z", r"\1\1"),
        "several_times",
        "x.atoms:",
        "(7, 7)",
        "--step",
    ),
    (Replaced("log", "hertz/material 6e10", "mdr 6e10"), "unknown_word", "log.lammps:", "'mdr'"),
    (Replaced("log", "0.3\n", "0.3 rolling coulomb 1 1 1\n"), "unknown_word", "rolling 'coulomb'"),
    (Replaced("log", "style granular", "style gran/shm 1 2"), "unknown_law", "'gran/shm'"),
    (Replaced("log", END, "fix r all rigid/small molecule\n"), "no_column", "line 9, column mol:"),
    (Replaced("log", "6e10", "6e7"), "other_units", "x.atoms:"),
    (Replaced("log", SPRINGS, "hooke 0 0 tangential linear_history 1"), "not_positive", "log."),
    (Replaced("log", FORCES, "dist eng dx dy dz cutoff"), "no_forces", "x.contacts, line 9:"),
    (Replaced("log", "units si", ""), "unknown_units", "log.lammps:", "lj", "--scales"),
    (Replaced("spheres", "ITEM: ATOMS.*", "ITEM: "), "no_item", "x.atoms, line 9:"),
    (Replaced("log", "zplane", "xplane"), "other_wall", "fix w wall/gran: xplane"),
    (Replaced("spheres", "ITEM: ATOMS", "ITEM: ENTRIES"), "other_item", "line 9: ITEM: ENTRIES"),
    (Replaced("log", "compute p", "compute q"), "unknown_column", "line 9, column c_p[1]:"),
    (Replaced("log", END, "dimension 2\n"), "two_dimensions", "log.lammps, line 10:"),
    (Replaced("log", END, "bond_style bpm/spring\n"), "bonds", "log.lammps, line 10:"),
    (Replaced("log", END, "fix f all spring/self 1\n"), "held_bodies", "line 10: fix spring/self"),
    (Replaced("log", END, "fix h all wall/harmonic zlo EDGE 1\n"), "unknown_fix", "wall/harmonic"),
    (
        Replaced("log", END, f"fix w all wall/gran {HERTZ} wiggle z 1 1\n"),
        "moving_wall",
        "fix w wall/gran:",
    ),
    (Replaced("log", END, "clear\n"), "no_law", "x.atoms:"),
    (Replaced("log", END, "Step\n8\n9\n"), "other_log", "x.atoms: step 7", "8 to 9"),
    (Replaced("log", END, "Created 9 atoms\n"), "other_log", "x.atoms: atoms 60", "9 to 9"),
    # Variables without a value, as in a script that is given in place of its log.
    (
        Replaced("log", END, "pair_coeff 1 1 hertz ${E} 0 0.2\n"),
        "unknown_variable",
        "log.lammps, line 10: ${E}",
    ),
    (
        Replaced("log", END, "fix v all wall/gran hertz $(v_l) zplane 0 1\n"),
        "unknown_variable",
        "log.lammps, line 10: $(v_l)",
    ),
]
RIGID_BODIES = [
    (Replaced("log", "rigid molecule", "rigid single"), "unknown_bodies", "log.lammps: fix r"),
    (
        Replaced("log", "rigid molecule", "rigid molecule infile r.txt"),
        "unknown_masses",
        "log.lammps: fix r",
    ),
    (Replaced("log", END, "fix s clumps rigid molecule\n"), "several_bodies", "log.lammps:"),
    (Replaced("log", "rigid molecule", "rigid custom i_b"), "no_column", "line 9, column i_b:"),
    (Replaced("log", "r clumps", "r all"), "unknown_bodies", "x.atoms:", "mol of 0"),
]
LIGGGHTS = [
    (Replaced("log", "run 0", "fix r all multisphere motion"), "unknown_fix", "line 48:"),
    (Replaced("log", "run 0", "fix b all bond/create 1"), "unknown_fix", "line 48:"),
    (Replaced("log", "history", "history cohesion sjkr"), "unknown_law", "log.liggghts: cohesion"),
    (Replaced("log", "model hertz", "model hooke"), "unknown_law", "log.liggghts:"),
    (Replaced("log", FIX, FIX.replace("6e10", "60e")), "not_a_number", "line 10: youngsModulus"),
    (Replaced("log", FIX, FIX.replace("6e10", "60")), "material", "log.liggghts:", "60 Pa"),
    (Replaced("log", FIX, ""), "no_material", "log.liggghts: no youngsModulus"),
    (
        Replaced("log", "(youngsModulus peratomtype) 6e10", r"\1 $E"),
        "unknown_variable",
        "log.liggghts, line 10: $E",
    ),
]
MERCURY = [
    (Replaced("spheres", f"{LINEAR}S", "LinearPlasticViscoelasticS"), "unknown_law", "line 12:"),
    (Replaced("spheres", f"{LINEAR}S", f"{LINEAR}ReversibleAdhesiveS"), "unknown_law", "Adhesive"),
    (Replaced("spheres", f"{LINEAR}S", f"{LINEAR}LiquidBridgeWilletS"), "unknown_law", "Bridge"),
    (
        Replaced("spheres", "particleDimensions 3", "particleDimensions 2"),
        "two_dimensions",
        "line 10: particleDimensions 2",
    ),
    (Replaced("spheres", "stiffness 75857.5", "stiffness x7.5"), "not_a_number", "line 12:"),
    (
        Replaced("spheres", "Boundaries 0", "Boundaries 1\nAngledPeriodicBoundary"),
        "angled_period",
        "line 21: AngledPeriodicBoundary",
    ),
    (
        Replaced("spheres", "Boundaries 0", "Boundaries 1\nLeesEdwardsBoundary"),
        "angled_period",
        "line 21: LeesEdwardsBoundary",
    ),
    (
        Replaced("spheres", "particleWallIds 120 4", "particleWallIds 120 0"),
        "other_wall",
        "line 173:",
        "wall 0",
    ),
    (
        Replaced("spheres", "particleIds 115 116", "particleIds 120 121"),
        "repeated_row",
        "line 149:",
        "line 148",
    ),
    (
        Replaced("spheres", "particleIds 120 121", "particleIds 120 900"),
        "unknown_sphere",
        "line 148, column particleIds:",
        "900",
    ),
    (
        Replaced("spheres", "BaseParticle id 1 ", "MultiParticle id 1 "),
        "no_spheres",
        "line 23: MultiParticle",
    ),
    (
        Replaced("spheres", r"(?s)\A((?:[^\n]*\n){64}).*", r"\1"),
        "cut_off",
        "line 64: 43 Particles of 125",
    ),
]
TABLES = [
    (Respelled("spheres", 9, 0, "14.5"), "not_an_integer", "spheres.csv, line 9, column id: 14.5"),
    (Respelled("spheres", 9, 0, "1e17"), "not_an_integer", "spheres.csv, line 9, column id: 1e+17"),
    (Respelled("contacts", 9, slice(2), ["12", "12"]), "same_place", "csv, line 9:", "12 and 12"),
    (
        Respelled("contacts", 9, 3, "\x1b[31m" * 99),
        "not_a_number",
        r"contacts.csv, line 9, column kt: '\x1b[31m\x1b",
    ),
    (Respelled("spheres", 9, 3, "0,5"), "long_row", "spheres.csv, line 9:", "6 columns"),
    (Respelled("contacts", 1, 2, "stiff"), "no_column", "contacts.csv, line 1, column kn:"),
    (Respelled("spheres", 6, 0, "10"), "repeated_row", "csv, line 6, column id:", "line 5"),
    (Respelled("spheres", 9, 4, "-1e-3"), "not_positive", "spheres.csv: sphere 14", "radius"),
    (Respelled("spheres", 9, slice(9), []), "empty_line", "spheres.csv, line 9:"),
    (Respelled("spheres", 1, 0, "# cell 0 1"), "missing_word", "spheres.csv, line 1:", "# cell"),
    (Respelled("contacts", 7, 3, "inf"), "not_finite", "contacts.csv, line 7, column kt: inf"),
    (Respelled("contacts", 9, 4, "-2"), "pulling_force", "contacts.csv, line 9, column fn: -2"),
    (Respelled("spheres", 9, 3, "5e-3"), "apart", "contacts.csv, line 19: spheres 14 and 33"),
    (Replaced("spheres", PERIODS, "# periodic 1 1\n"), "unknown_axis", "csv, line 2: '1'"),
    (Replaced("spheres", PERIODS, 2 * PERIODS), "repeated_line", "csv, line 3:", "(line 2)"),
    (Replaced("spheres", "# periodic", "# peridoic"), "apart", "contacts.csv, line 2:"),
    (Replaced("spheres", r"(?s)\A((?:[^\n]*\n){4}).*", r"\1"), "no_rows", "spheres.csv, line 5:"),
    (
        Replaced("contacts", "i,j,kn,kt", "i;j;kn;kt"),
        "no_column",
        "line 1, column i:",
        "'i;j;kn;kt",
    ),
    (Replaced("contacts", "i,j", "\x1b[2J\0" * 999), "no_column", "line 1, column i:"),
    (
        Replaced("contacts", "kt,fn", "kt,bond\x1b[2J"),
        "unknown_column",
        r"line 1, column bond\x1b[2J:",
    ),
]
CASES = {
    "walled": LAMMPS,
    "paired": RIGID_BODIES,
    "liggghts": LIGGGHTS,
    "cubic": MERCURY,
    "tables": TABLES,
}
"""Changes, codes, and what the message names, by the fixture of the files."""


@pytest.mark.parametrize(
    ("fixture", "change", "code", "names"),
    [
        pytest.param(fixture, change, code, names, id=f"{fixture}-{code}-{names[0]}")
        for fixture, cases in CASES.items()
        for change, code, *names in cases
    ],
)
def test_spoilt_file_is_refused(fixture, change, code, names, request):
    """Refuse before any warning of numpy."""
    files = request.getfixturevalue(fixture)
    change.apply(files)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        files.refused(code, *names)


@pytest.mark.parametrize("fixture", ["walled", "liggghts"])
@pytest.mark.parametrize(
    ("file", "code", "name"),
    [("contacts", "no_contacts", "x.contacts"), ("spheres", "no_spheres", "x.atoms:")],
)
def test_file_without_rows_is_refused(request, fixture, file, code, name):
    files = request.getfixturevalue(fixture)
    files.spoil(file, r"(?s)(NUMBER OF \S+\n)\d+(.*ITEM: (ATOMS|ENTRIES)[^\n]*\n).*", r"\g<1>0\2")
    files.refused(code, name)


def test_contact_that_is_listed_twice_is_refused_by_its_line(walled):
    i, j = walled.contacts.read_text().splitlines()[10].split()[1:3]
    walled.respell("contacts", 16, slice(1, 3), [j, i])
    walled.refused("repeated_row", "x.contacts, line 16:", "line 11")


def test_lines_without_a_part_in_the_law_may_stand_in_a_log(walled):
    """Accept variables without a value, and a fix that is removed again."""
    walled.spoil("log", END, "fix t all langevin $T 1 ${seed}\nrun $n\nfix f all freeze\nunfix f\n")
    walled.imported()


EXCLUDED = "neigh_modify delay 0 exclude type 1 1\n"


def test_excluded_contacts_are_refused_unless_they_are_listed(walled):
    """Refuse contacts from positions that LAMMPS does not compute; a dump lacks them."""
    walled.spoil("log", END, EXCLUDED)
    walled.imported()
    walled.refused("excluded_pairs", "log.lammps, line 10:", "exclude type", contacts=None)


@pytest.mark.parametrize(
    "line",
    ["neigh_modify delay 0\n", f"{EXCLUDED}neigh_modify exclude none\n"],
    ids=["no exclusion", "exclusion that is removed again"],
)
def test_other_neighbour_settings_change_nothing(walled, line):
    walled.spoil("log", END, line)
    walled.imported(contacts=None)


def test_contacts_inside_rigid_bodies_may_be_excluded(paired):
    """Accept this exclusion: contacts inside bodies are none in a network either."""
    expected = paired.network()
    paired.spoil("log", END, "neigh_modify exclude molecule/intra all\n")
    assert paired.network().n_contacts == expected.n_contacts
