"""results/README.md says of every committed result which command made it."""

import re
import subprocess
from fnmatch import fnmatchcase

import pytest
from places import ROOT

RESULTS = ROOT / "results"


def test_every_file_is_in_one_row_and_every_row_has_its_files():
    done = subprocess.run(["git", "ls-files"], cwd=RESULTS, capture_output=True, text=True)
    if done.returncode:
        pytest.skip("not a clone: nothing says which files are committed")
    committed = [path for path in done.stdout.splitlines() if (RESULTS / path).exists()]
    rows = re.findall(r"^\| (`.*?) \| (.*?) \|$", (RESULTS / "README.md").read_text(), re.MULTILINE)
    patterns = [pattern for files, _ in rows for pattern in re.findall("`(.+?)`", files)]
    for path in set(committed) - {"README.md"}:
        matches = [pattern for pattern in patterns if fnmatchcase(path, pattern)]
        assert len(matches) == 1, f"results/{path}: in {len(matches)} rows of results/README.md"
    for pattern in patterns:
        assert any(fnmatchcase(path, pattern) for path in committed), f"{pattern}: no such file"
    assert all(made for _, made in rows)
