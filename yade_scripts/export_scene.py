"""Export any YADE scene as a contact network, with radii, kn and ks as in YADE.

In a script of your own, when the packing is at rest:

    import sys; sys.path.insert(0, "path/to/this/repository")
    from yade_scripts.export_scene import export_scene
    export_scene("mine.network.h5")

or of a saved scene, with the same version of YADE that saved it:

    yade -n -x -j1 yade_scripts/export_scene.py SCENE.yade.bz2 mine.network.h5

Clumps are one body, with YADE's mass, centre and tensor of inertia and the contacts of their
spheres. Cohesive-frictional contacts keep `kr` and `ktw` where their moment law is active.

Wall, Facet and Box bodies become the two flat walls at low and high z. A network's levers end in
the middle of the overlap, as those of YADE's torques do. For motions YADE uses other levers, which
differ by overlap / radius: to the plane of a Wall, and by default those of its "ratcheting"
variant. Other cohesion and rolling resistance, walls across x or y, and sheared cells between walls
are refused, in one line. Motions blocked by `fixed`, `blockedDOFs` or the mask of the integrator
are held in the network; a sphere that an engine moves must have all of its motions blocked.
"""

import sys
from dataclasses import replace
from pathlib import Path

if __name__ == "__main__":
    # Inside YADE __file__ is YADE itself; the script is its first argument.
    sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

from yade import O, config, runtime

from modal.formats.hdf5 import named
from modal.formats.provenance import Provenance, versions
from modal.packing.network import write_network
from modal.tools.errors import InputError
from yade_scripts.export import network_of_scene, note_gravity
from yade_scripts.scene import exit_at_refusal, find_contacts, finish


def export_scene(path):
    """Write the network of the present scene to a file.

    Raises InputError for a scene that a network cannot represent; if YADE was started with -x, the
    process ends with one line and status 2 instead.
    """
    if runtime.opts.exitAfter:
        exit_at_refusal(lambda: _write_scene(path))
    else:
        _write_scene(path)


def _write_scene(path):
    """Write the network of the present scene and print a summary."""
    with named(path):
        network = note_gravity(network_of_scene())
    made = Provenance("yade_scripts/export_scene.py", versions=versions(yade=config.version))
    write_network(path, replace(network, provenance=made.attributes()))
    pulling = int((network.force_normal < 0).sum())
    print(
        f"{path}: {network.n_particles} spheres, {network.n_contacts} contacts, "
        f"{int(network.with_wall.sum())} of them with walls, {pulling} pull"
    )


def main():
    """Load a saved scene and export it."""
    if len(sys.argv) != 3:
        raise InputError("arguments", "two arguments needed", "SCENE.yade.bz2 OUT.network.h5")
    if not Path(sys.argv[1]).is_file():
        raise InputError("no_file", sys.argv[1], "no such file", "check the name")
    O.load(sys.argv[1])
    # Geometry is not saved with every contact: a step without motion makes it again.
    find_contacts()
    export_scene(sys.argv[2])


if __name__ == "__main__":
    finish(main)
