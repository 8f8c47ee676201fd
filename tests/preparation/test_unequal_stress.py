"""Unequal stresses: reached or refused, stiffer along the larger one, K0 plausible."""

import numpy as np
import pytest

import modal
from modal.packing.sample import read_sample
from modal.preparation.random_packing import pack
from modal.tools.errors import InputError

GIVEN = {"spheres": 300, "friction": 0.3, "seed": 1, "aspect": 1.5, "periodic": True}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """With the isotropic states of all tests, which are made once."""
    made = tmp_path_factory.mktemp("unequal")
    pack(made, lambda text: None, stresses=[1e4, 1e5], **GIVEN)
    return made


def states(folder, stresses, **options):
    files = pack(folder, lambda text: None, stresses=stresses, **GIVEN, **options)
    return [read_sample(path) for _, path in files]


def principal(sample):
    """Normal stresses (3,), Pa, from contact forces and branches alone."""
    network = sample.network()
    force = network.force_normal[:, None] * network.normal - network.force_tangential
    return (network.branch * force).sum(axis=0) / network.cell_size.prod()


def test_stress_ratio_is_reached_and_stiffens_along_the_larger_stress(folder):
    """0.6: the springs' moduli follow, C_zz over the lateral ones, though the forces do alone."""
    (isotropic,) = states(folder, [1e5])
    (sample,) = states(folder, [1e5], stress_ratio=0.6)
    assert sample.study["settled"]
    # The stresses settle to 3e-3, and the forces of the file miss one step.
    assert principal(sample) == pytest.approx([6e4, 6e4, 1e5], rel=6e-3)
    before, after = (modal.elastic_moduli(s.network()).stiffness for s in (isotropic, sample))

    def along(stiffness):
        return stiffness[2, 2] / np.mean([stiffness[0, 0], stiffness[1, 1]])

    # Hertz alone: (1 / 0.6)^(1/3) = 1.19; lost lateral contacts add to it.
    assert along(after) > 1.1 * along(before)
    assert abs(along(before) - 1) < 0.1
    # Shorter along z, wider across.
    assert sample.study["strain"][2] > 0 > sample.study["strain"][:2].max()


def test_ratio_beyond_the_strength_is_refused_in_a_line(folder):
    """Friction 0.3 holds no 0.2: an angle of 42 degrees, where spheres have 20 to 25."""
    said = r"the packing fails .* lateral over axial stress is 0\.[345]"
    with pytest.raises(InputError, match=said):
        states(folder, [1e5], stress_ratio=0.2)


def test_k0_of_one_dimensional_compression(folder, printed):
    """From 10 kPa to 1 MPa at constant width.

    Jaky's rule, K0 = 1 - sin(phi), has 0.58 to 0.66 for angles of friction of 20 to 25 degrees. The
    range that is asked for lies around these; it is a plausible one, without a source of its own.
    """
    first, second = states(folder, [1e5, 1e6], oedometric=True)
    for sample, axial in ((first, 1e5), (second, 1e6)):
        stress = principal(sample)
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
