"""Network of a random sample and the wave through it, in one YADE: small packings start it once.

    yade-batch own.table yade_scripts/sample_and_wave.py

Runs export_sample.py, then wave.py, each in a fork; columns of the table and files are theirs.
"""

import os
import sys
from pathlib import Path

FOLDER = Path(sys.argv[0]).resolve().parent
sys.path.insert(0, str(FOLDER.parent))

# What both need is loaded once.
import yade_scripts.export  # noqa: E402, F401
import yade_scripts.wave_run  # noqa: E402, F401

for script in ("export_sample.py", "wave.py"):
    child = os.fork()
    if not child:  # each ends its process
        exec(compile((FOLDER / script).read_text(), script, "exec"), globals())
    if status := os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
        os._exit(status)
os._exit(0)
