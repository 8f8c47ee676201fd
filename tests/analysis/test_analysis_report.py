"""Figures, also from their CSV, structure factor, effective medium, coherent wave, plateau."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from exact_crystal import CHAIN, LENGTH, record, write_crystal
from packings import slender
from refusals import refusal
from scipy.special import ndtr

from analysis.__main__ import main
from analysis.estimators.coherent import coherent_wave, longest_waves
from analysis.estimators.effective_medium import velocity_of_contacts
from analysis.estimators.layer_lattice import LayerLattice
from analysis.estimators.structure_factor import (
    StructureFactor,
    read_structure,
    standing_waves,
    structure_factor,
    write_structure,
)
from analysis.figures.picture import Panel, Picture, read_picture, write_picture
from modal.packing.crystal import fcc
from modal.packing.network import Network, write_network
from modal.packing.state import affine_stiffness, affine_velocity
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.operator import ContactOperator


@pytest.fixture(scope="module")
def packing() -> Network:
    return slender()


FIGURES = ["signals_stress", "space_time", "dispersion", "samples"]
"""Figures that a crystal without modes has."""


@pytest.fixture(scope="module")
def figures(tmp_path_factory) -> Path:
    """Return the folder of a crystal's figures, drawn by the command line."""
    products = tmp_path_factory.mktemp("products")
    write_crystal(products, "case02")
    network = str(products / "case02.network.h5")
    folder = tmp_path_factory.mktemp("figures")
    for name in FIGURES:
        assert main(["figure", name, network, "-o", str(folder)]) == 0
    return folder


@pytest.mark.parametrize("name", FIGURES)
def test_figure_is_redrawn_from_its_csv(name, figures, tmp_path):
    assert main(["figure", str(figures / f"case02.{name}.csv"), "-o", str(tmp_path)]) == 0
    drawn = (tmp_path / f"case02.{name}.png").read_bytes()
    assert drawn == (figures / f"case02.{name}.png").read_bytes()


@pytest.fixture(scope="module")
def random_case(tmp_path_factory) -> Path:
    """Return a random packing without a run, beside the spectra that `measure --keep` makes."""
    folder = tmp_path_factory.mktemp("random")
    network = folder / "case06.network.h5"
    write_network(network, slender())
    command = ["measure", str(network), "--keep", str(folder)]
    assert main([*command, "--quantities", "gain", "excess_peak", "ioffe_regel"]) in (0, 3)
    return network


def test_missing_spectra_are_kept(random_case):
    assert len(list(random_case.parent.glob("case06.*.h5"))) == 4


@pytest.mark.parametrize("name", ["natural_frequencies", "gain_cases", "signals", "dispersion"])
def test_figure_needs_no_run(name, random_case, tmp_path):
    assert main(["figure", name, str(random_case), "-o", str(tmp_path)]) == 0
    assert (tmp_path / f"case06.{name}.png").is_file()


def test_picture_survives_its_file(tmp_path):
    panel = Panel("x (m)", "y (s)", 'a, "b"', xlim=(0, 1), yscale="log")
    panel.line([1 / 3, np.nan], [2, 3], "line", ls="--")
    panel.add("map", np.linspace(0, 1, 4), np.array([1.0, 2.0]), np.arange(8.0), cmap="gray")
    write_picture(tmp_path / "a.csv", Picture([panel], columns=2))
    write_picture(tmp_path / "b.csv", read_picture(tmp_path / "a.csv"))
    assert (tmp_path / "a.csv").read_text() == (tmp_path / "b.csv").read_text()


def test_table_that_is_no_figure_is_refused(tmp_path):
    (tmp_path / "c.csv").write_text("not,a,figure\n")
    with refusal("figure", "c.csv"):
        read_picture(tmp_path / "c.csv")


def test_mean_strain_is_exact_for_the_crystal():
    assert velocity_of_contacts(fcc(cells=(2, 2, 30))) == pytest.approx(CHAIN.velocity, rel=1e-9)


def test_affine_stiffness_is_the_energy_of_a_stretch(packing):
    """Compare with u K u for u_z = z and no rotation, by contacts between spheres alone.

    The matrix does not use the formula's springs; both are sums of the same terms.
    """
    inner = packing.with_contacts(np.flatnonzero(~packing.with_wall))
    u = np.zeros((packing.n_particles, 6))
    u[:, 2] = packing.position[:, 2]
    energy = u.ravel() @ (stiffness_matrix(inner) @ u.ravel())
    assert affine_stiffness(packing).sum() == pytest.approx(energy, rel=1e-9)


@pytest.mark.parametrize("layers", [30, 60])
def test_affine_velocity_of_a_crystal_counts_its_ends(layers):
    """Find sqrt(1 - 1/n) of the velocity in the bulk: n layers weigh as n, stretch as n - 1."""
    bulk_velocity = affine_velocity(fcc(cells=(2, 2, layers))) / np.sqrt(1 - 1 / layers)
    assert bulk_velocity == pytest.approx(CHAIN.velocity, rel=1e-9)


ORDERS = np.array([1, 2, 5])
"""Orders of the standing waves whose structure factor is compared."""


@pytest.fixture(scope="module")
def structure(packing) -> StructureFactor:
    """Return the structure factor of the packing."""
    return structure_factor(packing, ORDERS, resolution=2e3)


class StandingWavesInModes(NamedTuple):
    """Frequencies (k,), Hz, of all modes, and the weight (k, orders) of standing waves in each."""

    frequency: np.ndarray
    weight: np.ndarray


@pytest.fixture(scope="module")
def dense_modes(packing) -> StandingWavesInModes:
    """Solve for all modes by a dense solver."""
    operator = ContactOperator(packing, mass_scaled=True)
    square, vector = np.linalg.eigh(operator.apply(np.eye(operator.shape[0])))
    weight = (vector.T @ standing_waves(packing, ORDERS)) ** 2
    return StandingWavesInModes(np.sqrt(np.maximum(square, 0)) / (2 * np.pi), weight)


def test_structure_factor_is_not_negative(structure):
    assert structure.power.min() > -1e-9


@pytest.mark.parametrize("index", range(len(ORDERS)), ids=ORDERS.tolist())
@pytest.mark.parametrize(
    ("low", "high"), [(10200, 30200), (30200, 80200), (80200, 150200)], ids=str
)
def test_structure_factor_is_a_sum_over_modes(index, low, high, structure, dense_modes):
    """Compare the share of the modes between two frequencies, which lie off the grid.

    The modes are blurred by the near-Gaussian of the structure factor, here by differences of its
    distribution function. The kernel is not quite a Gaussian, hence 1.5 %.
    """
    deviation = structure.resolution / np.sqrt(8 * np.log(2))
    below_high = ndtr((high - dense_modes.frequency) / deviation)
    below_low = ndtr((low - dense_modes.frequency) / deviation)
    step = structure.frequency[1] - structure.frequency[0]
    inside = (structure.frequency > low) & (structure.frequency < high)
    share = structure.power[index, inside].sum() * step
    assert share == pytest.approx(
        dense_modes.weight[:, index] @ (below_high - below_low), abs=0.015
    )


def test_structure_factor_survives_its_file(structure, tmp_path):
    write_structure(tmp_path / "a.structure.h5", structure)
    read = read_structure(tmp_path / "a.structure.h5")
    assert np.array_equal(read.power, structure.power)
    assert read.resolution == structure.resolution


def test_ridge_of_the_structure_factor_is_the_crystals_dispersion():
    network = fcc(cells=(1, 1, 60))
    orders = np.array([5, 20, 40])
    peak, width = structure_factor(network, orders, resolution=1e3).ridge()
    frequencies = LayerLattice.of_network(network).eigenmodes()[0] / (2 * np.pi)
    assert peak == pytest.approx(frequencies[orders - 1], rel=3e-3)
    assert np.nanmax(width) < 500  # half a resolution: a mode has no width


def test_standing_waves_are_unit_vectors(packing):
    waves = standing_waves(packing, np.array([1, 7]))
    assert (waves**2).sum(axis=0) == pytest.approx(1)


def test_standing_waves_move_spheres_along_z_alone(packing):
    waves = standing_waves(packing, np.array([1, 7]))
    displacement = (waves / np.sqrt(mass_diagonal(packing))[:, None]).reshape(-1, 6, 2)
    assert not displacement[:, [0, 1, 3, 4, 5]].any()


@pytest.mark.parametrize("passages", [0.8, 1.0, 1.3])
def test_coherent_wave_of_the_exact_chain(passages):
    """Find phase velocity to 0.1 %, group velocity to 1 % up to 0.8 of the band edge."""
    wave = coherent_wave(record(passages, 2e-7), LENGTH)
    is_inside = wave.frequency < 0.8 * CHAIN.low_pass_frequency
    is_inside[0] = False  # at zero frequency there is no phase
    half_angle = np.arcsin(wave.frequency[is_inside] / CHAIN.low_pass_frequency)
    phase_velocity = CHAIN.velocity * np.sin(half_angle) / half_angle
    assert wave.phase_velocity[is_inside] == pytest.approx(phase_velocity, rel=1e-3)
    group_velocity = CHAIN.velocity * np.cos(half_angle)
    assert wave.group_velocity[is_inside] == pytest.approx(group_velocity, rel=1e-2)


PASSAGES = pytest.mark.parametrize("passages", [1.0, 1.3, 1.73, 1.95, 4.0])


@PASSAGES
def test_coherent_wave_does_not_see_the_reflection(passages):
    """Cut the record, however long, by the wave's own speed.

    A record of one passage is 0.016 % off, by its window; what the reflection adds must stay below
    that, twice 0.016 % in all.
    """
    velocity, _ = longest_waves(coherent_wave(record(passages, 5e-7), LENGTH))
    assert velocity == pytest.approx(CHAIN.velocity, rel=3.2e-4)


@PASSAGES
def test_coherent_wave_does_not_depend_on_the_sign_of_the_pulse(passages):
    velocity, _ = longest_waves(coherent_wave(record(passages, 5e-7), LENGTH))
    reverse_record = record(passages, 5e-7, amplitude=-2.5e-9)
    reverse_velocity, _ = longest_waves(coherent_wave(reverse_record, LENGTH))
    assert reverse_velocity == pytest.approx(velocity, rel=1e-9)
