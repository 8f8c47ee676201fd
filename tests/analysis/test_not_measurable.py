"""What may be "not known", and what must not: a packing's lack against a mistake of ours."""

from dataclasses import replace

import numpy as np
import pytest
from changes import bare
from packings import polydisperse

import modal
from analysis.packing_data import PackingData
from analysis.quantities import QUANTITIES
from analysis.quantities.registry import Quantity
from modal.packing import crystal as gallery
from modal.tools.errors import InputError, UnavailableError


def unbounded(network):
    """Return a cluster without walls and periods."""
    inside = ~network.with_wall & ~network.cell_shift.any(axis=1)
    nowhere = {"cell_periodic": np.zeros(3, bool), "wall_position": np.zeros(2)}
    return replace(network.with_contacts(inside), **nowhere)


def small():
    """Return 60 spheres of unequal sizes between walls."""
    return polydisperse()


ODD = {
    "without forces": lambda: bare(small()),
    "without contacts": lambda: small().with_contacts(slice(0)),
    "walls alone": lambda: small().with_contacts(small().with_wall),
    "unbounded": lambda: unbounded(small()),
    "without a cell": lambda: replace(unbounded(small()), cell_size=np.zeros(3)),
    "short": lambda: gallery.fcc(cells=(1, 1, 3)),
    "loose": lambda: small().with_contacts(slice(0, None, 3)),
    "column": lambda: gallery.column(3),
    "one sphere": lambda: gallery.column(1),
    "periodic": lambda: polydisperse(periodic_z=True),
}


@pytest.mark.parametrize("kind", ODD)
def test_of_odd_packings_every_quantity_is_known_or_says_why(kind):
    packing = PackingData(ODD[kind]())
    for quantity in QUANTITIES.values():
        value = quantity.measured(packing)
        assert value.known or value.caveats, quantity.name


def of_a_call(call):
    return Quantity("trial", "Hz", "a trial", lambda m: call(m.network))


MISTAKES = {
    "a word for a number": lambda net: modal.eigenmodes(net, lowest="five").frequency[0],
    "an unknown word": lambda net: modal.elastic_moduli(net, solver="magic").bulk_modulus,
    "an index": lambda net: net.position[net.n_particles],
}


@pytest.mark.parametrize("call", MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_in_a_quantity_is_a_traceback(call):
    with pytest.raises(Exception) as raised:
        of_a_call(call).measured(PackingData(gallery.fcc(cells=(1, 1, 6))))
    assert not isinstance(raised.value, InputError)


def test_what_a_packing_lacks_is_not_known_whatever_the_words_of_the_refusal():
    def refuse(network):
        raise UnavailableError("no_walls", "packing", "of no kind that has it")

    value = of_a_call(refuse).measured(PackingData(gallery.fcc(cells=(1, 1, 6))))
    assert not value.known and len(value.caveats) == 1


def test_a_refusal_of_the_input_ends_the_measurement():
    def refuse(network):
        raise InputError("damaged_file", "damaged")

    with pytest.raises(InputError) as refused:
        of_a_call(refuse).measured(PackingData(gallery.fcc(cells=(1, 1, 6))))
    assert refused.value.code == "damaged_file"
