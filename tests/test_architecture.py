"""The rooms of modal and of analysis: each stands on those before it, and loads little."""

import ast
import builtins
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from places import ROOT

from modal.packing.crystal import fcc
from modal.packing.network import write_network

ORDER = {
    "modal": (
        *("tools", "formats", "solvers", "packing", "system", "dem", "waves", "sources", "motions"),
        *(
            "modes",
            "elasticity",
            "preparation",
            "theory",
            "exchange",
            "description",
            "cli",
            "__main__",
        ),
    ),
    "analysis": (
        *(
            "table",
            "typed_json",
            "watch",
            "caveats",
            "steps",
            "explanation",
            "value",
            "mean",
            "estimators",
        ),
        *("transducer_pair", "bench", "agreement", "case"),
        *(
            "same_state",
            "packing_state",
            "static_packing",
            "record_rules",
            "packing_data",
            "spectra_cache",
            "quantities",
            "measurement",
        ),
        *("case_columns", "case_result", "case_measurement", "column_results", "result_file"),
        *("expressions", "frame", "crystal", "figures", "study"),
        *("cli", "shadowing", "__main__"),
    ),
}
"""Rooms and modules from the ground up: each imports from those before it alone."""
OTHERS = {"yade_scripts", "benchmarks", "tests", "yade"}


def imports(path: Path) -> set[str]:
    """Return the dotted names of the modules that a file imports, inside functions too."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


@pytest.mark.parametrize("package", ORDER)
def test_arrows_run_one_way(package):
    """Find no import upward.

    Estimators know signals, no case; modal nothing of analysis, neither of them a script.
    """
    order = ["__init__", *ORDER[package]]
    for path in (ROOT / package).rglob("*.py"):
        room = path.relative_to(ROOT / package).parts[0].removesuffix(".py")
        assert room in order, f"a new room: put {room} where it stands in this file's order"
        found = [name.split(".") for name in imports(path)]
        outside = {name[0] for name in found} & (OTHERS | {"analysis"} - {package})
        used = {name[1] for name in found if name[0] == package and name[1:]}
        above = [other for other in order[order.index(room) + 1 :] if other in used]
        assert room == "__init__" or not above + [*outside], f"{path}: {above} {outside}"


def modules_of(room: str) -> str:
    """Return the modules of a subpackage of modal, as `import` takes them."""
    paths = sorted((ROOT / "modal" / room).glob("[!_]*.py"))
    return ", ".join(f"modal.{room}.{path.stem}" for path in paths)


INFO = "from modal.__main__ import main; assert main(['info', 'small.network.h5']) == 0"


@pytest.mark.parametrize(
    ("code", "heavy"),
    [
        ("import modal", "numpy h5py scipy numba matplotlib"),
        # A short command needs no compiler and no plots, whose start takes as long as the command.
        (INFO, "numba matplotlib scipy.spatial"),
        # What runs inside YADE.
        (f"import {modules_of('packing')}", "scipy numba matplotlib"),
        (f"import {modules_of('formats')}", "scipy numba matplotlib"),
    ],
    ids=["modal", "info", "packing", "formats"],
)
def test_nothing_heavy_is_loaded(code, heavy, tmp_path):
    """Import modal in a process of its own, which takes some milliseconds."""
    write_network(tmp_path / "small.network.h5", fcc(cells=(2, 2, 20)))
    timed = (
        f"import sys, time; start = time.perf_counter(); {code}\nprint(time.perf_counter() - start)"
    )
    timed += f"\nassert not set({heavy.split()}) & set(sys.modules)"
    variables = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", timed], cwd=tmp_path, env=variables, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert code != "import modal" or float(done.stdout) < 0.3


@pytest.mark.parametrize(
    ("absent", "command", "said"),
    [
        ("matplotlib", "figure gain 2", "matplotlib is absent, which draws; pip install matp"),
        ("matplotlib", "measure none.h5", "none.h5: no such file"),  # which draws nothing
        ("pandas", "study --help", "pandas is absent, which groups the results of a study; pip"),
    ],
)
def test_analysis_without_a_package_is_one_line(absent, command, said, tmp_path):
    (tmp_path / f"{absent}.py").write_text(f"raise ModuleNotFoundError(name='{absent}')")
    command = [sys.executable, "-m", "analysis", *command.split()]
    variables = os.environ | {"PYTHONPATH": f"{tmp_path}:{ROOT}"}
    done = subprocess.run(command, env=variables, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {said}")
    assert done.stderr.count("\n") == 1


def calls_of(tree: ast.AST, *names: str) -> list[ast.Call]:
    """Return the calls of functions or methods of these names."""
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return [call for call in calls if ast.unparse(call.func).split(".")[-1] in names]


def is_word(node: ast.expr | None) -> bool:
    """Return whether an expression is a text without blanks: a name or a number, no sentence."""
    return isinstance(node, ast.Constant) and not re.search(r"\s", str(node.value))


def sentences_of_raises(tree: ast.AST) -> list[int]:
    """Return the lines where a test matches an error of ours by a sentence."""
    lines = []
    for call in calls_of(tree, "raises"):
        error = ast.unparse(call.args[0]) if call.args else ""
        match = next((word.value for word in call.keywords if word.arg == "match"), None)
        if match is not None and not is_word(match) and not hasattr(builtins, error):
            lines.append(call.lineno)
    return lines


def sentences_of_one_line(tree: ast.AST) -> list[int]:
    """Return the lines where a test compares the line of a refusal with a sentence."""
    lines = []
    for call in calls_of(tree, "one_line"):
        has_code = any(word.arg == "code" for word in call.keywords)
        if len(call.args) > 2 and not has_code and not is_word(call.args[2]):
            lines.append(call.lineno)
    return lines


def branches_on_messages(tree: ast.AST) -> list[int]:
    """Return the lines that compare or search the message of an exception."""
    messages = set()
    for handler in ast.walk(tree):
        if isinstance(handler, ast.ExceptHandler) and handler.name:
            messages |= {f"str({handler.name})", f"{handler.name}.args[0]"}
    lines = []
    for node in ast.walk(tree):
        operands: list[ast.expr] = []
        if isinstance(node, ast.Compare):
            operands = [node.left, *node.comparators]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            if node.func.attr in ("startswith", "endswith"):
                operands = [node.func.value]
            elif node.func.attr in ("match", "search", "fullmatch"):
                operands = node.args
        if any(ast.unparse(operand) in messages for operand in operands):
            lines.append(node.lineno)
    return lines


FOREIGN_MESSAGES = {"modal/formats/hdf5.py"}
"""Files that tell errors of another library apart, which have no codes, by its messages."""


@pytest.mark.parametrize("package", ["modal", "analysis", "workflow", "yade_scripts"])
def test_no_branch_depends_on_the_message_of_an_error(package):
    """Find no sentence in a condition: people may improve sentences; programs have codes."""
    for path in (ROOT / package).rglob("*.py"):
        if str(path.relative_to(ROOT)) not in FOREIGN_MESSAGES:
            assert not branches_on_messages(ast.parse(path.read_text())), path


TESTS = sorted(str(path.relative_to(ROOT)) for path in (ROOT / "tests").rglob("test_*.py"))


@pytest.mark.parametrize("name", TESTS)
def test_no_test_depends_on_a_sentence(name):
    """Find codes, names and numbers alone where tests compare errors."""
    tree = ast.parse((ROOT / name).read_text())
    lines = sentences_of_raises(tree) + sentences_of_one_line(tree)
    assert not lines
