"""Compress spheres with one friction coefficient from a cloud to `highest`, Pa.

    yade -n -x -j1 yade_scripts/compress.py              (mu_comp = 0.4, 35,201 spheres)
    yade-batch own.table yade_scripts/compress.py

Columns `sizes` ("lognormal_0.2", "two_2_0.5", with the quotes), `densities` ("2230_7800") and
`walls` ("2.1e11_0.3") make a mixture (as in `modal.preparation.sizes`).

Writes a state at each stress, products/compression_mu0.4/STRESSPa.sample.h5, and a checkpoint from
which a killed compression continues. The environment variable WAVE_PRODUCTS names another folder.
The protocol and its numbers are those of `modal.preparation.protocol`;
results/samples/compaction.md gives the reasons. Each run starts from the last checkpoint, so that a
compression that was killed takes the same steps as one that was not.
"""

import sys
from dataclasses import asdict
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

from yade import config
from yade.utils import readParamsFromTable

from modal.preparation import protocol
from modal.preparation.compression import Simulation, compress_to_stresses
from modal.preparation.mixture import MIXTURE
from modal.preparation.study import Study
from modal.tools.errors import InputError
from yade_scripts.scene import finish, products_folder
from yade_scripts.servo import Scene

readParamsFromTable(noTableOk=True, highest=protocol.STRESSES[-1], **asdict(Study()))
from yade.params import table  # noqa: E402


def main():
    """Compress from the checkpoint, or from the cloud, to the highest stress."""
    parameters = {name: getattr(table, name) for name in asdict(Study())}
    for name in MIXTURE:
        # A column of the table holds one word.
        parameters[name] = str(parameters[name]).replace("_", " ")
    study = Study(**parameters)
    if study.mu_comp == 0:
        raise InputError(
            "friction",
            "mu_comp 0",
            "YADE compresses packings with friction alone",
            "use `python -m modal pack` for packings without friction",
        )
    if study.rolling or study.twisting or study.clump:
        raise InputError(
            "rolling_or_twisting",
            f"rolling {study.rolling:g}, twisting {study.twisting:g}, clump {study.clump!r}",
            "this script in YADE has spheres alone, whose contacts do not resist turns",
            "use `python -m modal pack`",
        )
    compress_to_stresses(
        products_folder() / f"compression_mu{study.mu_comp:g}",
        study,
        [stress for stress in protocol.STRESSES if stress <= table.highest],
        study.provenance("yade_scripts/compress.py", yade=config.version),
        Simulation(Scene),
        show_progress,
    )


def show_progress(line):
    """Print a line without buffering."""
    print(line, flush=True)


finish(main)
