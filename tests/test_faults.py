"""Interrupted runs, full disks, folders that are none, two runs at once, YADE missing or failing.

What counts is the state left behind: every file whole or absent, and the next run ends with the
very products of an undisturbed one.
"""

import contextlib
import fcntl
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np
import pytest
from places import ROOT
from refusals import refusal

from modal.__main__ import main
from modal.formats.whole_file import HOST, refuse_unwritable
from modal.packing import crystal as gallery
from modal.packing.network import read_network, write_network
from modal.packing.sample import read_sample
from modal.tools.errors import InputError

ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
NOISE = {"run_time", "seconds", "study", "provenance", "network_sha256"}
"""What two undisturbed runs differ in: the time that they took, and what depends on it."""
PACK = """
set -e
run() { "$PYTHON" -m modal "$@" >/dev/null 2>&1; }
run pack --spheres 30 --aspect 2 --stress 1e5 -o chain
[ -f a.modes.h5 ] || run modes chain/100000Pa.sample.h5 --all -o a.modes.h5
[ -f a.signals.h5 ] || run wave chain/100000Pa.sample.h5 --duration 3e-5 -o a.signals.h5
"""
WALK = """
"$PYTHON" -m modal pack --friction 0.4 --spheres 400 --width 5 --stress 1e4 1e5 1e6 -o walk
"""


def contents(path: Path) -> dict[str, np.ndarray]:
    """All datasets and numeric attributes of a file, but for times and what depends on them."""
    found: dict[str, np.ndarray] = {}

    def keep(name: str, node: h5py.HLObject) -> None:
        if isinstance(node, h5py.Dataset):
            found[name] = node[()]

    with h5py.File(path) as file:
        file.visititems(keep)
        found |= {f"@{name}": value for name, value in file.attrs.items() if name not in NOISE}
    return found


def equal(first: Path, second: Path) -> None:
    """The same products in both folders, dataset by dataset, and nothing half written."""
    names = sorted(path.relative_to(first) for path in first.rglob("*.h5"))
    assert names == sorted(path.relative_to(second) for path in second.rglob("*.h5"))
    assert not list(second.rglob(".*.part"))
    for name in names:
        np.testing.assert_equal(contents(second / name), contents(first / name), str(name))


def study(script: str, folder: Path, **environment: str) -> subprocess.Popen:
    """Start a shell script in a folder, in a process group of its own."""
    folder.mkdir(exist_ok=True)
    variables = os.environ | ONE_THREAD | {"PYTHON": sys.executable, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        ["bash", "-c", script],
        cwd=folder,
        env=variables | environment,
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def end(process: subprocess.Popen, how: int) -> None:
    """Send a signal to the whole group, as a terminal or a batch system does, and wait."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, how)
    process.wait()


def killed_again_and_again(
    script: str, reference: Path, folder: Path, kills: int, seconds: float
) -> tuple[int, int]:
    """Kill a study at random, then let it end; how many kills met it, and a job of it."""
    random, alive, at_work = np.random.default_rng(kills), 0, 0
    for kill in range(1, kills + 1):
        shutil.rmtree(folder, ignore_errors=True)
        if reference.with_name("start").exists():
            shutil.copytree(reference.with_name("start"), folder, symlinks=True)
        started, process = time.monotonic(), study(script, folder)
        try:
            process.wait(timeout=random.uniform(0.02, 1.0) * seconds)
            seconds = time.monotonic() - started  # the machine has become quicker
        except subprocess.TimeoutExpired:
            alive += 1
            at_work += held(folder / "products/.jobs")
        end(process, signal.SIGKILL)
        assert study(script, folder).wait(timeout=600) == 0
        equal(reference, folder)
        print(f"kill {kill}: {alive} met the study, {at_work} a job of it", flush=True)
    return alive, at_work


def held(lock: Path) -> bool:
    """Whether a process holds the lock of this file."""
    with contextlib.suppress(FileNotFoundError), lock.open() as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def undisturbed(script: str, folder: Path) -> float:
    """Run the study once; seconds that it took."""
    started = time.monotonic()
    assert study(script, folder).wait(timeout=600) == 0
    return time.monotonic() - started


@pytest.mark.parametrize(
    ("script", "products", "kills", "met"),
    [
        (PACK, "*.h5", 1, 0),
        pytest.param(PACK, "*.h5", 50, 41, marks=pytest.mark.slow),
        pytest.param(WALK, "*Pa.sample.h5", 20, 16, marks=pytest.mark.slow),
    ],
)
def test_killed_and_started_again(script, products, kills, met, tmp_path):
    """From its last checkpoint a walk takes the very steps again: all states to the bit."""
    seconds = undisturbed(script, tmp_path / "reference")
    assert len(list((tmp_path / "reference").rglob(products))) in (3, 4)
    again = tmp_path / "again"
    alive, _ = killed_again_and_again(script, tmp_path / "reference", again, kills, seconds)
    assert alive >= met


@pytest.mark.slow
def test_two_packings_in_one_folder_at_once(tmp_path):
    undisturbed(PACK, tmp_path / "reference")
    both = [study(PACK, tmp_path / "shared") for _ in range(2)]
    assert [process.wait(timeout=600) for process in both] == [0, 0]
    equal(tmp_path / "reference", tmp_path / "shared")


def interrupted(command: list[str], cwd: Path, after: float | None = None) -> tuple[int, str]:
    """Status and stderr of a program that Ctrl-C meets after so many seconds, or by itself."""
    process = subprocess.Popen(
        [sys.executable, *command],
        cwd=cwd,
        env=os.environ | ONE_THREAD | {"PYTHONPATH": f"{cwd}:{ROOT}"},
        stderr=subprocess.PIPE,
        text=True,
        # A shell's background jobs ignore Ctrl-C, and so do their children.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    if after is not None:
        time.sleep(after)
        process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=120)[1]
    return process.returncode, said


def test_interrupt_is_one_line_and_leaves_nothing_half(tmp_path):
    """Ctrl-C while a larger packing is made."""
    out = tmp_path / "out"
    command = ["-m", "modal", "pack", "--spheres", "20000", "-o", str(out)]
    status, said = interrupted(command, tmp_path, after=4)
    assert status == 130
    # A quick machine has a state or two by then, each with a line of its own.
    assert said.splitlines()[-1] == "interrupted; files are whole or absent"
    assert "Traceback" not in said
    assert not list(out.glob(".*"))
    for path in out.glob("*.h5"):
        read_sample(path)


ONCE = "import os, signal, time; os.kill(os.getpid(), signal.SIGINT); time.sleep(0.1)"
AT = {
    "as it is loaded": ONCE,
    "as an object is deleted": f"class A:\n    def __del__(self):\n        {ONCE}\n"
    "A()\nraise SystemExit(0)",
}
"""Moments at which Ctrl-C as an exception is a traceback, or lost."""


@pytest.mark.parametrize("moment", AT)
@pytest.mark.parametrize("program", ["modal", "analysis"])
def test_interrupt_at_any_moment_is_one_line(program, moment, tmp_path):
    """In place of a library stands what interrupts itself as it is loaded."""
    (tmp_path / "numpy.py").write_text(AT[moment])
    status, said = interrupted(["-m", program, "--help"], tmp_path)
    assert (status, said) == (130, "interrupted; files are whole or absent\n")


def outcome_with_limit(arguments: list[str], limit: int) -> tuple[int, str]:
    """Return exit status and output of a command that may write `limit` bytes to a file."""
    sys.stdout.flush()
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        status = 99
        with os.fdopen(writing, "w") as sys.stderr:
            sys.stdout = sys.stderr
            status = main(arguments)
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
    """The HDF5 library alone ends with a segmentation fault here."""
    if name == "a.vtu":
        pytest.importorskip("meshio")
    source, out = tmp_path / "a.network.h5", tmp_path / "out" / name
    write_network(source, gallery.fcc(cells=(2, 2, 20)))
    out.parent.mkdir()
    out.write_bytes(b"old")
    verb, *options = command.split()
    words = [verb, str(source), *options, "--json", "-o", str(out)]
    status, output = outcome_with_limit(words, limit)
    *_, line, result = output.splitlines()
    assert status == 2 and line.startswith("error: ")
    assert json.loads(result)["error"]["code"] == "unwritable"
    assert out.read_bytes() == b"old" and os.listdir(out.parent) == [name]


PLACES = {
    "device": ("/dev/null", "no_file"),
    "standard output": ("/dev/stdout", "no_file"),  # which the test runs with a pipe as
    "pipe": ("pipe", "no_file"),
    "folder": ("folder", "folder"),
    "name too long": ("a" * 300 + ".h5", "unwritable"),
    "name too long for a partial file": ("a" * 240 + ".h5", "unwritable"),
    "empty": ("", "empty_text"),
    "not UTF-8": ("not\udcfftext.h5", "not_utf8"),
    "below a file": ("file/a.h5", "unwritable"),
    "absent folder": ("absent/", "folder"),
}
"""Places where no file can be written, with the code of the refusal."""


@pytest.mark.parametrize("place", PLACES)
def test_no_place_for_a_file_is_refused_before_anything_is_computed(place, tmp_path, monkeypatch):
    """In one line, and what stands there stays what it is."""
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    os.mkdir("folder")
    Path("file").touch()
    write_network("a.network.h5", gallery.fcc(cells=(1, 1, 5)))
    name, code = PLACES[place]
    before = {path: os.stat(path).st_mode for path in (*os.listdir(), "/dev/null")}
    # The number of modes, zero, would be refused as soon as anything is computed.
    command = ["-m", "modal", "modes", "a.network.h5", "--lowest", "0", "--json", "-o", name]
    done = subprocess.run(
        [sys.executable, *command], env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True
    )
    assert done.returncode == 2
    assert len(done.stderr.decode().splitlines()) == 1
    assert json.loads(done.stdout)["error"]["code"] == code
    assert before == {path: os.stat(path).st_mode for path in (*os.listdir(), "/dev/null")}
    if name in before and not name.startswith("/"):
        with refusal(code):
            write_network(name, gallery.fcc(cells=(1, 1, 5)))


@pytest.mark.parametrize("name", ["old.network.h5", "folder/new.network.h5"])
def test_who_may_not_write_is_told_so_first(name):
    """A file or folder that is read-only; who is root here becomes another user for it."""
    with tempfile.TemporaryDirectory() as above:
        os.chmod(above, 0o777)
        os.chdir(above)
        write_network("old.network.h5", gallery.fcc(cells=(1, 1, 5)))
        os.chmod("old.network.h5", 0o444)
        os.mkdir("folder", 0o555)
        child = os.fork()
        if child == 0:
            with contextlib.suppress(PermissionError):
                os.setuid(65534)
            try:
                refuse_unwritable(name)
            except InputError as error:
                os._exit(error.code == "unwritable")
            os._exit(0)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 1
        os.chdir(ROOT)


def test_a_link_leads_to_the_new_content(tmp_path):
    """It stays a link; one to a file that is not there yet makes it."""
    link, absent = tmp_path / "link.network.h5", tmp_path / "absent.network.h5"
    old = tmp_path / "elsewhere" / "old.network.h5"
    write_network(old, gallery.fcc(cells=(1, 1, 5)))
    link.symlink_to(old)
    absent.symlink_to("elsewhere/new.network.h5")
    for path in (link, absent):
        write_network(path, gallery.fcc(cells=(1, 1, 7)))
        assert path.is_symlink()
        assert read_network(path.resolve()).n_particles == 7


def test_threads_that_write_one_file_do_not_meet(tmp_path):
    path, crystal = tmp_path / "a.network.h5", gallery.fcc(cells=(1, 1, 5))
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: write_network(path, crystal), range(100)))
    assert read_network(path).n_particles == 5
    assert os.listdir(tmp_path) == [path.name]


@pytest.mark.parametrize(("to", "status"), [(">", 2), ("2>", 0)])
def test_full_disk_behind_the_terminal(to, status, tmp_path):
    """What is printed cannot be; what is only said in passing need not be."""
    path = tmp_path / "a.network.h5"
    write_network(path, gallery.fcc(cells=(1, 1, 5)))
    shell = f"{sys.executable} -m modal info {path} --json {to} /dev/full"
    done = subprocess.run(shell, shell=True, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == status
    refused = "error: standard output: cannot be written (No space left on device)\n"
    assert done.stderr == refused * bool(status)


def _part(folder: Path, host: str, number: int) -> Path:
    """A partial file of the network in this folder, half written."""
    part = folder / f".a.network.h5.{host}.{number:016x}.part"
    part.write_bytes(b"half")
    return part


def test_parts_of_killed_processes_are_removed(tmp_path):
    """Those that nobody has locked: another container has other numbers of processes."""
    path = tmp_path / "a.network.h5"
    other = f"{int(HOST, 16) ^ 1:08x}"  # a machine that writes to the same disk
    dead, living, elsewhere = (_part(tmp_path, HOST, 0), _part(tmp_path, HOST, 1),
                               _part(tmp_path, other, 0))  # fmt: skip
    with living.open("rb") as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        write_network(path, gallery.fcc(cells=(1, 1, 5)))
        assert not dead.exists() and living.exists() and elsewhere.exists()
    assert read_network(path).n_particles == 5
    with refusal("unreadable"):
        read_network(living)


def test_a_partial_file_is_locked_new_and_under_a_name_that_none_foresees(tmp_path, monkeypatch):
    """Links under all names of before lead to another's file, which stays as it was."""
    victim, names = tmp_path / "victim", []
    victim.write_text("precious")
    for number in range(50):
        link = tmp_path / f".a.network.h5.{HOST}.{os.getpid()}.{number}.part"
        link.symlink_to(victim)

    def replace(partial: Path, place: Path) -> None:
        names.append(partial.name)
        assert held(partial) and not partial.is_symlink()
        os.rename(partial, place)

    monkeypatch.setattr(os, "replace", replace)
    for _ in range(2):
        write_network(tmp_path / "a.network.h5", gallery.fcc(cells=(1, 1, 5)))
    assert victim.read_text() == "precious" and len(set(names)) == 2


def test_who_may_read_a_new_file_is_as_the_umask_says(tmp_path):
    """And as it was of one that is written again."""
    path, before = tmp_path / "a.network.h5", os.umask(0o027)
    try:
        write_network(path, gallery.fcc(cells=(1, 1, 5)))
        assert path.stat().st_mode & 0o777 == 0o640
        path.chmod(0o604)
        write_network(path, gallery.fcc(cells=(1, 1, 5)))
        assert path.stat().st_mode & 0o777 == 0o604
    finally:
        os.umask(before)


@pytest.mark.skipif(os.getuid() != 0, reason="only root gives a link to another user")
def test_a_link_of_another_user_is_not_followed(tmp_path):
    """As Linux does not in /tmp; one of the folder's owner is."""
    link, victim = tmp_path / "a.network.h5", tmp_path / "victim"
    victim.write_text("precious")
    link.symlink_to(victim)
    os.lchown(link, 65534, 65534)
    with pytest.raises(InputError) as refused:
        write_network(link, gallery.fcc(cells=(1, 1, 5)))
    assert refused.value.code == "foreign_link" and victim.read_text() == "precious"
    os.chown(tmp_path, 65534, 65534)
    write_network(link, gallery.fcc(cells=(1, 1, 5)))
    assert link.is_symlink() and read_network(victim).n_particles == 5
