"""Link a walk's states to their names in the study: link_states.py FOLDER OUTPUT ...

Each OUTPUT is named STRESSPa.sample.h5; it becomes a link to the last state in FOLDER, or in a
folder of it, that was made for this stress. Exit status 1 where one is missing.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from modal.packing.sample import read_sample


def main(folder: Path, outputs: list[Path]) -> int:
    """Link all; the exit status."""
    states = {}
    for path in sorted(folder.rglob("*Pa.sample.h5")):
        stress = read_sample(path).study.get("stress")
        if stress is not None:
            states[f"{float(stress):g}Pa.sample.h5"] = path
    for output in outputs:
        if output.name not in states:
            print(f"{folder}: no state for {output.name}; see the log of the walk", file=sys.stderr)
            return 1
        output.parent.mkdir(parents=True, exist_ok=True)
        output.unlink(missing_ok=True)
        os.link(states[output.name], output)
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]]))
