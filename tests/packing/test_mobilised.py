"""Tests of contacts at the friction limit: their number, and what it means for isostaticity."""

from dataclasses import replace

import numpy as np
import pytest
from places import ROOT

import modal
from analysis.measurement import measure
from modal.packing.sample import read_sample
from modal.packing.state import isostatic_coordination, mobilised_per_particle, residual_forces
from modal.packing.summary import summary
from modal.preparation.relax import relax
from modal.tools.errors import UnavailableError

FRICTION = ROOT / "tests" / "data" / "friction150.sample.h5"
"""150 spheres that were compressed with friction 0.4."""


@pytest.fixture(scope="module")
def packing():
    return modal.random_packing(100, seed=2, aspect=1.0)


def test_without_friction_every_contact_is_mobilised(packing):
    """Count n_m = z / 2 without friction; at z = 6 this is isostatic: 4 + 2 = 6."""
    numbers = summary(packing)
    mobilised = numbers["mobilised_contacts_per_particle"]
    with_wall = packing.with_wall.sum()
    bearing = packing.n_particles - numbers["rattlers"]
    half = (numbers["coordination_number_without_rattlers"] + with_wall / bearing) / 2
    # Contacts of rattlers with walls are few.
    assert mobilised == pytest.approx(half, rel=0.02)
    assert isostatic_coordination(3.0) == 6
    assert numbers["isostatic_coordination_number"] == 4 + 2 / 3 * mobilised


def test_relax_keeps_contacts_at_their_limit_on_request():
    """Relax at the friction of the compression, at whose limit some contacts still are."""
    sample = replace(read_sample(FRICTION), friction=0.4)
    rested, state = relax(sample, mobilised=True)
    assert state.at_rest
    network = rested.network()
    assert mobilised_per_particle(network) > 0
    # Sliding contacts are cut back to the limit, which round-off of 1,000 steps leaves.
    assert state.friction_used == pytest.approx(1, abs=1e-9)
    assert residual_forces(network).mean() < 1e-9


def test_only_contacts_at_the_limit_of_bearing_spheres_count(packing):
    sliding = np.zeros(packing.n_contacts, bool)
    assert mobilised_per_particle(replace(packing, sliding=sliding)) == 0
    pair = np.flatnonzero(~packing.with_wall)[:7]
    sliding[pair] = True
    slid = replace(packing, sliding=sliding)
    mobilised = mobilised_per_particle(slid)
    n_bearing = packing.n_particles - summary(slid)["rattlers"]
    assert 0 < mobilised <= 7 / n_bearing
    assert measure(slid, quantities=["mobilised"])["mobilised"].value == mobilised
    with pytest.raises(UnavailableError):
        mobilised_per_particle(replace(packing, sliding=None))
