"""Export a random sample and send a wave through it, in one run of YADE to save start-up time.

    yade-batch own.table yade_scripts/sample_and_wave.py

Runs export_sample.py, then wave.py, each in a fork; these scripts define the columns and the files.
"""

import os
import sys
from pathlib import Path

FOLDER = Path(sys.argv[0]).resolve().parent
sys.path.insert(0, str(FOLDER.parent))

# Modules that both need are loaded once, before the forks.
import yade_scripts.export  # noqa: E402, F401
import yade_scripts.wave_run  # noqa: E402, F401

for script in ("export_sample.py", "wave.py"):
    child = os.fork()
    if child == 0:
        # The script ends this process.
        exec(compile((FOLDER / script).read_text(), script, "exec"), globals())
    _, wait_status = os.waitpid(child, 0)
    status = os.waitstatus_to_exitcode(wait_status)
    if status:
        os._exit(status)
os._exit(0)
