"""The products of a case: which files there are, read on demand."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from analysis.exact_chain import Chain
from modal.mode_set import ModeSet, read_modes
from modal.network import Network, read_network
from modal.signals import Signals, read_signals
from modal.source import Pulse
from modal.storage import InputError
from modal.wave import propagate

KINDS = ("network", "modes", "translations.modes", "signals")


def case_name(text: str) -> str:
    """`2`, `02` or `case02` as `case02`; InputError otherwise."""
    match = re.fullmatch(r"(?:case)?0*([1-9]\d?)", text.strip().lower())
    if not match or int(match[1]) > 32:
        raise InputError(f"{text!r} is not a case; there are cases 1 to 32, write for example 2")
    return f"case{int(match[1]):02d}"


@dataclass
class Products:
    """Files of one case in a folder; each is None where the file is absent."""

    name: str
    folder: Path

    def path(self, kind: str) -> Path:
        """File name of one kind of product."""
        return self.folder / f"{self.name}.{kind}.h5"

    @property
    def number(self) -> int:
        """Number of the case."""
        return int(self.name.removeprefix("case"))

    def has(self, kind: str) -> bool:
        """Whether the file exists."""
        return self.path(kind).is_file()

    @cached_property
    def network(self) -> Network:
        """Contact network; without it nothing can be said about a case."""
        if not self.has("network"):
            raise InputError(
                f"{self.path('network')}: no such file; run the case first, or give --products DIR"
            )
        return read_network(self.path("network"))

    @cached_property
    def chain(self) -> Chain:
        """The planar chain that the theory of a crystal reduces to."""
        chain = Chain.of_network(self.network)
        if chain.layers < 3 or self.network.n_particles % chain.layers:
            raise InputError(
                f"{self.name}: not a layered crystal, so it has no theory to compare with; "
                "choose an FCC case, 1 to 4"
            )
        return chain

    @cached_property
    def modes(self) -> ModeSet | None:
        """Modes with rotations."""
        return read_modes(self.path("modes")) if self.has("modes") else None

    @cached_property
    def translations(self) -> ModeSet | None:
        """Modes without rotations."""
        kind = "translations.modes"
        return read_modes(self.path(kind)) if self.has(kind) else None

    @cached_property
    def signals(self) -> Signals | None:
        """Signals of the wave run."""
        if not self.has("signals"):
            return None
        signals = read_signals(self.path("signals"))
        if signals.chain_displacement.shape[0] < 50 or signals.chain_displacement.shape[1] < 10:
            raise InputError(
                f"{self.path('signals')}: fewer than 50 times or 10 particles; record more"
            )
        return signals

    def linear(self, duration: float | None = None) -> Signals:
        """The linear wave of the network, exact tangent, at the times of the recorded wave.

        With `duration` (s), or where there is no record, every microsecond instead.
        """
        recorded, motion, interval = self.signals, Pulse(), 1e-6
        if recorded is not None:
            motion = Pulse(recorded.amplitude, recorded.input_frequency)
        if recorded is not None and duration is None:
            duration, interval = float(recorded.time[-1]), float(recorded.time[1])
        if duration is None:
            duration = self.network.length / self.chain.velocity
        wave = propagate(
            self.network, duration, motion=motion, interval=interval, pre_stress="full"
        )
        return wave.signals


def find(text: str, folder: str | Path) -> Products:
    """The products of a case in a folder."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; run the cases first, or give --products DIR")
    return Products(case_name(text), folder)
