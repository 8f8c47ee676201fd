"""The lines of a log of LAMMPS or LIGGGHTS, with their variables put in.

These programs write a line that has variables (`$E`, `${name}`, `$(formula)`) as it stands in the
script, and again each time that one is replaced. The last of these counts; where it is not there,
as in a script that never ran, the value is not known.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from pathlib import Path

from modal.exchange.rows import fault, read_lines

VARIABLE = re.compile(r"\$(?:\{[^}]*\}?|\(.*\)|\w)", re.ASCII)
QUOTED = re.compile(r"\"[^\"]*\"|'[^']*'")
"""Variables in quotes stay as they are; a line of such a kind counts for nothing here."""
COMMANDS = ("units", "dimension", "pair_style", "pair_coeff", "bond_style", "unfix")


def logged_lines(path: str | Path, styles: Collection[str]) -> Iterator[tuple[int, list[str]]]:
    """Number, from 1, and words of each line that has no variable left, comments left out.

    `styles` are those of the fixes and computes that count. InputError for a line of these, or of
    `COMMANDS`, whose variables have no value.
    """
    lines = iter(enumerate(read_lines(path), 1))
    waiting: dict[str, tuple[int, re.Pattern[str]]] = {}
    printed = None
    for number, line in lines:
        text = line.split("#")[0]
        while text.rstrip().endswith("&"):
            text = text.rstrip()[:-1] + next(lines, (0, ""))[1]
        words = text.split()
        text = " ".join(words)
        waiting = {raw: at for raw, at in waiting.items() if not at[1].fullmatch(text)}
        said, printed = printed, None
        if not words or (said and said.fullmatch(text)):
            continue
        if "$" not in text or not VARIABLE.search(QUOTED.sub("", text)):
            if words[0] == "print":  # what it prints may look like a command
                printed = _replaced(" ".join(words[1:]).strip("\"'"))
            yield number, words
        elif _counts(words, styles):
            waiting[text] = number, _replaced(text)
    for raw, (number, _) in waiting.items():
        what = f"{' '.join(VARIABLE.findall(raw))} has no value in this file: {raw[:80]}"
        fault(path, what, "give the log of the run, or write the value in its place", number)


def _replaced(text: str) -> re.Pattern[str]:
    """What a line becomes when its variables are put in, which may be empty; blanks are single."""
    parts = [re.escape(part.strip()) for part in VARIABLE.split(text)]
    return re.compile(r"\s*.*".join(parts))


def _counts(words: list[str], styles: Collection[str]) -> bool:
    """Whether a line with variables may be one that counts."""
    command, style = words[0], (words[3:4] or [""])[0]
    if command in ("fix", "compute"):
        return "$" in style or any(f"{style}/".startswith(f"{each}/") for each in styles)
    return command in COMMANDS or VARIABLE.fullmatch(command) is not None
