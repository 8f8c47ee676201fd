"""Mutation testing of modal's mathematical core: are small wrong changes noticed by the tests?

    python -m tests.mutation [--count 300] [--seed 1] [--modules waves/propagate ...]

Draws mutants from the modules of `TESTS`, puts each into a copy of the project, runs the tests of
its module there and prints the first that failed, which must pass without the mutant. The runs are
forks of a program that has loaded the libraries. Survivors that compute the same as the original
are listed, with the reason, in tests/mutation/equivalent.toml.
"""

import argparse
import contextlib
import importlib
import os
import resource
import shutil
import signal
import sys
import tempfile
import tomllib
from collections import Counter
from pathlib import Path

import pytest

from tests.mutation.mutants import drawn, mutants_of

ROOT = Path(__file__).resolve().parents[2]
EQUIVALENT = Path(__file__).with_name("equivalent.toml")
TESTS = tomllib.loads(Path(__file__).with_name("tests.toml").read_text())
"""Test files of a module of modal, the quickest and most likely ones first."""
MEMORY = 8 << 30
"""Bytes that one run of the tests may take: a wrong size must not stop the machine."""
TIME = 300
"""Seconds of the processor, which pass as slowly as the tests where the machine is busy."""
LEFT_BEHIND = (".git", ".venv", "products", "build", "*.egg-info")
THREADS = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
LIBRARIES = ("h5py", "numba", "numpy", "scipy.integrate", "scipy.optimize", "scipy.sparse.linalg")
OPTIONS = ("-x", "-q", "-p", "no:cacheprovider", "--hypothesis-seed=1")


class Failures:
    """Plugin of pytest that writes the names of tests, or files, that fail."""

    def __init__(self, at: int) -> None:
        self.at = at

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Of a test."""
        if report.failed:
            os.write(self.at, f"{report.nodeid}\n".encode())

    pytest_collectreport = pytest_runtest_logreport


def tested(folder: Path, *tests: str) -> str:
    """The first test that failed in a copy of the project; none if all passed."""
    reading, writing = os.pipe()
    if not (child := os.fork()):
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (TIME, TIME))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        signal.alarm(20 * TIME)
        for stream in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
        os.chdir(folder)
        sys.path.insert(0, str(folder))
        os._exit(pytest.main([*OPTIONS, *tests], [Failures(writing)]))
    os.close(writing)
    _, status = os.waitpid(child, 0)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    with os.fdopen(reading) as said:
        return said.readline().strip() or f"exit status {status}" * bool(status)


def main(arguments: list[str] | None = None) -> None:
    """Test the mutants one by one; how many of each module were noticed stands at the end."""
    parser = argparse.ArgumentParser("python -m tests.mutation", None, __doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--count", type=int, default=300, help="mutants to draw (300)")
    parser.add_argument("--seed", type=int, default=1, help="of the draw (1)")
    parser.add_argument("--modules", nargs="+", choices=TESTS, default=list(TESTS))
    options = parser.parse_args(arguments)
    pools = [mutants_of(ROOT, f"modal/{module}.py") for module in options.modules]
    mutants = drawn(pools, options.count, options.seed)
    same = {
        f"{row['path']}: {row['before']} -> {row['after']}"
        for row in tomllib.loads(EQUIVALENT.read_text())["mutant"]
    }
    sound, told = set[str](), Counter[tuple[str, str]]()
    with tempfile.TemporaryDirectory(prefix="mutation-") as parent:
        folder = Path(parent, "project")
        shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(*LEFT_BEHIND))
        os.environ |= THREADS | {"PYTHONPATH": str(folder)}
        for library in LIBRARIES:
            importlib.import_module(library)
        for number, mutant in enumerate(mutants, 1):
            path = folder / mutant.path
            # Compiled code is kept, and known by its file's time: each mutant has its own.
            path.write_text(mutant.apply(path.read_text()))
            os.utime(path, (number, number))
            files = [f"test_{name}.py" for name in TESTS[mutant.module].split()]
            by = tested(folder, *(str(next((folder / "tests").rglob(name))) for name in files))
            shutil.copy2(ROOT / mutant.path, path)
            if by.startswith("tests/") and by not in sound:
                if tested(folder, *["--collect-only"] * ("::" not in by), by):
                    raise SystemExit(f"{by} fails without any mutant")
                sound.add(by)
            outcome = "noticed" if by else "equivalent" if str(mutant) in same else "SURVIVED"
            told[mutant.module, outcome] += 1
            print(f"{number}/{len(mutants)} {outcome} {mutant} {by}", flush=True)
    for (module, outcome), count in sorted(told.items()):
        print(f"{module}: {count} {outcome}")


if __name__ == "__main__":
    main()
