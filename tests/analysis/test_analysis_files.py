"""Reports of packings that are no cases of the study: named by their files, joined by digest."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from exact_crystal import coarse_gain
from oracles import stepped
from packings import frictionless, slender
from refusals import refusal

from analysis.__main__ import main
from analysis.case import Case, cases_of_files
from analysis.case_measurement import measure_result
from analysis.estimators.layer_lattice import LayerLattice, lattice_signals
from analysis.figures.picture import Panel, Picture, write_picture
from analysis.figures.render import to_figure, write_png
from analysis.packing_data import PackingData
from analysis.table import Table
from modal.__main__ import main as modal_main
from modal.formats.hdf5 import atomic_h5
from modal.formats.provenance import Provenance, packing_of
from modal.packing.crystal import fcc
from modal.packing.network import write_network
from modal.packing.sample import sample_of_network, write_sample
from modal.waves.motions import Pulse
from modal.waves.response import write_response
from modal.waves.signals import write_signals

STRESS = 2.5e5
"""Stress of the crystal, Pa; no case of the study has it."""
CRYSTAL = fcc(STRESS, (1, 1, 120))
LATTICE = LayerLattice.of_network(CRYSTAL)
MODES = {
    "quartz_all.h5": ["quartz.network.h5", "--all"],
    "low.h5": ["heap.h5", "--lowest", "40"],
    "top.h5": ["heap.h5", "--highest", "1"],
    "band.h5": ["heap.h5", "--between", "40000", "50000"],
}
"""Files of modes, with the packing and the options of the command that makes each."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Return a crystal of 120 layers and 200 random spheres, each with its waves and modes."""
    folder = tmp_path_factory.mktemp("own")
    write_network(folder / "quartz.network.h5", CRYSTAL)
    write_response(folder / "gain.h5", coarse_gain(CRYSTAL))
    record = lattice_signals(LATTICE, np.arange(0, CRYSTAL.length / LATTICE.velocity, 2e-7))
    provenance = Provenance(sources=packing_of(folder / "quartz.network.h5"))
    write_signals(folder / "run7.h5", record, provenance)
    packing = replace(slender(), study={})
    write_network(folder / "heap.h5", packing)
    run = stepped(packing, 1e-4, 2e-7, motion=Pulse(2.5e-9), every=2, particles=True)
    provenance = Provenance(sources=packing_of(folder / "heap.h5"))
    write_signals(folder / "heap.signals.h5", replace(run, producer="other DEM"), provenance)
    for name, (source, *options) in MODES.items():
        command = ["modes", str(folder / source), *options, "-o", str(folder / name)]
        assert modal_main(command) == 0
    return folder


def cases_in(folder: Path, *names: str) -> list[Case]:
    """Return the cases of some files of the folder."""
    return cases_of_files([folder / name for name in names])


@pytest.fixture(scope="module")
def result_of_crystal(folder):
    """Return the numbers of the crystal."""
    (case,) = cases_in(folder, "quartz.network.h5", "run7.h5", "quartz_all.h5", "gain.h5")
    return measure_result(PackingData.of(case))


def test_crystal_that_is_no_case_is_named_by_its_stress_and_file(result_of_crystal):
    assert result_of_crystal.label == "FCC, 250 kPa (quartz)"
    assert result_of_crystal.number is None


@pytest.mark.parametrize("name", ["v_p_long_waves_yade_m_per_s", "v_p_modes_fitted_m_per_s"])
def test_velocity_of_a_crystal_that_is_no_case_is_that_of_its_stress(name, result_of_crystal):
    """Compare within the bias of the damped transform, 1e-5, and of the modes, 1e-6."""
    assert result_of_crystal.value(name) == pytest.approx(LATTICE.velocity, rel=1e-3)


def test_band_edge_of_a_crystal_that_is_no_case_is_that_of_its_stress(result_of_crystal):
    edge = result_of_crystal.value("band_edge_yade_khz")
    assert edge == pytest.approx(LATTICE.low_pass_frequency / 1e3, rel=1e-3)


def test_random_packing_that_is_no_case_has_the_numbers_of_its_files(folder):
    """Take the stress, which no file states, from the contacts, and f_max from the modes."""
    (case,) = cases_in(folder, "heap.h5", "heap.signals.h5", "low.h5", "top.h5")
    result = measure_result(PackingData.of(case))
    assert result.label == "random, 100 kPa (heap)"
    assert result.record == "yade"
    assert result.values["f_max"].value == case.read("highest.modes").frequency[-1]


def test_files_of_two_packings_go_to_their_own(folder):
    heap, quartz = cases_in(
        folder,
        *("low.h5", "run7.h5", "heap.h5", "quartz_all.h5"),
        *("quartz.network.h5", "heap.signals.h5"),
    )
    assert heap.name == "heap"
    assert {kind: path.name for kind, path in heap.files.items()} == {
        "network": "heap.h5",
        "modes": "low.h5",
        "signals": "heap.signals.h5",
    }
    assert quartz.name == "quartz"
    assert {kind: path.name for kind, path in quartz.files.items()} == {
        "network": "quartz.network.h5",
        "modes": "quartz_all.h5",
        "signals": "run7.h5",
    }


@pytest.fixture
def sample(tmp_path) -> Path:
    """Write a sample of another packing."""
    path = tmp_path / "grains.sample.h5"
    write_sample(path, sample_of_network(frictionless(), 0.1))
    return path


def test_sample_alone_is_a_packing(sample):
    (case,) = cases_of_files([sample])
    packing = PackingData.of(case)
    assert case.name == "grains"
    assert packing.network.n_particles == 150
    assert not packing.crystal


def test_sample_and_a_network_that_is_not_its_own_are_two_packings(sample, folder):
    assert [case.name for case in cases_of_files([sample, folder / "heap.h5"])] == [
        "heap",
        "grains",
    ]


def test_stress_that_is_not_stated_is_the_one_that_contacts_bear(folder):
    """Measure the stress of a packing made at 100 kPa, which its file does not say."""
    (case,) = cases_in(folder, "heap.h5")
    packing = PackingData.of(case)
    assert "stress" not in packing.network.study
    assert packing.stress == 1e5
    assert packing.label.startswith("random, 100 kPa")


def test_stress_is_unknown_without_forces(tmp_path):
    bare = replace(slender(), study={}, force_normal=None, force_tangential=None)
    write_network(tmp_path / "bare.network.h5", bare)
    (case,) = cases_of_files([tmp_path / "bare.network.h5"])
    packing = PackingData.of(case)
    assert np.isnan(packing.stress)
    assert packing.label == "random (bare)"


def test_files_beside_a_packing_under_its_name_are_read(folder):
    (case,) = cases_in(folder, "heap.h5", "low.h5")
    assert {path.name for path in case.files.values()} >= {"heap.signals.h5", "low.h5"}


@pytest.fixture(scope="module")
def heap(folder, tmp_path_factory) -> Path:
    """Return the packing in a folder of its own, beside modes and waves, one of another packing."""
    folder_of_heap = tmp_path_factory.mktemp("heap")
    names = {
        "heap.h5": "heap.network.h5",
        "low.h5": "heap.modes.h5",
        "run7.h5": "heap.signals.h5",  # of the crystal
        "heap.signals.h5": "heap.100kHz.signals.h5",
    }
    for name, target in names.items():
        shutil.copy(folder / name, folder_of_heap / target)
    return folder_of_heap / "heap.network.h5"


def test_file_of_another_packing_under_its_name_is_left_out(heap):
    (case,) = cases_of_files([heap])
    assert list(case.files) == ["network", "100kHz.signals", "modes"]


def test_kept_spectrum_beside_a_packing_is_drawn(heap, capsys):
    folder = heap.parent
    command = ["measure", str(heap), "--quantities", "ioffe_regel", "--keep", str(folder)]
    assert main(command) in (0, 3)
    assert "diameters wide" in capsys.readouterr().err
    assert main(["figure", "scattering", str(heap), "-o", str(folder / "out")]) == 0
    (case,) = cases_of_files([heap])
    assert "structure" in case.files


def test_further_modes_do_not_replace_those_beside_the_packing(heap, folder):
    (case,) = cases_of_files([heap, folder / "band.h5", folder / "top.h5"])
    assert case.files["modes"].name == "heap.modes.h5"
    assert {"band.modes", "highest.modes"} <= set(case.files)


def test_linear_wave_is_no_record(folder, tmp_path):
    """Keep the wave of the same springs out of the columns of the DEM run."""
    wave = tmp_path / "w.h5"
    command = ["wave", str(folder / "heap.h5"), "--duration", "1e-4", "-o", str(wave)]
    assert modal_main(command) == 0
    (case,) = cases_of_files([folder / "heap.h5", wave])
    assert PackingData.of(case).yade is None
    assert any("linear wave" in note for note in case.notes)


def test_record_of_another_program_beside_the_packing_is_one(folder):
    (case,) = cases_in(folder, "heap.h5")
    assert PackingData.of(case).yade.producer == "other DEM"


@pytest.fixture(scope="module")
def odd_files(tmp_path_factory) -> Path:
    """Return a folder with a file of an unknown format, and a record of no packing."""
    folder = tmp_path_factory.mktemp("odd")
    with atomic_h5(folder / "odd.h5") as file:
        file.attrs["schema"] = "something-else"
    write_signals(folder / "stray.h5", lattice_signals(LATTICE, np.arange(0, 2e-5, 2e-7)))
    return folder


@pytest.mark.parametrize(
    ("names", "odd_name", "code"),
    [
        (["heap.h5", "run7.h5"], None, "other_packing"),
        (["run7.h5"], None, "no_packing"),
        (["heap.h5"], "odd.h5", "unknown_schema"),
        (["heap.h5", "quartz.network.h5"], "stray.h5", "unknown_packing"),
        (["heap.h5", "absent.h5"], None, "no_file"),
    ],
)
def test_file_that_does_not_belong_is_refused(
    names, odd_name, code, folder, odd_files, tmp_path, one_line
):
    paths = [folder / name for name in names]
    if odd_name is not None:
        paths.append(odd_files / odd_name)
    one_line(main, ["figure", "signals", *paths, "-o", tmp_path], code=code)


def test_file_that_is_listed_twice_counts_once(folder):
    assert len(cases_in(folder, "heap.h5", "low.h5", "low.h5")) == 1


def test_two_files_of_a_kind_are_refused(folder, tmp_path):
    shutil.copy(folder / "low.h5", tmp_path / "again.h5")
    with refusal("two_of_a_kind"):
        cases_of_files([folder / "heap.h5", folder / "low.h5", tmp_path / "again.h5"])


PICTURE = Picture([Panel("x", "y", "", series=[])])


@pytest.mark.parametrize(
    "write",
    [
        pytest.param(Table("", ["a"], [["1"]]).write_csv, id="table"),
        pytest.param(lambda path: write_picture(path, PICTURE), id="picture"),
        pytest.param(lambda path: write_png(to_figure(PICTURE), path), id="figure"),
    ],
)
def test_output_stays_as_it_was_if_the_last_step_fails(write, tmp_path, monkeypatch):
    """Make the renaming fail."""

    def fail(*paths):
        raise OSError("no space left")

    monkeypatch.setattr("modal.formats.whole_file.os.replace", fail)
    path = tmp_path / "a.csv"
    path.write_text("before")
    with refusal("unwritable"):
        write(path)
    assert path.read_text() == "before"
    assert [file.name for file in tmp_path.iterdir()] == ["a.csv"]
