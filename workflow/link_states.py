"""Link a walk's states to their names: link_states.py FOLDER [NAME=VALUE ...] OUTPUT ...

Each OUTPUT is named STRESSPa.sample.h5; it becomes a link to the last state in FOLDER, or in a
folder of it, that was made for this stress, of unequal stresses to the loaded one. Exit status 1
where one is missing, or where the study of one says another value by a NAME.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from modal.packing.sample import read_sample


def cell(value: object) -> object:
    """A setting as YADE has it of a cell of its table: a number, or a text with `_` for a blank."""
    try:
        return float(str(value))
    except ValueError:
        return str(value).replace("_", " ")


def main(folder: Path, wanted: dict[str, str], outputs: list[Path]) -> int:
    """Link all; the exit status."""
    states = {}
    for path in sorted(folder.rglob("*Pa*.sample.h5")):
        study = read_sample(path).study
        for name, own in wanted.items():
            if name in study and cell(study[name]) != cell(own):
                print(
                    f"{path}: made with {name} {study.get(name)}, not {own}; move {folder} away",
                    file=sys.stderr,
                )
                return 1
        if "stress" in study:
            states[f"{float(study['stress']):g}Pa.sample.h5"] = path
    for output in outputs:
        if output.name not in states:
            print(f"{folder}: no state for {output.name}; see the log of the walk", file=sys.stderr)
            return 1
        output.parent.mkdir(parents=True, exist_ok=True)
        output.unlink(missing_ok=True)
        os.link(states[output.name], output)
    return 0


if __name__ == "__main__":
    given = dict(text.split("=") for text in sys.argv[2:] if not text.endswith(".h5"))
    files = [Path(text) for text in sys.argv[2:] if text.endswith(".h5")]
    sys.exit(main(Path(sys.argv[1]), given, files))
