"""Commands in one process, one after the other: in_turn.py COMMAND ...

Those of modal and analysis as they are typed behind `python -m`: what several need is loaded once.
Others are the shell's, and what they write to `$log` is told. The first that fails ends all, with
its status. Behind a dash a product counts though it falls short of what was asked (status 3): a
sample says how near to rest it is, spectra are kept that do not give all quantities.
"""

import os
import shlex
import subprocess
import sys
from importlib import import_module
from tempfile import NamedTemporaryFile

SHORT = 3
PROGRAMS = "modal", "analysis"


def main(commands: list[str]) -> int:
    """Run all; the exit status."""
    for command in commands:
        program, *words = shlex.split(command.removeprefix("- "))
        if program in PROGRAMS:
            sys.argv = [program, *words]
            status = import_module(f"{program}.__main__").main()
        else:
            with NamedTemporaryFile("r") as log:
                shell = "bash", "-euc", command
                status = subprocess.run(shell, env=os.environ | {"log": log.name}).returncode
                print(log.read(), flush=True)
        if status and not (status == SHORT and command.startswith("- ")):
            return status
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
