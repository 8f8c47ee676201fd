"""Tests of a small random packing in YADE: compression, resumption, rest, export."""

import shutil
import time

import numpy as np
import pytest
from in_yade import error_lines, run, start, write_highest

from modal.__main__ import main
from modal.formats.provenance import packing_of, read_provenance
from modal.formats.whole_file import sha256
from modal.packing.network import read_network
from modal.packing.sample import read_sample, sample_of_network, write_sample
from modal.packing.state import stress_tensor
from modal.preparation.protocol import CHECKPOINT, SETTLED
from modal.waves.energy_balance import MAX_GAP
from modal.waves.signals import read_signals

TABLE = "mu_comp spheres width seed highest\n0.4 150 4.1 1 1e5\n"
FIRST_STATE = "1000Pa.sample.h5"
CASES = "case mu_comp mu_wave stress input_frequency fraction passage\n30 0.4 0.5 1e5 1e5 0.2 1.3\n"


@pytest.fixture(scope="module")
def products(tmp_path_factory, yade):
    """Return a folder with the states of a small compression, and case 30 at rest and exported.

    It also has the last checkpoint before the first state.
    """
    folder = tmp_path_factory.mktemp("random")
    states = folder / "compression_mu0.4"
    job = start("compress", TABLE, folder)
    while job.poll() is None:
        if (states / CHECKPOINT).exists() and not (states / FIRST_STATE).exists():
            shutil.copy(states / CHECKPOINT, folder)
        time.sleep(0.1)
    assert job.returncode == 0
    state = states / "100000Pa.sample.h5"
    sample = folder / "case30.sample.h5"
    assert main(["relax", str(state), "--friction", "0.5", "-o", str(sample)]) == 0
    run("export_sample", CASES, folder)
    return folder


def test_states_have_their_stress(products):
    """Compare the stress by contact forces and branches with the force on the walls.

    The unbalanced part is below 1e-3 of the mean force; the stress error that the servo allows is
    3e-3 for each direction. The walls, with ten contacts each, may differ by the unbalanced part
    of the column of some 12 layers between them.
    """
    for stress in (1e3, 1e4, 1e5):
        sample = read_sample(products / "compression_mu0.4" / f"{stress:g}Pa.sample.h5")
        stresses = [sample.study[f"stress_{axis}"] for axis in ("xx", "yy", "zz")]
        # The file's forces give the stresses that the run has seen, but for the last step's motion.
        rebuilt = np.diag(stress_tensor(sample.network()))
        assert stresses == pytest.approx(rebuilt, rel=SETTLED.stress_error)
        if stress > 1e3:  # there a packing of friction may run out of patience
            assert sample.study["settled"]
            assert stresses == pytest.approx([stress] * 3, rel=SETTLED.stress_error)
        error = sample.study["stress_error"]
        residual = sample.study["unbalanced"]
        assert error == pytest.approx(max(abs(np.array(stresses) / stress - 1)), abs=1e-12)
        # Whoever's patience ended first is marked.
        assert sample.study["settled"] == (
            error < SETTLED.stress_error and residual < SETTLED.residual
        )
        assert 0.55 < sample.study["void_ratio"] < 0.8
        assert 3.0 < sample.study["coordination_number"] < 5.0
    network = read_network(products / "case30.network.h5")
    walls = [network.study["stress_source_wall"], network.study["stress_receiver_wall"]]
    assert walls == pytest.approx([network.study["stress_zz"]] * 2, rel=0.02)


def test_relaxed_packing_is_at_rest_in_yade(products):
    """Check in YADE, by its own law, the balance and the rest of a sample from `modal relax`.

    Relaxed to 1e-9 on average and 1e-8 for a sphere. In the 1.5 ms of the noise run 1e-9 of a mean
    force, some 0.4 N, pushes a free sphere of 19 mg by 2e-11 m, and a held one far less: the limit
    that the study sets for noise is 0.1 % of a wave of 5 nm, in every layer.
    """
    network = read_network(products / "case30.network.h5")
    assert network.study["unbalanced"] < 2e-9
    assert network.study["noise_layer"] < 1e-3 * 5e-9


def test_export_leaves_the_sample_as_it_was(products):
    """Check that an export does not make itself stale; the network has the noise."""
    sample = read_sample(products / "case30.sample.h5")
    assert not [name for name in sample.study if name.startswith("noise")]
    network = products / "case30.network.h5"
    digest = sha256(products / "case30.sample.h5")
    assert read_network(network).provenance["parent_sha256"] == digest
    assert [source.sha256 for source in packing_of(network)] == [sha256(network), digest]
    before = network.stat().st_mtime_ns
    assert "already there" in run("export_sample", CASES, products)
    assert network.stat().st_mtime_ns == before


def test_sample_out_of_balance_or_of_other_settings_is_not_exported(products, tmp_path):
    """Export a state with another friction, then one with net forces of 1e-3."""
    state = products / "compression_mu0.4" / "100000Pa.sample.h5"
    shutil.copy(state, tmp_path / "case30.sample.h5")
    (error,) = error_lines(run("export_sample", CASES, tmp_path))
    assert "friction" in error
    assert "0.4" in error
    assert "0.5" in error
    (error,) = error_lines(run("export_sample", CASES.replace("0.4 0.5", "0.4 0.4"), tmp_path))
    assert "1e-07" in error
    assert not (tmp_path / "case30.network.h5").exists()


def test_network_from_the_compact_form_is_the_exported_one(products):
    """Compare YADE's overlaps, stiffnesses and forces with those by positions and shear forces."""
    exported = read_network(products / "case30.network.h5")
    rebuilt = sample_of_network(exported, 0.5).network()
    # Round-off of a position, eps times 50 D, over an overlap of 1e-4 R at the smallest.
    tolerance = np.finfo(float).eps * 100 * exported.radius[0] / exported.overlap.min()
    for name in ("overlap", "stiffness_normal", "stiffness_tangential", "force_normal"):
        assert getattr(rebuilt, name) == pytest.approx(getattr(exported, name), rel=10 * tolerance)
    scale = abs(exported.force_tangential).max()
    assert rebuilt.force_tangential == pytest.approx(exported.force_tangential, abs=1e-9 * scale)


def test_energy_books_close_where_contacts_slide(products, tmp_path):
    """Compare the energy of wave, contacts and slip with the work of the source wall.

    At twenty times the study's amplitude, 100 nm on overlaps of some 0.36 um, contacts slide and
    free energy of the state at rest: the drift alone is beyond what the books may miss.
    """
    shutil.copy(products / "case30.network.h5", tmp_path)
    write_highest(tmp_path, "case30")
    header, row = CASES.splitlines()
    run("wave", f"{header} amplitude\n{row} 5e-8\n", tmp_path)
    balance = read_signals(tmp_path / "case30.signals.h5").balance
    assert balance.slid > 0
    assert balance.friction > 0
    assert abs(balance.drift) > MAX_GAP
    assert abs(balance.gap) < MAX_GAP
    assert balance.closes


def test_compression_goes_on_from_a_checkpoint_and_ends_the_same(tmp_path, products):
    """Resume from the checkpoint before the first state: the state is equal to the bit."""
    states = [folder / "compression_mu0.4" / FIRST_STATE for folder in (tmp_path, products)]
    states[0].parent.mkdir()
    shutil.copy(products / CHECKPOINT, states[0].parent)
    log = run("compress", TABLE.replace(" 1e5", " 1e3"), tmp_path)
    assert "friction 0.4, 1000: " in log
    assert "jam" not in log
    state, undisturbed = map(read_sample, states)
    assert (state.position == undisturbed.position).all()
    assert (state.shear == undisturbed.shear).all()


def test_higher_stress_is_added_to_a_finished_compression(products, tmp_path):
    """Raise `highest` in the table; a state of another study is refused first."""
    folder = tmp_path / "compression_mu0.4"
    shutil.copytree(products / folder.name, folder)
    state = read_sample(folder / "100000Pa.sample.h5")
    settings = read_provenance(folder / "100000Pa.sample.h5").settings
    assert settings["mu_comp"] == 0.4
    assert settings["spheres"] == 150
    state.study["seed"] = 2
    write_sample(folder / "100000Pa.sample.h5", state)
    log = run("compress", TABLE.replace(" 1e5", " 1e6"), tmp_path)
    (error,) = error_lines(log)
    assert "100000Pa.sample.h5" in error
    assert "seed is 2, not 1" in error
    shutil.copy(products / folder.name / "100000Pa.sample.h5", folder)
    run("compress", TABLE.replace(" 1e5", " 1e6"), tmp_path)
    higher = read_sample(folder / "1e+06Pa.sample.h5")
    assert higher.study["stress_zz"] == pytest.approx(1e6, rel=SETTLED.stress_error)
