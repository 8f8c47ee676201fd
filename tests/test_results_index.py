"""results/README.md says of every committed result which command made it, and from which commit."""

from __future__ import annotations

import re
import subprocess
from fnmatch import fnmatchcase
from hashlib import sha256
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
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
def entries() -> list[tuple[list[str], str, list[str]]]:
    """Patterns, what made the files, and commits, of each row of the index."""
    found = []
    for line in (RESULTS / "README.md").read_text().splitlines():
        if line.startswith("| `"):
            files, made, commits = line.strip("| ").split(" | ")
            found.append((re.findall("`(.+?)`", files), made, re.findall("`(.+?)`", commits)))
    return found


def test_every_file_is_in_one_row_and_every_row_has_its_files(committed, entries):
    patterns = [pattern for names, _, _ in entries for pattern in names]
    for path in committed:
        matches = [pattern for pattern in patterns if fnmatchcase(path, pattern)]
        assert len(matches) == 1, f"results/{path}: in {len(matches)} rows of results/README.md"
    for pattern in patterns:
        assert any(fnmatchcase(path, pattern) for path in committed), f"{pattern}: no such file"
    assert all(made for _, made, _ in entries)


def test_commits_are_those_that_brought_the_files(committed, entries):
    """Each commit of a row has changed one of its files, and each file has one of them.

    Not necessarily the last: a commit cannot name itself, so the index follows the files.
    """
    if git("rev-parse", "--is-shallow-repository") == ["true"]:
        pytest.skip("a shallow clone: the history is cut")
    changed: dict[str, list[str]] = {}
    for line in git("log", "--format=@%H", "--name-only", "--", "results"):
        if line.startswith("@"):
            commit = line[1:]
        elif line:
            changed.setdefault(line.removeprefix("results/"), []).append(commit)
    for patterns, _, commits in entries:
        paths = [p for p in committed if any(fnmatchcase(p, pattern) for pattern in patterns)]
        assert commits, patterns
        for commit in commits:
            own = [path for path in paths if any(c.startswith(commit) for c in changed[path])]
            assert own, f"{commit} has changed nothing of {patterns}"
        for path in paths:
            known = [c for c in changed[path] for commit in commits if c.startswith(commit)]
            assert known, f"results/{path}: not of {commits}"


def test_nothing_is_committed_twice(committed):
    """No two files are the same byte by byte, and the study's figures are in its page alone."""
    digests: dict[str, str] = {}
    for path in committed:
        digest = sha256((RESULTS / path).read_bytes()).hexdigest()
        assert digest not in digests, f"{path} is {digests.get(digest)}"
        digests[digest] = path
    assert not [path for path in committed if fnmatchcase(path, "study/*.png")]
