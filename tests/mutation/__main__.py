"""Mutation testing of modal's mathematical core: are small wrong changes noticed by the tests?

    python -m tests.mutation [--count 300] [--seed 1] [--modules waves/propagate ...] [-o FILE]

Draws mutants from the modules of `TESTS`, puts each into a copy of the project and runs the tests
of its module there. Each result is a line of FILE (by default in a temporary folder); the same
command goes on where it was stopped. 300 mutants take about 40 minutes. Survivors that compute the
same as the original are listed, with the reason, in tests/mutation/equivalent.toml.
"""

import argparse
import json
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
from pathlib import Path

from tests.mutation.mutants import Mutant, drawn, mutants_of

ROOT = Path(__file__).resolve().parents[2]
EQUIVALENT = Path(__file__).with_name("equivalent.toml")
TESTS = {
    "system/contacts": "bodies stiffness operator tangent law_waves linear_wave",
    "system/imposed": "bodies statics linear_wave shear_waves plane_source sources moduli",
    "system/root_mass": "bodies operator linear_wave",
    "system/assembly": "stiffness operator tangent counts lowest_modes zero_modes",
    "system/operator": "operator bodies linear_wave density",
    "packing/checks": "consistency bodies",
    "packing/columns": "consistency tiling operator bodies",
    "packing/plausibility": "plausibility",
    "exchange/programs/mercury": "mercury",
    "dem/motion": "dynamics nonlinear",
    "modes/collective": "edges_of_lists collective_modes zero_modes",
    "modes/dense": "lattice_and_modes mode_lists edges_of_lists",
    "modes/search": "edges_of_lists mode_lists highest_modes lowest_modes",
    "modes/counts": "counts edges_of_lists zero_modes lowest_modes edges lattice_and_modes",
    "modes/zero_modes": "zero_modes lowest_modes edges files_and_commands",
    "solvers/arnoldi": "pre_stress damped_waves",
    "solvers/factor": "factor counts lowest_modes",
    "solvers/factorisations/blocks": "factor counts collective_modes lowest_modes",
    "solvers/lanczos": "krylov highest_modes lowest_modes mode_lists edges lattice_and_modes",
    "solvers/spectrum": "spectrum linear_wave density response mode_lists edges",
    "waves/chebyshev": "told_errors linear_wave response spectrum",
    "waves/oscillator": "motions linear_wave told_errors damped_waves",
    "waves/propagate": "spectrum linear_wave response edges",
    "modes/density": "density spectrum edges files_and_commands",
}
"""Test files of a module of modal, the quickest and most likely ones first."""
MEMORY = 8 << 30
"""Bytes that one run of the tests may take: a wrong size must not stop the machine."""
LEFT_BEHIND = (".git", ".venv", "products", "build", "results", "__pycache__", "*.egg-info")


class Workplace:
    """A copy of the project in which one mutant at a time is tested."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "project"
        shutil.copytree(ROOT, self.folder, ignore=shutil.ignore_patterns(*LEFT_BEHIND))
        self.cache = folder / "numba"

    def run(self, module: str, timeout: float) -> tuple[str, str]:
        """Outcome, and the first test that failed."""
        names = [f"test_{name}.py" for name in TESTS[module].split()]
        files = [str(next((self.folder / "tests").rglob(name))) for name in names]
        options = ["-x", "-q", "-p", "no:cacheprovider", "--hypothesis-seed=1"]
        settings = dict.fromkeys(("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
        settings |= {"PYTHONPATH": str(self.folder), "NUMBA_CACHE_DIR": str(self.cache)}
        how = {"cwd": self.folder, "env": os.environ | settings | {"PYTHONDONTWRITEBYTECODE": "1"}}
        how |= {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        command = [sys.executable, "-m", "pytest", *options, *files]
        process = subprocess.Popen(command, start_new_session=True, **how)
        try:
            output, _ = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return "noticed", "timeout"
        failed = re.search(r"^(?:FAILED|ERROR) (?:tests/)?(\S+)", output, re.MULTILINE)
        if process.returncode == 0:
            return "survived", ""
        return "noticed", failed[1] if failed else f"exit status {process.returncode}"

    def judge(self, mutant: Mutant, timeout: float) -> tuple[str, str]:
        """Outcome of the tests with the mutant in place of the module."""
        path = self.folder / mutant.path
        source = path.read_bytes()
        if b"numba" in source:
            # Compiled code is looked up by the time and size of a file: start without any.
            shutil.rmtree(self.cache, ignore_errors=True)
        path.write_bytes(mutant.apply(source))
        try:
            return self.run(module_of(mutant), timeout)
        finally:
            path.write_bytes(source)


def module_of(mutant: Mutant) -> str:
    """The module's name in `TESTS`."""
    return mutant.path.removeprefix("modal/").removesuffix(".py")


def key_of(mutant: Mutant) -> str:
    """The same wherever the line stands in its module."""
    return f"{mutant.path}: {mutant.before} -> {mutant.after}"


def results_of(path: Path) -> dict[str, dict]:
    """What was found so far; a last line that was cut off is left out."""
    lines = path.read_text().splitlines() if path.exists() else []
    rows = [json.loads(line) for line in lines if line.endswith("}")]
    return {row["key"]: row for row in rows}


def report(mutants: list[Mutant], found: dict[str, dict]) -> str:
    """How many of each module were noticed, and those that were not, but for the equivalent."""
    same = {
        f"{row['path']}: {row['before']} -> {row['after']}"
        for row in tomllib.loads(EQUIVALENT.read_text())["mutant"]
    }
    noticed = {key for key, row in found.items() if row["outcome"] == "noticed"}
    lines, survivors = [], []
    for module in (*TESTS, "all"):
        own = [key_of(m) for m in mutants if module in (module_of(m), "all")]
        seen, equal = len(noticed.intersection(own)), len((same - noticed).intersection(own))
        survivors = [key for key in own if key in found and key not in noticed | same]
        total = seen + equal + len(survivors)
        if total:
            lines.append(f"{module}: {seen} of {total} noticed, {equal} equivalent")
    return "\n".join([*lines, *survivors])


def main(arguments: list[str] | None = None) -> int:
    """Test the mutants that have no result yet, then print the report."""
    layout = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        "python -m tests.mutation", None, __doc__, formatter_class=layout
    )
    parser.add_argument("--count", type=int, default=300, help="mutants to draw (300)")
    parser.add_argument("--seed", type=int, default=1, help="of the draw (1)")
    parser.add_argument("--modules", nargs="+", choices=TESTS, default=list(TESTS))
    default = Path(tempfile.gettempdir()) / "granular-mutation.jsonl"
    parser.add_argument("-o", "--output", type=Path, default=default, help=f"results ({default})")
    options = parser.parse_args(arguments)
    pools = [mutants_of(ROOT, f"modal/{module}.py") for module in options.modules]
    mutants = drawn(pools, options.count, options.seed)
    found = results_of(options.output)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    waiting = {key_of(mutant): mutant for mutant in mutants if key_of(mutant) not in found}
    limits: dict[str, float] = {}
    with (
        tempfile.TemporaryDirectory(prefix="mutation-") as folder,
        options.output.open("a") as file,
    ):
        place = Workplace(Path(folder))
        for number, (key, mutant) in enumerate(waiting.items(), 1):
            module = module_of(mutant)
            if module not in limits:
                started = time.monotonic()
                if place.run(module, 600)[0] != "survived":
                    raise SystemExit(f"the tests of {module} fail without any mutant")
                limits[module] = 20 + 3 * (time.monotonic() - started)
            outcome, by = place.judge(mutant, limits[module])
            found[key] = {"key": key, "outcome": outcome, "by": by}
            print(json.dumps(found[key]), file=file, flush=True)
            print(f"{number}/{len(waiting)} {mutant.path}:{mutant.line} {outcome} {by}", flush=True)
    print(report(mutants, found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
