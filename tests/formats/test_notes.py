"""Free notes beside the numbers: written and read as they are, or refused; never a traceback."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from refusals import refusal

from modal.formats.attributes import MAX_NOTE_BYTES, number_noted, read_attributes
from modal.packing.crystal import fcc
from modal.packing.network import read_network, write_network
from modal.packing.sample import sample_of_network

CRYSTAL = fcc(cells=(1, 1, 6))


@pytest.mark.parametrize(
    "note",
    ["100 kPa", "", 1e5, 3, True, np.float32(2), [1.0, 2.0], ["a", "b"], np.arange(3), 2 + 1j, ()],
)
def test_texts_numbers_and_lists_come_back(note, tmp_path):
    write_network(tmp_path / "a.network.h5", replace(CRYSTAL, study={"note": note}))
    np.testing.assert_array_equal(read_network(tmp_path / "a.network.h5").study["note"], note)


@pytest.mark.parametrize(
    ("study", "code"),
    [
        ({"note": "a\0b"}, "note"),
        ({"note": "\udcff"}, "note"),
        ({"note": {"a": 1}}, "note"),
        ({"note": [[1], [1, 2]]}, "note"),
        ({"note": ["a", "b\0"]}, "note"),
        ({"note": 2**70}, "note"),
        ({"note": object()}, "note"),
        ({"note": np.datetime64("2020-01-01")}, "note"),
        ({"note": "x" * 2_000_000}, "note"),
        ({"note": np.zeros(2**18)}, "huge_note"),
        ({1: 2}, "note_name"),
        ({"": 2}, "note_name"),
        ({"a\0": 2}, "note_name"),
        ({None: 2}, "note_name"),
    ],
)
def test_what_is_no_note_is_refused_before_a_file_is_there(study, code, tmp_path):
    with refusal(code):
        write_network(tmp_path / "a.network.h5", replace(CRYSTAL, study=study))
    assert not list(tmp_path.iterdir())


def test_a_note_may_be_as_long_as_the_limit(tmp_path):
    note = "x" * MAX_NOTE_BYTES
    write_network(tmp_path / "a.network.h5", replace(CRYSTAL, study={"note": note}))
    assert read_network(tmp_path / "a.network.h5").study == {"note": note}


def test_none_says_nothing(tmp_path):
    write_network(tmp_path / "a.network.h5", replace(CRYSTAL, study={"note": None, "seed": 3}))
    assert read_network(tmp_path / "a.network.h5").study == {"seed": 3}


def test_attributes_of_other_programs_are_read(tmp_path):
    """Read bytes as texts; ignore references and lists of lists, which are no notes."""
    lists = np.array([np.arange(2.0), np.arange(3.0)], dtype=object)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs.update(text=np.bytes_(b"SI"), both=np.array([b"a", b"b"]), none=h5py.Empty("f"))
        file.attrs.update(reference=file.ref, record=np.zeros(2, "f8,i4"), one=np.array([3.0]))
        file.attrs.create("lists", lists, dtype=h5py.vlen_dtype("f8"))
        assert read_attributes(file) == {"text": "SI", "both": ["a", "b"], "one": 3.0}


@pytest.mark.parametrize(
    ("note", "number"),
    [(1e5, 1e5), (0, 0.0), (np.float32(2), 2.0), (np.array([5.0]), 5.0)]
    + [(note, None) for note in ("1e5", True, np.True_, None, [1e5], {}, np.ones(3))]
    + [(note, None) for note in (np.nan, np.inf, 10**400, 1j, b"1")],
)
def test_a_number_is_noted_or_none(note, number):
    assert number_noted({"stress": note}, "stress") == number
    assert number_noted({}, "stress") is None


def test_a_sample_of_a_network_takes_no_text_for_a_modulus():
    """Take the glass of the crystal if the note is no number."""
    noted = replace(CRYSTAL, study=CRYSTAL.study | {"young": "much", "wall_young": "more"})
    glass = replace(CRYSTAL, study={})
    first = sample_of_network(noted, 0.1).material
    second = sample_of_network(glass, 0.1).material
    assert first == second
