"""Damaged copies of a file, and a watched child process that reads them."""

import os
import resource
import signal
import sys
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

WATCHDOG = 30
"""Seconds after which one reading counts as a hang; a sound file takes well under one."""
MEMORY = 6_000_000_000
"""Bytes of address space of a child: a damaged length must not take the whole machine."""


KINDS = (
    *("bit", "bit", "bit"),  # the most frequent one
    "bits",
    "random",
    "zeros",
    "ones",
    "cut",
    "removed",
    "inserted",
    "moved",
    "end",
)
"""Kinds of damage, each as often as it is drawn."""


def mangled(data: bytes, random: np.random.Generator) -> tuple[str, bytes]:
    """Return the kind of one damage, as storage and transfer cause them, and the damaged bytes."""
    size = len(data)
    offset = int(random.integers(size))
    length = int(random.integers(1, 65))
    kind = KINDS[int(random.integers(len(KINDS)))]
    raw = bytearray(data)
    if kind == "bit":
        raw[offset] ^= 1 << int(random.integers(8))
    elif kind == "bits":
        for position in random.integers(size, size=length):
            raw[position] ^= 1 << int(random.integers(8))
    elif kind in ("random", "zeros", "ones"):
        length = min(length, size - offset)
        if kind == "zeros":
            block = b"\0" * length
        elif kind == "ones":
            block = b"\xff" * length
        else:
            block = random.bytes(length)
        raw[offset : offset + length] = block
    elif kind == "cut":
        del raw[offset:]
    elif kind == "removed":
        del raw[offset : offset + length]
    elif kind == "inserted":
        raw[offset:offset] = random.bytes(length)
    elif kind == "moved":
        block = raw[offset : offset + length]
        to = int(random.integers(size))
        raw[to : to + len(block)] = block
    else:
        raw += random.bytes(length)
    return kind, bytes(raw)


def in_child(work: Callable[[int], str], numbers: list[int], log: Path) -> Iterator[tuple]:
    """Yield (number, verdict) of work(number), done in a forked child that may crash or hang.

    A crash of the HDF5 library or a hang ends the child: verdict "crash" or "hang", and another
    child goes on behind it. A Python exception is the verdict "traceback".
    """
    todo = list(numbers)
    while todo:
        log.write_text("")
        sys.stdout.flush()
        child = os.fork()
        if child == 0:
            _work_through(work, todo, log)
        _, status = os.waitpid(child, 0)
        rows = [row for row in log.read_text().splitlines() if "\t" in row]
        verdicts = [row.split("\t", 1)[1] for row in rows]
        yield from zip(todo, verdicts, strict=False)
        n_done = len(verdicts)
        if n_done < len(todo):
            number_of_signal = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
            if number_of_signal == signal.SIGALRM:
                yield todo[n_done], "hang"
            else:
                yield todo[n_done], f"crash, signal {number_of_signal}"
            n_done += 1
        todo = todo[n_done:]


def _work_through(work: Callable[[int], str], todo: list[int], log: Path) -> None:
    """Do the work of the child process; never return."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 2)
    with open(log, "w") as out:
        for number in todo:
            signal.alarm(WATCHDOG)
            try:
                verdict = work(number)
            except BaseException:  # a traceback is what is looked for
                verdict = "traceback " + traceback.format_exc().replace("\n", " | ")
            signal.alarm(0)
            out.write(f"{number}\t{verdict}\n")
            out.flush()
    os._exit(0)
