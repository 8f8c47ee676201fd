"""The elastic stiffness tensor, V_P and V_S along any direction; or V_P and V_S by depth."""

import math
from contextlib import suppress

from modal.cli.options import Group, NewFile, Option, Options, Result, chosen_for, flag
from modal.cli.reading import packing_of, springs
from modal.elasticity.box import state_inside
from modal.elasticity.cross_anisotropy import cross_anisotropy
from modal.elasticity.depth import velocities_by_depth
from modal.elasticity.moduli import read_moduli, write_moduli
from modal.elasticity.plane_waves import isotropic_mean, unit_vector
from modal.elasticity.static_response import TOLERANCE, elastic_moduli
from modal.elasticity.steady import SOLVERS
from modal.packing.network import Network
from modal.packing.noted_laws import noted_material
from modal.packing.state import write_profile
from modal.theory.effective_medium import IsotropicModuli, assembly_of, walton
from modal.theory.saturation import named_fluid, saturate
from modal.tools.display import quantity
from modal.tools.errors import InputError, UnavailableError

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
DIRECTION_HELP = "of waves, besides x, y and z; may be repeated"
LAYERS_HELP = "in place of moduli: velocities and stress by depth, of layers along z, *.csv"
INSIDE_HELP = "moduli of a box inside a packing of any shape, m"
BOUNDS = ("XLO", "XHI", "YLO", "YHI", "ZLO", "ZHI")
SOLVER_HELP = "what solves (default: the likely faster)"
EXAMPLE = "moduli mine.network.h5 --direction 1 1 0"
OPTIONS = (
    *springs(".moduli.h5"),
    Option("--direction", ("X", "Y", "Z"), DIRECTION_HELP, [], more={"action": "append"}),
    Option("--tolerance", "T", "relative error", TOLERANCE),
    Option("--layers", "FILE", LAYERS_HELP, kind=NewFile, endings=(".csv",)),
    Option("--inside", BOUNDS, INSIDE_HELP, kind=float),
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
    if options.inside and options.fluid:
        problem = "--fluid with --inside"
        raise InputError("box_alone", problem, remedy="leave one of the two out")
    network = packing_of(options, added_mass=False)
    if options.layers:
        return _layers_of(network, options)
    moduli = elastic_moduli(network, **chosen_for(elastic_moduli, options))
    options.remarks.extend(map(str, moduli.remarks()))
    if options.output:
        write_moduli(options.output, moduli, options.made)
    velocities = {}
    for name, vector in directions.items():
        velocities[name] = moduli.velocities(vector).tolist()
    result: Result = {
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
        "relative_error_of_velocities": moduli.error / 2,
        "asymmetry": moduli.asymmetry,
        "soft_strains": len(moduli.soft_strains()),
        "solver": moduli.solver,
        "products_with_k": moduli.products,
    }
    measured = IsotropicModuli(moduli.bulk_modulus, moduli.shear_modulus)
    bulk, shear = isotropic_mean(moduli.affine)
    theories = {"affine": IsotropicModuli(bulk, shear)}
    if not options.inside:
        # A packing without forces or notes on its material is compared with its springs alone.
        with suppress(InputError):
            assembly = assembly_of(network)
            theories["walton_rough"] = walton(assembly)
            theories["walton_smooth"] = walton(assembly, rough=False)
    result["theory"] = {name: _compare(measured, expected) for name, expected in theories.items()}
    if not len(moduli.soft_strains()):
        result["cross_anisotropy"] = {
            name if name.startswith("poisson") else f"{name}_pa": list(constant)
            for name, constant in cross_anisotropy(moduli)._asdict().items()
        }
    if options.inside:
        state = state_inside(network, options.inside)
        if state.stress is not None:
            result["stress_pa"] = state.stress.tolist()
        result["void_ratio"] = state.void_ratio
        result["coordination_number"] = state.coordination_number
    if options.fluid:
        result["saturated"] = _saturated(network, measured, options)
    return result


def _layers_of(network: Network, options: Options) -> Result:
    """Write the velocities by depth as a table, and return the velocities."""
    for name in ("output", "fluid", "non_affine", "inside"):
        if getattr(options, name):
            option = "-o" if name == "output" else f"--{name.replace('_', '-')}"
            raise InputError("layers_alone", f"--layers with {option}", remedy="leave one out")
    by_depth = velocities_by_depth(network)
    write_profile(options.layers, by_depth.layers, by_depth.columns())
    columns = {name: column.tolist() for name, column in by_depth.columns().items()}
    return {"z_m": by_depth.z.tolist(), **columns}


def _compare(measured: IsotropicModuli, expected: IsotropicModuli) -> Result:
    """Return the moduli of an effective-medium theory, and the measured ones divided by them."""
    shear_ratio = math.nan
    if expected.shear > 0:
        shear_ratio = measured.shear / expected.shear
    return {
        "bulk_modulus_pa": expected.bulk,
        "shear_modulus_pa": expected.shear,
        "poisson": expected.poisson,
        "measured_over_theory": [measured.bulk / expected.bulk, shear_ratio],
    }


def _saturated(network: Network, dry: IsotropicModuli, options: Options) -> Result:
    """Return Gassmann's moduli and velocities with the named fluid, and the frequency limit."""
    if "young" not in network.study:
        raise UnavailableError(
            "unknown_material",
            f"{options.network}: it does not say of which material its spheres are",
            "Gassmann's moduli need the bulk modulus of the grains",
            "note young and poisson in its group study",
        )
    fluid = named_fluid(options.fluid)
    full = saturate(network, dry, noted_material(network.study), fluid)
    options.remarks.append(
        f"full of {options.fluid}: Gassmann's moduli hold well below Biot's frequency, "
        f"{quantity(full.biot_frequency, 'Hz')} here, above which the fluid slips past the grains"
    )
    return {
        "fluid": options.fluid,
        "bulk_modulus_pa": full.moduli.bulk,
        "shear_modulus_pa": full.moduli.shear,
        "density_kg_per_m3": full.density,
        "velocity_m_per_s": list(full.velocities),
        "permeability_m2": full.permeability,
        "biot_frequency_hz": full.biot_frequency,
    }
