"""Motions that a script of LAMMPS or LIGGGHTS takes from spheres, and what is refused by name.

A column of three spheres (types 1, 2, 1) between two walls. Expected are the manuals' meanings of
the commands; `test_lammps_moves_whom_we_say` asks LAMMPS itself.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from lammps_runs import LAMMPS, needs_lammps
from program_files import COLUMN_PAIR, COLUMN_WALL, column
from refusals import refusal

import modal
from modal.exchange.groups import Groups
from modal.exchange.registry import import_packing
from modal.tools.errors import InputError

SPHERE = "fix n all nve/sphere"
MOBILE = "group mobile id 2\n1 atoms in group mobile\n"
ENDS = "group ends id 1 3\n2 atoms in group ends\n"
TABLE = "   Step          Temp\n         0   0\n"
RUN = f"run 0\n{TABLE}Loop time of 0.1 on 1 procs for 0 steps with 3 atoms\n"


def log_of(script: str, law: str = COLUMN_PAIR) -> str:
    """Return a log of these commands, each `RUN` with the table that it prints."""
    style, coefficients = law.split(" ", 1)
    head = f"LAMMPS (22 Jul 2025)\nunits si\npair_style {style}\npair_coeff * * {coefficients}\n"
    return f"{head}fix w all wall/gran {COLUMN_WALL}\n{script}"


MOTIONS = "xyzXYZ"
"""Letters of the motions of a sphere, in the order of the column: displacements, then turns."""


def held_by(folder: Path, script: str, law: str = COLUMN_PAIR, **options: object) -> str:
    """Return the motions that the script takes from each sphere of the column, as letters.

    Spheres are separated by blanks, and "-" is a free one. If the column is refused, the code is
    returned.
    """
    dump = column(folder, types=(1, 2, 1), **options)
    log = folder / "log.lammps"
    log.write_text(log_of(script, law))
    try:
        network = import_packing(dump, log=log).network
    except InputError as error:
        assert "\n" not in str(error)
        return error.code
    assert network.n_contacts == 4
    words = []
    for fixed in ~network.free_motions:
        words.append("".join(np.array([*MOTIONS])[fixed]) or "-")
    return " ".join(words)


ALL = "xyzXYZ - xyzXYZ"
"""The two ends of the column are held in all motions."""
HELD = {
    "a part is integrated": (f"{MOBILE}fix n mobile nve/sphere\n{RUN}", ALL),
    "a part by type": (
        f"{MOBILE.replace('id 2', 'type 2')}fix n mobile nve/sphere\n{RUN}",
        ALL,
    ),
    "a part by a number that is compared": (
        f"group mobile id > 1\nfix n mobile nve/sphere\n{RUN}",
        "xyzXYZ - -",
    ),
    "a part, to a thermostat": (
        f"{MOBILE}fix n mobile npt/sphere temp 1 1 1 iso 0 0 1\n{RUN}",
        ALL,
    ),
    "a part, accelerated": (f"{MOBILE}fix n mobile nve/sphere/omp\n{RUN}", ALL),
    "all but one": (
        f"{MOBILE}group rest subtract all mobile\nfix n rest nve/sphere\n{RUN}",
        "- xyzXYZ -",
    ),
    "what two groups share": (
        "group low id 1 2\ngroup high id 2 3\n"
        f"group both intersect low high\nfix n both nve/sphere\n{RUN}",
        ALL,
    ),
    "a part in the last stage": (
        f"{SPHERE}\n{RUN}unfix n\n{MOBILE}fix n mobile nve/sphere\n{RUN}",
        ALL,
    ),
    "a part, then nobody": (f"{MOBILE}fix n mobile nve/sphere\n{RUN}unfix n\n{RUN}", ALL),
    "a moving wall of spheres": (
        f"{MOBILE}{ENDS}fix n mobile nve/sphere\nfix e ends nve/noforce\n{RUN}",
        ALL,
    ),
    "setforce": (f"{ENDS}{SPHERE}\nfix s ends setforce 0 0 0\n{RUN}", "xyz - xyz"),
    "setforce of one component": (
        f"{ENDS}{SPHERE}\nfix s ends setforce NULL NULL 0.0\n{RUN}",
        "z - z",
    ),
    "move": (f"{ENDS}{SPHERE}\nfix m ends move linear 0 0 0\n{RUN}", "xyz - xyz"),
    "move of those that nothing integrates": (
        f"{MOBILE}{ENDS}fix n mobile nve/sphere\nfix m ends move linear 0 0 0\n{RUN}",
        ALL,
    ),
    "freeze": (f"{ENDS}{SPHERE}\nfix f ends freeze\n{RUN}", ALL),
    "a plane across y": (f"{ENDS}{SPHERE}\nfix p ends planeforce 0 1 0\n{RUN}", "y - y"),
    "a line": (f"{ENDS}{SPHERE}\nfix p ends lineforce 0 0 1\n{RUN}", "xy - xy"),
    "no rotation": (f"fix n all nve\n{RUN}", "XYZ XYZ XYZ"),
    "no rotation, thermostat": (f"fix n all nvt temp 1 1 1\n{RUN}", "XYZ XYZ XYZ"),
    "no rotation, limited": (f"fix n all nve/limit 0.1\n{RUN}", "XYZ XYZ XYZ"),
    "no rotation of a part": (
        f"{MOBILE}{ENDS}fix n mobile nve/sphere\nfix e ends nve\n{RUN}",
        "XYZ - XYZ",
    ),
    "no rotation, and one component": (
        f"{ENDS}fix n all nve\nfix s ends setforce NULL 0 NULL\n{RUN}",
        "yXYZ XYZ yXYZ",
    ),
    "a script that never ran": (f"{ENDS}{SPHERE}\nfix f ends freeze\nrun 100\n", ALL),
    "a log without a run": (f"{MOBILE}fix n mobile nve/sphere\n", ALL),
    "a plane": (f"dimension 2\n{SPHERE}\nfix p all enforce2d\n{RUN}", "zXY zXY zXY"),
}
REFUSED = {
    "a region": "region slab block 0 8 0 8 1 2\ngroup mobile region slab\n1 atoms in group mobile\n"
    f"fix n mobile nve/sphere\n{RUN}",
    "a region whose number is not printed": "group mobile region slab\n"
    f"fix n mobile nve/sphere\n{RUN}",
    "a group that no line defines": f"fix n mobile nve/sphere\n{RUN}",
    "a group that changes": f"group mobile dynamic all region slab\nfix n mobile nve/sphere\n{RUN}",
    "setforce of a variable": f"{ENDS}{SPHERE}\nfix s ends setforce v_push NULL NULL\n{RUN}",
    "setforce of a push": f"{ENDS}{SPHERE}\nfix s ends setforce 0 0 1\n{RUN}",
    "one force of several": f"{ENDS}{SPHERE}\nfix s ends aveforce 0 0 0\n{RUN}",
    "a part of a motion": f"{ENDS}{SPHERE}\nfix m ends move linear NULL 0 0\n{RUN}",
    "springs to places": f"{ENDS}{SPHERE}\nfix t ends spring/self 10.0\n{RUN}",
    "a slanting line": f"{ENDS}{SPHERE}\nfix p ends lineforce 0 1 1\n{RUN}",
    "discs": f"{SPHERE} disc\n{RUN}",
    "a group in a variable": "variable who string mobile\nfix n ${who} nve/sphere\n"
    f"fix n mobile nve/sphere\n{RUN}",
}
FREE = {
    "all": f"{SPHERE}\n{RUN}",
    "nobody is integrated": RUN,
    "read and dumped": f"read_restart x.restart\n  3 atoms\n{RUN}",
    "all, then nobody": f"{SPHERE}\n{RUN}unfix n\n{RUN}",
    "all, then at given velocities": f"{SPHERE}\n{RUN}unfix n\nfix m all nve/noforce\n{RUN}",
    "only minimized": f"minimize 0 0 9 9\n{RUN.removeprefix('run 0')}",
    "halves": f"{MOBILE}{ENDS}fix n mobile nve/sphere\nfix e ends nve/sphere\n{RUN}",
    "a region and the rest": "group low region slab\n1 atoms in group low\n"
    "group rest subtract all low\nfix a low nve/sphere\nfix b rest nvt/sphere temp 1 1 1\n" + RUN,
    "three regions and the rest": "group a region ra\ngroup b region rb\ngroup c union a b\n"
    "group d subtract all c\ngroup e region re\ngroup f union c d\nfix f f nve/sphere\n" + RUN,
    "a region that has all": "group grains region whole\n3 atoms in group grains\n"
    f"fix n grains nve/sphere\n{RUN}",
    "all types": f"group grains type 1 2\nfix n grains nve/sphere\n{RUN}",
    "a range of types": f"group grains type <= 5\nfix n grains nve/sphere\n{RUN}",
    "all numbers": f"group grains id 1:3\nfix n grains nve/sphere\n{RUN}",
    "held, then let go": f"{ENDS}{SPHERE}\nfix f ends freeze\n{RUN}unfix f\n{RUN}",
    "setforce of nothing": f"{ENDS}{SPHERE}\nfix s ends setforce NULL NULL NULL\n{RUN}",
    "nobody is held": f"group none type 7\n0 atoms in group none\n{SPHERE}\n"
    f"fix f none freeze\n{RUN}",
    "nobody is in the region": f"group none region far\n0 atoms in group none\n{SPHERE}\n"
    f"fix f none freeze\n{RUN}",
    "forces that only push": f"{SPHERE}\nfix g all gravity 9.81 vector 0 0 -1\n"
    f"fix v all viscous 1\nfix a all addforce 0 0 1\n{RUN}",
    "another velocity": f"{ENDS}{SPHERE}\nvelocity ends set 0 0 0\n{RUN}",
    "a mesh that moves": f"{SPHERE}\nfix m all move/mesh mesh plate linear 0 0 1\n{RUN}",
    "many groups that hold nobody": "".join(f"group g{k} region r{k}\n" for k in range(40))
    + f"{SPHERE}\n{RUN}",
    "a group made again and again": "group g region r\ngroup g delete\n" * 40 + f"{SPHERE}\n{RUN}",
}


@pytest.mark.parametrize(("script", "held"), HELD.values(), ids=HELD)
def test_held_motions_go_into_the_network(tmp_path, script, held):
    assert held_by(tmp_path, script) == held


@pytest.mark.parametrize("script", REFUSED.values(), ids=REFUSED)
def test_what_has_no_place_or_is_not_known_is_refused(tmp_path, script):
    assert held_by(tmp_path, script) == "held_bodies"


@pytest.mark.parametrize("script", FREE.values(), ids=FREE)
def test_spheres_that_move_freely_are_taken(tmp_path, script):
    assert held_by(tmp_path, script) == "- - -"


def test_another_job_begins_without_the_fixes_of_the_one_before(tmp_path):
    """Freeze the ends in a job that is killed; the log of a second job follows."""
    head = "LAMMPS (22 Jul 2025)\n"
    script = f"{ENDS}{SPHERE}\nfix f ends freeze\nrun 9\n{TABLE}{head}{SPHERE}\n{RUN}"
    assert held_by(tmp_path, script) == "- - -"


def test_frequencies_of_a_held_column(tmp_path):
    """Compare a sphere between two held ones, with two springs kn, and two kt at arms of a radius.

    m u'' = -2 kn u along z, and across m u'' = -2 kt u, (2/5) m R^2 theta'' = -2 kt R^2 theta: the
    slips at the two contact points, u + R theta and u - R theta, do not couple them.
    """
    assert held_by(tmp_path, HELD["freeze"][0]) == ALL
    log = tmp_path / "log.lammps"
    network = import_packing(tmp_path / "x.dump", log=log).network
    modes = modal.eigenmodes(network, all=True)
    mass = 1.3
    kn = 1e5
    kt = 8e4
    arm = 0.5 - 1e-5
    turning = 2 * kt * arm**2 / (0.4 * mass * 0.5**2)
    square = [0, 2 * kt / mass, 2 * kt / mass, 2 * kn / mass, turning, turning]
    np.testing.assert_allclose(modes.frequency, np.sqrt(np.sort(square)) / (2 * np.pi), rtol=1e-7)


def test_a_plane_needs_spheres_that_are_kept_in_it(tmp_path):
    assert held_by(tmp_path, f"dimension 2\n{SPHERE}\n{RUN}") == "two_dimensions"
    # A cell of a program in a plane is thinner than a sphere, and periodic.
    script = HELD["a plane"][0]
    assert (
        held_by(tmp_path, script, flags="pp pp pp", bounds=("0 8", "0 8", "0 3")) == "zXY zXY zXY"
    )


def test_pairs_of_held_spheres_may_be_excluded(tmp_path):
    """Accept excluded contacts inside a wall of spheres; refuse others, which are needed."""
    exclude = "neigh_modify exclude group {} {}\n"
    freeze = f"{ENDS}{SPHERE}\nfix f ends freeze\n"
    assert held_by(tmp_path, f"{freeze}{exclude.format('ends', 'ends')}{RUN}") == ALL
    exclude_others = exclude.format("ends", "all")
    assert held_by(tmp_path, f"{freeze}{exclude_others}{RUN}") == "excluded_pairs"


def rows(*steps: int) -> str:
    return "Step Temp\n" + "".join(f"{step} 0\n" for step in steps)


def over(steps: int) -> str:
    return f"Loop time of 1 on 1 procs for {steps} steps with 3 atoms\n"


@pytest.mark.parametrize(("step", "held"), [(50, ALL), (100, ALL), (150, "- - -"), (200, "- - -")])
def test_the_run_that_wrote_the_dump_counts(tmp_path, step, held):
    """Freeze the ends for 100 steps, then release them; the first run has dumped step 100."""
    script = f"{ENDS}{SPHERE}\nfix f ends freeze\ndump d all custom 50 x.dump id\nrun 100\n"
    script += rows(0, 100) + over(100) + "unfix f\nrun 100\n" + rows(100, 200) + over(100)
    assert held_by(tmp_path, script, step=step) == held


@pytest.mark.parametrize(
    "write",
    [
        "dump d all custom 1 x.dump id\nrun 0\n" + rows(100) + over(0),
        "write_dump all custom x.dump id\n",
    ],
)
def test_a_dump_that_comes_after_the_hold_counts_as_it_is(tmp_path, write):
    """Freeze until step 100, release, dump step 100, and freeze again."""
    script = f"{ENDS}{SPHERE}\nfix f ends freeze\nrun 100\n" + rows(0, 100) + over(100)
    script += f"unfix f\n{write}undump d\nfix f ends freeze\nrun 100\n" + rows(100, 200) + over(100)
    assert held_by(tmp_path, script, step=100) == "- - -"


def test_the_last_step_of_a_run_is_of_this_run_alone(tmp_path):
    """Dump step 100 at the end of a free run, then freeze the ends for a further one."""
    script = f"{ENDS}{SPHERE}\ndump d all custom 50 x.dump id\nrun 100\n" + rows(0, 100) + over(100)
    script += "fix f ends freeze\nrun 100\n" + rows(100, 200) + over(100)
    log = tmp_path / "log.lammps"
    log.write_text(log_of(script))
    dump = column(tmp_path, step=100, types=(1, 2, 1))
    assert import_packing(dump, log=log).network.n_contacts == 4


@pytest.mark.parametrize("first_is_held", [True, False])
@pytest.mark.parametrize(("step", "both"), [(50, True), (80, False)])
def test_steps_that_are_counted_again_may_be_of_either_run(tmp_path, first_is_held, step, both):
    """Freeze the ends in one of two runs, of steps 0 to 100 and again 0 to 60."""
    frozen = "fix f ends freeze\n"
    free = "unfix f\n"
    script = f"{ENDS}{SPHERE}\n{frozen}{'' if first_is_held else free}"
    script += "run 100\n" + rows(0, 100) + over(100) + "reset_timestep 0\n"
    script += (free if first_is_held else frozen) + "run 60\n" + rows(0, 60) + over(60)
    expected = "held_bodies"
    if not both:
        expected = ALL if first_is_held else "- - -"
    assert held_by(tmp_path, script, step=step) == expected


POURED = "region reg block 0 8 0 8 0 16\ncreate_box 1 reg\n"


@pytest.mark.parametrize(
    ("script", "code"),
    [
        ("group grains region reg\n0 atoms in group grains\nfix n grains nve/sphere\n"
         "fix i grains insert/pack seed 1\n", ""),
        ("group grains region reg\n0 atoms in group grains\nfix n grains nve/sphere\n"
         "fix i all insert/pack seed 1\n", "held_bodies"),
        ("fix n all nve/sphere\nfix i all pour 3 1 1 region reg\n", ""),
        ("create_atoms 1 single 1 1 1\nCreated 1 atoms\ngroup base region reg\n"
         "1 atoms in group base\ngroup grains subtract all base\nfix n grains nve/sphere\n"
         "fix i grains pour 2 1 1 region reg\n", "held_bodies"),
        ("create_atoms 1 single 1 1 1\nCreated 1 atoms\ngroup base region reg\n"
         "1 atoms in group base\nfix n all nve/sphere\nfix f base freeze\n"
         "fix i all pour 2 1 1 region reg\n", "held_bodies"),
        ("fix i all insert/pack seed 1\nrun 10\nunfix i\ngroup grains type 1 2\n"
         "3 atoms in group grains\nfix n grains nve/sphere\n", ""),
    ],
)  # fmt: skip
def test_atoms_that_are_inserted_are_in_the_group_of_their_fix(tmp_path, script, code):
    assert held_by(tmp_path, f"{POURED}{script}{RUN}") == (code or "- - -")


def test_bodies_that_are_held_are_refused(tmp_path):
    """Refuse rigid bodies whose forces or torques are off."""
    path = column(tmp_path)
    text = path.read_text().replace("mass\n", "mass mol\n")
    numbers = iter("110")
    head, _, spheres = text.partition("mol\n")
    body = "".join(f"{row} {next(numbers)}\n" for row in spheres.splitlines())
    path.write_text(f"{head}mol\n{body}")
    log = tmp_path / "log.lammps"
    rigid = "group clumps molecule 1\nfix r clumps rigid molecule"
    rest = "group rest subtract all clumps\nfix n rest nve/sphere\n"
    log.write_text(log_of(f"{rigid}\n{rest}{RUN}"))
    assert import_packing(path, log=log).network.n_particles == 2
    log.write_text(log_of(f"{rigid} torque * off off off\n{rest}{RUN}"))
    with refusal("held_bodies"):
        import_packing(path, log=log)
    log.write_text(log_of(f"{rigid}\nrun 9\n{RUN}"))  # the single sphere is left alone
    assert import_packing(path, log=log).network.held.tolist() == [False, True]


def test_groups_are_those_of_sets():
    """Compare a random history of unions, differences and intersections with sets of numbers."""
    random = np.random.default_rng(3)
    n = 8
    columns = {"id": np.arange(1, n + 1), "type": random.integers(1, 4, n)}
    for _ in range(30):
        sets = {"all": set(range(1, n + 1))}
        history = []
        for k in range(4):
            ids = random.choice(n, 3, replace=False) + 1
            history.append(["group", f"g{k}", "id", *map(str, ids)])
            sets[f"g{k}"] = {int(number) for number in ids}
        for k in range(6):
            style = str(random.choice(["union", "subtract", "intersect"]))
            parts = [str(name) for name in random.choice([*sets], 2)]
            a, b = (sets[name] for name in parts)
            chosen = {"union": a | b, "subtract": a - b, "intersect": a & b}[style]
            history.append(["group", f"h{k}", style, *parts])
            sets[f"h{k}"] = chosen
        groups = Groups.from_history(history, columns, n, sets)
        for name, members in sets.items():
            assert groups.may_contain_atoms(groups.possible_members(name)) == bool(members)
            assert groups.may_contain_atoms(~groups.possible_members(name)) == (len(members) < n)


@needs_lammps
@pytest.mark.parametrize("case", ["a part is integrated", "setforce", "setforce of one component",
                                  "move", "move of those that nothing integrates", "freeze",
                                  "a line", "no rotation", "no rotation of a part",
                                  "all", "halves"])  # fmt: skip
def test_lammps_moves_whom_we_say(tmp_path, case):
    """Let spheres out of balance push and turn each other: the motions that keep still are held."""
    script, held = HELD.get(case) or (FREE[case], "- - -")
    commands = script.replace(RUN, "")
    lines = "\n".join(line for line in commands.splitlines() if not line[0].isdigit())
    style, coefficients = COLUMN_PAIR.split(" ", 1)
    places = [f"{4 + 1e-3 * k**2} {4 + 2e-3 * k**2} {0.4999 + 0.9997 * k}" for k in range(3)]
    (tmp_path / "in.lmp").write_text(
        "units si\natom_style sphere\nboundary p p f\nnewton off\ncomm_modify vel yes\n"
        "atom_modify map array\nregion box block 0 8 0 8 0 16\ncreate_box 2 box\n"
        + "".join(f"create_atoms {1 + k % 2} single {place}\n" for k, place in enumerate(places))
        + f"set group all diameter 1.0 density 2.5\npair_style {style}\n"
        f"pair_coeff * * {coefficients}\nfix w all wall/gran {COLUMN_WALL}\n{lines}\n"
        "timestep 1e-6\ndump d all custom 1000 x.out id type x y z radius mass omegax omegay "
        "omegaz\n"
        "dump_modify d sort id format float %.17g\nrun 1000\n"
    )
    command = [LAMMPS, "-in", "in.lmp", "-log", "log.lammps", "-screen", "none"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, (tmp_path / "log.lammps").read_text()[-500:]
    frames = re.split(r"omegaz ?\n", (tmp_path / "x.out").read_text())[1:]
    first, last = (np.loadtxt(frame.split("ITEM")[0].splitlines()) for frame in frames)
    moved = abs(last - first)[:, [2, 3, 4, 7, 8, 9]] > 0
    # Turns about z need a contact aside: two spheres above each other turn each other about x, y.
    turned = moved[:, 3:].any(axis=1)
    # What the import reads of LAMMPS' own log and dump.
    fixed = ~modal.read(tmp_path / "x.out", log=tmp_path / "log.lammps", step=1000).free_motions
    words = ["".join(np.array([*MOTIONS])[row]) or "-" for row in fixed]
    assert " ".join(words) == held
    np.testing.assert_array_equal(moved[:, :3], ~fixed[:, :3])
    np.testing.assert_array_equal(turned, ~fixed[:, 3:].all(axis=1))
