"""The elastic stiffness tensor, V_P and V_S along any direction."""

from modal.cli.options import Group, Option, Options, Result, chosen_for, flag
from modal.cli.reading import packing_of, springs
from modal.elasticity.moduli import TOLERANCE, elastic_moduli, read_moduli, write_moduli
from modal.elasticity.plane_waves import unit_vector
from modal.elasticity.steady import SOLVERS

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
ALONG = "of waves, besides x, y and z; may be repeated"
SOLVES = "what solves (default: the likely faster)"
EXAMPLE = "moduli mine.network.h5 --direction 1 1 0"
OPTIONS = (
    *springs(".moduli.h5"),
    Option("--direction", ("X", "Y", "Z"), ALONG, [], more={"action": "append"}),
    Option("--tolerance", "T", "relative error", TOLERANCE),
    Group("advanced", [Option("--solver", "", SOLVES, kind=SOLVERS)]),
    flag("--non-affine", "write how each sphere moves beyond the strain, too"),
)

read_product = read_moduli


def run(options: Options) -> Result:
    """Moduli in Pa, and velocities along the axes and the directions that are asked for."""
    along = {" ".join(f"{x:g}" for x in given): tuple(given) for given in options.direction}
    for direction in along.values():
        unit_vector(direction)
    found = elastic_moduli(packing_of(options), **chosen_for(elastic_moduli, options))
    options.remarks.extend(found.remarks())
    if options.output:
        write_moduli(options.output, found, options.made)
    velocities = {name: found.velocities(way).tolist() for name, way in (AXES | along).items()}
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
        "velocity_m_per_s": velocities,
        "isotropic_velocity_m_per_s": [found.v_p, found.v_s],
        "relative_error": found.error,
        "asymmetry": found.asymmetry,
        "soft_strains": len(found.soft_strains()),
        "solver": found.solver,
        "products_with_k": found.products,
    }
