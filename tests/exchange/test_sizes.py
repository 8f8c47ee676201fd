"""Files that claim or hide more than they have are refused before they fill the memory."""

from __future__ import annotations

import gzip
import resource
from multiprocessing import get_context
from pathlib import Path

import pytest
from program_files import COLUMN_PAIR, COLUMN_WALL, column
from refusals import refusal

import modal
from modal.exchange.registry import import_packing
from modal.tools.errors import InputError

ROOM = 80 * 2**20
"""Bytes that a reader may take beside what Python and numpy have."""


def code_within_room(path: Path, answer, **options) -> None:
    """Put the code of the refusal into a queue, of a process with little memory left."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + ROOM
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    try:
        modal.read(path, **options)
    except InputError as error:
        answer.put(error.code)
    except MemoryError:
        answer.put("memory")
    else:
        answer.put("")


def code_of(path: Path, **options: str) -> str:
    context = get_context("fork")
    answer = context.Queue()
    process = context.Process(target=code_within_room, args=(path, answer), kwargs=options)
    process.start()
    code = answer.get(timeout=100)
    process.join()
    return code


def packed(path: Path, parts: list[bytes], times: int) -> Path:
    """Write parts, the last one many times over, as an archive that is a thousandth of it."""
    with gzip.open(path, "wb", compresslevel=1) as file:
        for part in parts[:-1]:
            file.write(part)
        for first in range(0, times, 1000):
            file.write(parts[-1] * min(1000, times - first))
    return path


HEAD = b"ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n3\n"
LONG = b"7" * 2**20
TABLE = b"# cell 0 1 0 1 0 1\nid,x,y,z,radius,mass\n"


@pytest.mark.parametrize(
    ("name", "begin"), [("x.dump.gz", b"ITEM:"), ("x.dump.gz", HEAD), ("x.csv.gz", TABLE)]
)
def test_a_line_without_end_is_refused(tmp_path, name, begin):
    path = packed(tmp_path / name, [begin, LONG], 150)
    assert path.stat().st_size < 1e6
    options = {"contacts": path} if name == "x.csv.gz" else {}
    assert code_of(path, **options) == "long_line"


def test_a_log_whose_line_has_no_end_is_refused(tmp_path):
    log = packed(tmp_path / "log.gz", [b"LAMMPS (22 Jul 2025)\n", LONG], 150)
    assert code_of(column(tmp_path), log=log) == "long_line"


@pytest.mark.parametrize("count", [10**6, 10**12, 10**19, 10**40])
def test_more_spheres_than_there_are_is_a_file_that_was_cut(tmp_path, count):
    path = column(tmp_path)
    path.write_text(path.read_text().replace("OF ATOMS\n3", f"OF ATOMS\n{count}"))
    assert code_of(path, pair=COLUMN_PAIR, wall=COLUMN_WALL) == "cut_off"


@pytest.mark.parametrize("name", ["x.dump.gz", "x.csv.gz"])
def test_rows_that_do_not_fit_into_the_memory_are_refused(tmp_path, name):
    head, row = column(tmp_path).read_bytes().split(b"mass\n")
    head = head.replace(b"OF ATOMS\n3", b"OF ATOMS\n1000000000000") + b"mass\n"
    if name == "x.csv.gz":
        head = TABLE
        row = b"1,0.5,0.5,0.5,0.1,1\n"
    path = packed(tmp_path / name, [head, row.split(b"\n")[0] + b"\n"], 900_000)
    options = {"contacts": path} if name == "x.csv.gz" else {}
    assert code_of(path, **options) == "too_large"


def test_rows_end_where_the_next_header_begins(tmp_path):
    """Stop reading rows at the next header if the count is too large."""
    path = column(tmp_path)
    text = path.read_text()
    path.write_text(text.replace("OF ATOMS\n3", "OF ATOMS\n4") + text)
    with refusal("cut_off"):
        import_packing(path, pair=COLUMN_PAIR, wall=COLUMN_WALL)
