"""The command `moduli`: elastic stiffness tensor, velocities of the longest waves."""

from __future__ import annotations

import argparse
from typing import Any

from modal.cli.options import add_choice, add_flag, add_value, chosen
from modal.cli.reading import network_command, packing_of
from modal.elasticity.moduli import TOLERANCE, elastic_moduli, read_moduli, write_moduli
from modal.elasticity.plane_waves import unit_vector
from modal.elasticity.steady import SOLVERS
from modal.formats.hdf5 import sha256
from modal.system.contacts import TANGENTS

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}

read_product = read_moduli


def add(commands: Any) -> None:
    """The options of `moduli`."""
    text = "the elastic stiffness tensor, V_P and V_S along any direction"
    example = "moduli mine.network.h5 --direction 1 1 0"
    command = network_command(commands, "moduli", text, example, "*.moduli.h5", TANGENTS)
    command.add_argument(
        "--direction", nargs=3, type=float, action="append", default=[], metavar=("X", "Y", "Z"),
        help="of waves, besides x, y and z; may be repeated",
    )  # fmt: skip
    add_value(command, "--tolerance", "T", "relative error", TOLERANCE)
    text = "what solves (default: the likely faster)"
    add_choice(command.add_argument_group("advanced"), "--solver", SOLVERS, text)
    add_flag(command, "--non-affine", "write how each sphere moves beyond the strain, too")


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Moduli in Pa, and velocities along the axes and the directions that are asked for."""
    along = {" ".join(f"{x:g}" for x in given): tuple(given) for given in options.direction}
    for direction in along.values():
        unit_vector(direction)
    asked = chosen(options, "tolerance", "pre_stress", "solver", "non_affine")
    found = elastic_moduli(packing_of(options), **asked)
    options.remarks.extend(found.remarks())
    if options.output:
        write_moduli(options.output, found, sha256(options.network), options.made)
    return {
        "region": found.region,
        "order": "xx yy zz yz zx xy",
        "stiffness_pa": found.stiffness.tolist(),
        "affine_stiffness_pa": found.affine.tolist(),
        "whole_stiffness_pa": found.whole.tolist(),
        "bulk_modulus_pa": found.bulk_modulus,
        "shear_modulus_pa": found.shear_modulus,
        "poisson": found.poisson,
        "anisotropy": found.anisotropy,
        "density_kg_per_m3": found.density,
        "velocity_m_per_s": {
            name: found.velocities(direction).tolist() for name, direction in (AXES | along).items()
        },
        "isotropic_velocity_m_per_s": [found.v_p, found.v_s],
        "relative_error": found.error,
        "asymmetry": found.asymmetry,
        "soft_strains": len(found.soft_strains()),
        "solver": found.solver,
        "products_with_k": found.products,
    }
