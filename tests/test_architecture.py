"""The rooms of modal and of analysis: what may import what, and what runs without scipy."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

BELOW = {
    "tools": set(),
    "formats": {"tools"},
    "solvers": {"tools"},
    "packing": {"formats", "tools"},
    "system": {"packing", "solvers", "tools"},
    "dem": {"packing", "tools"},
    "waves": {"dem", "formats", "packing", "solvers", "system", "tools"},
    "modes": {"formats", "packing", "solvers", "system", "tools"},
    "elasticity": {"formats", "modes", "packing", "solvers", "system", "tools"},
    "preparation": {"dem", "formats", "packing", "solvers", "system", "tools"},
    "theory": {"packing", "tools"},
    "exchange": {"formats", "packing", "system", "tools"},
    "description": {"modes", "packing", "system", "tools"},
    "cli": {
        *("elasticity", "exchange", "formats", "modes", "packing", "preparation", "solvers"),
        *("system", "theory", "tools", "waves"),
    },
    "__main__": {"cli", "tools"},
}
"""Room of modal: the rooms that it may import from, besides itself."""
ANALYSIS_BELOW = {
    "table": set(),
    "watch": set(),
    "estimators": {"table"},
    "agreement": {"estimators", "table"},
    "case_files": set(),
    "case": {"case_files", "estimators"},
    "belonging": {"case", "estimators"},
    "prepare": {"case", "estimators"},
    "value": set(),
    "measuring": {"case", "estimators", "prepare", "value"},
    "quantities": {"estimators", "measuring", "value"},
    "measurement": {"belonging", "measuring", "quantities", "value"},
    "status": {"case", "case_files", "estimators"},
    "crystal": {"case", "estimators"},
    "measures": {"case", "estimators"},
    "columns": {"estimators", "measures"},
    "rows": {"case", "columns", "estimators", "measures"},
    "comparable": {"rows"},
    "figures": {
        *("case", "columns", "comparable", "crystal", "estimators", "measures"),
        "rows",
    },
    "study": {
        *("case", "case_files", "columns", "crystal", "estimators", "figures", "measurement"),
        *("measures", "rows", "table", "value"),
    },
    "cli": {
        *("agreement", "belonging", "figures", "measurement", "measures", "quantities"),
        *("status", "study", "table", "watch"),
    },
    "__main__": {"cli"},
}
"""Room or module of analysis: what of analysis it may import from, besides itself."""
RULES = {"modal": BELOW, "analysis": ANALYSIS_BELOW}


def imports(path: Path) -> set[str]:
    """Dotted names of the modules that a file imports, inside functions too."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def rooms_of(names: set[str]) -> set[str]:
    """Rooms of modal among dotted names."""
    return {name.split(".")[1] for name in names if name.startswith("modal.")} & set(BELOW)


def files() -> list[Path]:
    return sorted(path for path in (ROOT / "modal").rglob("*.py"))


@pytest.mark.parametrize("package", ["modal", "analysis"])
def test_every_room_and_module_has_a_rule(package):
    """A new one says what it stands on: a line in the package's table, here."""
    folder = ROOT / package
    found = {path.relative_to(folder).parts[0].removesuffix(".py") for path in folder.rglob("*.py")}
    ruled = {*RULES[package], "__init__"}
    assert not found - ruled, f"without a rule in this file: {sorted(found - ruled)}"
    assert not ruled - found, f"a rule for what is not there: {sorted(ruled - found)}"


@pytest.mark.parametrize("room", BELOW)
def test_arrows_run_one_way(room):
    """A room imports from those below it alone."""
    folder, single = ROOT / "modal" / room, ROOT / "modal" / f"{room}.py"
    for path in [single] if single.exists() else sorted(folder.rglob("*.py")):
        above = rooms_of(imports(path)) - {room} - BELOW[room]
        assert not above, f"{path.relative_to(ROOT)} imports from {above}"


@pytest.mark.parametrize("package", ["modal", "analysis"])
def test_no_room_stands_on_itself(package):
    """The tables themselves have no circle."""
    order: list[str] = []
    left = dict(RULES[package])
    while left:
        ground = [room for room, below in left.items() if below <= set(order)]
        assert ground, f"a circle among {sorted(left)}"
        order += ground
        left = {room: below for room, below in left.items() if room not in ground}


def test_modal_knows_nothing_of_the_others():
    for path in files():
        others = {name.split(".")[0] for name in imports(path)}
        assert not others & {"analysis", "yade_scripts", "benchmarks", "tests", "yade"}, path


@pytest.mark.parametrize("room", ["packing", "formats"])
def test_rooms_that_run_inside_yade_load_neither_scipy_nor_numba(room):
    """Import every module of the room in a new process and look at what is loaded."""
    names = [
        f"modal.{room}.{path.stem}"
        for path in sorted((ROOT / "modal" / room).glob("*.py"))
        if path.stem != "__init__"
    ]
    heavy = "('scipy', 'numba', 'matplotlib')"
    loaded = f"*(name for name in {heavy} if sys.modules.get(name))"
    code = f"import sys, {', '.join(names)}; print({loaded})"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []


def test_what_is_installed_is_the_whole_of_modal_and_says_that_it_is_typed(tmp_path):
    """Build as pip does, without its isolation: all modules, the mark of types, the style."""
    pytest.importorskip("setuptools")
    build = [sys.executable, "-c", "import setuptools; setuptools.setup()", "-q"]
    build += ["egg_info", "--egg-base", str(tmp_path)]
    build += ["build_py", "--build-lib", str(tmp_path / "lib")]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    built = {path.relative_to(tmp_path / "lib") for path in (tmp_path / "lib").rglob("*.py")}
    wanted = {path for room in ("modal", "analysis") for path in (ROOT / room).rglob("*.py")}
    assert built == {path.relative_to(ROOT) for path in wanted}
    assert (tmp_path / "lib/modal/py.typed").exists()
    assert (tmp_path / "lib/analysis/figures/paper.mplstyle").exists()
    for name in ("page.html", "libraries.min.js", "uplot.min.css"):
        assert (tmp_path / "lib/analysis/watch" / name).exists()


def of_analysis(path: Path) -> set[str]:
    """Rooms and modules of analysis that a file imports from."""
    return {name.split(".")[1] for name in imports(path) if name.startswith("analysis.")}


def files_of(room: str) -> list[Path]:
    folder = ROOT / "analysis" / room
    return sorted(folder.rglob("*.py")) if folder.is_dir() else [folder.with_suffix(".py")]


@pytest.mark.parametrize("room", ANALYSIS_BELOW)
def test_arrows_of_analysis_run_one_way(room):
    """Estimators know signals and networks, no case; figures no report; the command line all."""
    for path in files_of(room):
        above = of_analysis(path) - {room} - ANALYSIS_BELOW[room]
        assert not above, f"{path.relative_to(ROOT)} imports from {above}"


def test_analysis_imports_no_script():
    """What runs in YADE or measures run times may use analysis, never the other way round."""
    for path in (ROOT / "analysis").rglob("*.py"):
        others = {name.split(".")[0] for name in imports(path)}
        assert not others & {"yade_scripts", "benchmarks", "tests", "yade"}, path


@pytest.mark.parametrize("package", ["modal", "analysis"])
def test_modules_stand_in_no_circle(package):
    """Over all modules: a module is loaded after those that it imports."""
    modules = {}
    for path in (ROOT / package).rglob("*.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        modules[".".join(parts).removesuffix(".__init__")] = imports(path)
    left = {name: (found & set(modules)) - {name} for name, found in modules.items()}
    for name, below in left.items():
        # A package is loaded before what stands in it.
        below -= {other for other in modules if other.startswith(f"{name}.")}
    done: set[str] = set()
    while left:
        ground = {name for name, below in left.items() if below <= done}
        assert ground, f"a circle among {sorted(left)}"
        done |= ground
        left = {name: below for name, below in left.items() if name not in ground}
