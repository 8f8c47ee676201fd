"""The elastic stiffness tensor, V_P and V_S along any direction."""

from modal.cli.options import Group, Option, Options, Result, chosen_for, flag
from modal.cli.reading import packing_of, springs
from modal.elasticity.moduli import TOLERANCE, elastic_moduli, read_moduli, write_moduli
from modal.elasticity.plane_waves import unit_vector
from modal.elasticity.steady import SOLVERS

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
DIRECTION_HELP = "of waves, besides x, y and z; may be repeated"
SOLVER_HELP = "what solves (default: the likely faster)"
EXAMPLE = "moduli mine.network.h5 --direction 1 1 0"
OPTIONS = (
    *springs(".moduli.h5"),
    Option("--direction", ("X", "Y", "Z"), DIRECTION_HELP, [], more={"action": "append"}),
    Option("--tolerance", "T", "relative error", TOLERANCE),
    Group("advanced", [Option("--solver", "", SOLVER_HELP, kind=SOLVERS)]),
    flag("--non-affine", "write how each sphere moves beyond the strain, too"),
)

read_product = read_moduli


def run(options: Options) -> Result:
    """Compute moduli in Pa, and velocities along the axes and the requested directions."""
    directions = dict(AXES)
    for vector in options.direction:
        unit_vector(tuple(vector))  # refuses a vector without length before the work
        name = " ".join(f"{x:g}" for x in vector)
        directions[name] = tuple(vector)
    moduli = elastic_moduli(packing_of(options), **chosen_for(elastic_moduli, options))
    options.remarks.extend(map(str, moduli.remarks()))
    if options.output:
        write_moduli(options.output, moduli, options.made)
    velocities = {}
    for name, vector in directions.items():
        velocities[name] = moduli.velocities(vector).tolist()
    return {
        "region": moduli.region,
        "order": "xx yy zz yz zx xy",
        "stiffness_pa": moduli.stiffness.tolist(),
        "affine_stiffness_pa": moduli.affine.tolist(),
        "whole_stiffness_pa": moduli.whole.tolist(),
        "bulk_modulus_pa": moduli.bulk_modulus,
        "shear_modulus_pa": moduli.shear_modulus,
        "poisson": moduli.poisson,
        "anisotropy": moduli.anisotropy,
        "density_kg_per_m3": moduli.density,
        "velocity_m_per_s": velocities,
        "isotropic_velocity_m_per_s": [moduli.v_p, moduli.v_s],
        "relative_error": moduli.error,
        "asymmetry": moduli.asymmetry,
        "soft_strains": len(moduli.soft_strains()),
        "solver": moduli.solver,
        "products_with_k": moduli.products,
    }
