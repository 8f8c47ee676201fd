"""One packing in all forms that LIGGGHTS writes: the same contacts, and its forces by our law.

`examples/packings/liggghts/settled/settle.in` made the files, with the digits that the program
gives them by itself. LIGGGHTS is not needed here.
"""

from __future__ import annotations

import numpy as np
import pytest
from places import PACKINGS

from modal.exchange.import_result import ImportResult
from modal.exchange.registry import import_packing
from modal.packing.network import Network

FOLDER = PACKINGS / "liggghts" / "settled"
LAW = {
    "pair": "gran model hertz tangential history youngsModulus 5e7 poissonsRatio 0.2 "
    "coefficientFriction 0.3",
    "wall": "type 1 zplane 0 0.012",
    "cell": (0, 0.006, 0, 0.006, 0, 0.012),
    "periodic": "xy",
}


def imported(name: str, **options: object) -> ImportResult:
    """Return the packing of a file."""
    return import_packing(FOLDER / name, **options)


def by_ends(network: Network) -> dict[tuple[int, ...], float]:
    """Return the normal forces of contacts by their ends, the lower one first."""
    ends = np.sort(np.column_stack([network.particle_i, network.particle_j]), axis=1)
    return dict(zip(map(tuple, ends.tolist()), network.force_normal.tolist(), strict=True))


@pytest.fixture(scope="module")
def exact() -> dict[tuple[int, ...], float]:
    """Return the forces by our law of the centres that `write_data` writes in full."""
    return by_ends(imported("settled.data", **LAW).network)


def dumped() -> ImportResult:
    """Return the packing of the two text dumps and the log."""
    return imported(
        "settled.atoms", contacts=FOLDER / "settled.contacts", log=FOLDER / "log.settled"
    )


def test_forces_of_the_program_are_those_of_our_law(exact):
    """Compare the forces between spheres, written with six digits, with Hertz' of full centres."""
    forces = by_ends(dumped().network)
    assert forces.keys() == exact.keys()
    pairs = [ends for ends in exact if min(ends) >= 0]
    assert len(pairs) == 111
    for ends in pairs:
        assert forces[ends] == pytest.approx(exact[ends], rel=1e-5)


def test_weight_is_read_from_the_log():
    network = dumped().network
    np.testing.assert_array_equal(network.study["gravity"], [0, 0, -981])


@pytest.mark.parametrize(("name", "digits"), [("settled.vtp", 7), ("settled.vtk", 6)])
def test_centres_in_single_precision_are_known_for_it(exact, name, digits):
    """Compare the stated error of overlaps with the last digit, and forces with exact ones.

    A force by Hertz' law is off by 3/2 of the error of its overlap; some contacts are less deep
    than the median, and the largest of a hundred errors is some three of the mean square.
    """
    pytest.importorskip("vtkmodules")
    result = imported(name, **LAW)
    error = result.told["error_of_overlaps"]
    last_digit = 10.0 ** (-2 - digits)
    assert error == pytest.approx(last_digit / np.sqrt(6) / np.median(result.network.overlap))
    forces = by_ends(result.network)
    assert forces.keys() == exact.keys()
    largest = max(abs(forces[ends] - exact[ends]) for ends in exact)
    assert largest < 10 * error * np.mean([*exact.values()])


def test_lines_of_pairs_bring_the_forces(exact):
    """Take the forces of `dump local/gran/vtk`, also of lines that lead across the whole cell.

    A quarter of the contacts crosses a period; their force is a vector along the short way.
    """
    pytest.importorskip("vtkmodules")
    result = imported("settled.vtp", contacts=FOLDER / "settled.pairs.vtk", **LAW)
    assert result.told["overlaps_from"] == "forces"
    forces = by_ends(result.network)
    assert forces.keys() == exact.keys()
    pairs = [ends for ends in exact if min(ends) >= 0]
    np.testing.assert_allclose(
        [forces[ends] for ends in pairs], [exact[ends] for ends in pairs], rtol=1e-4
    )


def test_periods_beside_a_typed_cell_count(exact):
    """Read a data file with --cell and --periodic, and with --periodic alone."""
    options = {name: LAW[name] for name in ("pair", "wall", "periodic")}
    assert by_ends(imported("settled.data", **options).network) == exact
