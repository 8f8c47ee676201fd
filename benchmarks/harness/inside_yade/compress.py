"""Compress a sample file to one stress and write down how its state changes: result.json.

    yade -n -x -j1 benchmarks/harness/inside_yade/compress.py result.json '{"sample": ..., ...}'

The servo of the study drives the spheres, which do not touch at first, to the stress; they are
hardly damped until they are jammed and damped from there on: `yade_scripts/compress.py` for a
single stress, without its rest at constant volume. Arguments: sample (file), output (file), stress
(Pa), inertial_number (of the largest strain rate), steps (once jammed).
"""

import json
import sys
import time
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[3]))

from yade import O
from yade.utils import PyRunner

from modal.packing.sample import read_sample, write_sample
from modal.preparation import protocol
from yade_scripts.scene import finish
from yade_scripts.servo import Drive, unbalanced, void_ratio
from yade_scripts.state import build_scene, read_scene

CHECK = 50
LONGEST = 100_000
"""Steps after which a packing that does not jam is given up."""
JAMMED, JAM_ERROR = 3.7, 0.1
"""Coordination number and relative stress error from which the packing counts as jammed."""
JAM_PATIENCE = 3000
"""Steps after the stress was first met at which damping sets in although spheres still move."""


def coordination_number(n):
    """Mean number of contacts of a sphere, walls included."""
    walls = sum(c.isReal for wall in (n, n + 1) for c in O.interactions.withBody(wall))
    return (2 * O.interactions.countReal() - walls) / n


def main():
    """Compress, look, write."""
    global drive
    result, given = Path(sys.argv[1]), json.loads(sys.argv[2])
    sample, stress = read_sample(given["sample"]), given["stress"]
    n = len(sample.position)
    build_scene(sample, margin=0.1, damping=protocol.AGITATED_DAMPING)
    trace = {name: [] for name in ("step", "seconds", "e", "Z", "stress_error", "unbalanced")}
    started, steps = time.process_time(), 0

    def look():
        error = float(abs(control.stress / stress - 1).max())
        numbers = (
            steps,
            time.process_time() - started,
            void_ratio(n),
            coordination_number(n),
            error,
            unbalanced(),
        )
        for column, number in zip(trace.values(), numbers, strict=True):
            column.append(float(number))

    control = protocol.Servo(stress, given["inertial_number"])
    drive = Drive(n, control)
    interval = protocol.duration(protocol.CONTROL, stress)
    runner = PyRunner(
        command="drive()", iterPeriod=protocol.steps_of(interval, protocol.time_step(stress))
    )
    O.engines = [*O.engines[:3], runner, O.engines[-1]]
    met = jammed = None
    while steps < LONGEST and not (jammed and steps - jammed >= given["steps"]):
        O.dt = protocol.time_step(max(stress, 1.5 * control.stress.mean()))
        O.run(CHECK, wait=True)
        steps += CHECK
        if met is None and control.stress.mean() > stress:
            met = steps
        settled = control.error() < JAM_ERROR and coordination_number(n) > JAMMED
        if not jammed and met and (settled or steps - met >= JAM_PATIENCE):
            jammed = steps
            O.engines[-1].damping = protocol.DAMPING
        look()
    seconds = time.process_time() - started
    write_sample(given["output"], read_scene(n, sample.friction, moving=False))
    result.write_text(json.dumps({"value": trace, "seconds": seconds}))


finish(main)
