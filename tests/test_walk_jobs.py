"""Jobs of YADE: what it has not made is not given out."""

import subprocess

import pytest
from places import ROOT


@pytest.mark.parametrize(
    "says, there, status",
    [
        ("error: it belongs to another study", True, 1),
        ("killed", False, 1),
        ("written", True, 0),
    ],
)
def test_a_job_of_yade_fails_with_its_script(says, there, status, tmp_path):
    """yade-batch itself returns 0 whatever comes of its job; a product may be there from before."""
    for name, text in (("yade-batch", says), ("yade", "2023.02a")):
        (tmp_path / name).write_text(f"#!/bin/sh\necho '{text}'\n")
        (tmp_path / name).chmod(0o755)
    product = tmp_path / "100000Pa.sample.h5"
    if there:
        product.touch()
    table = tmp_path / "own.table"
    table.write_text("mu_comp spheres width seed\n0.4 120 4.2 1\n")
    job = [ROOT / "workflow/yade_job.sh", table, "0.4"]
    job += ["yade_scripts/compress.py", tmp_path, tmp_path / "walk.log", product]
    done = subprocess.run(
        [str(word) for word in job],
        env={"YADE": str(tmp_path / "yade"), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == status, (tmp_path / "walk.log").read_text()
    assert says in (tmp_path / "walk.log").read_text()


@pytest.mark.parametrize(
    ("raised", "status", "first"),
    [
        ("InputError('no such sample; make it')", 2, "error: no such sample; make it"),
        ("ValueError('operands could not be broadcast')", 1, "Traceback (most recent call last):"),
    ],
)
def test_what_a_script_itself_gets_wrong_is_no_mistake_of_its_user(
    raised, status, first, yade, tmp_path
):
    """One line and 2 for what the user can mend; the place and 1 for a fault of the script."""
    script = tmp_path / "script.py"
    script.write_text(
        f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n"
        "from modal.formats.hdf5 import InputError\nfrom yade_scripts.scene import finish\n\n"
        f"def main():\n    raise {raised}\n\nfinish(main)\n"
    )
    command = ["yade", "-n", "-x", "-j1", str(script)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == status and first in done.stderr.splitlines(), done.stderr
