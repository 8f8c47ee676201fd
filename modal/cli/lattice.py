"""The face-centred cubic crystal in theory: stiffness, velocity, low-pass frequency."""

from modal.cli.options import Option, Options, Result
from modal.theory.fcc import FccLattice

EXAMPLE = "lattice --stress 1e5"
OPTIONS = (Option("--stress", "PA", "isotropic", 1e5),)


def run(options: Options) -> Result:
    """Compute stiffnesses, f_low-pass and the velocity of long waves at a stress."""
    crystal = FccLattice(options.stress)
    return {
        "stress_pa": crystal.stress,
        "overlap_m": crystal.overlap,
        "stiffness_normal_n_per_m": crystal.kn,
        "stiffness_tangential_n_per_m": crystal.kt,
        "layer_stiffness_n_per_m": crystal.C,
        "layer_distance_m": crystal.layer_distance,
        "f_low_pass_hz": crystal.low_pass_frequency,
        "long_wave_velocity_m_per_s": crystal.velocity,
    }
