"""What is remarked on in a packing that no check can refuse, and that every command says it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import packings
import pytest
from changes import changed, permuted, times

from analysis.measurement import measure
from modal.__main__ import main
from modal.description import describe
from modal.packing import crystal as gallery
from modal.packing.columns import SOURCE_WALL
from modal.packing.neighbours import tangents
from modal.packing.network import write_network
from modal.packing.plausibility import plausibility


def test_info_tells_of_what_no_check_can():
    """Law, pulling contacts, balance and densities, in sound and in wrong networks."""
    sound = plausibility(packings.sheared())
    assert sound["law"] == "Hertz" and sound["pulling_contacts"] == 0
    assert all("diameters wide" in remark for remark in sound["remarks"])
    # At rest to 1e-9 in YADE; the compact form keeps forces to the round-off of overlaps.
    assert sound["net_force_over_contact_force"] < 1e-6
    wrong = plausibility(changed(packings.sheared(), stiffness_normal=permuted))
    assert wrong["law"] == "unknown" and "no law" in wrong["remarks"][-1]
    wrong = plausibility(changed(packings.sheared(), force_normal=permuted))
    assert wrong["law"] == "unknown" and wrong["net_force_over_contact_force"] > 0.1
    linear = changed(packings.sheared(), stiffness_normal=times(2 / 3))
    assert plausibility(linear)["law"] == "linear"
    cohesive = changed(packings.cohesive(), force_normal=lambda force: force * (force < force[0]))
    assert plausibility(cohesive)["pulling_contacts"] == 1
    low, _, high = plausibility(packings.polydisperse())["density_kg_per_m3"]
    assert (low, high) == pytest.approx((2230, 7850))


@pytest.mark.parametrize("factor", [0.9, 1.1])
@pytest.mark.parametrize(("share", "law"), [(0.045, "Hertz"), (0.055, "unknown")])
def test_a_law_is_that_of_nine_contacts_in_ten(share, law, factor):
    """One in twenty may lie above it, and one in twenty below."""
    crystal = gallery.fcc(cells=(3, 3, 10))
    stiffness = crystal.stiffness_normal.copy()
    stiffness[: round(share * len(stiffness))] *= factor
    assert plausibility(replace(crystal, stiffness_normal=stiffness))["law"] == law


def test_contacts_that_are_left_out_are_told_with_their_number():
    """Three between spheres and two with the lower wall, of a crystal that has all."""
    crystal = gallery.fcc(cells=(2, 2, 8))
    pairs = np.flatnonzero(crystal.particle_j >= 0)[:3]
    walls = np.flatnonzero(crystal.particle_j == SOURCE_WALL)[:2]
    left = np.setdiff1d(np.arange(crystal.n_contacts), [*pairs, *walls])
    told = plausibility(crystal.with_contacts(left))
    assert (told["missing_contacts"], told["missing_wall_contacts"]) == (3, 2)
    assert not any("places where" in remark for remark in plausibility(crystal)["remarks"])


@pytest.mark.parametrize("radius", [1e-3, 3.1e-4, 7e-6])
def test_round_off_of_spheres_that_just_touch_is_no_fault(radius):
    """Their overlaps are round-off as well; a millionth of a radius is not."""
    column = gallery.column(10, 1e-30, radius)
    stiff = replace(column, stiffness_normal=np.full(11, 1e6), overlap=None)
    below = changed(stiff, position=lambda x: x - 1, wall_position=lambda z: z - 1)
    for network in (stiff, below):
        assert not [one for one in plausibility(network)["remarks"] if "end in one point" in one]
    longer = plausibility(changed(stiff, lever_i=times(1 + 1e-6)))["remarks"]
    assert [text for text in longer if "end in one point" in text]


def _remark(network, words, waves=False):
    """The numbers in the one remark that has these words, if there is one."""
    told = [r for r in plausibility(network, waves=waves)["remarks"] if words in r]
    return [float(x) for x in re.findall(r"[-+.e\d]+", " ".join(told)) if re.search(r"\d", x)][:1]


def test_shape_and_order_are_remarked_on_with_their_numbers():
    """A crystal of 4 diameters is sound; stirred it is not, nor is half a crystal random."""
    crystal = gallery.fcc(cells=(4, 4, 60))
    diameter, random = 2 * crystal.radius[0], np.random.default_rng(1)
    assert all("diameters long" in one for one in plausibility(crystal, waves=True)["remarks"])
    stirred = crystal.position + 0.3 * diameter * random.standard_normal(crystal.position.shape)
    half = np.where(crystal.position[:, 2:] < crystal.length / 2, crystal.position, stirred)
    for position, share in ((half, 50), (stirred, None)):
        network = crystal.unchecked(position=position)
        (width,) = _remark(network, "diameters wide")
        assert width == pytest.approx(crystal.cell_size[0] / diameter, abs=0.05)
        # Of 60 layers two at the edge of the stirred half may count either way.
        found = _remark(network, "crystalline share of the bulk")
        assert found == ([] if share is None else [pytest.approx(share, abs=4)])
        (length,) = _remark(network, "diameters long", waves=True)
        assert length == pytest.approx(crystal.length / diameter, abs=0.05)
        assert not _remark(network, "diameters long")


@pytest.mark.parametrize(("spread", "told"), [(0.008, False), (0.012, True)])
def test_numbers_within_a_hundredth_count_as_one(spread, told):
    """Densities, shares of friction, ratios of stiffnesses, a ratio of 1, springs of a lattice."""
    crystal = gallery.fcc(cells=(2, 2, 8))
    of_spheres, of_contacts = (
        1 + spread * (np.arange(n) % 2) for n in (crystal.n_particles, crystal.n_contacts)
    )
    shear = (0.3 * of_contacts * crystal.force_normal)[:, None] * tangents(crystal.normal)[0]
    slid = {"force_tangential": shear, "sliding": np.ones(crystal.n_contacts, bool)}
    across = of_contacts * crystal.stiffness_tangential
    for words, columns in (
        ("densities from", {"mass": of_spheres * crystal.mass}),
        ("unequal shares of friction", slid),
        ("differs among contacts", {"stiffness_tangential": across}),
        ("stiffer across", {"stiffness_tangential": of_contacts * crystal.stiffness_normal}),
        ("diameters wide", {"stiffness_normal": (2 * of_contacts - 1) * crystal.stiffness_normal}),
    ):
        remarks = plausibility(crystal.unchecked(**columns))["remarks"]
        assert any(words in remark for remark in remarks) == told, words


@pytest.mark.parametrize("sliding", [True, False])
def test_balance_and_sliding_springs_are_told_with_their_numbers(sliding):
    """A push on one sphere, mean and largest by hand; friction 0 has sliding contacts, and springs
    along them in modes and waves."""
    rest = packings.sheared()
    assert not _remark(rest, "not in balance")
    force = rest.force_normal.copy()
    force[0] *= 2
    pushed = replace(rest, force_normal=force)
    both = 1 if rest.particle_j[0] < 0 else 2
    (mean,) = _remark(pushed, "not in balance")
    assert mean == pytest.approx(both * force[0] / 2 / rest.n_particles / force.mean(), rel=0.05)
    told = plausibility(replace(rest, sliding=np.full(rest.n_contacts, sliding)))
    assert ("springs_of_sliding_contacts" in told) == sliding
    if sliding:
        ratio = rest.stiffness_tangential[0] / rest.stiffness_normal[0]
        assert f"{ratio:.3g} of the normal" in told["springs_of_sliding_contacts"]


@pytest.mark.parametrize(
    "command",
    [
        "modes --lowest 3",
        "count --at 3e4",
        "density --resolution 5e4 --tolerance 0.5",
        "wave --duration 2e-5",
        "response --highest 2e4 --resolution 1e4",
    ],
)
def test_every_command_passes_the_remarks_on(command, tmp_path, capsys):
    """On standard error, a line each, and nothing about a sound network."""
    name, *options = command.split()
    path = tmp_path / "some.network.h5"
    for network, said in (
        (packings.sheared(), False),
        (changed(packings.sheared(), stiffness_normal=permuted), True),
    ):
        write_network(path, network)
        assert main([name, str(path), *options, "--json"]) == 0
        lines = capsys.readouterr().err.splitlines()
        shape = " diameters (wide|long)"
        remarks = [line for line in lines if str(path) in line and not re.search(shape, line)]
        assert bool(remarks) == any("follow no law" in line for line in remarks) == said


@pytest.mark.parametrize("factor", [1e-3, 1e-6, 100.0])
def test_masses_in_other_units_are_remarked_on_wherever_numbers_are_told(factor):
    """In memory too, where no command has read a file: of grams and centimetres nothing else."""
    sound = gallery.fcc(cells=(2, 2, 12))
    other = replace(sound, mass=factor * sound.mass, inertia=factor * sound.inertia, study={})
    codes = []
    for network in (sound, other):
        caveats = measure(network, quantities=["void_ratio"])["void_ratio"].caveats
        codes.append("no_solid" in {caveat.code for caveat in caveats})
        codes.append("density" in {line.split()[0] for line in describe(network).split("\n")})
    assert codes == [False, False, True, True]
