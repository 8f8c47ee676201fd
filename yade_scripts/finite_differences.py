"""The tangent of YADE's contact law at a sample, by central differences of YADE's own forces.

    yade -n -x -j1 yade_scripts/finite_differences.py SAMPLE.sample.h5 OUT.h5

Every particle is moved by +h and by -h along each axis and turned about it, all else at rest; the
forces and torques on it and its neighbours are read. OUT holds the matrix K, minus the forces per
motion, as row, column, value (N/m, N, N m), six rows a particle as in modal/system/assembly.py.
Sliding is suppressed. A tool for the tests of modal/system/contacts.py, meant for some hundred
particles.
"""

import sys
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

from yade import O

from modal.formats.hdf5 import atomic_h5, put
from modal.packing.sample import read_sample
from modal.tools.errors import InputError
from yade_scripts.scene import finish
from yade_scripts.state import build_scene
from yade_scripts.tangent import Tangent


def main():
    """Read, differentiate, write; InputError for what the user can mend."""
    if len(sys.argv) != 3:
        raise InputError("two arguments needed: SAMPLE.sample.h5 OUT.h5")
    sample = read_sample(sys.argv[1])
    n = len(sample.position)
    build_scene(sample, margin=0.01, damping=0.0)
    row, column, value = Tangent(range(n), sample.radius).matrix()
    with atomic_h5(sys.argv[2]) as file:
        put(file, "row", row, "1")
        put(file, "column", column, "1")
        put(file, "value", value, "N/m, N, N m")
    print(f"{sys.argv[2]}: {6 * n} columns, {len(O.interactions)} contacts")


finish(main)
