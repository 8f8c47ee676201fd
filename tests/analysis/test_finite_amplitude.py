"""What changes with the amplitude of a wave: orders of a column, slip in a packing, the command."""

import json

import numpy as np
import pytest

import analysis
import modal
from analysis.__main__ import main
from analysis.quantities.amplitude import AMPLITUDE
from modal.packing import crystal as gallery
from modal.packing.sample import sample_of_network, write_sample
from modal.preparation.relax import relax


def test_orders_of_a_column_of_hertz_spheres():
    """Even part and second harmonic go as A, the odd part's change as A^2; nothing slides or opens.

    The series in A over the overlap converges fast at the thousandths that are taken.
    """
    column = gallery.column(40)
    sizes = column.overlap[1] * np.array([0.01, 0.02])
    found = analysis.measure(sample_of_network(column, 0.3), amplitudes=sizes)
    assert tuple(found) == AMPLITUDE
    for name, order in (("even_part", 1), ("second_harmonic", 1), ("odd_part", 2)):
        low, high = found[name].value
        assert np.log2(high / low) == pytest.approx(order, abs=0.05), name
        assert 0 < high < 0.1
    assert not found["slip_loss"].value.any() and not found["slip_sharing"].value.any()
    assert not found["slipping_share"].value.any() and not found["opening_share"].value.any()


def test_more_contacts_slide_and_open_the_larger_the_wave(tmp_path, capsys):
    packed = modal.random_packing(300, seed=2, aspect=6)
    sample, _ = relax(sample_of_network(packed, 0.3))
    found = analysis.measure(sample, amplitudes=[1e-9, 1e-7])
    for name in ("slipping_share", "opening_share", "even_part", "odd_part", "slip_loss"):
        low, high = found[name].value
        assert 0 <= low < high < 1, name
    # Contacts that share the loss: more than one, fewer than slid.
    slid = found["slipping_share"].value[1] * sample.network().n_contacts
    assert 1 < found["slip_sharing"].value[1] < slid
    write_sample(tmp_path / "a.sample.h5", sample)
    command = ["measure", tmp_path / "a.sample.h5", "--quantities", "even_part", "--json"]
    assert main([str(word) for word in command]) == 3
    told = json.loads(capsys.readouterr().out)
    assert "amplitudes, which were not given" in told["even_part"]["caveats"][0]
    assert main([str(word) for word in [*command, "--amplitudes", "1e-7"]]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["even_part"]["value"] == pytest.approx(found["even_part"].value[1:])
