"""Measures of a case against known answers: standing waves, power laws, stated numbers, columns."""

import re
from dataclasses import replace

import numpy as np
import pytest
from packings import frictionless, slender
from places import ROOT

from analysis.case import AbsentError, Case
from analysis.case_columns import of_one_producer
from analysis.case_measurement import measure_result
from analysis.estimators.fits import power_law
from analysis.estimators.layer_lattice import lattice_signals
from analysis.estimators.low_pass import THRESHOLDS
from analysis.estimators.resonances import standing_modes
from analysis.frame import frame_of, numbers
from analysis.packing_data import PackingData
from analysis.packing_state import why_unsettled
from analysis.quantities import QUANTITIES, passband, spectrum, velocity
from analysis.table import number
from modal.modes.eigenmodes import modes_of
from modal.modes.mode_set import ModeSet
from modal.packing.contact_law import GLASS
from modal.packing.crystal import column, fcc
from modal.packing.network import write_network
from modal.packing.sample import read_sample, sample_of_network
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError
from modal.waves.propagate import propagate
from modal.waves.signals import write_signals


@pytest.fixture(scope="module")
def crystal():
    return PackingData(fcc(cells=(1, 1, 200)))


def test_standing_waves_of_a_crystal_are_its_pure_modes():
    """Without disorder one mode bears each standing wave, at the exact lattice's frequency."""
    network = fcc(cells=(1, 1, 40))
    modes = modes_of(LinearSystem.of(network), all=True)
    found = standing_modes(modes.frequency, modes.shapes()[:, :, 2], network)
    exact = PackingData(network).lattice.eigenmodes()[0][:10] / (2 * np.pi)
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
    noise = np.exp(0.05 * np.random.default_rng(2).standard_normal((400, 4)))
    laws = [power_law(x, 3 * x**0.4 * draw) for draw in noise]
    seen, stated = np.array([(law.exponent, law.error) for law in laws]).T
    # The mean square of the stated errors is the variance of the exponents; 400 draws: 15 %.
    assert np.sqrt((stated**2).mean()) == pytest.approx(np.std(seen), rel=0.15)
    assert np.isnan(power_law(x[:1], x[:1]).exponent)


def test_crystal_from_its_network_alone(crystal):
    """The linear wave stands in for a run; the short cell has one column alone."""
    chain, band = crystal.lattice, passband.passband(crystal)
    assert crystal.affine_velocity == pytest.approx(chain.velocity, rel=1e-6)
    mean, scatter = velocity.columns(crystal, "linear")
    assert mean == pytest.approx(chain.velocity, rel=0.015)
    assert np.isnan(scatter)  # of one column none is known
    for of_run in (velocity.longest, passband.edges):
        with pytest.raises(AbsentError):
            of_run(crystal, "yade")
    low = [plateau.value for plateau in band.low_pass]
    order = np.argsort(THRESHOLDS)
    assert (np.diff(np.array(low)[order]) <= 0).all()  # a higher threshold passes less
    assert low[0] == pytest.approx(chain.low_pass_frequency, rel=0.01)


def test_crystal_is_found_from_the_packing_not_from_its_number():
    """An FCC crystal called case 30 has a theory; a random packing called case 2 has none."""
    packing = frictionless()
    rng = np.random.default_rng(1)
    shaken = fcc(cells=(2, 2, 12))
    shake = 1e-2 * shaken.radius[0] * rng.normal(size=shaken.position.shape)
    shaken = shaken.unchecked(position=shaken.position + shake)
    for network, crystal in (
        (fcc(cells=(1, 1, 200)), True),
        (fcc(1e7, (2, 2, 12)), True),
        (packing, False),
        (column(9), False),  # layers of equal distance, but of straight springs
        (shaken, False),
    ):
        m = PackingData(network, case=Case("case30", None, {}))
        assert m.crystal == crystal
        if not crystal:
            with pytest.raises(InputError) as refused:
                _ = m.lattice
            assert refused.value.code == "absent"


@pytest.mark.parametrize(
    "value, error, text",
    [
        (539.153, 0.62, "539.2 ± 0.6"),
        (1226.7, 9.4, "1227 ± 9"),
        (22.4263, 0.0961, "22.4 ± 0.1"),
        (215.352612, 3e-9, "215.4"),
        (107072.0, np.nan, "107072"),
        (np.nan, np.nan, ""),
    ],
)
def test_no_digit_beyond_the_error(value, error, text):
    assert number(value, error) == text


@pytest.fixture(scope="module")
def two_producers():
    """FCC at three stresses, one of them with a YADE record 10 % slower than its springs."""
    soft, middle, stiff = (fcc(stress, (1, 1, 100)) for stress in (1e4, 1e5, 1e6))
    lattice = PackingData(middle).lattice
    time = np.arange(0, middle.length / lattice.velocity, 5e-7)
    slow = replace(lattice, mass=lattice.mass / 0.81)
    record = replace(lattice_signals(slow, time), producer="yade")
    return [PackingData(soft), PackingData(middle, [record]), PackingData(stiff)]


def test_no_exponent_through_two_producers(two_producers):
    """A single YADE record among linear waves: its own column, and Hertz's exponent without it.

    For a crystal it is 1/6 and what the overlap does to the distances, 2e-3 (Eq. 6).
    """
    middle = two_producers[1]
    run, linear = (velocity.first_peak(middle, key).value for key in ("yade", "linear"))
    assert run == pytest.approx(0.9 * linear, rel=1e-2)
    rows = [replace(measure_result(m), name=str(k)) for k, m in enumerate(two_producers)]
    frame, columns = frame_of(rows), ("v_p_first_peaks_{record}_m_per_s", "{record}")
    _, name, producer = of_one_producer(frame["record"], *columns)
    law = power_law(frame["stress"], numbers(frame, name))
    assert producer == "linear" and law.exponent == pytest.approx(1 / 6, abs=2e-3)
    # One case is no law.
    assert np.isnan(
        power_law(frame["stress"], numbers(frame, columns[0].format(record="yade"))).exponent
    )


def test_modes_are_pure_up_to_a_frequency_that_the_list_must_pass(two_producers):
    """One pure mode a resonance, V_P / 2 L apart: the chain's chi_z is half of these numbers."""
    network, lattice = two_producers[1].network, two_producers[1].lattice
    modes = some([1e3, 2e3, 4e4, 9e5], [1.9, 1.84, 1.7, 0.6]), some([1e3, 9e5], [1.9, 1.9])
    found, ends = (
        PackingData(network, case=Case("case06", None, {}, contents={"modes": list_}))
        for list_ in modes
    )
    last, apart = spectrum.last_pure(found), lattice.velocity / 2 / network.length
    assert (last.value, last.error) == pytest.approx((2e3, apart), rel=0.01)
    with pytest.raises(AbsentError):
        spectrum.last_pure(ends)


def some(frequency, chi):
    zero = np.zeros(len(frequency))
    return ModeSet(np.array(frequency), zero, np.array(chi), np.array(chi) / 2, zero)


def with_modes(modes, band):
    contents = {"modes": modes, "band.modes": band}
    return PackingData(frictionless(), case=Case("case06", None, {}, contents=contents))


def test_modes_that_two_lists_share_count_once():
    """Join a list of the lowest modes with one of all modes to 20 kHz.

    Frequencies of one mode differ in the last digits, because two searches have found them.
    """
    lowest, every = [1e3, 2e3, 9.5e3], [1e3 * (1 - 1e-10), 2e3, 9.5e3 * (1 + 1e-10), 1.6e4, 1.9e4]
    every = some(every, np.array(every) / 2e4)
    m = with_modes(some(lowest, np.array(lowest) / 2e4), every)
    largest = spectrum.largest_chi(m, 0, 1e4, chain=False)
    assert largest == (pytest.approx(0.475), "3 modes, 1.00-9.50 kHz")
    # Of the chain, half of it here; of the modes that there are above a lower end, not all.
    assert spectrum.largest_chi(m, 0, 1e4)[0] == pytest.approx(0.475 / 2)
    assert spectrum.largest_chi(m, 1.5e4, np.inf)[1] == "2 modes, 16.00-19.00 kHz"
    # Of 0.4 and 0.475, whose standard error is half their gap.
    mean = spectrum.mean_chi(m, 1.5e4, np.inf)
    assert (mean.value, mean.error) == pytest.approx((0.4375, 0.0375))
    with pytest.raises(AbsentError):
        spectrum.mean_chi(m, 1.7e4, np.inf)
    first = [1e3 * (1 - 2e-10), *lowest[1:]]  # now the short list begins first
    m = with_modes(some(first, first), every)
    assert spectrum.largest_chi(m, 0, np.inf)[1] == "5 modes, 1.00-19.00 kHz"
    assert [len(f) for f, _, _ in spectrum.chi_lists(m)] == [3, 2]


def test_a_run_that_is_the_linear_wave_does_not_differ_from_it(tmp_path):
    network = slender()
    write_network(tmp_path / "case06.network.h5", network)
    own = propagate(network, 2e-4, interval=1e-6).signals
    write_signals(tmp_path / "case06.signals.h5", replace(own, producer="yade"))
    m = PackingData.of(Case("case06", tmp_path))
    assert QUANTITIES["yade_less_linear_layers"].measure(m) < 1e-6  # the record is that very wave


@pytest.fixture(scope="module")
def sample():
    """At rest under 1 kPa: one of 100 kPa, its spheres softer by 100."""
    found = sample_of_network(frictionless(), 0.4)
    soft = replace(GLASS, young=1e-2 * GLASS.young)
    return replace(found, material=soft, shear=None, study={"stress": 1e3, "mu_comp": 0.4})


def test_a_state_is_marked_in_its_label_unless_at_rest_under_its_stress(sample):
    """Shaken: every centre moved by 3 % of the median overlap; forces change by as much."""
    network, rng = sample.network(), np.random.default_rng(2)
    shake = 3e-2 * np.median(network.overlap) * rng.standard_normal(sample.position.shape)
    moved = sample.position + shake
    moved[:, :2] %= sample.side
    for state, marked in ((network, False), (replace(sample, position=moved).network(), True)):
        assert ("not settled" in PackingData(state).label) == marked
    assert why_unsettled(network, 1e3) == why_unsettled(network) == ""  # on target, without one
    assert re.search("stress (1.0|0.9)", why_unsettled(network, 1.01e3))


def test_crystal_is_settled_without_its_lateral_stress():
    """Its walls, not its sides, have the stated stress: 4.5 % less between the layers of 20."""
    m = PackingData(fcc(cells=(2, 2, 20)))
    assert m.unsettled == "" and "settled" not in m.label


@pytest.mark.parametrize("name, marked", [("mu0.4_1kPa", True), ("mu0_1kPa", False)])
def test_states_of_this_repository(name, marked):
    """The 1 kPa state of friction 0.4 is compared with the paper's 3.84; it has not settled."""
    path = ROOT / "results" / "samples" / f"{name}.sample.h5"
    assert bool(why_unsettled(read_sample(path).network(), 1e3)) == marked
