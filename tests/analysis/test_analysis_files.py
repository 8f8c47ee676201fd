"""Reports of packings that are no cases of the study: named by their files, joined by digest."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from oracles import stepped
from packings import frictionless, slender

from analysis.__main__ import main
from analysis.case import cases_of_files
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
from modal.tools.errors import InputError
from modal.waves.motions import Pulse
from modal.waves.signals import write_signals

STRESS = 2.5e5
"""Of the crystal, Pa; the study has none like it."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A crystal of 120 layers and 200 random spheres, each with what belongs to it."""
    folder = tmp_path_factory.mktemp("mine")
    crystal = fcc(STRESS, (1, 1, 120))
    chain = LayerLattice.of_network(crystal)
    write_network(folder / "quartz.network.h5", crystal)
    recorded = lattice_signals(chain, np.arange(0, crystal.length / chain.velocity, 2e-7))
    made = Provenance(sources=packing_of(folder / "quartz.network.h5"))
    write_signals(folder / "run7.h5", recorded, made)
    packing = replace(slender(), study={})
    write_network(folder / "heap.h5", packing)
    run = stepped(packing, 1e-4, 2e-7, motion=Pulse(2.5e-9), every=2, particles=True)
    run = replace(run, producer="other DEM")
    write_signals(
        folder / "heap.signals.h5", run, Provenance(sources=packing_of(folder / "heap.h5"))
    )
    for name, options, target in (
        ("quartz.network.h5", ["--all"], "quartz_all.h5"),
        ("heap.h5", ["--lowest", "40"], "low.h5"),
        ("heap.h5", ["--highest", "1"], "top.h5"),
        ("heap.h5", ["--between", "40000", "50000"], "band.h5"),
    ):
        assert modal_main(["modes", str(folder / name), *options, "-o", str(folder / target)]) == 0
    return folder


def files(folder, *names):
    return [str(folder / name) for name in names]


def test_numbers_of_a_crystal_that_is_no_case(folder):
    """Its theory is found from the packing; every value is that of its own stress."""
    names = "quartz.network.h5", "run7.h5", "quartz_all.h5"
    row = measure_result(PackingData.of(cases_of_files(files(folder, *names))[0]))
    assert row.label == "FCC, 250 kPa (quartz)" and row.number is None
    chain = LayerLattice.of_network(fcc(STRESS, (1, 1, 120)))
    # The damped transform's bias is below 1e-5, the modes' 1e-6.
    for name in ("v_p_long_waves_yade_m_per_s", "v_p_modes_fitted_m_per_s"):
        assert row.value(name) == pytest.approx(chain.velocity, rel=1e-3)
    edge = row.value("band_edge_yade_khz")
    assert edge == pytest.approx(chain.low_pass_frequency / 1e3, rel=1e-3)


def test_numbers_of_a_random_packing_that_is_no_case(folder):
    """Without stress or friction in its study: its contacts tell the one; f_max is its file's."""
    (case,) = cases_of_files(files(folder, "heap.h5", "heap.signals.h5", "low.h5", "top.h5"))
    row = measure_result(PackingData.of(case))
    assert row.label == "random, 100 kPa (heap)" and row.record == "yade"
    assert row.values["f_max"].value == case.read("highest.modes").frequency[-1]


def test_files_of_two_packings_go_to_their_own(folder):
    names = "low.h5", "run7.h5", "heap.h5", "quartz_all.h5", "quartz.network.h5", "heap.signals.h5"
    heap, quartz = cases_of_files(files(folder, *names))
    assert (heap.name, quartz.name) == ("heap", "quartz")
    for case, *wanted in (
        (heap, "heap.h5", "low.h5", "heap.signals.h5"),
        (quartz, "quartz.network.h5", "quartz_all.h5", "run7.h5"),
    ):
        found = [case.files[kind].name for kind in ("network", "modes", "signals")]
        assert found == wanted and len(case.files) == 3


def test_a_sample_alone_and_beside_its_network(folder, tmp_path):
    sample = tmp_path / "grains.sample.h5"
    write_sample(sample, sample_of_network(frictionless(), 0.1))
    (case,) = cases_of_files([sample])
    m = PackingData.of(case)
    assert case.name == "grains" and m.network.n_particles == 150 and not m.crystal
    both = cases_of_files([sample, folder / "heap.h5"])  # not exported from it: two packings
    assert [case.name for case in both] == ["heap", "grains"]


def test_stress_of_a_packing_that_states_none_is_what_its_contacts_bear(folder, tmp_path):
    """The packing was made at 100 kPa; its file here does not say so, and may hold no forces."""
    (case,) = cases_of_files([folder / "heap.h5"])
    heap = PackingData.of(case)
    assert "stress" not in heap.network.study
    assert heap.stress == 1e5 and heap.label.startswith("random, 100 kPa")
    bare = replace(heap.network, force_normal=None, force_tangential=None)
    write_network(tmp_path / "bare.network.h5", bare)
    (case,) = cases_of_files([tmp_path / "bare.network.h5"])
    unknown = PackingData.of(case)
    assert np.isnan(unknown.stress) and unknown.label == "random (bare)"


def test_what_lies_beside_a_packing_under_its_name_is_read(folder, tmp_path, capsys):
    """If it was made from that very packing, and no other of its kind is given."""
    (case,) = cases_of_files(files(folder, "heap.h5", "low.h5"))
    assert {path.name for path in case.files.values()} >= {"heap.signals.h5", "low.h5"}
    heap = tmp_path / "heap.network.h5"
    shutil.copy(folder / "heap.h5", heap)
    shutil.copy(folder / "low.h5", tmp_path / "heap.modes.h5")
    shutil.copy(folder / "run7.h5", tmp_path / "heap.signals.h5")  # of the crystal
    shutil.copy(folder / "heap.signals.h5", tmp_path / "heap.100kHz.signals.h5")
    (case,) = cases_of_files([heap])
    assert list(case.files) == ["network", "100kHz.signals", "modes"]
    kept = ["--quantities", "ioffe_regel", "--keep", str(tmp_path)]
    assert main(["measure", str(heap), *kept]) in (0, 3)
    assert "diameters wide" in capsys.readouterr().err
    assert main(["figure", "scattering", str(heap), "-o", str(tmp_path / "out")]) == 0
    (case,) = cases_of_files([heap, folder / "band.h5", folder / "top.h5"])
    assert case.files["modes"].name == "heap.modes.h5" and len(case.files) == 6


def test_linear_waves_are_no_record(folder, tmp_path):
    """`modal wave` of the same springs would stand in the columns of the DEM run."""
    wave = tmp_path / "w.h5"
    command = ["wave", str(folder / "heap.h5"), "--duration", "1e-4", "-o", str(wave)]
    assert modal_main(command) == 0
    (case,) = cases_of_files([folder / "heap.h5", wave])
    assert PackingData.of(case).yade is None
    assert any("linear wave" in note for note in case.notes)
    # The other program's record, which lies beside the packing, is one.
    (case,) = cases_of_files([folder / "heap.h5"])
    assert PackingData.of(case).yade.producer == "other DEM"


def test_what_does_not_belong_is_refused(folder, tmp_path, one_line):
    with atomic_h5(tmp_path / "odd.h5") as file:
        file.attrs["schema"] = "something-else"
    chain = LayerLattice.of_network(fcc(STRESS, (1, 1, 120)))
    write_signals(tmp_path / "stray.h5", lattice_signals(chain, np.arange(0, 2e-5, 2e-7)))
    odd, stray = str(tmp_path / "odd.h5"), str(tmp_path / "stray.h5")
    for given, code in (
        (files(folder, "heap.h5", "run7.h5"), "other_packing"),
        (files(folder, "run7.h5"), "no_packing"),
        ([*files(folder, "heap.h5"), odd], "unknown_schema"),
        ([*files(folder, "heap.h5", "quartz.network.h5"), stray], "unknown_packing"),
        (files(folder, "heap.h5", "absent.h5"), "no_file"),
    ):
        one_line(main, ["figure", "signals", *given, "-o", tmp_path], code=code)
    assert len(cases_of_files(files(folder, "heap.h5", "low.h5", "low.h5"))) == 1
    shutil.copy(folder / "low.h5", tmp_path / "again.h5")
    with pytest.raises(InputError) as refused:
        cases_of_files([*files(folder, "heap.h5", "low.h5"), tmp_path / "again.h5"])
    assert refused.value.code == "two_of_a_kind"


def test_tables_and_figures_are_whole_or_as_they_were(tmp_path, monkeypatch):
    """Where the last step, the renaming, fails, what stood there still stands."""
    picture = Picture([Panel("x", "y", "", series=[])])
    writers = {
        "a.csv": Table("", ["a"], [["1"]]).write_csv,
        "b.csv": lambda path: write_picture(path, picture),
        "c.png": lambda path: write_png(to_figure(picture), path),
    }

    def fails(*paths):
        raise OSError("no space left")

    monkeypatch.setattr("modal.formats.whole_file.os.replace", fails)
    for name, write in writers.items():
        (tmp_path / name).write_text("before")
        with pytest.raises(InputError) as refused:
            write(tmp_path / name)
        assert refused.value.code == "unwritable"
        assert (tmp_path / name).read_text() == "before"
    assert {path.name for path in tmp_path.iterdir()} == set(writers)
