"""Waves and matrices by LAMMPS, if it is installed (Debian package lammps)."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.harness.measure import Job, Measured, median_of, run_command
from benchmarks.harness.packing import step_and_records
from modal.packing.chain import wall_to_wall_chain
from modal.packing.contact_law import GLASS
from modal.packing.network import Network
from modal.waves.motions import INPUT_FREQUENCY, Pulse
from modal.waves.propagate import propagate
from modal.waves.signals import Signals

SCRIPT = Path(__file__).resolve().parent / "inside_lammps.in"


def write_atoms(path: Path, network: Network) -> None:
    """Write spheres and their cell as a data file; a cell with walls reaches beyond them."""
    edges = np.column_stack([np.zeros(3), network.cell_size])
    if not network.cell_periodic[2]:
        edges[2] = network.wall_position + np.multiply(network.radius[0], (-1, 1))
    lines = ["packing", "", f"{network.n_particles} atoms", "1 atom types", ""]
    for (low, high), axis in zip(edges.tolist(), "xyz", strict=True):
        lines.append(f"{low!r} {high!r} {axis}lo {axis}hi")
    lines += ["", "Atoms # sphere", ""]
    positions = network.position.tolist()
    for number, (radius, position) in enumerate(zip(network.radius, positions, strict=True), 1):
        cells = [number, 1, float(2 * radius), GLASS.density, *position]
        lines.append(" ".join(map(repr, cells)))
    path.write_text("\n".join(lines) + "\n")


def run_lammps(script: Path, folder: Path, variables: Mapping[str, object]) -> Measured:
    """Run a script in a folder, with the values of its variables."""
    command = ["lmp", "-in", str(script), "-log", "none"]
    for name, value in variables.items():
        command += ["-var", name, str(value)]
    return run_command(command, folder, folder / "scene.log")


class Lammps:
    """Waves of LAMMPS through one crystal, by the script `inside_lammps.in`."""

    name = "LAMMPS"
    command = "lmp"

    def __init__(self, job: Job, network: Network) -> None:
        self.job = job
        self.network = network
        write_atoms(job.folder / "scene.data", network)

    def wave(
        self, *, fraction: float, amplitude: float, duration: float, interval: float
    ) -> tuple[Signals, Measured]:
        """Return the signals and the cost of a run, with its short start; settings as in `Yade`.

        The time step divides the period of the pulse, so that the wall's motion changes between
        two steps.
        """
        step, every = step_and_records(self.network, fraction, interval)
        chain = wall_to_wall_chain(self.network)
        low, high = self.network.wall_position.tolist()
        pulse = round(1 / (INPUT_FREQUENCY * step))
        variables = {
            "data": "scene.data",
            "records": "scene.dump",
            "low": low,
            "high": high,
            "young": GLASS.young,
            "poisson": GLASS.poisson,
            "friction": 0.1,
            "amplitude": amplitude,
            "period": 1 / INPUT_FREQUENCY,
            "step": step,
            "pulse": pulse,
            "rest": round(duration / step) - pulse,
            "every": every,
            "chain": " ".join(str(k + 1) for k in chain),
        }
        folder = self.job.folder
        spent = median_of(self.job.times, lambda: run_lammps(SCRIPT, folder, variables))
        blocks = (folder / "scene.dump").read_text().split("ITEM: TIMESTEP\n")[1:]
        z = np.array([[row.split()[1] for row in b.splitlines()[8:]] for b in blocks], float)
        # Spheres are dumped in the order of their ids.
        displacement = (z - z[0])[:, np.argsort(np.argsort(chain))]
        how = {"interval": every * step, "time_step": step, "motion": Pulse(amplitude)}
        same = propagate(self.network, duration, **how).signals
        return replace(same, chain_displacement=displacement[: len(same.time)]), spent
