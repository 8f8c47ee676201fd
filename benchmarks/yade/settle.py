"""Let a sample settle at a fixed cell with its real masses, damped, and write it.

    yade -n -x -j1 benchmarks/yade/settle.py result.json '{"sample": ..., "output": ...}'

Arguments: sample, output (files), steps, damping.
"""

import json
import sys
import time
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[2]))

from yade import O

from modal.preparation import protocol
from modal.sample import read_sample, write_sample
from yade_scripts import compression
from yade_scripts.scene import finish
from yade_scripts.state import build_scene, read_scene


def main():
    """Settle and write; the value is the residual in the end."""
    result, given = Path(sys.argv[1]), json.loads(sys.argv[2])
    sample = read_sample(given["sample"])
    n = len(sample.position)
    build_scene(sample, margin=0.05, damping=given["damping"])
    O.dt = protocol.time_step(compression.principal_stresses(n).mean())
    started = time.process_time()
    O.run(given["steps"], wait=True)
    seconds = time.process_time() - started
    unbalanced = compression.unbalanced()
    write_sample(given["output"], read_scene(n, sample.friction, moving=False))
    result.write_text(json.dumps({"value": unbalanced, "seconds": seconds}))


finish(main)
