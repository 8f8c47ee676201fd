"""results/README.md says of every committed result which command made it."""

import re
import subprocess
from fnmatch import fnmatchcase

import pytest
from places import ROOT

RESULTS = ROOT / "results"


def git(*arguments: str) -> list[str]:
    """Lines that git prints; the test is skipped where there is no history to ask."""
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        pytest.skip("not a clone: nothing says which files are committed")
    return done.stdout.splitlines()


@pytest.fixture(scope="module")
def committed() -> list[str]:
    """Paths from results/ of the committed files, the index itself left out."""
    paths = (path.removeprefix("results/") for path in git("ls-files", "results"))
    return [path for path in paths if path != "README.md" and (RESULTS / path).exists()]


@pytest.fixture(scope="module")
def entries() -> list[tuple[list[str], str]]:
    """Patterns, and what made the files, of each row of the index."""
    found = []
    for line in (RESULTS / "README.md").read_text().splitlines():
        if line.startswith("| `"):
            files, made = line.strip("| ").split(" | ")
            found.append((re.findall("`(.+?)`", files), made))
    return found


def test_every_file_is_in_one_row_and_every_row_has_its_files(committed, entries):
    patterns = [pattern for names, _ in entries for pattern in names]
    for path in committed:
        matches = [pattern for pattern in patterns if fnmatchcase(path, pattern)]
        assert len(matches) == 1, f"results/{path}: in {len(matches)} rows of results/README.md"
    for pattern in patterns:
        assert any(fnmatchcase(path, pattern) for path in committed), f"{pattern}: no such file"
    assert all(made for _, made in entries)
