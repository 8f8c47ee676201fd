"""What users do to the files of a program, and the one line that names file, line and column."""

from __future__ import annotations

import warnings

import pytest

END = r"\Z"
CGS = "ITEM: UNITS\ncgs\n"
HERTZ = "granular hertz 4e10 0 zplane 0 1"
LINEAR = "LinearViscoelastic"
FIX = "fix m1 all property/global youngsModulus peratomtype 6e10 2.1e11"
PERIODS = "# periodic x y\n"
SPOILT = {
    # The words of a line, from 1, and column, from 0; or a pattern, and what stands in its place.
    "walled": [
        ("spheres", 14, 3, "1.2e", "line 14, column y: '1.2e' is no number"),
        ("contacts", 12, 4, "nan", r"x.contacts, line 12, column c_f\[2\]: nan"),
        ("spheres", 69, slice(8, 11), [], r"x.atoms, line 69, column f_w\[2\]: has 8 col"),
        ("spheres", 20, 0, "60", "x.atoms, line 20, column id: sphere 60 again .line 10"),
        ("contacts", 13, 2, "777", r"line 13, column c_p\[2\]: sphere 777 is not among"),
        ("spheres", 16, 4, "1.5", "x.atoms: sphere 54 lies outside the cell along z"),
        ("spheres", "radius", "vx", r"x.atoms, line 9, column radius: .*; add it to"),
        ("contacts", r"(.*\n){3}\Z", "", r"line \d+: \d+ rows of \d+: the file ends"),
        ("spheres", "mass", "mass shapex", "line 9, column shapex: .*no spheres, which"),
        ("spheres", r"\A", CGS, r"x.atoms: ITEM: UNITS cgs, and .*log.lammps has units si"),
        ("spheres", r"(?s)\A(.*)\Z", r"\1\1", r"x.atoms: it has 2 times .*with --step"),
        ("log", "hertz/material 6e10", "jkr 6e10", "the normal model 'jkr' is not known"),
        ("log", "0.3\n", "0.3 rolling coulomb 1 1 1\n", "rolling 'coulomb' is not known"),
        ("log", "style granular", "style gran/shm 1 2", "'gran/shm' is no law of contact"),
        ("log", END, "fix r all rigid/small molecule\n", "line 9, column mol: no column"),
        ("log", "6e10", "6e7", "x.atoms: the law makes overlaps of .*; give stiffnesses"),
        ("log", "units si", "", r"log.lammps: units lj .*--scales"),
        ("spheres", "ITEM: ATOMS.*", "ITEM: ", r"x.atoms, line 9: 'ITEM:' where"),
        ("log", "zplane", "xplane", r"fix w wall/gran: xplane is not known"),
        ("spheres", "ITEM: ATOMS", "ITEM: ENTRIES", "line 9: ITEM: ENTRIES where spheres"),
        ("log", r"compute p", "compute q", r"column c_p\[1\]: what the 2 columns"),
        ("log", END, "dimension 2\n", "line 10: dimension 2; a network has spheres that move in"),
        ("log", END, "bond_style bpm/spring\n", "bond_style bpm/spring: bonds are no contacts"),
        ("log", END, "fix f all freeze\n", "fix freeze: frozen spheres"),
        ("log", END, "fix h all wall/harmonic zlo EDGE 1\n", "fix wall/harmonic: walls of this"),
        ("log", END, f"fix w all wall/gran {HERTZ} wiggle z 1 1\n", "fix w .*it wiggles,"),
        ("log", END, "clear\n", "no law of contact is known; `import` it"),
        ("log", END, "Step\n8\n9\n", "x.atoms: step 7, the runs of .* 8 to 9: the log of another"),
        ("log", END, "Created 9 atoms\n", "x.atoms: atoms 60, the runs of .* 9 to 9: the log of"),
        # Variables without a value, as in a script that is given for its log.
        ("log", END, "pair_coeff 1 1 hertz ${E} 0 0.2\n", r"\${E} has no value in this file: pair"),
        ("log", END, "fix v all wall/gran hertz $(v_l) zplane 0 1\n", r"\$\(v_l\) has no value"),
    ],
    "paired": [
        ("log", "rigid molecule", "rigid single", "fix r rigid single: which spheres are one body"),
        ("log", "rigid molecule", "rigid molecule infile r.txt", r"masses of its own \(infile\)"),
        ("log", END, "fix s clumps rigid molecule\n", "several fix rigid"),
        ("log", "rigid molecule", "rigid custom i_b", "x.atoms, line 9, .* no column i_b among"),
        ("log", "r clumps", "r all", "a mol of 0, which is one more body to fix rigid; make s"),
    ],
    "liggghts": [
        ("log", "run 0", "fix r all multisphere motion", r"log.*, line \d+: fix multisphere: clum"),
        ("log", "run 0", "fix b all bond/create 1", r"log.*, line \d+: fix bond/create: bonds"),
        ("log", "history", "history cohesion sjkr", r"log.*: cohesion is resisted by no spring"),
        ("log", "model hertz", "model hooke", r"only model hertz with tangential history"),
        ("log", FIX, FIX.replace("6e10", "60e"), r"line \d+: youngsModulus '60e' is no number"),
        ("log", FIX, FIX.replace("6e10", "60"), r"Young's modulus 60 Pa is that of no material"),
        ("log", FIX, "", r"log.*: no youngsModulus; give --pair"),
        ("log", "(youngsModulus peratomtype) 6e10", r"\1 $E", r"\$E has no value in this file: fi"),
    ],
    "cubic": [
        ("spheres", f"{LINEAR}S", "LinearPlasticViscoelasticS", "line 12: .* is not known; Linear"),
        ("spheres", "particleDimensions 3", "particleDimensions 2", "line 10: particle.* 2: discs"),
        ("spheres", "stiffness 75857.5", "stiffness x7.5", "line 12: stiffness .x.* is no number"),
        ("spheres", "Boundaries 0", "Boundaries 1\nAngledPeriodicBoundary", "line 21: .*angled"),
        ("spheres", "Boundaries 0", "Boundaries 1\nLeesEdwardsBoundary", "line 21: .*or moves"),
        ("spheres", "particleWallIds 120 4", "particleWallIds 120 0", "line 173: .* with wall 0"),
        ("spheres", "particleIds 115 116", "particleIds 120 121", "line 149: .* of line 148 again"),
        ("spheres", "particleIds 120 121", "particleIds 120 900", "line 148, .* sphere 900 is not"),
        ("spheres", "BaseParticle id 1 ", "MultiParticle id 1 ", "line 23: MultiP.* is no sphere"),
        ("spheres", r"(?s)\A((?:[^\n]*\n){64}).*", r"\1", "43 Particles of 125: the file ends"),
    ],
    "tables": [
        ("spheres", 9, 0, "14.5", "spheres.csv, line 9, column id: 14.5 is no whole number"),
        ("spheres", 9, 0, "1e17", r"spheres.csv, line 9, column id: 1e\+17 is no whole number"),
        ("contacts", 9, slice(2), ["12", "12"], "csv, line 9: spheres 12 and 12 lie in one place"),
        ("contacts", 9, 3, "\x1b[31m" * 99, r"line 9, column kt: '\\x1b\[31m[^\n]{,250} is no num"),
        (
            "spheres",
            9,
            3,
            "0,5",
            "csv, line 9: more than the 6 columns .*; write numbers with a po",
        ),
        ("contacts", 1, 2, "stiff", "contacts.csv, line 1, column kn: no column kn among"),
        ("spheres", 6, 0, "10", r"spheres.csv, line 6, column id: sphere 10 again \(line 5\)"),
        ("spheres", 9, 4, "-1e-3", "spheres.csv: sphere 14 has radius <= 0"),
        ("spheres", 9, slice(9), [], "spheres.csv, line 9: an empty line between the rows"),
        ("spheres", 1, 0, "# cell 0 1", "csv, line 1: ends where a number of # cell .*; write #"),
        ("contacts", 7, 3, "inf", "contacts.csv, line 7, column kt: inf is no finite number"),
        ("contacts", 9, 4, "-2", "contacts.csv, line 9, column fn: -2 pulls; write compression"),
        ("spheres", 9, 3, "5e-3", r"contacts.csv, line \d+: sphere.* 14 .*do not touch, there are"),
        ("spheres", PERIODS, "# periodic 1 1\n", "csv, line 2: '1' is no axis; write # periodic x"),
        ("spheres", PERIODS, 2 * PERIODS, r"spheres.csv, line 3: # periodic again \(line 2\)"),
        ("spheres", "# periodic", "# peridoic", r"line \d+: .* not touch, .* with the cell's per"),
        ("spheres", r"(?s)\A((?:[^\n]*\n){4}).*", r"\1", "csv, line 5: no rows below the names"),
        ("contacts", "i,j,kn,kt", "i;j;kn;kt", "'i;j;kn;kt.*; name the columns .*, with commas: i"),
        ("contacts", "i,j", "\x1b[2J\0" * 999, r"no column i among '[^\n]{,400}'...; name the col"),
        ("contacts", "kt,fn", "kt,bond\x1b[2J", r"column bond\\x1b\[2J: it is not known, and may"),
    ],
}
"""By the fixture of the files."""


@pytest.mark.parametrize(
    ("files", "change"),
    [pytest.param(name, row, id=f"{name}-{row[-1]}") for name in SPOILT for row in SPOILT[name]],
)
def test_what_cannot_be_is_refused(files, change, request):
    """Without a warning of numpy before the one line, which has no byte that a terminal obeys."""
    files, (file, *change, said) = request.getfixturevalue(files), change
    if len(change) == 3:
        files.respell(file, *change)
    else:
        files.spoil(file, *change)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        files.refused(said)
        files.refused(r"\A[^\x00-\x1f\x7f]{,700}\n\Z")


@pytest.mark.parametrize("files", ["walled", "liggghts"])
@pytest.mark.parametrize(
    ("file", "said"),
    [("contacts", "no two spheres touch.*; dump a packing"), ("spheres", "x.atoms: no spheres; ")],
)
def test_files_without_a_row_are_refused_by_name(request, files, file, said):
    files = request.getfixturevalue(files)
    files.spoil(file, r"(?s)(NUMBER OF \S+\n)\d+(.*ITEM: (ATOMS|ENTRIES)[^\n]*\n).*", r"\g<1>0\2")
    files.refused(said)


def test_a_contact_that_is_listed_twice_is_refused_by_its_line(walled):
    i, j = walled.contacts.read_text().splitlines()[10].split()[1:3]
    walled.respell("contacts", 16, slice(1, 3), [j, i])
    walled.refused("x.contacts, line 16: the contact of line 11 again; list each contact once")


def test_what_has_no_part_in_the_law_may_stand_in_a_log(walled):
    """Variables without a value, and a fix that is no more."""
    walled.spoil("log", END, "fix t all langevin $T 1 ${seed}\nrun $n\nfix f all freeze\nunfix f\n")
    walled.imported()
