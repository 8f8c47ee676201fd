"""Run commands in one process, one after the other: in_turn.py COMMAND ...

Commands of modal and analysis are written as after `python -m`; modules that several of them need
are loaded once. Other commands run in the shell, and their output to `$log` is printed. The first
command that fails ends the process with its status. A dash before a command accepts a product that
falls short of the request (status 3): a sample records its residual forces, and spectra are useful
even if they do not give all quantities.
"""

import os
import shlex
import subprocess
import sys
from importlib import import_module
from tempfile import NamedTemporaryFile

FALLS_SHORT_STATUS = 3
"""Exit status of a program whose product falls short of the request."""
PROGRAMS = ("modal", "analysis")
MAY_FALL_SHORT = "- "
"""Beginning of a command that may end with `FALLS_SHORT_STATUS`."""


def main(commands: list[str]) -> int:
    """Run all commands and return the exit status."""
    for command in commands:
        program, *words = shlex.split(command.removeprefix(MAY_FALL_SHORT))
        if program in PROGRAMS:
            sys.argv = [program, *words]
            status = import_module(f"{program}.__main__").main()
        else:
            status = _run_in_shell(command)
        accepted = command.startswith(MAY_FALL_SHORT) and status == FALLS_SHORT_STATUS
        if status and not accepted:
            return status
    return 0


def _run_in_shell(command: str) -> int:
    """Run a command of the shell, print what it writes to `$log`, and return its status."""
    with NamedTemporaryFile("r") as log:
        environment = os.environ | {"log": log.name}
        status = subprocess.run(["bash", "-euc", command], env=environment).returncode
        print(log.read(), flush=True)
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
