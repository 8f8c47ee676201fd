"""Commands of modal and analysis in one process, one after the other: in_turn.py COMMAND ...

Each as it is typed behind `python -m`; what several need is loaded once. The first that fails ends
all, with its status. Behind a dash a product counts though it falls short of what was asked
(status 3): a sample says how near to rest it is, spectra are kept that do not give all quantities.
"""

import shlex
import sys
from importlib import import_module

SHORT = 3


def main(commands: list[str]) -> int:
    """Run all; the exit status."""
    for command in commands:
        program, *words = shlex.split(command.removeprefix("- "))
        sys.argv = [program, *words]
        status = import_module(f"{program}.__main__").main()
        if status and not (status == SHORT and command.startswith("- ")):
            return status
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
