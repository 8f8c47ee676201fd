"""The tangent of another program's law; waves on it stand in `tests/waves/test_sources.py`."""

from __future__ import annotations

import numpy as np
import packings
import pytest
from oracles import asymmetry
from program_files import of_law

from modal.__main__ import main
from modal.modes.eigenmodes import eigenmodes
from modal.modes.first_order import shift_by_law
from modal.packing.network import read_network, write_network
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.operator import ContactOperator
from modal.tools.errors import InputError


def test_operator_is_the_matrix_of_the_law_and_survives_a_file(tmp_path):
    write_network(tmp_path / "x.network.h5", of_law())
    network = read_network(tmp_path / "x.network.h5")
    K = stiffness_matrix(network, pre_stress="law")
    u = np.random.default_rng(1).standard_normal((K.shape[0], 3))
    found = ContactOperator(network, pre_stress="law").apply(u)
    np.testing.assert_allclose(found, K @ u, atol=1e-13 * abs(K @ u).max())
    # It is not symmetric: the shear forces of the made packing are a tenth of the normal ones.
    assert asymmetry(K) > 1e-3 > asymmetry(stiffness_matrix(network, pre_stress="full"))


def test_law_is_refused_where_the_network_does_not_know_it(tmp_path, one_line):
    network = packings.polydisperse(False)
    with pytest.raises(InputError, match="pre-stress 'law' .of imported packings; there is 'full'"):
        stiffness_matrix(network, pre_stress="law")
    write_network(tmp_path / "x.network.h5", network)
    wave = ["wave", tmp_path / "x.network.h5", "--pre-stress", "law"]
    one_line(main, wave, "no contacts/shear_growth")


def test_shift_of_modes_is_the_law_to_first_order():
    """Against all eigenvalues of the tangent, which is not symmetric, at forces x 1 and x 1/2.

    The error is of second order: a quarter at half the difference. Rigid, well separated modes.
    """
    network = of_law()
    modes = eigenmodes(network, all=True)
    scale = np.sqrt(np.outer(*[mass_diagonal(network)] * 2))
    own, springs = (
        stiffness_matrix(network, pre_stress=which).toarray() / scale for which in ("law", "none")
    )
    errors = []
    for share in (0.02, 0.01):
        weak = springs + share * (own - springs)
        exact = np.sort(np.sqrt(np.maximum(np.linalg.eigvals(weak).real, 0))) / (2 * np.pi)
        moved = modes.frequency**2 + share * (
            (modes.frequency + shift_by_law(network, modes)) ** 2 - modes.frequency**2
        )
        found = np.sort(np.sqrt(moved))
        firm = slice(len(exact) // 2, None)
        errors.append(np.linalg.norm((found - exact)[firm] / exact[firm]))
        assert errors[-1] < 0.05 * np.linalg.norm((modes.frequency - exact)[firm] / exact[firm])
    assert 3 < errors[0] / errors[1] < 5
