"""Lists of the mutation tests: test files of each module, and equivalent mutants.

    python -m tests.mutation.lists

prints the entries that point to no file or to no mutant of the present sources.
"""

import ast
import sys
import tomllib
from functools import cache
from pathlib import Path
from typing import NamedTuple

from tests.mutation.mutants import find_mutants

ROOT = Path(__file__).resolve().parents[2]
TESTS: dict[str, str] = tomllib.loads(Path(__file__).with_name("tests.toml").read_text())
"""Test files of a module, the quickest and most likely ones first."""
OTHER_PACKAGES = ("analysis/", "workflow/")
"""How the names of modules begin that are not of modal."""


class EquivalentMutant(NamedTuple):
    """A mutant that computes the same as the original, with the reason.

    `before` and `after` are the first line of the changed statement, as `ast.unparse` prints it.
    """

    path: str
    before: str
    after: str
    reason: str

    def __str__(self) -> str:
        return f"{self.path}: {self.before} -> {self.after}"


def read_equivalent_mutants() -> list[EquivalentMutant]:
    """Read the list of equivalent mutants."""
    text = Path(__file__).with_name("equivalent.toml").read_text()
    return [EquivalentMutant(**row) for row in tomllib.loads(text)["mutant"]]


def module_path(module: str) -> str:
    """Return the path of a module, by its name in the list of tests."""
    if module.startswith(OTHER_PACKAGES):
        return f"{module}.py"
    return f"modal/{module}.py"


def find_test_files(module: str, folder: Path = ROOT) -> list[Path]:
    """Return the test files of a module in a copy of the project.

    Raises FileNotFoundError for a name without a file.
    """
    files = []
    for name in TESTS[module].split():
        matches = sorted((folder / "tests").rglob(f"test_{name}.py"))
        if not matches:
            raise FileNotFoundError(f"{module}: no tests/**/test_{name}.py")
        files.append(matches[0])
    return files


@cache
def mutants_of_file(path: str) -> frozenset[str]:
    """Return all mutants of a file of the project, as text."""
    tree = ast.parse((ROOT / path).read_text())
    return frozenset(map(str, find_mutants(tree, path)))


def find_stale_modules() -> list[str]:
    """Return a line for each module or test file of the list of tests that does not exist."""
    stale = []
    for module in TESTS:
        if not (ROOT / module_path(module)).exists():
            stale.append(f"{module}: no {module_path(module)}")
        try:
            find_test_files(module)
        except FileNotFoundError as error:
            stale.append(str(error))
    return stale


def find_stale_mutants() -> list[EquivalentMutant]:
    """Return the equivalent mutants whose file, statement or change does not exist."""
    stale = []
    for mutant in read_equivalent_mutants():
        if not (ROOT / mutant.path).exists() or str(mutant) not in mutants_of_file(mutant.path):
            stale.append(mutant)
    return stale


def main() -> int:
    """Print stale entries; return 1 if there are any, else 0."""
    stale = [*find_stale_modules(), *map(str, find_stale_mutants())]
    for line in stale:
        print(line)
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
