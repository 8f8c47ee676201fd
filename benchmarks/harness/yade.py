"""Waves by the study's script inside YADE: their signals, time and memory."""

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
    """The network of equal spheres with its contacts in the order that the scripts expect."""
    lateral = network.cell_size[:2]
    return Sample(network.position, lateral, network.wall_position, friction=0.1).network()


class Yade:
    """The wave script on one network, which stands as case 2 in a folder."""

    name, command = "YADE", "yade"

    def __init__(self, job: Job, network: Network) -> None:
        self.folder, self.times = job.folder, job.times
        job.write(network, "case02")
        highest = modes_of(LinearSystem.of(network), highest=1, certify=False)
        write_modes(job.folder / "case02.highest.modes.h5", highest)
        # A wave of a single interval is a start.
        self.start = self._run(fraction=0.5, amplitude=AMPLITUDE, duration=1.1e-5)

    def wave(self, **settings: float) -> tuple[Signals, Measured]:
        """Signals, and what the steps have cost, without YADE's start and the scene's building.

        Settings: fraction of the time-step limit; amplitude A, m; duration and interval of the
        records, s.
        """
        spent = self._run(**settings)
        seconds = max(spent.seconds - self.start.seconds, 1e-2)
        return read_signals(self.folder / "case02.signals.h5"), replace(spent, seconds=seconds)

    def _run(self, **settings: float) -> Measured:
        """The script as yade-batch runs it for a table of one line: the median of several runs.

        yade-batch itself looks only every second whether a job has ended.
        """
        table, log = self.folder / "wave.table", self.folder / "wave.log"
        table.write_text(f"case mu_wave input_frequency\n2 0.1 {INPUT_FREQUENCY:g}\n")
        environment = {f"WAVE_{name.upper()}": repr(float(v)) for name, v in settings.items()}
        environment |= {"WAVE_PRODUCTS": str(self.folder), "YADE_BATCH": f"{table}:2"}
        command = ["yade", "-n", "-x", "-j1", str(ROOT / "yade_scripts" / "wave.py")]

        def once() -> Measured:
            (self.folder / "case02.signals.h5").unlink(missing_ok=True)
            return run_command(command, self.folder, log, environment)

        return median_of(self.times, once)
