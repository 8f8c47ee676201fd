"""Run, in forks of one YADE, the scripts that lines of JSON on standard input describe.

Starting YADE takes ten times as long as most of these scripts.
"""

import json
import os
import signal
import sys
from pathlib import Path

for line in sys.stdin:
    job = json.loads(line)
    child = os.fork()
    if child == 0:
        signal.alarm(job["seconds"])
        log = os.open(job["log"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(log, 1)
        os.dup2(log, 2)
        os.chdir(job["folder"])
        os.environ.update(job["environment"])
        sys.argv = job["words"]
        exec(compile(Path(sys.argv[0]).read_text(), sys.argv[0], "exec"), globals())
        os._exit(0)
    print("ended", os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
