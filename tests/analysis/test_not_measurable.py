"""Unknown quantities: what a packing lacks makes one unknown, a mistake of ours does not."""

from dataclasses import replace

import numpy as np
import pytest
from changes import bare
from packings import polydisperse
from refusals import refusal

import modal
from analysis.packing_data import PackingData
from analysis.quantities import QUANTITIES
from analysis.quantities.registry import Quantity
from modal.packing import crystal as gallery
from modal.tools.errors import InputError, UnavailableError


def unbounded(network):
    """Return a cluster without walls and periods."""
    inside = ~network.with_wall & ~network.cell_shift.any(axis=1)
    return replace(
        network.with_contacts(inside),
        cell_periodic=np.zeros(3, bool),
        wall_position=np.zeros(2),
    )


def without_forces():
    """Return spheres between walls, of whose contacts only the springs are known."""
    return bare(polydisperse())


def without_contacts():
    """Return spheres that touch nothing."""
    return polydisperse().with_contacts(slice(0))


def with_walls_alone():
    """Return spheres with contacts at the walls alone."""
    network = polydisperse()
    return network.with_contacts(network.with_wall)


def without_a_cell():
    """Return a cluster whose cell has no size."""
    return replace(unbounded(polydisperse()), cell_size=np.zeros(3))


def loose():
    """Return spheres with a third of their contacts."""
    return polydisperse().with_contacts(slice(0, None, 3))


UNUSUAL_PACKINGS = {
    "without forces": without_forces,
    "without contacts": without_contacts,
    "walls alone": with_walls_alone,
    "unbounded": lambda: unbounded(polydisperse()),
    "without a cell": without_a_cell,
    "short": lambda: gallery.fcc(cells=(1, 1, 3)),
    "loose": loose,
    "column": lambda: gallery.column(3),
    "one sphere": lambda: gallery.column(1),
    "periodic": lambda: polydisperse(periodic_z=True),
}


@pytest.mark.parametrize("kind", UNUSUAL_PACKINGS)
def test_every_quantity_of_an_unusual_packing_is_known_or_has_a_caveat(kind):
    packing = PackingData(UNUSUAL_PACKINGS[kind]())
    for quantity in QUANTITIES.values():
        value = quantity.measured(packing)
        assert value.known or value.caveats, quantity.name


def trial_quantity(compute):
    """Return a quantity that is computed from the network by a function."""
    return Quantity("trial", "Hz", "a trial", lambda packing: compute(packing.network))


@pytest.fixture
def crystal():
    """Return the data of six layers of a crystal."""
    return PackingData(gallery.fcc(cells=(1, 1, 6)))


MISTAKES = {
    "a word for a number": lambda net: modal.eigenmodes(net, lowest="five").frequency[0],
    "an unknown word": lambda net: modal.elastic_moduli(net, solver="magic").bulk_modulus,
    "an index": lambda net: net.position[net.n_particles],
}


@pytest.mark.parametrize("call", MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_in_a_quantity_is_a_traceback(call, crystal):
    with pytest.raises(Exception) as raised:
        trial_quantity(call).measured(crystal)
    assert not isinstance(raised.value, InputError)


def test_a_quantity_that_a_packing_cannot_have_is_not_known(crystal):
    """Raise an UnavailableError, whatever its sentence: the value has one caveat."""

    def refuse(network):
        raise UnavailableError("no_walls", "packing", "of no kind that has it")

    value = trial_quantity(refuse).measured(crystal)
    assert not value.known
    assert len(value.caveats) == 1


def test_a_refusal_of_the_input_ends_the_measurement(crystal):
    def refuse(network):
        raise InputError("damaged_file", "damaged")

    with refusal("damaged_file"):
        trial_quantity(refuse).measured(crystal)
