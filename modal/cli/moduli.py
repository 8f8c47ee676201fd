"""The command `moduli`: elastic stiffness tensor, velocities of the longest waves."""

from __future__ import annotations

import argparse
from typing import Any

from modal.cli.options import add_output, add_skip_current, network_command
from modal.cli.reading import add_springs, packing_of
from modal.elasticity.moduli import TOLERANCE, elastic_moduli, read_moduli, write_moduli
from modal.elasticity.plane_waves import unit_vector
from modal.elasticity.steady import SOLVERS
from modal.formats.hdf5 import sha256

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}

read_product = read_moduli


def add(commands: Any) -> None:
    """The options of `moduli`."""
    text = "the elastic stiffness tensor, V_P and V_S along any direction"
    command = network_command(commands, "moduli", text, "moduli mine.network.h5 --direction 1 1 0")
    command.add_argument(
        "--direction", nargs=3, type=float, action="append", default=[], metavar=("X", "Y", "Z"),
        help="of waves, besides x, y and z; may be repeated",
    )  # fmt: skip
    command.add_argument(
        "--tolerance",
        type=float,
        metavar="T",
        default=TOLERANCE,
        help="relative error (default 1e-6)",
    )
    command.add_argument_group("advanced").add_argument(
        "--solver", choices=SOLVERS, help="what solves (default: the likely faster)"
    )
    command.add_argument(
        "--non-affine",
        action="store_true",
        help="write how each sphere moves beyond the strain, too",
    )
    add_springs(command)
    add_output(command, "write *.moduli.h5")
    add_skip_current(command)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Moduli in Pa, and velocities along the axes and the directions that are asked for."""
    asked = {" ".join(f"{x:g}" for x in given): tuple(given) for given in options.direction}
    for direction in asked.values():
        unit_vector(direction)
    found = elastic_moduli(
        packing_of(options),
        tolerance=options.tolerance,
        pre_stress=options.pre_stress,
        solver=options.solver,
        non_affine=options.non_affine,
    )
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
            name: found.velocities(direction).tolist() for name, direction in (AXES | asked).items()
        },
        "isotropic_velocity_m_per_s": [found.v_p, found.v_s],
        "relative_error": found.error,
        "asymmetry": found.asymmetry,
        "soft_strains": len(found.soft_strains()),
        "solver": found.solver,
        "products_with_k": found.products,
    }
