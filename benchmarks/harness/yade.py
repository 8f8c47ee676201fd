"""Waves by the study's script in YADE, with their signals, time and memory."""

from dataclasses import replace

from benchmarks.harness.measure import ROOT, Job, Measured, median_of, run_command
from modal.modes.eigenmodes import modes_of
from modal.modes.mode_set import write_modes
from modal.packing.network import Network
from modal.packing.sample import Sample
from modal.system.linear_system import LinearSystem
from modal.waves.motions import AMPLITUDE, INPUT_FREQUENCY
from modal.waves.signals import Signals, read_signals


def in_yades_order(network: Network) -> Network:
    """Return a network of equal spheres with its contacts in the order that the scripts expect."""
    lateral = network.cell_size[:2]
    return Sample(network.position, lateral, network.wall_position, friction=0.1).network()


class Yade:
    """Waves of YADE through one network, which is case 2 in a folder."""

    name = "YADE"
    command = "yade"

    def __init__(self, job: Job, network: Network) -> None:
        self.folder = job.folder
        self.times = job.times
        job.write(network, "case02")
        highest = modes_of(LinearSystem.of(network), highest=1, certify=False)
        write_modes(job.folder / "case02.highest.modes.h5", highest)
        # A wave of a single interval costs as much as the start alone.
        self.start = self._run(fraction=0.5, amplitude=AMPLITUDE, duration=1.1e-5)

    def wave(self, **settings: float) -> tuple[Signals, Measured]:
        """Return the signals and the cost of the steps, without that of starting YADE.

        Settings are the fraction of the time-step limit; the amplitude A, m; the duration and the
        interval of the records, s.
        """
        cost = self._run(**settings)
        seconds = max(cost.seconds - self.start.seconds, 1e-2)
        return read_signals(self.folder / "case02.signals.h5"), replace(cost, seconds=seconds)

    def _run(self, **settings: float) -> Measured:
        """Run the script as yade-batch does for a table of one line; return medians of the runs.

        yade-batch itself checks only every second whether a job has ended.
        """
        table = self.folder / "wave.table"
        log = self.folder / "wave.log"
        table.write_text(f"case mu_wave input_frequency\n2 0.1 {INPUT_FREQUENCY:g}\n")
        environment = {f"WAVE_{name.upper()}": repr(float(v)) for name, v in settings.items()}
        environment |= {"WAVE_PRODUCTS": str(self.folder), "YADE_BATCH": f"{table}:2"}
        command = ["yade", "-n", "-x", "-j1", str(ROOT / "yade_scripts" / "wave.py")]

        def run_once() -> Measured:
            (self.folder / "case02.signals.h5").unlink(missing_ok=True)
            return run_command(command, self.folder, log, environment)

        return median_of(self.times, run_once)
