"""What is computed of a packing is kept on it, by function and arguments, and nowhere else."""

import inspect

import pytest

import modal
from analysis.estimators.coherent import DECAY
from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities.velocity import coherent


@pytest.fixture(scope="module")
def crystal():
    return PackingData(modal.fcc(cells=(1, 1, 40)))


def test_each_set_of_arguments_is_computed_once_however_it_is_passed(crystal):
    calls = []

    @cached_on_packing
    def product(packing, factor, power=2.0, *, sign=1):
        calls.append((factor, power, sign))
        return sign * factor**power

    assert product(crystal, 3.0) == 9.0
    for same in (
        lambda: product(crystal, 3.0, 2.0),
        lambda: product(crystal, factor=3.0),
        lambda: product(crystal, power=2.0, factor=3.0, sign=1),
    ):
        assert same() == 9.0
    assert calls == [(3.0, 2.0, 1)]
    assert product(crystal, 3.0, power=1.0) == 3.0
    assert product(crystal, 3.0, sign=-1) == -9.0
    assert calls[1:] == [(3.0, 1.0, 1), (3.0, 2.0, -1)]


def test_packings_and_functions_share_nothing(crystal):
    first = cached_on_packing(lambda packing: object())
    second = cached_on_packing(lambda packing: object())
    other = PackingData(crystal.network)
    assert first(crystal) is first(crystal)
    assert first(crystal) is not first(other)
    assert first(crystal) is not second(crystal)


def test_none_is_a_result_and_an_error_is_not(crystal):
    calls = []

    @cached_on_packing
    def nothing(packing, fails=False):
        calls.append(fails)
        if fails:
            raise ValueError

    assert nothing(crystal) is nothing(crystal) is None
    for _ in range(2):
        with pytest.raises(ValueError):
            nothing(crystal, fails=True)
    assert calls == [False, True, True]


def test_the_default_and_its_value_are_one_entry(crystal):
    wave = coherent(crystal, "wave")
    assert wave is coherent(crystal, "wave", DECAY)
    assert wave is coherent(crystal, key="wave", decay=DECAY)
    assert wave is not coherent(crystal, "wave", decay=DECAY + 1)


def test_the_signature_and_the_name_are_those_of_the_function():
    assert list(inspect.signature(coherent).parameters)[1:] == ["key", "decay"]
    assert coherent.__name__ == "coherent"
    with pytest.raises(TypeError):
        coherent(PackingData(modal.fcc(cells=(1, 1, 6))), "wave", damping=5.0)


def test_a_linear_wave_that_is_at_hand_is_not_computed_again(crystal):
    wave = crystal.linear
    assert PackingData(crystal.network, linear_record=wave).linear is wave
    chain_alone = PackingData(crystal.network, every_particle=False)
    assert chain_alone.linear.particle_displacement is None
    assert (chain_alone.linear.chain_displacement == wave.chain_displacement).all()
