"""Tests of unequal stresses: reached or refused, stiffness along the larger one, K0."""

import numpy as np
import pytest

import modal
from modal.packing.sample import read_sample
from modal.preparation import unequal_stress
from modal.preparation.mixture import MixtureWords
from modal.preparation.random_packing import pack, width_of
from modal.preparation.stress_path import StressPath
from modal.preparation.study import Study
from modal.tools.errors import InputError

WORDS = MixtureWords(periodic=True).texts()
PACKING = Study(0.3, 300, width_of(300, aspect=1.5), seed=1, **WORDS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the isotropic states of all tests, which are made once."""
    folder = tmp_path_factory.mktemp("unequal")
    pack(folder, PACKING, StressPath((1e4, 1e5)), lambda text: None)
    return folder


def load(folder, stresses, **options):
    """Return the samples of a path to stresses, Pa, in a folder."""
    files = pack(folder, PACKING, StressPath(tuple(stresses), **options), lambda text: None)
    return [read_sample(path) for _, path in files]


def compute_principal_stresses(sample):
    """Compute the normal stresses (3,), Pa, from contact forces and branches alone."""
    network = sample.network()
    force = network.force_normal[:, None] * network.normal - network.force_tangential
    return (network.branch * force).sum(axis=0) / network.cell_size.prod()


def test_stress_ratio_is_reached_and_stiffens_along_the_larger_stress(folder, monkeypatch):
    """Compare C_zz divided by the lateral moduli before and after loading to a ratio of 0.6.

    Loading goes three times as fast as by default.
    """
    monkeypatch.setattr(unequal_stress, "RATE_RATIO", 0.3)
    (isotropic,) = load(folder, [1e5])
    (sample,) = load(folder, [1e5], stress_ratio=0.6)
    assert sample.study["settled"]
    # The stresses settle to 3e-3, and the forces of the file miss one step.
    assert compute_principal_stresses(sample) == pytest.approx([6e4, 6e4, 1e5], rel=6e-3)
    anisotropy_before = compute_anisotropy(isotropic)
    assert abs(anisotropy_before - 1) < 0.1
    # Hertz alone: (1 / 0.6)^(1/3) = 1.19; lost lateral contacts add to it.
    assert compute_anisotropy(sample) > 1.1 * anisotropy_before
    # Shorter along z, wider across.
    assert sample.study["strain"][2] > 0 > sample.study["strain"][:2].max()


def compute_anisotropy(sample):
    """Compute the axial modulus divided by the mean lateral one."""
    stiffness = modal.elastic_moduli(sample.network()).stiffness
    return stiffness[2, 2] / np.mean([stiffness[0, 0], stiffness[1, 1]])


def test_ratio_beyond_the_strength_is_refused(folder, monkeypatch):
    """Load to 0.2, an angle of friction of 42 degrees, where spheres have 20 to 25.

    The packing flows at a ratio between 0.3 and 0.6, also at the inertial number of 1e-2 that
    makes this test ten times as fast.
    """
    monkeypatch.setattr(unequal_stress, "RATE_RATIO", 1.0)
    with pytest.raises(InputError) as error:
        load(folder, [1e5], stress_ratio=0.2)
    assert error.value.code == "packing_flows"
    reached_ratio = float(error.value.reason.split()[-1])
    assert 0.3 <= reached_ratio < 0.6


def test_k0_of_one_dimensional_compression(folder, printed):
    """Compress from 10 kPa to 1 MPa at constant width.

    Jaky's rule, K0 = 1 - sin(phi), gives 0.58 to 0.66 for angles of friction of 20 to 25 degrees.
    The accepted range lies around these; it is plausible, without a source.
    """
    first, second = load(folder, [1e5, 1e6], oedometric=True)
    for sample, axial in ((first, 1e5), (second, 1e6)):
        stress = compute_principal_stresses(sample)
        assert stress[2] == pytest.approx(axial, rel=6e-3)
        ratio = stress[:2].mean() / stress[2]
        assert sample.study["stress_ratio"] == pytest.approx(ratio, rel=0.01)
        assert sample.side == pytest.approx(first.side, rel=1e-12)
    assert 0.4 < second.study["stress_ratio"] < 0.7
    stiffness = modal.elastic_moduli(second.network()).stiffness
    assert stiffness[2, 2] > 1.1 * max(stiffness[0, 0], stiffness[1, 1])
    words = "pack --spheres 300 --friction 0.3 --aspect 1.5 --periodic --stress 1e5 1e6"
    k0 = printed(*words.split(), "--oedometric", "-o", folder)["k0"]
    assert list(k0.values()) == [first.study["stress_ratio"], second.study["stress_ratio"]]
