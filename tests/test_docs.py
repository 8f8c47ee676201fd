"""The pages say what is so: every block of Python and of commands runs, links lead to files."""

import re
import shlex
import shutil
import subprocess
import sys
from fnmatch import fnmatchcase

import numpy as np
import pytest
from places import ROOT

import analysis.__main__
import analysis.cli.main
import modal
import modal.cli.main
from analysis.value import Value
from modal.cli.main import main
from modal.cli.options import FALLS_SHORT_STATUS
from modal.modes.mode_set import write_modes
from modal.packing.network import write_network
from modal.waves.signals import write_signals

PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
PROGRAMS = {"granular-modes": main, "python -m analysis": analysis.__main__.main}
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page):
    """Return the kind and the text of each block of a page."""
    return BLOCK.findall(page.read_text())


WITH_BLOCKS = [page for page in PAGES if {kind for kind, _ in blocks(page)} & {"python", "console"}]
SLOW_PAGES = {"attenuation.md", "from_scan.md", "lammps.md"}
"""Pages whose packings take 10 to 20 s, and whose numbers need packings of that size."""
SMALLER = {"--spheres 2000": "--spheres 500", "modal.fcc()": "modal.fcc(cells=(2, 2, 40))"}
"""Packings of other pages, each with a smaller one that is enough for its commands."""


def pages_with_blocks():
    """Return the parameters of tests of pages: with smaller packings, and as they are, if slow."""
    parameters = []
    for page in WITH_BLOCKS:
        is_shortened = any(packing in page.read_text() for packing in SMALLER)
        if page.name not in SLOW_PAGES:
            smaller = SMALLER if is_shortened else {}
            parameters.append(pytest.param(page, smaller, id=page.name))
        if page.name in SLOW_PAGES or is_shortened:
            name = f"{page.name} as it is"
            parameters.append(pytest.param(page, {}, id=name, marks=pytest.mark.slow))
    return parameters


def run_block(kind, text, page, names, statuses):
    """Run a block of Python with the names of earlier blocks, or a block of commands."""
    if kind == "python":
        exec(compile(text, page.name, "exec"), names)
    elif kind == "console":
        for line in text.splitlines():
            (program,) = [name for name in PROGRAMS if line.startswith(f"$ {name} ")]
            arguments = shlex.split(line.removeprefix(f"$ {program} "))
            assert PROGRAMS[program](arguments) in statuses, line


@pytest.mark.parametrize(("page", "smaller"), pages_with_blocks())
def test_every_block_runs(page, smaller, tmp_path, monkeypatch):
    """Run a page's blocks in order and in one folder; names stay, as they do for a reader."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    monkeypatch.chdir(tmp_path)
    # What pages call the reader's own.
    write_network("mine.network.h5", modal.fcc(cells=(2, 2, 12)))
    shutil.copytree(ROOT / "examples/packings", tmp_path, dirs_exist_ok=True)
    names = {}
    # A smaller packing may be too short for a low-pass frequency.
    # That of the tutorial is, as its text says.
    statuses = [0]
    if smaller or page.name == "tutorial.md":
        statuses = [0, FALLS_SHORT_STATUS]
    for kind, text in blocks(page):
        for packing, small_packing in smaller.items():
            text = text.replace(packing, small_packing)
        run_block(kind, text, page, names, statuses)
    pyplot.close("all")
    if page.name == "README.md":
        assert (tmp_path / "wave.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("known", ["v_p and the limit", "v_p", "nothing"])
def test_picture_of_lammps_page_does_without_what_is_not_known(tmp_path, monkeypatch, known):
    """A wave through a crystal in place of the page's packing; what is measured is given here."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    monkeypatch.chdir(tmp_path)
    crystal = modal.fcc(cells=(2, 2, 12))
    measured = {"v_p": Value(np.nan, "m/s"), "low_pass_unbiased": Value(np.nan, "Hz")}
    if "v_p" in known:
        measured["v_p"] = Value(700.0, "m/s", {"fit": 1.0})
    if "limit" in known:
        measured["low_pass_unbiased"] = Value(1e5, "Hz", {"fit": 1e3})
    monkeypatch.setattr(modal, "read", lambda path: crystal)
    monkeypatch.setattr(analysis, "measure", lambda network, quantities: measured)
    pages = blocks(ROOT / "docs/lammps.md")
    picture = next(text for kind, text in pages if kind == "python" and "matplotlib" in text)
    if known == "nothing":
        with pytest.raises(SystemExit):
            exec(compile(picture, "lammps.md", "exec"), {})
    else:
        exec(compile(picture, "lammps.md", "exec"), {})
        assert (tmp_path / "lammps.png").read_bytes().startswith(b"\x89PNG")
    pyplot.close("all")


def commands_that_are_not_run(page):
    """Return the commands of a page in text blocks and in indented ones, without remarks."""
    text = re.sub(r"^```(python|console)\n.*?^```$", "", page.read_text(), flags=re.M | re.S)
    names = "|".join(map(re.escape, PROGRAMS))
    found = re.findall(rf"^(?:    )?(?:{names}) [^#\n]*", text, re.MULTILINE)
    return [line.strip() for line in found if "--help" not in line]


def test_commands_that_are_not_run_have_options_that_exist():
    """What cannot run without other programs' files, or takes long, is parsed at least."""
    parsers = {
        "granular-modes": modal.cli.main.parser,
        "python -m analysis": analysis.cli.main.parser,
    }
    counts = dict.fromkeys(parsers, 0)
    for page in PAGES:
        for line in commands_that_are_not_run(page):
            (program,) = [name for name in parsers if line.startswith(f"{name} ")]
            words = shlex.split(line.removeprefix(program))
            parsers[program](words[0]).parse_args(words)
            counts[program] += 1
    assert counts["granular-modes"] > 35
    assert counts["python -m analysis"] > 4


def test_exports_of_the_page_of_other_programs_run(tmp_path, monkeypatch):
    """Export contacts, matrices, modes and a wave of a crystal, as the page says."""
    pytest.importorskip("meshio")  # writes the modes for ParaView
    monkeypatch.chdir(tmp_path)
    network = modal.fcc(cells=(2, 2, 12))
    write_network("mine.network.h5", network)
    write_modes("mine.modes.h5", modal.eigenmodes(network, lowest=2, shapes=True))
    write_signals("mine.signals.h5", modal.propagate(network, 2e-5, particles=True).signals)
    page = ROOT / "docs/other_programs.md"
    lines = [line for line in commands_that_are_not_run(page) if " export " in line]
    assert len(lines) == 7
    for line in lines:
        assert main(shlex.split(line)[1:]) == 0, line
    for name in ("mine.csv", "mine.mass.npz", "mine.mass.mtx", "mine.vtu", "wave.xyz"):
        assert (tmp_path / name).exists(), name


@pytest.mark.slow
def test_packings_of_the_page_of_contacts_run(tmp_path, monkeypatch):
    """Pack, rest and measure grains that stick, roll and are clumps, as the page has them."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "two.csv").write_text("x,y,z,radius\n0,0,-0.5,1\n0,0,0.5,1\n")
    lines = commands_that_are_not_run(ROOT / "docs/contacts.md")
    assert len(lines) > 6
    for line in lines:
        assert main(shlex.split(line)[1:]) == 0, line


LIST_OF_COMMANDS = "pack", "info", "modes", "count", "density", "moduli", "wave", "response"
"""Commands of the page of the command line that need no file of another program."""


@pytest.mark.slow
def test_list_of_the_page_of_the_command_line_runs(tmp_path, monkeypatch):
    """Run its lines on a small packing that has the names that the page gives."""
    monkeypatch.chdir(tmp_path)
    network = modal.random_packing(spheres=200, aspect=4)
    modal.write("mine.network.h5", network)
    modal.write("cell.network.h5", modal.random_packing(spheres=200, periodic=True))
    assert main(["pack", "--spheres", "200", "--stress", "1e5", "-o", "."]) == 0
    (tmp_path / "100000Pa.sample.h5").rename("mine.sample.h5")
    run = 0
    for line in commands_that_are_not_run(ROOT / "docs/command_line.md"):
        command = shlex.split(line.replace("--spheres 2000", "--spheres 200"))[1:]
        # No sphere of this packing is held; its cell is less than 20 mm high.
        if command[0] not in LIST_OF_COMMANDS or {"--rough-wall", "--plane"} & {*command}:
            continue
        line = line.replace("--disc 0 0 0.02 0.004 --receivers 0.1 0.2", "--point 3")
        command = shlex.split(line.replace("--spheres 2000", "--spheres 200"))[1:]
        assert main(command) in (0, FALLS_SHORT_STATUS), line
        run += 1
    assert run > 10


def test_links_and_names_within_the_repository_lead_to_files():
    rooms = [folder.name for folder in ROOT.iterdir() if folder.is_dir() and folder.name[0] != "."]
    named = re.compile(rf"`((?:{'|'.join(rooms)})/[\w./-]+)`")
    for page in PAGES:
        text = BLOCK.sub("", page.read_text())
        for target in re.findall(r"\]\((?!https?:)([^)#\s]+)(?:#[^)]*)?\)", text):
            assert (page.parent / target).exists(), (page.name, target)
            # The site has pictures from anywhere, but pages from its own folder alone.
            outside = page.parent.name == "docs" and target.startswith("..")
            assert not (outside and target.endswith(".md")), (page.name, target)
        for name in named.findall(text):
            made = name.startswith(("products/", "site/")) or "NAME" in name
            # The layout tells of its tests by their names below tests.
            below = page.stem == "layout" and (ROOT / "tests" / name).exists()
            assert made or below or (ROOT / name).exists(), (page.name, name)


MAX_WORDS_FOR_USERS = 14_000
"""Words of the users' part: about an hour and a half of reading."""


def users_pages():
    """Return README, the index, and the pages of its tables of contents but the developers'."""
    index = ROOT / "docs/index.md"
    table = re.compile(r"```\{toctree\}\n:caption: ([^\n]+)\n(.*?)```", re.DOTALL)
    contents = table.findall(index.read_text())
    names = " ".join(rest for caption, rest in contents if caption != "For developers").split()
    pages = [ROOT / f"docs/{name}.md" for name in names]
    return [ROOT / "README.md", index, *(page for page in pages if page.exists())]


def count_words(text):
    """Count the words of sentences, lists and headings, without code blocks, tables and links."""
    text = re.sub(r"^(`{3,}).*?^\1`*$", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"^(    |\|).*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"\]\([^)]*\)", "]", text)
    return len(re.findall(r"[A-Za-z][\w'-]*", text))


def test_words_are_counted_without_code_tables_and_links():
    page = "# A head\n\nSee [this page](other.md): it isn't long.\n\n| a | b |\n\n    code here\n"
    assert count_words(page) == 8
    assert count_words(f"{page}\n```text\nmore code\n```\n\nEnd.\n") == 9


def test_users_part_is_at_most_14000_words():
    """Code blocks and tables are not counted, nor what a page includes from another file."""
    pages = users_pages()
    assert len(pages) > 15
    words = {page.stem: count_words(page.read_text()) for page in pages}
    assert sum(words.values()) <= MAX_WORDS_FOR_USERS, words


def test_links_that_lead_nowhere_are_found(tmp_path):
    """The check that `.ci/site` runs on the built site, here on two small pages."""
    check = [sys.executable, str(ROOT / "docs/links.py"), str(tmp_path)]
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub/two.html").write_text('<h1 id="here">2</h1><img src="../one.html">')
    sound = '<p id="p"><a href="#p"></a><a href="sub/two.html#here"></a><a href="https://a.org/b">'
    (tmp_path / "one.html").write_text(sound)
    done = subprocess.run(check, capture_output=True, text=True)
    assert done.returncode == 0 and "1 go out" in done.stdout
    listed = subprocess.run([*check, "--external"], capture_output=True, text=True)
    assert listed.stdout == "https://a.org/b\n"
    wrong = ["#q", "three.html", "sub/two.html#there", "sub", "https:///b", "htp://a.org"]
    (tmp_path / "one.html").write_text("".join(f'<a href="{target}"></a>' for target in wrong))
    done = subprocess.run(check, capture_output=True, text=True)
    assert done.returncode == 1
    assert [line.split(": ")[1] for line in done.stdout.splitlines()] == sorted(wrong)


def test_every_result_is_in_one_row_and_every_row_has_its_files():
    """Of results/README.md, which says which command made it."""
    results = ROOT / "results"
    done = subprocess.run(["git", "ls-files"], cwd=results, capture_output=True, text=True)
    if done.returncode:
        pytest.skip("not a clone: nothing says which files are committed")
    committed = [path for path in done.stdout.splitlines() if (results / path).exists()]
    rows = re.findall(r"^\| (`.*?) \| (.*?) \|$", (results / "README.md").read_text(), re.MULTILINE)
    patterns = [pattern for files, _ in rows for pattern in re.findall("`(.+?)`", files)]
    for path in set(committed) - {"README.md"}:
        matches = [pattern for pattern in patterns if fnmatchcase(path, pattern)]
        assert len(matches) == 1, f"results/{path}: in {len(matches)} rows of results/README.md"
    for pattern in patterns:
        assert any(fnmatchcase(path, pattern) for path in committed), f"{pattern}: no such file"
    assert all(made for _, made in rows)
