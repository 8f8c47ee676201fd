"""Mutation testing: are small wrong changes noticed by the tests?

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
from collections import Counter
from pathlib import Path

import pytest

from tests.mutation.lists import (
    ROOT,
    TESTS,
    find_test_files,
    module_path,
    read_equivalent_mutants,
)
from tests.mutation.mutants import draw_mutants, read_mutants

MAX_MEMORY_BYTES = 8 << 30
"""Memory that one run of the tests may take: a wrong size must not stop the machine."""
MAX_PROCESSOR_SECONDS = 300
"""Processor time of one run, which does not depend on how busy the machine is."""
MAX_SECONDS = 20 * MAX_PROCESSOR_SECONDS
"""Time of one run, for mutants that wait for ever."""
IGNORED_FILES = (".git", ".venv", "products", "build", "*.egg-info")
"""Files that the copy of the project does not need."""
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
LIBRARIES = ("h5py", "numba", "numpy", "scipy.integrate", "scipy.optimize", "scipy.sparse.linalg")
"""Libraries that are loaded before the forks."""
OPTIONS = ("-x", "-q", "-p", "no:cacheprovider", "--hypothesis-seed=1")
"""Options of pytest."""


class FailureWriter:
    """Plugin of pytest that writes the names of tests, or files, that fail to a file descriptor."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Write the name of a test that failed."""
        if report.failed:
            os.write(self.descriptor, f"{report.nodeid}\n".encode())

    pytest_collectreport = pytest_runtest_logreport


def run_tests(folder: Path, *arguments: str) -> str:
    """Run tests in a copy of the project and return the first that failed; empty if all passed.

    A run that ends otherwise returns its exit status as text.
    """
    reading_end, writing_end = os.pipe()
    child = os.fork()
    if child == 0:
        _run_pytest(folder, arguments, writing_end)
    os.close(writing_end)
    _, status = os.waitpid(child, 0)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    with os.fdopen(reading_end) as names:
        first_failure = names.readline().strip()
    if first_failure or status == 0:
        return first_failure
    return f"exit status {status}"


def _run_pytest(folder: Path, arguments: tuple[str, ...], descriptor: int) -> None:
    """Run pytest in a folder, within limits and without output, and end the process."""
    os.setsid()
    resource.setrlimit(resource.RLIMIT_CPU, (MAX_PROCESSOR_SECONDS, MAX_PROCESSOR_SECONDS))
    resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY_BYTES, MAX_MEMORY_BYTES))
    signal.alarm(MAX_SECONDS)
    for stream in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    os._exit(pytest.main([*OPTIONS, *arguments], [FailureWriter(descriptor)]))


def main(arguments: list[str] | None = None) -> None:
    """Test mutants one by one, and print how many of each module were noticed."""
    parser = argparse.ArgumentParser("python -m tests.mutation", None, __doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--count", type=int, default=300, help="mutants to draw (300)")
    parser.add_argument("--seed", type=int, default=1, help="of the draw (1)")
    parser.add_argument("--modules", nargs="+", choices=TESTS, default=list(TESTS))
    options = parser.parse_args(arguments)
    pools = [read_mutants(ROOT, module_path(module)) for module in options.modules]
    mutants = draw_mutants(pools, options.count, options.seed)
    equivalent = set(map(str, read_equivalent_mutants()))
    sound_tests: set[str] = set()
    outcomes: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory(prefix="mutation-") as parent:
        folder = Path(parent, "project")
        shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(*IGNORED_FILES))
        os.environ |= ONE_THREAD | {"PYTHONPATH": str(folder)}
        for library in LIBRARIES:
            importlib.import_module(library)
        for number, mutant in enumerate(mutants, 1):
            path = folder / mutant.path
            path.write_text(mutant.apply(path.read_text()))
            # Compiled code is cached by the time of its file: each mutant has its own.
            os.utime(path, (number, number))
            failure = run_tests(folder, *map(str, find_test_files(mutant.module, folder)))
            shutil.copy2(ROOT / mutant.path, path)
            if failure.startswith("tests/") and failure not in sound_tests:
                _require_sound(folder, failure)
                sound_tests.add(failure)
            if failure:
                outcome = "noticed"
            elif str(mutant) in equivalent:
                outcome = "equivalent"
            else:
                outcome = "SURVIVED"
            outcomes[mutant.module, outcome] += 1
            print(f"{number}/{len(mutants)} {outcome} {mutant} {failure}", flush=True)
    for (module, outcome), count in sorted(outcomes.items()):
        print(f"{module}: {count} {outcome}")


def _require_sound(folder: Path, failure: str) -> None:
    """End the program if a test, or the collection of a file, fails without any mutant."""
    arguments = [failure]
    if "::" not in failure:
        arguments = ["--collect-only", failure]
    if run_tests(folder, *arguments):
        raise SystemExit(f"{failure} fails without any mutant")


if __name__ == "__main__":
    main()
