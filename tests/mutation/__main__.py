"""Mutation testing of modal's mathematical core: are small wrong changes noticed by the tests?

    python -m tests.mutation [--count 300] [--seed 1] [--modules waves/propagate ...]

Draws mutants from the modules of `TESTS`, puts each into a copy of the project, runs the tests of
its module there and prints the first that failed. 300 mutants take about 40 minutes. Survivors that
compute the same as the original are listed, with the reason, in tests/mutation/equivalent.toml.
"""

import argparse
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter
from pathlib import Path

from tests.mutation.mutants import drawn, mutants_of

ROOT = Path(__file__).resolve().parents[2]
EQUIVALENT = Path(__file__).with_name("equivalent.toml")
TESTS = tomllib.loads(Path(__file__).with_name("tests.toml").read_text())
"""Test files of a module of modal, the quickest and most likely ones first."""
MEMORY = 8 << 30
"""Bytes that one run of the tests may take: a wrong size must not stop the machine."""
LEFT_BEHIND = (".git", ".venv", "products", "build", "results", "__pycache__", "*.egg-info")


def tested(folder: Path, module: str, timeout: float) -> str:
    """The first test that failed on the module in a copy of the project; none if all passed."""
    names = [f"test_{name}.py" for name in TESTS[module].split()]
    files = [str(next((folder / "tests").rglob(name))) for name in names]
    settings = dict.fromkeys(("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    # Compiled code is looked up by the time and size of a file: each mutant starts without any.
    shutil.rmtree(cache := folder / ".numba", ignore_errors=True)
    settings |= {"PYTHONPATH": str(folder), "NUMBA_CACHE_DIR": str(cache)}
    options = ["-x", "-q", "-p", "no:cacheprovider", "--hypothesis-seed=1"]
    process = subprocess.Popen(
        [sys.executable, "-m", "pytest", *options, *files],
        cwd=folder,
        env=os.environ | settings | {"PYTHONDONTWRITEBYTECODE": "1"},
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        output, _ = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return "timeout"
    failed = re.search(r"^(?:FAILED|ERROR) (?:tests/)?(\S+)", output, re.MULTILINE)
    status = f"exit status {process.returncode}" * bool(process.returncode)
    return failed[1] if failed else status


def main(arguments: list[str] | None = None) -> int:
    """Test the mutants one by one; how many of each module were noticed stands at the end."""
    layout = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        "python -m tests.mutation", None, __doc__, formatter_class=layout
    )
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
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    limits, told = dict[str, float](), Counter[tuple[str, str]]()
    with tempfile.TemporaryDirectory(prefix="mutation-") as parent:
        folder = Path(parent, "project")
        shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(*LEFT_BEHIND))
        for number, mutant in enumerate(mutants, 1):
            module = mutant.module
            if module not in limits:
                started = time.monotonic()
                if failed := tested(folder, module, 600):
                    raise SystemExit(f"the tests of {module} fail without any mutant: {failed}")
                limits[module] = 20 + 3 * (time.monotonic() - started)
            path = folder / mutant.path
            source = path.read_text()
            path.write_text(mutant.apply(source))
            by = tested(folder, module, limits[module])
            path.write_text(source)
            outcome = "noticed" if by else "equivalent" if str(mutant) in same else "SURVIVED"
            told[module, outcome] += 1
            print(f"{number}/{len(mutants)} {outcome} {mutant} {by}", flush=True)
    for (module, outcome), count in sorted(told.items()):
        print(f"{module}: {count} {outcome}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
