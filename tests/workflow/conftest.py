"""Fixtures of the workflow's tests: its modules, and a folder with studies of its own."""

import importlib
from pathlib import Path
from types import ModuleType

import pytest
from places import ROOT
from study_folder import study_folder


@pytest.fixture
def import_module(monkeypatch):
    """Return a function that imports a module of `workflow`, inside the project's folder."""
    pytest.importorskip("snakemake")
    monkeypatch.syspath_prepend(str(ROOT / "workflow"))
    monkeypatch.chdir(ROOT)
    return importlib.import_module


@pytest.fixture
def jobs(import_module) -> ModuleType:
    """Return the module `jobs` of the workflow."""
    return import_module("jobs")


@pytest.fixture
def driver(import_module) -> ModuleType:
    """Return the module of the driver that ./run_cases.sh starts."""
    return import_module("run")


@pytest.fixture(scope="session")
def study(tmp_path_factory) -> Path:
    """Return a copy of the project without products, in which nothing is set up."""
    pytest.importorskip("snakemake")
    folder = study_folder(tmp_path_factory.mktemp("study") / "project")
    (folder / "setup.sh").write_text("#!/bin/sh\n")
    return folder
