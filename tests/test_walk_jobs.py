"""Jobs of the study's walks: what YADE has not made, or made of another study, is not given out."""

import subprocess
import sys
from dataclasses import replace

import pytest
from places import ROOT

from modal.packing.sample import write_sample
from modal.preparation.random_packing import random_sample

OWN = ["mu_comp=0.4", "spheres=120", "width=4.2", "seed=1", "sizes=lognormal 0.2", "densities=7800"]


@pytest.fixture
def walked(tmp_path):
    """A walk's folder with one state."""
    study = {"mu_comp": 0.4, "spheres": 120, "width": 4.2, "seed": 1, "stress": 1e5}
    study |= {"sizes": "lognormal 0.2", "densities": "7800"}
    sample = replace(random_sample(120, 1e5, aspect=2.0), study=study)
    folder = tmp_path / "walks/compression_mu0.4"
    folder.mkdir(parents=True)
    write_sample(folder / "100000Pa.sample.h5", sample)
    return folder


def link(folder, *numbers):
    """What link_states.py says, its status, and the file that it makes."""
    output = folder.parents[1] / "100000Pa.sample.h5"
    script = ROOT / "workflow/link_states.py"
    command = [sys.executable, str(script), str(folder), *numbers, str(output)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    return done.stderr, done.returncode, output


def test_states_of_the_study_are_linked(walked, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    said, status, output = link(walked, *OWN)
    assert (said, status) == ("", 0) and output.samefile(walked / output.name)


@pytest.mark.parametrize(
    "other", ["seed=2", "width=4.3", "spheres=121", "mu_comp=0.3", "sizes=two 2 0.5"]
)
def test_states_of_another_study_are_refused(other, walked, monkeypatch):
    """As they are left over where the study was changed."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    name = other.split("=")[0]
    said, status, output = link(walked, *(w for w in OWN if not w.startswith(name)), other)
    assert status == 1 and len(said.splitlines()) == 1 and f"made with {name}" in said
    assert not output.exists()


@pytest.mark.parametrize(
    "says, there, status",
    [
        ("error: it belongs to another study", True, 1),
        ("killed", False, 1),
        ("written", True, 0),
    ],
)
def test_a_job_of_yade_fails_with_its_script(says, there, status, walked, tmp_path):
    """yade-batch itself returns 0 whatever comes of its job; a product may be there from before."""
    batch = tmp_path / "yade-batch"
    batch.write_text(f"#!/bin/sh\necho '{says}'\n")
    batch.chmod(0o755)
    (tmp_path / "yade").write_text("#!/bin/sh\necho 2023.02a\n")
    (tmp_path / "yade").chmod(0o755)
    product = walked / ("100000Pa.sample.h5" if there else "1e+06Pa.sample.h5")
    table = tmp_path / "own.table"
    table.write_text("mu_comp spheres width seed\n0.4 120 4.2 1\n")
    job = [ROOT / "workflow/yade_job.sh", table, "0.4"]
    job += ["yade_scripts/compress.py", walked.parent, tmp_path / "walk.log", product]
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
