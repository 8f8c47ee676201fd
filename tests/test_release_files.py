"""Files of a release say the same: versions, requirements, references, commands."""

import json
import os
import re
import tomllib

import pytest
from places import ROOT

import modal

SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT = SETTINGS["project"]


def read(name):
    """Return the text of a file of the repository."""
    return (ROOT / name).read_text()


@pytest.mark.parametrize(
    ("name", "pattern"),
    [
        ("CITATION.cff", r"^version: (\S+)$"),
        ("CHANGELOG.md", r"^## (\S+)$"),
        (".ci/conda/recipe.yaml", r'^  version: "(\S+)"$'),
        (".zenodo.json", r'^  "version": "(\S+)",$'),
    ],
)
def test_version_is_the_same_everywhere(name, pattern):
    assert re.search(pattern, read(name), re.MULTILINE)[1] == PROJECT["version"]
    assert modal.__version__ == PROJECT["version"]


def test_dates_of_the_release_agree():
    released = re.search(r'^date-released: "(\S+)"$', read("CITATION.cff"), re.MULTILINE)[1]
    assert json.loads(read(".zenodo.json"))["publication_date"] == released


def test_conda_recipe_has_the_bounds_of_the_project():
    recipe = read(".ci/conda/recipe.yaml")
    assert f"- python {PROJECT['requires-python']}\n" in recipe
    (backend,) = SETTINGS["build-system"]["requires"]
    for requirement in [
        backend,
        *PROJECT["dependencies"],
        *PROJECT["optional-dependencies"]["fast"],
    ]:
        name, bound = re.match(r"([\w-]+)(>=[\d.]+)", requirement).groups()
        assert f"- {name} {bound}\n" in recipe
    ((command, function),) = PROJECT["scripts"].items()
    assert f"- {command} = {function}\n" in recipe


def test_every_reference_of_the_paper_is_cited_and_every_citation_is_a_reference():
    cited = set(re.findall(r"@(\w+)", read("paper.md")))
    assert cited == set(re.findall(r"^@\w+\{(\w+),$", read("paper.bib"), re.MULTILINE))
    entries = read("paper.bib").split("\n\n")
    assert all(re.search(r"^  (doi|url) = ", entry, re.MULTILINE) for entry in entries)


def test_paper_has_the_sections_and_the_length_that_its_journal_asks_for():
    text = read("paper.md").split("---\n", 2)[2]
    sections = re.findall(r"^# (.*)$", text, re.MULTILINE)
    assert sections == [
        "Summary",
        "Statement of need",
        "State of the field",
        "Software design",
        "Research impact statement",
        "AI usage disclosure",
        "References",
    ]
    assert 750 <= len(text.split()) <= 1750


def test_documents_name_the_versions_of_python_that_the_classifiers_name():
    classified = set(re.findall(r"Python :: (3\.\d+)", " ".join(PROJECT["classifiers"])))
    _, _, where_it_runs = read("docs/limits.md").partition("\n## Where it runs\n")
    for text in (where_it_runs.partition(". ")[0], read("CHANGELOG.md").rpartition("Linux")[2]):
        assert set(re.findall(r"\b3\.\d+\b", text)) == classified


def test_workflows_call_programs_that_exist():
    text = "".join(path.read_text() for path in (ROOT / ".github/workflows").iterdir())
    programs = re.findall(r"(?:^|\s|bash )(\.ci/\w+|\./\w+\.sh)", text)
    assert {".ci/run", ".ci/release", ".ci/site", ".ci/versions"} <= set(programs)
    assert all(os.access(ROOT / program, os.X_OK) for program in programs)
    tests = re.findall(r"tests/[\w./]+", text)
    assert tests and all((ROOT / path).exists() for path in tests)
