"""Contact network of a random sample at rest as YADE has it, and its noise; caseNN.network.h5.

    yade-batch own.table yade_scripts/export_sample.py

Loads products/caseNN.sample.h5, which stays as it is, refuses it where YADE's own forces are not of
its stress or not in balance, and lets it run for a while without a wave: what moves by itself is
the noise floor of a wave run, which the network's study holds. Environment: WAVE_PRODUCTS.
"""

import sys
from dataclasses import replace
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

import numpy as np
from yade import O, config
from yade.utils import readParamsFromTable, unbalancedForce

from modal.formats.provenance import Provenance, packing_of, versions
from modal.packing.layers import Layers
from modal.packing.network import read_network, write_network
from modal.packing.rattlers import firmly_held
from modal.packing.sample import read_sample
from modal.preparation.durations import time_step
from modal.tools.errors import InputError
from yade_scripts.export import contact_network
from yade_scripts.scene import already_there, finish, products_folder
from yade_scripts.servo import principal_stresses, wall_stresses
from yade_scripts.state import build_scene

STRESS_TOLERANCE = 5e-3
BALANCE = 1e-7
"""Largest mean net force over the mean contact force: at 100 kPa it moves a free sphere by 2 nm in
the run without a wave, one that is held by others far less; compressions end at 1e-3, relax at
1e-10."""
MARGIN = 0.05
NOISE_STEPS = 1500
"""Steps of the run without a wave: at 100 kPa some 1.5 ms, twice the time that a wave takes."""
NEGLIGIBLE = 2.5e-12
"""Displacement, m, below which it does not matter how small: 1e-3 of the default amplitude."""

readParamsFromTable(noTableOk=True, unknownOk=True, case=30, mu_wave=0.5, stress=1e5)
from yade.params.table import case, mu_wave, stress  # noqa: E402


def noise(network):
    """At most so far, m, a layer's mean and a firmly held sphere move along z in NOISE_STEPS.

    What moves them is the rest of net force that the sample has. Whatever it is held by, a sphere
    under a constant force gets no further than a free one, whose way grows with the square of time.
    So the run ends early, and what was found is multiplied by that square, where the product is
    negligible.
    """
    n = network.n_particles
    layers, held = Layers(network), firmly_held(network)
    states = [O.bodies[k].state for k in range(n)]
    start = np.array([state.pos[2] for state in states])
    of_layer = of_sphere = 0.0
    for done in range(100, NOISE_STEPS + 1, 100):
        for _ in range(100):
            O.step()
        moved = abs(np.array([state.pos[2] for state in states]) - start)
        of_layer = max(of_layer, float(layers.means(moved).max()))
        of_sphere = max(of_sphere, float(moved[held].max()))
        growth = (NOISE_STEPS / done) ** 2
        if growth * max(of_layer, of_sphere) < NEGLIGIBLE:
            break
    return growth * of_layer, growth * of_sphere


def main():
    """Export, unless the network of this very sample is there, made with these settings."""
    folder = products_folder()
    sample_path, path = folder / f"case{case:02d}.sample.h5", folder / f"case{case:02d}.network.h5"
    sample, parent = read_sample(sample_path), packing_of(sample_path)
    settings = {"stress": float(stress), "mu_wave": float(mu_wave), "noise_steps": NOISE_STEPS}
    made = Provenance(
        "yade_scripts/export_sample.py", settings, parent, versions(yade=config.version)
    )
    if already_there(path, made, read_network):
        return
    n, target = len(sample.position), float(stress)
    for name, found, wanted in (
        ("friction", sample.friction, mu_wave),
        ("target stress", sample.study.get("stress"), stress),
    ):
        if found != wanted:
            raise InputError(
                "input",
                f"{sample_path}: its {name} is {found}, the table of cases has {wanted}",
                remedy="make the sample again",
            )
    build_scene(sample, margin=MARGIN, damping=0.0)
    stresses = principal_stresses(n)
    if abs(stresses / target - 1).max() > STRESS_TOLERANCE:
        raise InputError(
            "input",
            f"{sample_path}: stresses {stresses} Pa, target {target:g} Pa",
            remedy="compress it again",
        )
    unbalanced, walls = unbalancedForce(useMaxForce=False), wall_stresses(n)
    if not unbalanced < BALANCE:
        raise InputError(
            "input",
            f"{sample_path}: net forces of {unbalanced:.1e} of the mean contact force in YADE, "
            f"{BALANCE:g} is allowed",
            remedy="bring it to rest with python -m modal relax",
        )
    network = contact_network(n, sample.study | sample.constants | {"case": str(case)}, {})
    O.dt = time_step(target)
    of_layer, of_sphere = noise(network)
    measured = {"noise_layer": of_layer, "noise_sphere": of_sphere, "unbalanced": unbalanced}
    of_stresses = "xx", "yy", "zz", "source_wall", "receiver_wall"
    for name, value in zip(of_stresses, (*stresses, *walls), strict=True):
        measured[f"stress_{name}"] = value
    come_from = {"parent": parent[0].name, "parent_sha256": parent[0].sha256}
    study, provenance = network.study | measured, made.attributes() | come_from
    write_network(path, replace(network, study=study, provenance=provenance))
    print(
        f"{path}: {network.n_contacts} contacts, unbalanced {unbalanced:.1e}, noise of a layer "
        f"{of_layer:.1e} m, of a sphere {of_sphere:.1e} m"
    )


finish(main)
