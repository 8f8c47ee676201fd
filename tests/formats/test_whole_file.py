"""Files are whole or as they were: full disks, places that are no files, links, partial files."""

import contextlib
import fcntl
import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from killed_runs import is_locked
from places import ROOT
from refusals import refusal

from modal.__main__ import main
from modal.formats.whole_file import HOST, refuse_unwritable
from modal.packing import crystal as gallery
from modal.packing.network import read_network, write_network
from modal.tools.errors import InputError

CRYSTAL = gallery.fcc(cells=(1, 1, 5))


def run_with_file_limit(words: list[str], limit: int) -> tuple[int, str]:
    """Return exit status and output of a command that may write `limit` bytes to a file."""
    sys.stdout.flush()
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        status = 99
        with os.fdopen(writing, "w") as sys.stderr:
            sys.stdout = sys.stderr
            status = main(words)
        os._exit(status)
    os.close(writing)
    _, status = os.waitpid(child, 0)
    with os.fdopen(reading) as output:
        return os.waitstatus_to_exitcode(status), output.read()


@pytest.mark.parametrize("limit", [0, 100, 3000])
@pytest.mark.parametrize(
    ("command", "name"),
    [
        ("modes --all", "a.modes.h5"),
        ("wave --duration 1e-4 --particles", "a.signals.h5"),
        ("density", "a.density.h5"),
        ("export", "a.vtu"),  # meshio's error arrives from inside it
        ("export", "a.xyz"),
    ],
)
def test_full_disk_is_one_line_and_leaves_the_old_file(command, name, limit, tmp_path):
    """Write to a full disk, where the HDF5 library alone ends with a segmentation fault."""
    if name == "a.vtu":
        pytest.importorskip("meshio")
    source = tmp_path / "a.network.h5"
    write_network(source, gallery.fcc(cells=(2, 2, 20)))
    out = tmp_path / "out" / name
    out.parent.mkdir()
    out.write_bytes(b"old")
    verb, *options = command.split()
    words = [verb, str(source), *options, "--json", "-o", str(out)]
    status, output = run_with_file_limit(words, limit)
    *_, line, result = output.splitlines()
    assert status == 2
    assert line.startswith("error: ")
    assert json.loads(result)["error"]["code"] == "unwritable"
    assert out.read_bytes() == b"old"
    assert os.listdir(out.parent) == [name]


@pytest.fixture
def odd_places(tmp_path, monkeypatch) -> list[str]:
    """Change to a folder with a pipe, a folder, a file and a network; return all names."""
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    os.mkdir("folder")
    Path("file").touch()
    write_network("a.network.h5", CRYSTAL)
    return [*os.listdir(), "/dev/null"]


def read_modes_of_files(names: list[str]) -> dict[str, int]:
    """Return kind and rights of files by their names."""
    return {name: os.stat(name).st_mode for name in names}


# The number of modes, zero, would be refused as soon as anything is computed.
COMMAND = ["modes", "a.network.h5", "--lowest", "0", "--json", "-o"]


@pytest.mark.parametrize(
    ("name", "code"),
    [
        pytest.param("/dev/null", "no_file", id="device"),
        pytest.param("pipe", "no_file", id="pipe"),
        pytest.param("folder", "folder", id="folder"),
        pytest.param("a" * 300 + ".h5", "unwritable", id="name too long"),
        pytest.param("a" * 240 + ".h5", "unwritable", id="name too long for a partial file"),
        pytest.param("", "empty_text", id="empty"),
        pytest.param("not\udcfftext.h5", "not_utf8", id="not UTF-8"),
        pytest.param("file/a.h5", "unwritable", id="below a file"),
        pytest.param("absent/", "folder", id="absent folder"),
    ],
)
def test_place_without_a_file_is_refused_before_anything_is_computed(
    name, code, odd_places, capsys
):
    """Refuse in one line, and leave what stands there as it is."""
    before = read_modes_of_files(odd_places)
    assert main([*COMMAND, name]) == 2
    printed = capsys.readouterr()
    assert len(printed.err.splitlines()) == 1
    assert json.loads(printed.out)["error"]["code"] == code
    assert set(os.listdir()) == set(odd_places) - {"/dev/null"}
    assert read_modes_of_files(odd_places) == before


def test_standard_output_as_a_file_is_refused(odd_places):
    """Refuse a pipe, which the standard output of this program is."""
    done = subprocess.run(
        [sys.executable, "-m", "modal", *COMMAND, "/dev/stdout"],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
    )
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert json.loads(done.stdout)["error"]["code"] == "no_file"


@pytest.mark.parametrize(("name", "code"), [("pipe", "no_file"), ("folder", "folder")])
def test_function_refuses_what_is_no_file(name, code, odd_places):
    with refusal(code):
        write_network(name, CRYSTAL)


@pytest.fixture
def read_only_folder() -> Iterator[None]:
    """Change to a folder for all users, with a file and a folder that are read-only."""
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o777)
        os.chdir(folder)
        write_network("old.network.h5", CRYSTAL)
        os.chmod("old.network.h5", 0o444)
        os.mkdir("folder", 0o555)
        yield
        os.chdir(ROOT)


@pytest.mark.parametrize("name", ["old.network.h5", "folder/new.network.h5"])
def test_read_only_place_is_refused(name, read_only_folder):
    """Refuse a file or folder that is read-only; root becomes another user for it."""
    child = os.fork()
    if child == 0:
        with contextlib.suppress(PermissionError):
            os.setuid(65534)
        try:
            refuse_unwritable(name)
        except InputError as error:
            os._exit(error.code == "unwritable")
        os._exit(0)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 1


def test_link_to_a_file_leads_to_the_new_content(tmp_path):
    old = tmp_path / "elsewhere" / "old.network.h5"
    write_network(old, CRYSTAL)
    link = tmp_path / "link.network.h5"
    link.symlink_to(old)
    write_network(link, gallery.fcc(cells=(1, 1, 7)))
    assert link.is_symlink()
    assert read_network(old).n_particles == 7


def test_link_to_an_absent_file_makes_the_file(tmp_path):
    link = tmp_path / "absent.network.h5"
    link.symlink_to("elsewhere/new.network.h5")
    (tmp_path / "elsewhere").mkdir()
    write_network(link, CRYSTAL)
    assert link.is_symlink()
    assert read_network(tmp_path / "elsewhere/new.network.h5").n_particles == 5


def test_threads_that_write_one_file_do_not_meet(tmp_path):
    path = tmp_path / "a.network.h5"
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: write_network(path, CRYSTAL), range(100)))
    assert read_network(path).n_particles == 5
    assert os.listdir(tmp_path) == [path.name]


def run_info(tmp_path: Path, redirection: str) -> subprocess.CompletedProcess:
    """Run `info` on a network, with one of its outputs redirected by the shell."""
    path = tmp_path / "a.network.h5"
    write_network(path, CRYSTAL)
    shell = f"{sys.executable} -m modal info {path} --json {redirection}"
    return subprocess.run(shell, shell=True, cwd=ROOT, capture_output=True, text=True)


def test_result_that_cannot_be_printed_is_refused(tmp_path):
    done = run_info(tmp_path, "> /dev/full")
    assert done.returncode == 2
    assert done.stderr == "error: standard output: cannot be written (No space left on device)\n"


def test_remarks_that_cannot_be_printed_are_left_out(tmp_path):
    done = run_info(tmp_path, "2> /dev/full")
    assert done.returncode == 0
    assert done.stderr == ""


def write_partial_file(folder: Path, host: str, number: int) -> Path:
    """Write a partial file of a network, as a process of a host does, half of it."""
    partial = folder / f".a.network.h5.{host}.{number:016x}.part"
    partial.write_bytes(b"half")
    return partial


OTHER_HOST = f"{int(HOST, 16) ^ 1:08x}"
"""A machine that writes to the same disk."""


def test_partial_file_of_a_killed_process_is_removed(tmp_path):
    """Remove those that nobody has locked: another container has other numbers of processes."""
    partial = write_partial_file(tmp_path, HOST, 0)
    write_network(tmp_path / "a.network.h5", CRYSTAL)
    assert not partial.exists()


def test_partial_file_of_another_machine_stays(tmp_path):
    partial = write_partial_file(tmp_path, OTHER_HOST, 0)
    write_network(tmp_path / "a.network.h5", CRYSTAL)
    assert partial.exists()


def test_partial_file_that_is_being_written_stays(tmp_path):
    path = tmp_path / "a.network.h5"
    partial = write_partial_file(tmp_path, HOST, 1)
    with partial.open("rb") as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        write_network(path, CRYSTAL)
        assert partial.exists()
    assert read_network(path).n_particles == 5


def test_partial_file_is_no_network(tmp_path):
    with refusal("unreadable"):
        read_network(write_partial_file(tmp_path, HOST, 0))


def test_partial_file_is_locked_and_has_an_unforeseeable_name(tmp_path, monkeypatch):
    """Follow none of the links under all names of an earlier version to another's file."""
    victim = tmp_path / "victim"
    victim.write_text("precious")
    for number in range(50):
        link = tmp_path / f".a.network.h5.{HOST}.{os.getpid()}.{number}.part"
        link.symlink_to(victim)
    names = set()

    def replace(partial: Path, path: Path) -> None:
        names.add(partial.name)
        assert is_locked(partial)
        assert not partial.is_symlink()
        os.rename(partial, path)

    monkeypatch.setattr(os, "replace", replace)
    for _ in range(2):
        write_network(tmp_path / "a.network.h5", CRYSTAL)
    assert victim.read_text() == "precious"
    assert len(names) == 2


@pytest.fixture
def umask_of_a_group() -> Iterator[None]:
    """Let new files be readable for the group, and not for others."""
    before = os.umask(0o027)
    yield
    os.umask(before)


def test_rights_of_a_new_file_follow_the_umask(umask_of_a_group, tmp_path):
    path = tmp_path / "a.network.h5"
    write_network(path, CRYSTAL)
    assert path.stat().st_mode & 0o777 == 0o640


def test_rights_of_a_rewritten_file_stay(umask_of_a_group, tmp_path):
    path = tmp_path / "a.network.h5"
    write_network(path, CRYSTAL)
    path.chmod(0o604)
    write_network(path, CRYSTAL)
    assert path.stat().st_mode & 0o777 == 0o604


@pytest.fixture
def link_of_another_user(tmp_path) -> Path:
    """Return a link of another user to a file of this one; only root can make it."""
    if os.getuid() != 0:
        pytest.skip("only root gives a link to another user")
    link = tmp_path / "a.network.h5"
    (tmp_path / "victim").write_text("precious")
    link.symlink_to(tmp_path / "victim")
    os.lchown(link, 65534, 65534)
    return link


def test_link_of_another_user_is_not_followed(link_of_another_user, tmp_path):
    """Refuse the link; Linux does the same in /tmp."""
    with refusal("foreign_link"):
        write_network(link_of_another_user, CRYSTAL)
    assert (tmp_path / "victim").read_text() == "precious"


def test_link_of_the_owner_of_the_folder_is_followed(link_of_another_user, tmp_path):
    os.chown(tmp_path, 65534, 65534)
    write_network(link_of_another_user, CRYSTAL)
    assert link_of_another_user.is_symlink()
    assert read_network(tmp_path / "victim").n_particles == 5
