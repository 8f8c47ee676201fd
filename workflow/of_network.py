"""What is made of a case's network alone: of which cases, as which kind of file, by which command.

Shear waves, moduli and modes of a band are made on request; the last by
`snakemake -s workflow/Snakefile -c 2 products/case06.band.modes.h5`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from study import Study

from analysis.batch_table import word

Command = Callable[[Any, Any, Any], str]
"""Arguments of `.venv/bin/python -m`, of a job's wildcards, input and output."""


def modal(options: str) -> Command:
    """A command of modal that needs nothing but the network."""
    return lambda wildcards, input, output: f"modal {options} {input} -o {output}"


def wave(study: Study, times: float, options: str = "") -> Command:
    """A linear wave as the case's, for so many times the time that a P-wave needs."""

    def command(wildcards: Any, input: Any, output: Any) -> str:
        case, row = wildcards.case, study.rows[wildcards.case]
        direction = word(row.get("direction", "z"))
        own, slower = (options, times) if direction == "z" else (f"--direction {direction}", 2)
        pulse = f"--amplitude {study.amplitude(case)} --input-frequency {row['input_frequency']}"
        # Every step of YADE's, which a table may ask for as 0, is none of the linear wave's.
        interval = f"--interval {row['interval']}" if float(row.get("interval", 0)) > 0 else ""
        duration = slower * study.duration(case)
        return f"modal wave {input} {own} {pulse} {interval} --duration {duration} -o {output}"

    return command


def band_modes(study: Study) -> Command:
    """Modes of a case's band; from zero on they may be many, and shapes are kept as far as fit."""

    def command(wildcards: Any, input: Any, output: Any) -> str:
        low, high = study.band(wildcards.case)
        which = f"--between {low} {high}" if low > 0 else f"--below {high}"
        return f"modal modes --hours 4 {which} {input} -o {output}"

    return command


def prepared(study: Study, kind: str) -> Command:
    """A file for the figures of a case."""
    return lambda wildcards, input, output: (
        f"analysis prepare {wildcards.case} --kind {kind} --products {study.folder}"
    )


def commands(study: Study) -> dict[str, tuple[list[str], str, Command]]:
    """By rule: the cases that have such a file, its kind, and its command."""
    crystals, random = list(study.crystals), list(study.random)
    lowest = f"modes --lowest {study.config['lowest_modes']}"
    return {
        "highest_mode": (crystals + random, "highest.modes", modal("modes --highest 1")),
        "lowest_modes": (random, "modes", modal(lowest)),
        "all_modes": (crystals, "modes", modal("modes --all")),
        "band_modes": (random, "band.modes", band_modes(study)),
        "translations": (crystals, "translations.modes", modal("modes --all --translations-only")),
        "linear_wave": (crystals + random, "linear.signals", wave(study, 1)),
        "shear_wave": (crystals + random, "shear.signals", wave(study, 2, "--direction x")),
        "moduli": (crystals + random, "moduli", modal("moduli")),
        "response": (crystals + random, "response", prepared(study, "response")),
        "density": (random, "density", prepared(study, "density")),
        "structure_factor": (random, "structure", prepared(study, "structure")),
    }
