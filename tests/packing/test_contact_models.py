"""Tests of contact models: force, energy, tangent, a moving contact, moduli, files."""

from dataclasses import replace

import numpy as np
import pytest
from changes import in_flight
from refusals import refusal
from scipy.integrate import quad
from scipy.optimize import brentq

import modal
from modal.__main__ import main
from modal.dem import contacts as moving_contacts
from modal.dem.forces_by_arrays import forces_by_arrays
from modal.dem.motion import Dynamics
from modal.packing.contact_law import GLASS, RADIUS
from modal.packing.contact_models import MODELS, laws_of
from modal.packing.contact_models.rough import TOUCH_1, TOUCH_2
from modal.packing.sample import Sample, read_sample, sample_of_network, write_sample
from modal.preparation.relax import relax

ROUGHNESS = 5e-7
WITH_NUMBERS = {
    "rough": f"rough {ROUGHNESS:g}",
    "dmt": "dmt 0.1",
    "jkr": "jkr 5",
    "liquid-bridge": "liquid-bridge 0.073 1e-12 20",
    "cement-bond": "cement-bond 1e9 0.5 1e5",
}
"""Name -> name and numbers of the models that need numbers."""
ACROSS_GAPS = ("jkr", "liquid-bridge", "cement-bond")


@pytest.fixture(params=MODELS)
def model(request):
    return WITH_NUMBERS.get(request.param, request.param)


def compiled(names):
    """Return parameters for tests that run a compiled loop: numba takes ten seconds a model."""
    quick = ("hertz-mindlin", "cement-bond")
    return [pytest.param(name, marks=() if name in quick else pytest.mark.slow) for name in names]


@pytest.fixture(params=compiled(name for name in MODELS if name not in ACROSS_GAPS))
def model_without_gaps(request):
    """Return a model whose contacts open where they have formed."""
    return WITH_NUMBERS.get(request.param, request.param)


@pytest.fixture(params=compiled(MODELS))
def compiled_model(request):
    """Return a model whose loop is compiled."""
    return WITH_NUMBERS.get(request.param, request.param)


def material_with(model, **constants):
    """Return glass with another contact model and other constants."""
    return replace(GLASS, contact_model=model, **constants)


def test_force_is_the_integral_of_its_stiffness_and_the_energy_that_of_the_force(model):
    """Integrate by adaptive quadrature from touch on, over all regimes of the rough contact."""
    law, _ = laws_of(material_with(model))
    is_adhesive = hasattr(law, "friction_force")
    ends = ROUGHNESS * np.array([0.1, 1.0, 3.0, 20.0, 50.0, 500.0])
    for radius in (RADIUS / 2, RADIUS):
        for end in ends:
            breaks = [TOUCH_1 * ROUGHNESS * 2**0.5, TOUCH_2 * ROUGHNESS * 2**0.5]
            points = [overlap for overlap in breaks if overlap < end] or None
            for integrand, integral in (
                (law.stiffness_normal, law.normal_force),
                (law.normal_force, law.elastic_energy),
            ):
                expected, _ = quad(
                    integrand, 0, end, (radius,), points=points, epsabs=0, epsrel=1e-12, limit=500
                )
                at_touch = 0.0
                if is_adhesive:
                    at_touch = integral(0.0, radius)
                change = integral(end, radius) - at_touch
                assert change == pytest.approx(expected, rel=1e-9, abs=0)
        force = law.normal_force(ends, radius)
        assert law.overlap_of_force(force, radius) == pytest.approx(ends, rel=1e-12, abs=0)
        if model.startswith(("jkr", "cement-bond")):
            continue
        # Mindlin's ratio, 2 (1 - nu) / (2 - nu).
        ratio = law.stiffness_tangential(ends, radius) / law.stiffness_normal(ends, radius)
        assert ratio == pytest.approx(2 * (1 - GLASS.poisson) / (2 - GLASS.poisson), rel=1e-12)


def test_rough_contact_is_that_of_its_authors_program():
    """Compare with the compiled expressions of `PairGranCMHistory` in geoLAMMPS.

    Rows have overlap, force, kn, kt and energy, two in each regime, for radii of 1 and 1.5 mm,
    G = 25 GPa, nu = 0.22, RMS 0.4 um.
    """
    young = 2 * 25e9 * 1.22
    poisson = 0.22
    law, wall = laws_of(material_with("rough 4e-7 3e-7", young=young, poisson=poisson))
    overlap, *expected = np.transpose(
        [
            (1e-7, 7.688136551317e-04, 1.991070140809e04, 1.744982820035e04, 2.141664214944e-11),
            (7e-7, 1.187004008340e-01, 4.391568048196e05, 3.848789974824e05, 2.314624348152e-08),
            (2e-6, 1.536010053334e00, 1.582877885082e06, 1.387241292544e06, 9.371098330928e-07),
            (1e-5, 2.764581573994e01, 4.589236681645e06, 4.022027653577e06, 1.020884104950e-04),
            (2e-5, 8.556524816676e01, 6.814441103695e06, 5.972206809980e06, 6.497928540328e-04),
            (1e-4, 1.028546335898e03, 1.561010141968e07, 1.368076304197e07, 4.066757744298e-02),
        ]
    )
    quantities = "normal_force", "stiffness_normal", "stiffness_tangential", "elastic_energy"
    for name, values in zip(quantities, expected, strict=True):
        assert getattr(law, name)(overlap, 0.6e-3) == pytest.approx(values, rel=2e-12, abs=0), name
    assert wall.roughness == pytest.approx(5e-7, rel=1e-12, abs=0)
    # Hertz is right within some per cent where alpha = S R* / a0^2 is below 0.05, of his radius a0
    # (Greenwood, Johnson, Matsubara 1984); farther below it would be rough for longer than need be.
    smooth, _ = laws_of(material_with("hertz-mindlin", young=young, poisson=poisson))
    deep = smooth.overlap_of_force(law.normal_force(TOUCH_2 * law.roughness, 0.6e-3), 0.6e-3)
    assert 0.04 < law.roughness / deep < 0.05


def test_two_spheres_bounce_with_their_energy_and_at_the_time_of_the_law(model_without_gaps):
    """Compare depth and duration with those from the energy and by quadrature."""
    side = 20 * RADIUS
    approach = 0.05
    position = np.full((2, 3), side / 2)
    position[:, 0] += [-RADIUS, RADIUS]
    velocity = np.array([[approach / 2, 0, 0], [-approach / 2, 0, 0]])
    sample = Sample(
        position,
        np.full(2, side),
        np.array([0.0, side]),
        0.3,
        material=material_with(model_without_gaps),
    )
    law = sample.laws[0]
    mass, _ = sample.material.sphere(RADIUS)
    energy = mass * approach**2 / 4
    deepest = brentq(lambda d: law.elastic_energy(d, RADIUS / 2) - energy, 1e-12, 1e-3, xtol=1e-20)
    # With d = deepest (1 - x^2) the integrand has no pole at the largest overlap.
    time, _ = quad(
        lambda x: 2 * x * deepest
        / np.sqrt(4 / mass * (energy - law.elastic_energy(deepest * (1 - x * x), RADIUS / 2))),
        1e-9, 1,
    )  # fmt: skip
    motion = Dynamics(in_flight(sample, velocity))
    depth = 0.0
    energies = []
    opening_time = 0.0
    dt = time / 500
    for step in range(1500):
        before = motion.velocity[:, :3].copy()
        motion.step(dt)
        kinetic = 0.5 * mass * (before * motion.velocity[:, :3]).sum()
        energies.append(kinetic + motion.contacts.elastic_energy)
        depth = max(depth, 2 * RADIUS - abs(np.subtract(*motion.contacts.position[:, 0])))
        if not motion.contacts.touching and step > 10:
            opening_time = step * dt
            break
    assert np.ptp(energies) < 1e-4 * energy
    assert depth == pytest.approx(deepest, rel=1e-4, abs=0)
    assert opening_time == pytest.approx(2 * time, rel=5e-3, abs=0)
    assert motion.velocity[0, 0] == pytest.approx(-approach / 2, rel=1e-4)


def exponents(model, stresses):
    """Return the exponents of K and G as powers of the stress, between neighbouring stresses."""
    moduli = [
        modal.elastic_moduli(
            modal.fcc(stress, (2, 2, 4), material=material_with(model), periodic_z=True)
        )
        for stress in stresses
    ]
    values = np.log([(each.bulk_modulus, each.shear_modulus) for each in moduli])
    return np.diff(values, axis=0) / np.diff(np.log(stresses))[:, None]


def test_exponent_of_moduli_over_stress_is_that_of_the_law():
    """Find the exponent (a - 1) / a for a force proportional to d^a.

    The moduli of a crystal are proportional to its stiffness, except that its spacing shrinks by
    d / (2 R), 1e-4 for smooth spheres at 100 kPa. The exponent of rough spheres is 1.589 / 2.589
    while asperities touch and then falls to a third; with a roughness of 1e-7 m a crystal is past
    both transitions at 10 MPa.
    """
    assert exponents("linear", [1e4, 1e5]) == pytest.approx(0, abs=1e-4)
    assert exponents("hertz-mindlin", [1e4, 1e5]) == pytest.approx(1 / 3, abs=1e-3)
    rough = exponents("rough 1e-7", [1e1, 2e1, 1e4, 2e4, 1e6, 2e6, 1e8, 2e8])[::2].mean(axis=1)
    assert rough[0] == pytest.approx(1.5894 / 2.5894, abs=1e-3)
    assert (np.diff(rough[:3]) < 0).all()
    assert (rough[:3] > 1 / 3 - 1e-3).all()


def test_compiled_loop_is_that_of_numpy(compiled_model, monkeypatch):
    """Compare after 100 steps of sliding, opening and closing contacts, with rougher walls."""
    packed = modal.random_packing(60, seed=2, aspect=1.0)
    words = f"{compiled_model} 1e-6" if compiled_model.startswith("rough") else compiled_model
    material = material_with(words, young=6e9)
    bare = sample_of_network(packed, 0.1)
    bare = replace(bare, material=material, shear=None, study={})
    sample = in_flight(bare, 0.2 * np.random.default_rng(1).standard_normal((60, 3)))
    runs = []
    for _ in range(2):
        motion = Dynamics(sample)
        for _ in range(100):
            motion.step(2e-7)
        runs.append(motion.contacts)
        monkeypatch.setattr(moving_contacts, "forces_by_loop", forces_by_arrays)
    compiled, arrays = runs
    assert compiled.touching == arrays.touching
    assert compiled.sliding
    # Round-off of a hundred steps.
    assert compiled.load == pytest.approx(arrays.load, abs=1e-7 * compiled.mean_force)
    assert compiled.elastic_energy == pytest.approx(arrays.elastic_energy, rel=1e-9, abs=0)


def test_packed_relaxed_and_read_again_it_is_the_same_model(tmp_path, printed):
    """Read the model from the file of `pack`, relax the sample, and send a wave through it."""
    out = tmp_path / "rough"
    words = f"pack --spheres 60 --aspect 1 --stress 1e4 --contact-model rough 1e-6 -o {out}"
    assert main(words.split()) == 0
    (path,) = out.glob("10000Pa.sample.h5")
    sample = read_sample(path)
    assert sample.material.contact_model == "rough 1e-6"
    network = sample.network()
    law = sample.laws[0]
    pair = ~network.with_wall
    expected = law.stiffness_normal(network.overlap[pair], RADIUS / 2)
    assert network.stiffness_normal[pair] == pytest.approx(expected, rel=1e-12)
    assert sample_of_network(network, 0.0).material == sample.material
    with refusal("other_law"):
        sample_of_network(replace(network, study={}), 0.3)
    rested, _ = relax(replace(sample, friction=0.3))
    write_sample(tmp_path / "rested.sample.h5", rested)
    command = f"wave {tmp_path}/rested.sample.h5 --nonlinear --amplitude 1e-9 --duration 2e-5"
    assert printed(*command.split())["time_step_error"] < 1e-3


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("tabor", "contact_model"),
        ("jkr", "adhesion"),
        ("dmt 0.1 0.2 0.3", "adhesion"),
        ("dmt 1e5", "adhesion"),
        ("liquid-bridge 0.073", "liquid_bridge"),
        ("liquid-bridge 0.073 1e-12 95", "liquid_bridge"),
        ("jkr 0.1", "history_without_friction"),
        ("cement-bond 1e9 0.5", "cement_bond"),
        ("cement-bond 1e9 2 1e5", "cement_bond"),
        ("cement-bond 1e9 0.5 1e9", "cement_bond"),
        ("rough", "roughness"),
        ("rough 1e-6 none", "contact_model_numbers"),
        ("rough 1", "roughness"),
        ("linear 3", "contact_model_numbers"),
    ],
)
def test_wrong_models_are_refused_in_one_line(words, code, tmp_path, one_line):
    command = f"pack --spheres 60 --aspect 1 --stress 1e4 -o {tmp_path} --contact-model {words}"
    one_line(main, command.split(), code=code)
