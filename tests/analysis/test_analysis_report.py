"""Figures, also from their CSV, structure factor, effective medium, coherent wave, plateau."""

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
    read_structure,
    standing_waves,
    structure_factor,
    write_structure,
)
from analysis.figures.picture import Panel, Picture, read_picture, write_picture
from modal.packing.crystal import fcc
from modal.packing.network import write_network
from modal.packing.state import affine_stiffness, affine_velocity
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.operator import ContactOperator


@pytest.fixture(scope="module")
def packing():
    return slender()


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The figures that a crystal without modes has, by the command line."""
    folder, output = tmp_path_factory.mktemp("products"), tmp_path_factory.mktemp("figures")
    write_crystal(folder, "case02")
    for name in ("signals_stress", "space_time", "dispersion", "samples"):
        network = str(folder / "case02.network.h5")
        assert main(["figure", name, network, "-o", str(output)]) == 0
    return output


def test_every_figure_is_redrawn_from_its_csv(made, tmp_path):
    drawn = sorted(made.glob("*.png"))
    assert len(drawn) == 4
    for png in drawn:
        assert main(["figure", str(png.with_suffix(".csv")), "-o", str(tmp_path)]) == 0
        assert (tmp_path / png.name).read_bytes() == png.read_bytes(), png.name


def test_random_case_without_a_run(packing, tmp_path):
    """`measure --keep` makes what is missing; figures need no YADE run."""
    write_network(tmp_path / "case06.network.h5", packing)
    network = str(tmp_path / "case06.network.h5")
    kept = ["measure", network, "--keep", str(tmp_path)]
    assert main([*kept, "--quantities", "gain", "excess_peak", "ioffe_regel"]) in (0, 3)
    assert len(list(tmp_path.iterdir())) == 4
    for name in ("natural_frequencies", "gain_cases", "signals", "dispersion"):
        assert main(["figure", name, network, "-o", str(tmp_path)]) == 0
        assert (tmp_path / f"case06.{name}.png").is_file()


def test_picture_survives_its_file(tmp_path):
    panel = Panel("x (m)", "y (s)", 'a, "b"', xlim=(0, 1), yscale="log")
    panel.line([1 / 3, np.nan], [2, 3], "line", ls="--")
    panel.add("map", np.linspace(0, 1, 4), np.array([1.0, 2.0]), np.arange(8.0), cmap="gray")
    write_picture(tmp_path / "a.csv", Picture([panel], columns=2))
    write_picture(tmp_path / "b.csv", read_picture(tmp_path / "a.csv"))
    assert (tmp_path / "a.csv").read_text() == (tmp_path / "b.csv").read_text()
    (tmp_path / "c.csv").write_text("not,a,figure\n")
    with refusal("figure", "c.csv"):
        read_picture(tmp_path / "c.csv")


def test_mean_strain_is_exact_for_the_crystal():
    assert velocity_of_contacts(fcc(cells=(2, 2, 30))) == pytest.approx(CHAIN.velocity, rel=1e-9)


def test_affine_stiffness_is_the_energy_of_a_stretch(packing):
    """u_z = z on every sphere, none turned: u K u of the contacts between spheres, walls left out.

    By the matrix, whose springs are not those of the formula; both are sums of the same terms.
    """
    inner = packing.with_contacts(np.flatnonzero(~packing.with_wall))
    u = np.zeros((packing.n_particles, 6))
    u[:, 2] = packing.position[:, 2]
    energy = u.ravel() @ (stiffness_matrix(inner) @ u.ravel())
    assert affine_stiffness(packing).sum() == pytest.approx(energy, rel=1e-9)


def test_affine_velocity_of_a_crystal_counts_its_ends():
    """n layers weigh as n and stretch as n - 1: sqrt(1 - 1/n) of the velocity in the bulk."""
    for layers in (30, 60):
        bulk = affine_velocity(fcc(cells=(2, 2, layers))) / np.sqrt(1 - 1 / layers)
        assert bulk == pytest.approx(CHAIN.velocity, rel=1e-9)


def test_structure_factor_against_the_modes(packing, tmp_path):
    """Moments of the frequency over S_r are sums over the modes of a dense solution."""
    orders = np.array([1, 2, 5])
    found = structure_factor(packing, orders, resolution=2e3)
    operator = ContactOperator(packing, mass_scaled=True)
    square, vector = np.linalg.eigh(operator.apply(np.eye(operator.shape[0])))
    weight = (vector.T @ standing_waves(packing, orders)) ** 2
    frequency = np.sqrt(np.maximum(square, 0)) / (2 * np.pi)
    step = found.frequency[1] - found.frequency[0]
    assert found.power.min() > -1e-9
    for n in range(len(orders)):
        # Share of the modes between two frequencies, which lie between points of the grid, blurred
        # by the same near-Gaussian: the sum of its distribution functions. The kernel is not quite
        # a Gaussian, hence 1.5 %.
        sigma = found.resolution / 2.3548
        for low, high in ((10200, 30200), (30200, 80200), (80200, 150200)):
            inside = ndtr((high - frequency) / sigma) - ndtr((low - frequency) / sigma)
            part = found.power[n, (found.frequency > low) & (found.frequency < high)].sum() * step
            assert part == pytest.approx(weight[:, n] @ inside, abs=0.015)
    write_structure(tmp_path / "a.structure.h5", found)
    again = read_structure(tmp_path / "a.structure.h5")
    assert np.array_equal(again.power, found.power) and again.resolution == found.resolution


def test_structure_factor_ridge_is_the_crystals_dispersion():
    network = fcc(cells=(1, 1, 60))
    orders = np.array([5, 20, 40])
    peak, width = structure_factor(network, orders, resolution=1e3).ridge()
    chain = LayerLattice.of_network(network)
    exact = chain.eigenmodes()[0][orders - 1] / (2 * np.pi)
    assert peak == pytest.approx(exact, rel=3e-3)
    assert np.nanmax(width) < 500  # half a resolution: a mode has no width


def test_standing_waves_are_unit_vectors(packing):
    waves = standing_waves(packing, np.array([1, 7]))
    assert (waves**2).sum(axis=0) == pytest.approx(1)
    along = (waves / np.sqrt(mass_diagonal(packing))[:, None]).reshape(-1, 6, 2)
    assert not along[:, [0, 1, 3, 4, 5]].any()


@pytest.mark.parametrize("passages", [0.8, 1.0, 1.3])
def test_coherent_wave_of_the_exact_chain(passages):
    """Phase velocity to 0.1 %, group velocity to 1 % up to 0.8 of the band edge."""
    found = coherent_wave(record(passages, 2e-7), LENGTH)
    f = found.frequency[1:]
    inside = f < 0.8 * CHAIN.low_pass_frequency
    half = np.arcsin(f[inside] / CHAIN.low_pass_frequency)
    phase, group = found.phase_velocity[1:][inside], found.group_velocity[1:][inside]
    assert phase == pytest.approx(CHAIN.velocity * np.sin(half) / half, rel=1e-3)
    assert group == pytest.approx(CHAIN.velocity * np.cos(half), rel=1e-2)


@pytest.mark.parametrize("passages", [1.0, 1.3, 1.73, 1.95, 4.0])
def test_coherent_wave_does_not_see_the_reflection(passages):
    """The exact lattice, however long the record: cut by its own speed, not by a given one.

    A record of one passage is 0.016 % off, by its window; what the reflection adds must stay below
    that, twice 0.016 % in all.
    """
    found, _ = longest_waves(coherent_wave(record(passages, 5e-7), LENGTH))
    assert found == pytest.approx(CHAIN.velocity, rel=3.2e-4)
    reversed_wall = record(passages, 5e-7, amplitude=-2.5e-9)
    again, _ = longest_waves(coherent_wave(reversed_wall, LENGTH))
    assert again == pytest.approx(found, rel=1e-9)
