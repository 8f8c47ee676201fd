"""setup.sh: what is installed is seen, and what hides this folder is; nothing is downloaded."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from places import ROOT

PYTHON = """#!/bin/sh
# In place of the virtual environment's Python: pip only notes what it is asked for.
[ "$1 $2 $3" = "-m pip --version" ] && exit 0
if [ "$1 $2" = "-m pip" ]; then
    echo "$*" >> calls
    INSTALL
    exit STATUS
fi
export PYTHONPATH="$(cat paths)"
exec EXECUTABLE "$@"
"""


def project(folder: Path, *, paths: str = ".", pip: str = "", status: int = 0) -> Path:
    """Make a folder with setup.sh, a package modal and a .venv in which `paths` are Python's.

    Return it. `pip` is the shell's command in place of an installation, which ends with `status`.
    """
    for name in ("setup.sh", "pyproject.toml"):
        shutil.copy(ROOT / name, folder)
    (folder / ".venv/bin").mkdir(parents=True)
    (folder / "modal").mkdir()
    (folder / "modal/__init__.py").touch()
    shutil.copy(ROOT / "pyproject.toml", folder / ".venv/installed-analysis")
    (folder / "paths").write_text(str(folder / paths))
    python = PYTHON.replace("$(cat paths)", f"$(cat {folder}/paths)")
    python = python.replace("INSTALL", pip).replace("STATUS", str(status))
    (folder / ".venv/bin/python").write_text(python.replace("EXECUTABLE", sys.executable))
    (folder / ".venv/bin/python").chmod(0o755)
    return folder


def set_up(folder: Path, *options: str, **settings: object) -> subprocess.CompletedProcess:
    """Run its setup.sh, without YADE."""
    command = ["./setup.sh", "--without-yade", *options]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, **settings)


def calls(folder: Path) -> list[str]:
    """Words of each call of pip."""
    noted = folder / "calls"
    return noted.read_text().splitlines() if noted.exists() else []


def test_nothing_is_done_where_all_is_there(tmp_path):
    done = set_up(project(tmp_path))
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert calls(tmp_path) == []


def other_copy(folder: Path) -> None:
    """What `pip install .` leaves in site-packages, or a clone that this one was copied from."""
    (folder / "site/modal").mkdir(parents=True)
    (folder / "site/modal/__init__.py").touch()


def leftover(folder: Path) -> None:
    """A folder of caches alone, which Python takes for a package."""
    (folder / "site/modal/__pycache__").mkdir(parents=True)


@pytest.mark.parametrize("hidden_by", [other_copy, leftover])
def test_a_copy_in_the_place_of_this_folder_is_replaced_by_it(hidden_by, tmp_path):
    """By an editable installation; where that does not help, it is an error of one line."""
    good, bad = tmp_path / "good", tmp_path / "bad"
    for folder, pip in ((good, f"echo {good} > {good}/paths"), (bad, "")):
        folder.mkdir()
        hidden_by(project(folder, paths="site", pip=pip))
    assert set_up(good).returncode == 0
    (call,) = calls(good)
    assert call.endswith("-e .[analysis,fast]")
    assert set_up(good).returncode == 0 and len(calls(good)) == 1
    done = set_up(bad)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    # A folder of caches hides no package that Python finds elsewhere, as it may this one.
    assert str(bad / "site/modal" if hidden_by is other_copy else bad) in done.stderr


def test_changed_requirements_are_installed_without_the_fast_packages_if_need_be(tmp_path):
    """A failure of both is of status 2, and nothing is noted as installed."""
    folder = project(tmp_path, status=1)
    with (folder / "pyproject.toml").open("a") as file:
        file.write("# changed\n")
    assert set_up(folder).returncode == 2
    assert [call.rpartition(" ")[2] for call in calls(folder)] == [
        ".[analysis,fast]",
        ".[analysis]",
    ]
    assert set_up(folder).returncode == 2 and len(calls(folder)) == 4


def test_an_extra_that_is_none_is_refused(tmp_path):
    folder = project(tmp_path)
    for words in (["--extra", "tests"], ["--extra"], ["--extra", "requires"]):
        done = set_up(folder, *words)
        assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert calls(folder) == []


def test_a_folder_of_somebody_else_is_told_in_one_line():
    """Who is root here becomes another user for it."""
    with tempfile.TemporaryDirectory() as name:
        folder = project(Path(name))
        (folder / ".venv/installed-analysis").unlink()
        for path in (folder, folder / ".venv"):
            path.chmod(0o555)
        done = set_up(folder, user=None if os.getuid() else 65534)
        assert done.returncode == 2 and done.stderr.count("\n") == 1
        for path in (folder, folder / ".venv"):
            path.chmod(0o755)


@pytest.mark.parametrize(
    ("profile", "extra"),
    [("local", "workflow"), ("slurm", "slurm"), ("generic", "workflow"), ("mine", "slurm")],
)
def test_a_profile_needs_the_packages_of_its_executor(profile, extra, tmp_path):
    """`mine`: a cluster's own copy of the profile for Slurm."""
    shutil.copy(ROOT / "run_cases.sh", tmp_path)
    shutil.copytree(ROOT / "workflow/profiles", tmp_path / "workflow/profiles")
    shutil.copytree(tmp_path / "workflow/profiles/slurm", tmp_path / "workflow/profiles/mine")
    (tmp_path / "setup.sh").write_text('#!/bin/sh\necho "$2" > extra; exit 2\n')
    (tmp_path / "setup.sh").chmod(0o755)
    done = subprocess.run([tmp_path / "run_cases.sh", "--profile", profile])
    assert done.returncode == 2
    assert (tmp_path / "extra").read_text().strip() == extra
