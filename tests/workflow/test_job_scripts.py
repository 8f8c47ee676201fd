"""Scripts around jobs: yade_job.sh, the end of a script in YADE, the line for PBS."""

import re
import subprocess

import pytest
from in_yade import forked
from places import ROOT


@pytest.mark.parametrize(
    ("version", "output", "has_product", "status", "line"),
    [
        ("2023.02a", "error: it belongs to another study", True, 1, "error: it belongs"),
        ("2023.02a", "killed", False, 1, "killed"),
        ("2023.02a", "Traceback\nstatus  : 256 (FAILED)", True, 1, "no product"),
        ("2023.02a", "killed before its summary", True, 1, "no product"),
        ("2023.02a", "status  : 0 (OK)", False, 1, "no product"),
        ("2023.02a", "written\nstatus  : 0 (OK)", True, 0, "written"),
        ("2025.2.0", "written\nstatus  : 0 (OK)", True, 0, "written"),
        ("2025.2.0", "killed", False, 1, "killed"),
        ("2023.02", "killed", False, 1, "killed"),
        ("2018.02b", "", False, 2, "YADE 2018.02b"),
        ("2025.20", "", False, 2, "YADE 2025.20"),
        ("2023.021", "", False, 2, "YADE 2023.021"),
        ("of today", "", False, 2, "YADE of no known version"),
        ("", "", False, 2, "yade-batch is not in PATH"),
    ],
)
def test_job_of_yade_fails_with_its_script(version, output, has_product, status, line, tmp_path):
    """Fail with the script, although yade-batch itself always returns 0.

    A product may be there from an earlier run.
    """
    programs = {"yade-batch": output, "yade": f"YADE {version}"} if version else {}
    for name, text in programs.items():
        (tmp_path / name).write_text(f"#!/bin/sh\necho '{text}'\n")
        (tmp_path / name).chmod(0o755)
    product = tmp_path / "100000Pa.sample.h5"
    if has_product:
        product.touch()
    table = tmp_path / "own.table"
    table.write_text("mu_comp spheres width seed\n0.4 120 4.2 1\n")
    job = [ROOT / "workflow/yade_job.sh", table, "0.4", "yade_scripts/compress.py"]
    job += [tmp_path, tmp_path / "walk.log", product]
    done = subprocess.run(
        [str(word) for word in job],
        env={"YADE": str(tmp_path / "yade"), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
    )
    log = (tmp_path / "walk.log").read_text()
    assert done.returncode == status, log
    assert line in log


@pytest.fixture
def run_script(yade, tmp_path):
    """Return a function that runs a script in YADE whose main function raises an error."""

    def run(error: str) -> tuple[int, list[str]]:
        script = tmp_path / "script.py"
        script.write_text(
            f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n"
            "from modal.formats.hdf5 import InputError\nfrom yade_scripts.scene import finish\n\n"
            f"def main():\n    raise {error}\n\nfinish(main)\n"
        )
        status, log = forked(tmp_path, [script], {})
        return status, log.splitlines()

    return run


def test_mistake_of_the_user_ends_a_script_with_one_line(run_script):
    status, log = run_script("InputError('no_file', 'no such sample', remedy='make it')")
    assert status == 2
    assert "error: no such sample; make it" in log


def test_fault_of_a_script_ends_it_with_a_traceback(run_script):
    status, log = run_script("ValueError('operands could not be broadcast')")
    assert status == 1
    assert "Traceback (most recent call last):" in log


@pytest.mark.parametrize("minutes", [1, 30, 90, 1441])
def test_job_of_pbs_gets_its_minutes(minutes):
    """Evaluate the line for PBS in the profile of other clusters, as its users copy it."""
    profile = (ROOT / "workflow/profiles/generic/config.yaml").read_text()
    expression = re.search(r"walltime=(.+) -j oe", profile)[1]
    expression = expression.replace("{resources.runtime}", str(minutes))
    done = subprocess.run(["bash", "-c", f"echo {expression}"], capture_output=True, text=True)
    hours, minute, second = map(int, done.stdout.split(":"))
    assert 3600 * hours + 60 * minute + second == 60 * minutes
