"""The rooms of modal and of analysis: each stands on those before it."""

import ast
from pathlib import Path

import pytest
from places import ROOT

ORDER = {
    "modal": (
        *("tools", "formats", "solvers", "packing", "system", "dem", "waves", "modes"),
        *("elasticity", "preparation", "theory", "exchange", "description", "cli", "__main__"),
    ),
    "analysis": (
        *("table", "watch", "estimators", "agreement", "case"),
        *("value", "measuring", "prepare", "quantities", "measurement"),
        *("rows", "frame", "crystal", "figures", "study"),
        *("cli", "__main__"),
    ),
}
"""Rooms and modules from the ground up: each imports from those before it alone."""
OTHERS = {"yade_scripts", "benchmarks", "tests", "yade"}


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


@pytest.mark.parametrize("package", ORDER)
def test_arrows_run_one_way(package):
    """Estimators know signals, no case; modal nothing of analysis, neither of them a script."""
    order = ["__init__", *ORDER[package]]
    for path in (ROOT / package).rglob("*.py"):
        room = path.relative_to(ROOT / package).parts[0].removesuffix(".py")
        assert room in order, f"a new room: put {room} where it stands in this file's order"
        found = [name.split(".") for name in imports(path)]
        outside = {name[0] for name in found} & (OTHERS | {"analysis"} - {package})
        used = {name[1] for name in found if name[0] == package and name[1:]}
        above = [other for other in order[order.index(room) + 1 :] if other in used]
        assert room == "__init__" or not above + [*outside], f"{path}: {above} {outside}"
