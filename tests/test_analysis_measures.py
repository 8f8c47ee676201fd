"""Measures of a case against known answers: standing waves, power laws, stated numbers, columns."""

import numpy as np
import pytest

from analysis.deviations import deviations
from analysis.measures import Measures
from analysis.paper import matching_case, stated, stated_range
from analysis.passband import THRESHOLDS
from analysis.products import Products
from analysis.standing import standing_modes
from analysis.stress import power_law
from modal.eigenproblem import Eigenproblem
from modal.gallery import column, fcc
from modal.modes import all_modes
from modal.network import write_network
from modal.random_packing import random_network
from modal.storage import InputError


@pytest.fixture(scope="module")
def crystal(tmp_path_factory):
    folder = tmp_path_factory.mktemp("products")
    write_network(folder / "case02.network.h5", fcc(1, 200))
    return Measures(Products("case02", folder))


def test_standing_waves_of_a_crystal_are_its_pure_modes():
    """Without disorder one mode bears each standing wave, at the exact chain's frequency."""
    network = fcc(1, 40)
    case = Products("case02", None)
    case.network = network
    modes = all_modes(Eigenproblem.of(network))
    found = standing_modes(modes, network)
    exact = case.chain.eigenmodes()[0][:10] / (2 * np.pi)
    assert found.frequency[:10] == pytest.approx(exact, rel=1e-6)
    # The wall springs are not rigid, so the modes are sines of a length that is about a layer
    # longer: what is missing grows as (r / layers)^2, 6 % at r = 5 of 40 layers.
    missing = 1 - found.share[:5]
    assert missing[4] < 0.08
    assert missing[3] / missing[1] == pytest.approx(4, rel=0.3)


def test_power_law_and_its_error():
    x = np.array([1.0, 10, 100, 1000])
    exact = power_law(x, 3 * x**0.4)
    assert (exact.exponent, exact.factor) == (pytest.approx(0.4), pytest.approx(3))
    assert exact.error < 1e-12
    rng, seen, stated_errors = np.random.default_rng(2), [], []
    for _ in range(400):
        law = power_law(x, 3 * x**0.4 * np.exp(0.05 * rng.standard_normal(4)))
        seen.append(law.exponent)
        stated_errors.append(law.error)
    # The mean square of the stated errors is the variance of the exponents; 400 draws: 15 %.
    assert np.sqrt(np.mean(np.square(stated_errors))) == pytest.approx(np.std(seen), rel=0.15)
    assert np.isnan(power_law(x[:1], x[:1]).exponent)


def test_crystal_from_its_network_alone(crystal):
    """The linear wave stands in for a run; all columns of a crystal are one."""
    chain = crystal.case.chain
    assert crystal.long_wave.value == pytest.approx(chain.velocity, rel=2e-3)
    assert crystal.band_edge == pytest.approx(chain.low_pass_frequency, rel=2e-3)
    assert crystal.effective[0] == pytest.approx(chain.velocity, rel=1e-6)
    assert crystal.columns.value == pytest.approx(chain.velocity, rel=0.015)
    assert crystal.columns.error < 1e-3 * chain.velocity
    assert np.isnan(crystal.dem_long_wave.value) and np.isnan(crystal.passband.of_dem[0].value)
    low = [plateau.value for plateau in crystal.low_pass]
    order = np.argsort(THRESHOLDS)
    assert (np.diff(np.array(low)[order]) <= 0).all()  # a higher threshold passes less
    assert low[0] == pytest.approx(chain.low_pass_frequency, rel=0.01)


def test_gain_peaks_midway_between_resonances(crystal):
    """1 / |cos kappa L| between rigid walls; the wall springs and the blur shift it a little."""
    assert crystal.gain_place == pytest.approx(0.5, abs=0.03)


def test_deviations_of_what_is_stated(crystal):
    rows = {row[1]: row for row in deviations([crystal])}
    assert rows["void ratio"][4].endswith("%") and abs(float(rows["void ratio"][4][:-1])) < 1
    assert rows["number of P resonances"][4] == "not measured"
    assert not any("DEM" in head for head in rows)
    assert stated("f_low_pass", 2) == 137.7 and stated("f_low_pass", 3) is None
    assert stated_range("slope", 30).text == "1.2 to 1.4" and stated_range("slope", 2) is None


def test_crystal_is_found_from_the_packing_not_from_its_number(tmp_path):
    """An FCC crystal called case 30 has a theory; a random packing called case 2 has none."""
    packing = random_network(150, 1e5, seed=3)
    rng = np.random.default_rng(1)
    shaken = fcc(2, 12)
    shaken.position = shaken.position + 1e-2 * shaken.radius[0] * rng.normal(
        size=shaken.position.shape
    )
    for network, crystal in (
        (fcc(1, 200), True),
        (fcc(2, 12, 1e7), True),
        (packing, False),
        (column(9), False),  # layers of equal distance, but of straight springs
        (shaken, False),
    ):
        case = Products("case30", tmp_path)
        case.network = network
        assert case.is_crystal == crystal
        if not crystal:
            with pytest.raises(InputError, match="no FCC crystal"):
                _ = case.chain


@pytest.mark.parametrize(
    "mu, stress, case",
    [(0.0, 1e5, 6), (0.4, 1e5, 30), (0.4, 1e7, 32), (0.2, 1e5, 22), (0.0, 2e5, None)],
)
def test_stated_numbers_follow_friction_and_stress(mu, stress, case, tmp_path):
    """Whatever the number of the case: the paper's void ratio is that of the same preparation."""
    assert matching_case(False, stress, mu) == case
    network = random_network(150, 1e5, seed=3)
    network.study |= {"stress": stress, "mu_comp": mu}
    named = Products("case07", tmp_path)
    named.network = network
    rows = [row for row in deviations([Measures(named)]) if row[1] == "void ratio"]
    assert [row[3] for row in rows] == ([f"{stated('void_ratio', case):.5g}"] if rows else [])
    assert bool(rows) == (stated("void_ratio", case) is not None)
    assert matching_case(True, stress, np.nan) == (None if case is None else 1 + (case - 1) % 4)
