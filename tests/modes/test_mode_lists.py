"""What a list of modes says of itself: empty, short of its count, with or without shapes."""

import json
from dataclasses import replace

import numpy as np
import pytest
from packings import disordered
from refusals import refusal

from modal.__main__ import main
from modal.modes.eigenmodes import modes_of
from modal.modes.mode_set import Choice, chi_z, read_modes, read_z_shapes, write_modes
from modal.packing import crystal as gallery
from modal.packing.network import write_network
from modal.solvers import lanczos
from modal.solvers.factor import Cost
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.linear_system import Limits, LinearSystem, frequency_of

EPS = np.finfo(float).eps


@pytest.mark.parametrize("options", [("--below", "10"), ("--between", "1", "2")])
@pytest.mark.parametrize("layers", [6, 30])
def test_an_interval_without_modes_is_an_empty_certified_list(tmp_path, printed, layers, options):
    """Ask below 10 Hz, where a crystal has no mode, by a dense solver and by a search."""
    source = tmp_path / "x.network.h5"
    product = tmp_path / "x.modes.h5"
    write_network(source, gallery.fcc(cells=(2, 2, layers)))
    output = printed("modes", source, *options, "-o", product)
    written = read_modes(product)
    assert output["frequency_hz"] == []
    assert output["certified"]
    assert output["missing"] == 0
    assert len(written.frequency) == 0
    assert written.attributes["certified"]


SHAPES = {
    "symmetry": (gallery.fcc(cells=(4, 3, 4)), {"all": True}, "symmetry 4x3"),
    "dense": (disordered((2, 2, 14)), {"all": True}, "dense"),
    "small": (disordered((2, 2, 5)), {"lowest": 4}, "dense"),
    "lowest": (disordered((2, 2, 27)), {"lowest": 7}, "solves by"),
    "many lowest": (disordered((2, 2, 27)), {"lowest": 200}, "dense"),
    "highest": (disordered((2, 2, 27)), {"highest": 5}, "products"),
    "interval": (disordered((2, 2, 27)), {"between": (5e3, 2e4)}, "solves by"),
    "slices": (disordered((2, 2, 27)), {"below": 2e4}, "solves by superlu"),
    "low end": (disordered((2, 2, 27)), {"below": 2e4}, "products"),
    "translations": (gallery.fcc(cells=(3, 4, 5)), {"all": True}, "symmetry 3x4"),
}
"""A packing, what is asked of it, and what the list must say of the way it was found."""


@pytest.mark.parametrize("path", SHAPES)
def test_mode_shapes_are_in_the_file(tmp_path, path, monkeypatch):
    """Check that shapes are orthonormal with M and solve K phi = omega^2 M phi, by every solver."""
    limits = Limits(dense=0 if path in ("interval", "slices", "low end") else 6000,
                    slice=10 if path == "slices" else 700)  # fmt: skip
    if path == "low end":  # factors are told to be dear
        monkeypatch.setattr("modal.modes.effort.near_a_shift", lambda *_: Cost(0.0, 1e19, 0.0))
    network, question, solver_name = SHAPES[path]
    system = LinearSystem.of(
        network,
        translations_only=path == "translations",
        solver="superlu" if path == "slices" else None,
        limits=limits,
    )
    write_modes(tmp_path / "x.modes.h5", modes_of(system, **question))
    written = read_modes(tmp_path / "x.modes.h5")
    assert solver_name in written.attributes["solver"]
    count = len(written.frequency)
    assert count > 3
    assert written.mode_shape.shape == (count, network.n_particles, 6)
    dof = 3 if path == "translations" else 6
    mass = mass_diagonal(network, dof)
    K = stiffness_matrix(network, dof)
    phi = written.mode_shape[:, :, :dof].reshape(count, -1).T
    # Vectors of Lanczos are orthogonal as far as their clusters are resolved, 1e-10 over gaps.
    assert phi.T @ (mass[:, None] * phi) == pytest.approx(np.eye(count), abs=1e-6)
    square = (2 * np.pi * written.frequency) ** 2
    scale = np.sqrt(mass)[:, None]
    misfit = np.linalg.norm((K @ phi) / scale - square * (phi * scale), axis=0)
    assert (misfit <= 1e-5 * square + 1e-12 * square.max() * len(mass)).all()
    # In units of the mode's own omega^2; round-off of product and shapes: some eps |A| in each.
    floor = 20 * np.sqrt(system.size) * EPS * system.row_sum_bound + 1e-6 * misfit
    assert (abs(written.residual * square - misfit) <= floor).all()


def test_shapes_above_the_limit_are_left_out_with_a_word(tmp_path):
    """Leave shapes out of the file if they need one byte more than the limit.

    216 modes of 36 spheres take 373 kB.
    """
    system = LinearSystem.of(gallery.fcc(cells=(3, 3, 4)), limits=Limits(shapes=8 * 216**2 - 1))
    write_modes(tmp_path / "x.modes.h5", modes_of(system, all=True))
    written = read_modes(tmp_path / "x.modes.h5")
    assert written.mode_shape is None
    assert "fewer" in written.attributes["shapes_left_out"]
    assert read_z_shapes(tmp_path / "x.modes.h5") is None
    assert modes_of(system, lowest=5).mode_shape.shape == (5, 36, 6)


def test_motions_along_z_are_those_of_the_whole_shapes(tmp_path):
    """Read alone they are the same numbers, and refused where they are damaged in the same way."""
    path = tmp_path / "x.modes.h5"
    modes = modes_of(LinearSystem.of(gallery.fcc(cells=(1, 1, 4))), all=True)
    write_modes(path, modes)
    np.testing.assert_array_equal(read_z_shapes(path), read_modes(path).shapes()[:, :, 2])
    write_modes(path, replace(modes, mode_shape=None))
    assert read_z_shapes(path) is None
    shapes = modes.shapes().copy()
    shapes[3, 2, 2] = np.nan
    for damaged, code in (
        (shapes, "not_finite"),
        (modes.shapes()[:-1], "wrong_shape"),
        (modes.shapes()[:, :, :3], "wrong_shape"),
    ):
        write_modes(path, replace(modes, mode_shape=damaged))
        with refusal(code, "mode_shape"):
            read_z_shapes(path)


def test_pairs_of_a_crystal_have_the_chi_z_of_the_wave_that_they_make():
    """Compare chi_z of a pair of equal frequency with that of the travelling wave of both.

    Other modes have their own chi_z.
    """
    modes = modes_of(LinearSystem.of(gallery.fcc(cells=(3, 3, 6))), all=True)
    same_as_next = modes.frequency[1:] == modes.frequency[:-1]
    has_equal_before = np.append(False, same_as_next)
    has_equal_after = np.append(same_as_next, False)
    difference = abs(chi_z(modes.shapes()) - modes.chi_z)
    assert difference[~has_equal_before & ~has_equal_after].max() < 1e-9
    first = np.flatnonzero(
        has_equal_after & ~has_equal_before & ~np.append(has_equal_after[1:], False)
    )
    squared_motion = modes.shapes()[first] ** 2 + modes.shapes()[first + 1] ** 2
    wave = (squared_motion[:, :, 2] / squared_motion[:, :, :3].sum(axis=2)).mean(axis=1)
    assert len(first) > 80
    assert wave == pytest.approx(modes.chi_z[first], abs=1e-6)
    assert difference[first].max() > 0.1


@pytest.mark.parametrize("path", ["lowest", "interval", "slices", "low end", "highest"])
def test_a_list_short_of_its_count_says_so(tmp_path, capsys, monkeypatch, path):
    """Let 8 of 12 requested modes converge: the file has 8, 4 are missing, the status is 3."""
    network = disordered((2, 2, 27))
    highest = path == "highest"
    square = np.linalg.eigvalsh(LinearSystem.of(network).dynamical_matrix.toarray())
    frequency = frequency_of(square)

    def short(search):
        def search_and_forget(*arguments, **options):
            output = search(*arguments, **options)
            eighth = square[-9:-7].mean() if highest else square[7:9].mean()
            output.converged &= (output.square > eighth) == highest
            return output

        return search_and_forget

    for search in (lanczos.modes_nearest, lanczos.modes_below, lanczos.modes_from_top):
        monkeypatch.setattr(f"modal.modes.search.{search.__name__}", short(search))
    lifted = Cost(0.0, 0.0 if path == "low end" else 1e19, 0.0)
    monkeypatch.setattr("modal.modes.effort.below_an_edge", lambda *_, **__: lifted)
    if path == "slices":
        monkeypatch.setattr("modal.system.linear_system.Limits.slice", 5)
    options_of_path = {"lowest": ["--lowest", "12"], "highest": ["--highest", "12"]}
    options = options_of_path.get(path, ["--below", repr(float(frequency[11:13].mean()))])
    source = tmp_path / "x.network.h5"
    product = tmp_path / "x.modes.h5"
    write_network(source, network)
    assert main(["modes", str(source), "--json", *options, "-o", str(product)]) == 3
    printed = capsys.readouterr()
    output = json.loads(printed.out)
    assert output["missing"] == 4
    assert not output["certified"]
    assert "4 modes are missing" in printed.err
    written = read_modes(product)
    expected = frequency[-8:] if highest else frequency[:8]
    assert written.frequency == pytest.approx(expected, rel=1e-8)
    assert written.attributes["missing"] == 4
    assert not written.attributes["certified"]
    assert "4" in written.attributes["uncertified_because"] == output["uncertified_because"]


def test_what_was_asked_for_is_read_back_from_old_files_too():
    """Read the request of earlier files, which have only a text with frequencies of six digits."""
    between = Choice("between", low=1.25e4, high=2.5e4)
    for choice in (Choice("lowest", 12), Choice("highest", 3), Choice("all"), between):
        written = choice.attributes
        for attributes in (written, {"interval": written["interval"]}):
            assert Choice.of_attributes(attributes) == choice
