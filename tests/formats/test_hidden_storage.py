"""What HDF5 can hide: numbers of other files, numbers never written, more than the file holds.

A network is read whole from its own file, or refused with a code. The same reader serves modes,
signals and samples.
"""

import subprocess
import sys

import h5py
import numpy as np
import pytest
from refusals import refusal

from modal.modes.eigenmodes import eigenmodes
from modal.modes.mode_set import read_modes, write_modes
from modal.packing.crystal import fcc
from modal.packing.network import read_network, write_network
from modal.packing.sample import Sample, read_sample, write_sample
from modal.tools.errors import InputError
from modal.waves.propagate import propagate
from modal.waves.signals import read_signals, write_signals

CRYSTAL = fcc(cells=(1, 1, 12))
COLUMN = "contacts/stiffness_tangential"
SIZE = CRYSTAL.n_contacts


def _new(file: h5py.File, **how: object) -> h5py.Dataset:
    """Create the column anew."""
    del file[COLUMN]
    return file.create_dataset(COLUMN, **how)


def _virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout(shape=(SIZE,), dtype="f8")
    layout[:] = h5py.VirtualSource("absent.h5", "k", shape=(SIZE,))
    del file[COLUMN]
    file.create_virtual_dataset(COLUMN, layout)


def _part_written(file: h5py.File) -> None:
    _new(file, shape=(SIZE,), dtype="f8", chunks=(16,))[:16] = 1e6


def _linked(name: str, link: object, version: int = 1):
    """Return a change that puts a link in the place of a node."""

    def change(file: h5py.File) -> None:
        file.pop(name, None)
        file[name] = link
        file.attrs["schema_version"] = version

    return change


def _own_parent(file: h5py.File) -> None:
    file["contacts/again"] = file["/"]


def _two_names(file: h5py.File) -> None:
    file["other"] = file["contacts"]


def _second_name(file: h5py.File) -> None:
    file["contacts/cohesion"] = file["contacts/overlap"]
    file.attrs["schema_version"] = 2


def _replaced(data: object, **how: object):
    return lambda file: _new(file, data=data, **how)


OUT = h5py.ExternalLink("other.h5", "/k")
CHANGES = {
    "virtual": (_virtual, "other_file"),
    "external storage": (
        lambda file: _new(file, shape=(SIZE,), dtype="f8", external=[("raw", 0, 8 * SIZE)]),
        "other_file",
    ),
    "chunks never written": (_part_written, "unwritten"),
    "nothing written": (lambda file: _new(file, shape=(SIZE,), dtype="f8"), "unwritten"),
    "without a shape": (_replaced(h5py.Empty("f8")), "unwritten"),
    "external link": (_linked(COLUMN, OUT), "link"),
    "folder elsewhere": (_linked("study", h5py.ExternalLink("other.h5", "/")), "link"),
    "unknown column elsewhere": (_linked("contacts/cohesion", OUT, 2), "link"),
    "unknown column, soft": (
        _linked("contacts/cohesion", h5py.SoftLink("/contacts/overlap"), 2),
        "unknown_column",
    ),
    "unknown column, nowhere": (
        _linked("contacts/cohesion", h5py.SoftLink("/nowhere"), 2),
        "unknown_column",
    ),
    "unknown column, a second name": (_second_name, "unknown_column"),
    "column nowhere": (_linked(COLUMN, h5py.SoftLink("/nowhere")), "missing_dataset"),
    "a type in its place": (_linked(COLUMN, np.dtype("f8")), "missing_dataset"),
    "circle": (_own_parent, "link"),
    "a folder of two names": (_two_names, "link"),
    "more than the file": (
        lambda file: _new(file, shape=(2**30,), dtype="f8", chunks=(2**20,)),
        "unwritten",
    ),
    "one chunk for all": (
        lambda file: _new(
            file, shape=(SIZE,), maxshape=(None,), dtype="f8", chunks=(2**22,), compression=9
        ).write_direct(CRYSTAL.stiffness_tangential.copy()),
        "declared_size",
    ),
    "texts": (
        lambda file: _new(file, shape=(SIZE,), dtype=h5py.string_dtype()),
        "wrong_kind",
    ),
    "lists": (
        lambda file: _new(file, shape=(SIZE,), dtype=h5py.vlen_dtype("f8")),
        "wrong_kind",
    ),
    "references": (lambda file: _new(file, shape=(SIZE,), dtype=h5py.ref_dtype), "wrong_kind"),
    "records": (_replaced(np.zeros(SIZE, [("k", "f8")])), "wrong_kind"),
    "one number": (_replaced(1.0), "wrong_shape"),
    "version NaN": (lambda file: file.attrs.update(schema_version=np.nan), "schema_version"),
    "version True": (lambda file: file.attrs.update(schema_version=True), "schema_version"),
    "long note": (lambda file: file["study"].attrs.update(log="x" * 2_000_000), "huge_note"),
    "packed": (lambda file: file[COLUMN].attrs.update(scale_factor=1e-3), "unit"),
    "stands for none": (
        lambda file: file[COLUMN].attrs.update(_FillValue=CRYSTAL.stiffness_tangential[0]),
        "masked",
    ),
}


@pytest.fixture
def file(tmp_path, monkeypatch):
    """Write a network, and another file with suitable numbers beside it."""
    monkeypatch.chdir(tmp_path)
    write_network("a.network.h5", CRYSTAL)
    with h5py.File("other.h5", "w") as other_file:
        other_file["k"] = CRYSTAL.stiffness_tangential
    CRYSTAL.stiffness_tangential.tofile("raw")
    return tmp_path / "a.network.h5"


@pytest.mark.parametrize("change", CHANGES)
def test_what_is_not_whole_in_the_file_is_refused(change, file):
    edit, code = CHANGES[change]
    with h5py.File(file, "r+", libver="latest") as raw:
        edit(raw)
    with refusal(code):
        read_network(file)


@pytest.mark.parametrize(
    "edit",
    [
        _linked("other name", h5py.SoftLink("/contacts/overlap")),  # version 1: no column
        lambda file: file[COLUMN].attrs.update(scale_factor=1.0, add_offset=0.0),
        lambda file: file["study"].attrs.update(reference=file.ref, record=np.zeros(1, "f8,i4")),
        lambda file: file.attrs.update(schema=np.bytes_(b"granular-contact-network")),
        lambda file: file.attrs.update(schema_version=np.array([1])),
    ],
)
def test_what_changes_no_number_is_read(edit, file):
    with h5py.File(file, "r+", libver="latest") as raw:
        edit(raw)
    read = read_network(file)
    np.testing.assert_array_equal(read.stiffness_tangential, CRYSTAL.stiffness_tangential)


def test_shapes_are_compared_before_anything_is_read(file, monkeypatch):
    """Refuse positions of a million spheres with twelve radii; read neither."""
    with h5py.File(file, "r+") as raw:
        del raw["particles/position"]
        raw.create_dataset("particles/position", data=np.zeros((2**17, 3)), compression=9)
    monkeypatch.setattr(h5py.Dataset, "__getitem__", lambda *_: pytest.fail("was read"))
    with refusal("wrong_shape"):
        read_network(file)


def test_other_products_refuse_links_too(tmp_path):
    sphere = np.array([[1e-3, 1e-3, 1e-3]])
    sample = Sample(sphere, np.array([4e-3, 4e-3]), np.array([0.0, 2e-3]), 0.1, radius=1.0001e-3)
    write_sample(tmp_path / "a.sample.h5", sample)
    write_modes(tmp_path / "a.modes.h5", eigenmodes(CRYSTAL, lowest=2))
    write_signals(tmp_path / "a.signals.h5", propagate(CRYSTAL, 2e-5).signals)
    readers = {"sample": read_sample, "modes": read_modes, "signals": read_signals}
    columns = {"sample": "particles/position", "modes": "frequency", "signals": "time"}
    for kind, read in readers.items():
        path = tmp_path / f"a.{kind}.h5"
        read(path)
        with h5py.File(path, "r+", libver="latest") as raw:
            raw.move(columns[kind], "moved")
            raw[columns[kind]] = h5py.ExternalLink(path.name, "/moved")
        with refusal("link"):
            read(path)


HOLD = "import h5py, sys; file = h5py.File(sys.argv[1], 'r+'); print(flush=True); input()"


def test_a_file_that_is_open_elsewhere_is_not_called_damaged(file):
    command = [sys.executable, "-c", HOLD, str(file)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout
        assert holder.stdout.readline()
        with pytest.raises(InputError) as refused:
            read_network(file)
        holder.communicate(b"\n")
    assert refused.value.code == "file_in_use"
    assert read_network(file).n_contacts == SIZE


@pytest.mark.parametrize(("numbers", "code"), [([1, 1, 0], ""), ([84, 84, 70], "not_yes_or_no"),
                                               ([1, 2, 0], "not_yes_or_no")])  # fmt: skip
def test_yes_and_no_are_one_and_zero(tmp_path, numbers, code):
    """Refuse the letters T and F: in a file of bytes they are numbers, and neither is zero."""
    path = tmp_path / "a.network.h5"
    write_network(path, CRYSTAL)
    with h5py.File(path, "a") as file:
        del file["cell/periodic"]
        file["cell/periodic"] = np.array(numbers, np.uint8)
    if not code:
        assert read_network(path).cell_periodic.tolist() == [True, True, False]
        return
    with refusal(code):
        read_network(path)


def test_one_chunk_as_large_as_its_dataset_is_read(file, monkeypatch):
    """Read it although it is larger than what is read without a check of the file's size."""
    monkeypatch.setattr("modal.formats.storage.UNCHECKED_BYTES", 0)
    with h5py.File(file, "r+", libver="latest") as raw:
        _new(raw, data=CRYSTAL.stiffness_tangential, chunks=(SIZE,))
    read = read_network(file)
    np.testing.assert_array_equal(read.stiffness_tangential, CRYSTAL.stiffness_tangential)
