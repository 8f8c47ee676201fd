"""Tests of adhesive contacts: closed forms, finite differences, history across gaps, files."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from changes import in_flight
from refusals import refusal
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

import modal
from modal.dem import contacts as moving_contacts
from modal.dem.contacts import MovingContacts
from modal.dem.forces_by_arrays import forces_by_arrays
from modal.dem.motion import Dynamics
from modal.packing.contact_law import GLASS, RADIUS
from modal.packing.contact_models import friction_force, laws_of, rupture_distance
from modal.packing.sample import Sample, read_sample, sample_of_network, write_sample
from modal.packing.sphere_sample import UNSTABLE_CONTACTS
from modal.packing.state import friction_used
from modal.preparation.relax import relax
from modal.waves.motions import Pulse

WORK = 5.0
EFFECTIVE = RADIUS / 2
MODELS = ("dmt 5", "jkr 5", "liquid-bridge 0.073 1e-12 20", "cement-bond 1e9 0.5 1e5")
ACROSS_GAPS = MODELS[1:]
COMPILED = [
    pytest.param(model, marks=() if model.startswith("jkr") else pytest.mark.slow)
    for model in MODELS
]
"""Models of tests that run a compiled loop, which takes numba ten seconds a model."""
STENCIL = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
"""Weights of the differences f(x + kh) - f(x - kh), k = 1 to 4, in a derivative of order h^8."""


def material_with(model, **constants):
    """Return glass with another contact model and other constants."""
    return replace(GLASS, contact_model=model, **constants)


def law_of(model):
    """Return the law between two spheres of glass."""
    return laws_of(material_with(model))[0]


def derivative(function, x, h):
    """Return the derivative by central differences of order h^8."""
    k = np.arange(1, 5)
    return STENCIL @ (function(x + k * h) - function(x - k * h)) / h


SHARES = [*product(MODELS, (0.5, 2.0, 50.0)), *product(ACROSS_GAPS, (-0.7, -0.3))]
"""Models, and overlaps divided by the gap of rupture, or by 1 um where there is none."""


@pytest.mark.parametrize(("model", "share"), SHARES)
def test_stiffness_is_the_derivative_of_the_force_and_force_that_of_the_energy(model, share):
    """Take differences over 1 % of the distance from rupture or touch; 1e-8 of the stiffness."""
    law = law_of(model)
    gap = float(rupture_distance(law, EFFECTIVE))
    unit = gap or 1e-6
    overlap = share * unit
    h = 0.01 * min(overlap + gap, abs(overlap))

    def force(x):
        return law.normal_force(x, EFFECTIVE)

    def energy(x):
        return law.elastic_energy(x, EFFECTIVE)

    stiffness = law.stiffness_normal(overlap, EFFECTIVE)
    # The differences of a sum of opposite terms are rounded by eps / 0.01 of the larger one.
    attraction = abs(law.normal_force(0.0, EFFECTIVE))
    assert derivative(force, overlap, h) == pytest.approx(
        stiffness, rel=1e-8, abs=1e-13 * attraction / h
    )
    assert derivative(energy, overlap, h) == pytest.approx(
        force(overlap), rel=1e-8, abs=1e-8 * attraction
    )


@pytest.mark.parametrize("model", MODELS)
def test_energy_is_the_integral_of_the_force_from_touch_on(model):
    law = law_of(model)
    gap = float(rupture_distance(law, EFFECTIVE))
    for end in (-0.99 * gap, -0.4 * gap, 1e-7, 1e-5):
        expected, _ = quad(law.normal_force, 0, end, (EFFECTIVE,), epsabs=0, epsrel=1e-12)
        assert law.elastic_energy(end, EFFECTIVE) == pytest.approx(expected, rel=1e-9, abs=1e-20)


def test_dmt_is_hertz_under_its_load_and_the_attraction():
    law = law_of(f"dmt {WORK}")
    hertz = law_of("hertz-mindlin")
    pull_off = 2 * np.pi * WORK * EFFECTIVE
    assert law.normal_force(0.0, EFFECTIVE) == pytest.approx(-pull_off, rel=1e-14)
    overlap = law.overlap_of_force(0.3, EFFECTIVE)
    assert overlap == pytest.approx(hertz.overlap_of_force(0.3 + pull_off, EFFECTIVE), rel=1e-14)
    assert law.friction_force(overlap, EFFECTIVE) == pytest.approx(0.3 + pull_off, rel=1e-12)


def test_crystal_under_an_attraction_is_stiffer_by_the_cube_root_of_both_loads():
    """Find kn times ((N + F) / N)^(1/3), 1.32291 for F = 0.3 N at 100 kPa.

    N = p d^2 / (2 sqrt 2), whose spacing d is shorter than 2 R by 1e-4.
    """
    smooth = modal.fcc(1e5, (2, 2, 6))
    attraction = 0.3
    work = attraction / (2 * np.pi * EFFECTIVE)
    sticky = modal.fcc(1e5, (2, 2, 6), material=material_with(f"dmt {work:.17g}"))
    pair = ~smooth.with_wall
    load = 1e5 * (2 * RADIUS) ** 2 / (2 * np.sqrt(2))
    ratio = sticky.stiffness_normal[pair] / smooth.stiffness_normal[pair]
    expected = ((load + attraction) / load) ** (1 / 3)
    assert expected == pytest.approx(1.32291, abs=5e-6)
    assert ratio == pytest.approx(expected, rel=3e-4)
    # The load itself is that of the stress.
    assert sticky.force_normal[pair] == pytest.approx(load, rel=1e-3)
    tangential = sticky.stiffness_tangential[pair] / smooth.stiffness_tangential[pair]
    assert tangential == pytest.approx(ratio, rel=1e-12)


def test_jkr_is_the_law_of_its_paper():
    """Compare with a root of the overlap in the radius of contact, and with known extremes."""
    law = law_of(f"jkr {WORK}")
    young = GLASS.effective_young
    deepest = 0.75 * (np.pi**2 * WORK**2 * EFFECTIVE / young**2) ** (1 / 3)
    assert law.rupture_distance(EFFECTIVE) == pytest.approx(deepest, rel=1e-14)

    def overlap_of_radius(a):
        return a * a / EFFECTIVE - np.sqrt(2 * np.pi * WORK * a / young)

    least_radius = (np.pi * WORK * EFFECTIVE**2 / (8 * young)) ** (1 / 3)
    for overlap in (-0.9 * deepest, -0.2 * deepest, 0.3 * deepest, 1e-6, 1e-4):
        a = brentq(lambda a, x=overlap: overlap_of_radius(a) - x, least_radius, RADIUS, xtol=1e-20)
        force = 4 / 3 * young * a**3 / EFFECTIVE - np.sqrt(8 * np.pi * WORK * young * a**3)
        scale = 4 / 3 * young * a**3 / EFFECTIVE
        assert law.normal_force(overlap, EFFECTIVE) == pytest.approx(force, abs=1e-11 * scale)
        expected = 8 * GLASS.moduli.effective_shear * a
        assert law.stiffness_tangential(overlap, EFFECTIVE) == pytest.approx(expected, rel=1e-11)
        again = law.overlap_of_force(law.normal_force(overlap, EFFECTIVE), EFFECTIVE)
        if overlap > 0:
            assert again == pytest.approx(overlap, rel=1e-9)
    weakest = minimize_scalar(
        law.normal_force,
        bounds=(-deepest, deepest),
        args=(EFFECTIVE,),
        method="bounded",
        options={"xatol": 1e-7 * deepest},
    )
    assert weakest.fun == pytest.approx(-1.5 * np.pi * WORK * EFFECTIVE, rel=1e-10)
    # Without load the circle has the radius of the paper, (9 pi w R^2 / (2 E*))^(1/3).
    free = (4.5 * np.pi * WORK * EFFECTIVE**2 / young) ** (1 / 3)
    assert law.overlap_of_force(0.0, EFFECTIVE) == pytest.approx(overlap_of_radius(free), rel=1e-12)


def test_bridge_is_that_of_willett():
    """Compare with the form in half distances, F / (2 pi R gamma) = 1 / (1 + 2.1 S + 10 S^2).

    There S is half the gap times sqrt(R / V). A wall is a sphere of endless radius: at touch it
    pulls by 4 pi R gamma.
    """
    volume = 1e-12
    pair, wall = laws_of(material_with(f"liquid-bridge 0.073 {volume}"))
    gap = 4e-5
    half = gap / 2 * np.sqrt(RADIUS / volume)
    expected = -2 * np.pi * RADIUS * 0.073 / (1 + 2.1 * half + 10 * half**2)
    assert pair.normal_force(-gap, EFFECTIVE) == pytest.approx(expected, rel=1e-12)
    assert wall.normal_force(0.0, RADIUS) == pytest.approx(-4 * np.pi * RADIUS * 0.073, rel=1e-12)
    assert float(pair.rupture_distance(EFFECTIVE)) == pytest.approx(volume ** (1 / 3))


@pytest.mark.parametrize("ratio", [2.5, 4.0])
def test_cement_is_the_parallel_bond_of_its_paper(ratio):
    """Compare with k A, k A / q, k I, k J / q for k = E / (R1 + R2), and E / R at a wall."""
    words = f"cement-bond 2e9 0.4 3e6 {ratio}"
    laws = laws_of(material_with(words if ratio != 2.5 else words.removesuffix(" 2.5")))
    hertz = laws_of(GLASS)
    radius = 0.4 * RADIUS
    area = np.pi * radius**2
    inertia = np.pi * radius**4 / 4
    for law, smooth, effective, length in zip(
        laws, hertz, (RADIUS / 2, RADIUS), (2 * RADIUS, RADIUS), strict=True
    ):
        per_area = 2e9 / length
        gap = 3e6 / per_area
        assert law.rupture_distance(effective) == pytest.approx(gap, rel=1e-14)
        assert law.normal_force(-gap, effective) == pytest.approx(-3e6 * area, rel=1e-14)
        for overlap in (-0.5 * gap, 1e-6):
            depth = max(overlap, 0.0)
            kn = smooth.stiffness_normal(depth, effective) + per_area * area
            kt = smooth.stiffness_tangential(depth, effective) + per_area / ratio * area
            rolling = law.stiffness_rolling(overlap, effective)
            twisting = law.stiffness_twisting(overlap, effective)
            assert law.stiffness_normal(overlap, effective) == pytest.approx(kn, rel=1e-14)
            assert law.stiffness_tangential(overlap, effective) == pytest.approx(kt, rel=1e-14)
            assert rolling == pytest.approx(per_area * inertia, rel=1e-14)
            assert twisting == pytest.approx(per_area / ratio * 2 * inertia, rel=1e-14)
            force = law.normal_force(overlap, effective)
            assert law.overlap_of_force(force, effective) == pytest.approx(overlap, rel=1e-13)


def touching_pair(model, overlap, friction=0.5):
    """Return two spheres along x with an overlap, m, and a second pair, all far from the walls."""
    side = 20 * RADIUS
    position = np.full((4, 3), side / 2)
    position[1, 0] += 2 * RADIUS - overlap
    position[2:, 1] += 4 * RADIUS
    position[3, 0] += 2 * RADIUS - 1e-6
    walls = np.array([0.0, side])
    return Sample(position, np.full(2, side), walls, friction, material=material_with(model))


@pytest.mark.parametrize("by_arrays", [False, True])
@pytest.mark.parametrize("model", COMPILED[1:])
def test_contact_acts_across_its_gap_once_it_has_formed(model, by_arrays, monkeypatch):
    """Part two spheres, let them come near again, and account for the energy at rupture."""
    if by_arrays:
        monkeypatch.setattr(moving_contacts, "forces_by_loop", forces_by_arrays)
    law = law_of(model)
    gap = float(rupture_distance(law, EFFECTIVE))
    contacts = MovingContacts(touching_pair(model, gap / 2), track_energy=True)
    separation = np.zeros((4, 6))

    def force_at(overlap):
        present = 2 * RADIUS - (contacts.position[1, 0] - contacts.position[0, 0])
        separation[1, 0] = present - overlap
        contacts.move(separation)
        return -contacts.load[0, 0]

    for overlap in (0.3 * gap, -0.2 * gap, -0.99 * gap):
        expected = law.normal_force(overlap, EFFECTIVE)
        # Round-off of a position over the stiffness.
        assert force_at(overlap) == pytest.approx(expected, abs=1e-6 * abs(expected))
    # The sample of this state has the contact, also after a change of its list of pairs.
    sample = contacts.sample()
    assert sample.network().n_contacts == 2
    assert MovingContacts(sample).touching == 2
    assert force_at(-1.01 * gap) == 0
    assert contacts.touching == 1
    energy = law.elastic_energy(-gap, EFFECTIVE)
    assert contacts.slipped == pytest.approx(energy, rel=1e-12)
    assert force_at(-0.5 * gap) == 0
    assert contacts.sample().network().n_contacts == 1
    assert force_at(0.01 * gap) != 0


@pytest.mark.parametrize("model", COMPILED)
def test_friction_bears_on_the_force_that_presses_the_surfaces(model):
    """Shear a pair far beyond its limit: mu times normal force and adhesion."""
    law = law_of(model)
    overlap = 1e-7
    sample = touching_pair(model, overlap, friction=0.4)
    contacts = MovingContacts(sample)
    shear = np.zeros((4, 6))
    shear[1, 1] = 1e-6
    contacts.move(shear)
    assert contacts.sliding == 1
    network = contacts.sample().network()
    pressed = friction_force(law, network.overlap[0], EFFECTIVE)
    size = np.linalg.norm(network.force_tangential[0])
    assert size == pytest.approx(0.4 * pressed, rel=1e-3)
    assert size > 0.4 * network.force_normal[0]
    assert friction_used(network, 0.4) == pytest.approx([1.0, 0.0], rel=1e-3)


@pytest.fixture(scope="module")
def packed():
    return replace(sample_of_network(modal.random_packing(60, seed=2, aspect=1.0), 0.3), study={})


def sticky(packed, model):
    """Return a packing with another contact model, without shear forces."""
    return replace(packed, material=material_with(model, young=6e9), shear=None)


@pytest.mark.parametrize("model", COMPILED)
def test_compiled_loop_is_that_of_numpy(packed, model, monkeypatch):
    """Compare energies too, after steps in which contacts slide, break and form."""
    moving = in_flight(
        sticky(packed, model), 0.2 * np.random.default_rng(1).standard_normal((60, 3))
    )
    runs = []
    for _ in range(2):
        motion = Dynamics(moving, track_energy=True)
        for _ in range(150):
            motion.step(2e-7)
        runs.append(motion.contacts)
        monkeypatch.setattr(moving_contacts, "forces_by_loop", forces_by_arrays)
    compiled, arrays = runs
    assert compiled.touching == arrays.touching
    # Round-off of the steps.
    assert compiled.load == pytest.approx(arrays.load, abs=1e-7 * compiled.mean_force)
    assert compiled.elastic_energy == pytest.approx(arrays.elastic_energy, rel=1e-8)
    assert compiled.slipped == pytest.approx(arrays.slipped, rel=1e-6)


@pytest.mark.parametrize("model", COMPILED)
def test_rested_written_and_read_it_is_in_balance_and_carries_a_wave(packed, model, tmp_path):
    path = tmp_path / "rested.sample.h5"
    start = sticky(packed, model)
    rested, state = relax(start)
    assert state.at_rest
    write_sample(path, rested)
    sample = read_sample(path)
    network = sample.network()
    assert network.matches(rested.network().fingerprint)
    again = sample_of_network(network, 0.3).network()
    assert np.array_equal(again.particle_i, network.particle_i)
    assert np.array_equal(again.overlap, network.overlap)
    shear = network.force_tangential
    assert again.force_tangential == pytest.approx(shear, abs=1e-12 * abs(shear).max())
    wave = modal.propagate(sample, 2e-5, nonlinear=True, motion=Pulse(1e-9, 5e4))
    assert wave.error < 1e-3
    assert wave.noise < 1e-2


def test_unstable_contacts_are_counted_and_have_no_stiffness():
    """Hold a contact between its largest pull and its rupture."""
    law = law_of("jkr 5")
    gap = float(rupture_distance(law, EFFECTIVE))
    pair = touching_pair("jkr 5", -0.999 * gap)
    assert law.stiffness_normal(-0.999 * gap, EFFECTIVE) < 0
    network = replace(pair, acting=np.array([True, True])).network()
    assert network.stiffness_normal[0] == 0
    assert network.force_normal[0] < 0
    assert network.study[UNSTABLE_CONTACTS] == 1
    assert pair.network().n_contacts == 1
    with refusal("acting_pairs"):
        replace(pair, acting=np.array([True])).network()
