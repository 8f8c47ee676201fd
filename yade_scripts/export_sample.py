"""Export a random sample at rest from YADE, with its noise, to caseNN.network.h5.

    yade-batch own.table yade_scripts/export_sample.py

Loads products/caseNN.sample.h5, which is not changed, and refuses it if YADE's own forces give
another stress or are not in balance. The scene then runs for a while without a wave: the remaining
motion is the noise floor of a wave run, and is stored in the network's `study`. The environment
variable WAVE_PRODUCTS names another folder.
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
from yade_scripts.scene import finish, is_product_current, products_folder
from yade_scripts.servo import principal_stresses, wall_stresses
from yade_scripts.state import build_scene

MAX_STRESS_ERROR = 5e-3
"""Largest relative deviation of a principal stress, in YADE, from that of the sample."""
MAX_RESIDUAL = 1e-7
"""Largest mean net force divided by the mean contact force: at 100 kPa it moves a free sphere by 2
nm in the run without a wave, a sphere in contacts far less. Compressions end at 1e-3, relax at
1e-10."""
COLLIDER_MARGIN = 0.05
"""Distance around each sphere in which YADE's collider looks for contacts, in radii."""
NOISE_STEPS = 1500
"""Steps of the run without a wave: at 100 kPa some 1.5 ms, twice the time that a wave takes."""
STEPS_PER_CHECK = 100
"""Steps between two measurements of the displacements."""
NEGLIGIBLE_DISPLACEMENT = 2.5e-12
"""Displacement, m, below which the noise need not be known more exactly: 1e-3 of the default
amplitude."""

readParamsFromTable(noTableOk=True, unknownOk=True, case=30, mu_wave=0.5, stress=1e5)
from yade.params.table import case, mu_wave, stress  # noqa: E402


def measure_noise(network):
    """Return bounds, m, of the motion along z of a layer's mean and of a firmly held sphere.

    The bounds hold for a run of NOISE_STEPS. Spheres move because of the remaining net forces of
    the sample. A sphere under a constant force moves no further than a free one, whose displacement
    grows with the square of time. The run therefore ends early, and the displacements are
    extrapolated with the square of time, if the result is negligible.
    """
    n = network.n_particles
    layers = Layers(network)
    is_held = firmly_held(network)
    states = [O.bodies[k].state for k in range(n)]
    start = np.array([state.pos[2] for state in states])
    layer_motion = 0.0
    sphere_motion = 0.0
    for steps in range(STEPS_PER_CHECK, NOISE_STEPS + 1, STEPS_PER_CHECK):
        for _ in range(STEPS_PER_CHECK):
            O.step()
        displacement = abs(np.array([state.pos[2] for state in states]) - start)
        layer_motion = max(layer_motion, float(layers.means(displacement).max()))
        sphere_motion = max(sphere_motion, float(displacement[is_held].max()))
        growth = (NOISE_STEPS / steps) ** 2
        if growth * max(layer_motion, sphere_motion) < NEGLIGIBLE_DISPLACEMENT:
            break
    return growth * layer_motion, growth * sphere_motion


def refuse_other_sample(sample, path):
    """Raise InputError if a sample has another friction or stress than the table of cases."""
    expected = {"friction": mu_wave, "target stress": stress}
    actual = {"friction": sample.friction, "target stress": sample.study.get("stress")}
    for name, value in expected.items():
        if actual[name] != value:
            raise InputError(
                "other_sample",
                f"{path}: its {name} is {actual[name]}, the table of cases has {value}",
                remedy="make the sample again",
            )


def refuse_unsettled(stresses, unbalanced, path):
    """Raise InputError if stresses (3,), Pa, or net forces are not those of a sample at rest."""
    if abs(stresses / stress - 1).max() > MAX_STRESS_ERROR:
        raise InputError(
            "stress",
            f"{path}: stresses {stresses} Pa, target {stress:g} Pa",
            remedy="compress it again",
        )
    if not unbalanced < MAX_RESIDUAL:
        raise InputError(
            "not_at_rest",
            f"{path}: net forces of {unbalanced:.1e} of the mean contact force in YADE",
            f"{MAX_RESIDUAL:g} is allowed",
            "bring it to rest with python -m modal relax",
        )


def main():
    """Export the sample unless a network made from it with these settings exists."""
    folder = products_folder()
    sample_path = folder / f"case{case:02d}.sample.h5"
    path = folder / f"case{case:02d}.network.h5"
    sample = read_sample(sample_path)
    parent = packing_of(sample_path)
    settings = {"stress": float(stress), "mu_wave": float(mu_wave), "noise_steps": NOISE_STEPS}
    made = Provenance(
        "yade_scripts/export_sample.py", settings, parent, versions(yade=config.version)
    )
    if is_product_current(path, made, read_network):
        return
    refuse_other_sample(sample, sample_path)
    n = len(sample.position)
    build_scene(sample, margin=COLLIDER_MARGIN, damping=0.0)
    stresses = principal_stresses(n)
    unbalanced = unbalancedForce(useMaxForce=False)
    refuse_unsettled(stresses, unbalanced, sample_path)
    source_stress, receiver_stress = wall_stresses(n)
    network = contact_network(n, sample.study | sample.constants | {"case": str(case)}, {})
    O.dt = time_step(float(stress))
    layer_noise, sphere_noise = measure_noise(network)
    properties = {
        "noise_layer": layer_noise,
        "noise_sphere": sphere_noise,
        "unbalanced": unbalanced,
        "stress_xx": stresses[0],
        "stress_yy": stresses[1],
        "stress_zz": stresses[2],
        "stress_source_wall": source_stress,
        "stress_receiver_wall": receiver_stress,
    }
    parent_attributes = {"parent": parent[0].name, "parent_sha256": parent[0].sha256}
    network = replace(
        network,
        study=network.study | properties,
        provenance=made.attributes() | parent_attributes,
    )
    write_network(path, network)
    print(
        f"{path}: {network.n_contacts} contacts, unbalanced {unbalanced:.1e}, noise of a layer "
        f"{layer_noise:.1e} m, of a sphere {sphere_noise:.1e} m"
    )


finish(main)
