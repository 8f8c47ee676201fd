"""What products say of their making: recorded, compared, refused where two do not belong."""

from __future__ import annotations

import hashlib
import json
import shlex
import shutil
import sys
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import h5py
import numpy as np
import pytest
from places import ROOT, SHEARED
from refusals import refusal

from modal.__main__ import main
from modal.formats.provenance import (
    Provenance,
    changes,
    packing_of,
    read_provenance,
    require_same_packing,
    versions,
)
from modal.formats.whole_file import sha256
from modal.packing import crystal as gallery
from modal.packing.network import write_network
from modal.packing.sample import Sample, read_sample, write_sample
from modal.tools.errors import InputError

SOURCE = {"direction": "z", "motion": "pulse", "cycles": 1, "tolerance": 1e-9}
COMMANDS = {
    "modes": (["--lowest", "4"], "5", {}),
    "density": (["--resolution", "2e4"], "1.5e4", {}),
    "wave": (["--duration", "2e-5"], "2.5e-5", SOURCE),
    "response": (["--highest", "3e4", "--resolution", "1e4"], "2.5e4", {"direction": "z"}),
}
"""Commands that make a product of a packing: options that make it small, another value of the first
of them, and what the help says of options that are not given."""


@pytest.fixture
def network(tmp_path) -> Path:
    """Write a column of 12 spheres."""
    path = tmp_path / "case02.network.h5"
    write_network(path, gallery.fcc(1e5, (1, 1, 12)))
    return path


def made(command: str, network: Path, *options: str) -> Path:
    """Make the product of a command beside the network; later options replace earlier ones."""
    output = network.with_name(f"case02.{command}.h5")
    assert main([command, str(network), *COMMANDS[command][0], *options, "-o", str(output)]) == 0
    return output


def test_the_command_is_what_was_typed(tmp_path):
    """Let a shell split the command; files, also with blanks, have no folders in it."""
    (tmp_path / "my packings").mkdir()
    atoms = tmp_path / "my packings" / "mine.atoms"
    shutil.copy(ROOT / "examples" / "packings" / "mine.atoms", atoms)
    law = "granular hertz/material 6e10 0 0.2 tangential mindlin/force NULL 0 0.3"
    output = tmp_path / "new" / "mine.network.h5"
    options = ["--pair", law, f"--wall={law} zplane 0 NULL"]
    assert main(["import", str(atoms), *options, f"--output={output}"]) == 0
    typed = ["python", "-m", "modal", "import", "mine.atoms", *options, f"--output={output.name}"]
    assert shlex.split(read_provenance(output).command) == typed


@pytest.mark.parametrize("command", COMMANDS)
def test_a_product_says_what_it_was_made_from_and_is_kept_until_that_changes(
    command, network, capsys, one_line
):
    """Check the digest of the bytes on the disk and the canonical text of the settings."""
    path = made(command, network)
    digest = hashlib.sha256(network.read_bytes()).hexdigest()
    with h5py.File(path) as file:
        attributes = dict(file["provenance"].attrs)
    source = {"role": "packing", "name": "case02.network.h5", "sha256": digest}
    assert json.loads(attributes["sources"]) == [source]
    settings = json.loads(attributes["settings"])
    assert attributes["settings"] == json.dumps(settings, sort_keys=True, separators=(",", ":"))
    (option, old_text, *_), new_text, defaults = COMMANDS[command]
    assert settings[option[2:]] == float(old_text)
    assert attributes["command"].startswith(f"python -m modal {command} case02.network.h5 --")
    assert str(network.parent) not in "".join(attributes.values())
    assert f"numpy {np.__version__}" in attributes["versions"]
    # A default that is typed is no other setting: it is recorded as it is in force.
    assert defaults.items() <= settings.items()
    before = path.stat().st_mtime_ns
    for name, value in {"skip-current": "", **defaults}.items():
        typed = [f"--{name}", str(value)] if value else []
        made(command, network, "--skip-current", *typed)
    assert path.stat().st_mtime_ns == before
    capsys.readouterr()
    new_value = json.loads(new_text)
    made(command, network, "--skip-current", option, new_text)
    reported = capsys.readouterr().err
    for name in (option[2:], str(json.loads(old_text)), str(new_value)):
        assert name in reported
    assert path.stat().st_mtime_ns != before
    assert read_provenance(path).settings[option[2:]] == new_value
    # Without a file there is nothing to keep.
    one_line(main, [command, network, "--skip-current"], code="no_output")


def test_a_file_takes_the_place_of_the_setting_that_it_gives(network, tmp_path):
    motion = tmp_path / "motion.txt"
    motion.write_text("0 0\n1e-5 1e-9\n")
    provenance = read_provenance(made("wave", network, "--motion-file", str(motion)))
    assert "motion" not in provenance.settings
    assert [(s.role, s.name) for s in provenance.sources[1:]] == [("motion", "motion.txt")]


def test_changed_source_makes_a_product_stale(network, capsys):
    path = made("wave", network)
    old_digest = sha256(network)
    write_network(network, gallery.fcc(2e5, (1, 1, 12)))
    new_digest = sha256(network)
    expected = Provenance(read_provenance(path).command, {"seed": 1}, packing_of(network))
    (change,) = [each for each in changes(path, expected) if each.kind == "source"]
    assert (change.name, change.old.sha256, change.new.sha256) == (
        "packing",
        old_digest,
        new_digest,
    )
    made("wave", network, "--skip-current")
    reported = capsys.readouterr().err
    assert f"case02.network.h5 ({old_digest[:8]})" in reported
    assert f"case02.network.h5 ({new_digest[:8]})" in reported
    assert read_provenance(path).packing[0].sha256 == new_digest


def test_a_kept_list_that_lacks_modes_keeps_its_status(network):
    """Return 3 again."""
    modes = made("modes", network)
    with h5py.File(modes, "r+") as file:
        file.attrs["missing"] = 2
    arguments = ["modes", str(network), *COMMANDS["modes"][0], "--skip-current", "-o", str(modes)]
    assert main(arguments) == 3


def test_files_of_an_earlier_version(network):
    """Read files of unknown origin, and files that name their network at the root."""
    packing = packing_of(network)
    modes = made("modes", network)
    wave = made("wave", network)
    for path in (modes, wave):
        with h5py.File(path, "r+") as file:
            del file["provenance"]
            if path == modes:
                del file.attrs["network_sha256"]
    assert require_same_packing(modes, packing) != ""
    expected = Provenance(settings={"lowest": 4}, sources=packing)
    assert [change.kind for change in changes(modes, expected)] == ["no_settings"]
    assert require_same_packing(wave, packing) == ""
    write_network(network, gallery.fcc(2e5, (1, 1, 12)))
    with refusal("other_packing"):
        require_same_packing(wave, packing_of(network))


def test_a_network_that_is_not_among_the_sources_is_refused(network):
    path = made("wave", network)
    with h5py.File(path, "r+") as file:
        file.attrs["network_sha256"] = "abc"
    with pytest.raises(InputError) as refused:
        read_provenance(path)
    assert refused.value.code == "other_packing"
    assert "wave.h5" in str(refused.value)


def test_product_of_a_sample_belongs_to_the_network_exported_from_it(tmp_path):
    """Accept it both ways round; refuse another export, and the network of another sample."""
    names = "a.sample.h5", "a.network.h5", "b.network.h5"
    files = sample, network, other = [tmp_path / name for name in names]
    packing = gallery.fcc(1e5, (3, 3, 4))
    write_sample(sample, Sample(packing.position, packing.cell_size[:2], packing.wall_position, 0))
    made = Provenance("export", {}, packing_of(sample)).attributes()
    exported = replace(read_sample(sample).network(), provenance=made)
    write_network(network, exported)
    write_network(other, replace(exported, stiffness_normal=2 * exported.stiffness_normal))
    for source in files[:2]:
        product = source.with_suffix(".modes.h5")
        assert main(["modes", str(source), "--highest", "1", "-o", str(product)]) == 0
        assert all(require_same_packing(product, packing_of(file)) == "" for file in files[:2])
    with pytest.raises(InputError) as refused:
        require_same_packing(product, packing_of(other))
    assert refused.value.code == "other_packing"
    assert all(name in str(refused.value) for name in ("a.network.h5", "b.network.h5"))


def test_relaxed_sample_is_another_packing_than_its_state(tmp_path, capsys):
    rested = tmp_path / "case30.sample.h5"
    relax = ["relax", str(SHEARED), "--tolerance", "1e-6", "-o", str(rested)]
    assert main(relax) == 0
    sources = read_provenance(rested).sources
    assert [(s.role, s.sha256) for s in sources] == [("state", sha256(SHEARED))]
    assert [s.sha256 for s in packing_of(rested)] == [sha256(rested)]
    before = rested.stat().st_mtime_ns
    assert main([*relax, "--skip-current"]) == 0
    assert rested.stat().st_mtime_ns == before
    with h5py.File(rested, "r+") as file:
        file["study"].attrs["at_rest"] = False
    assert main([*relax, "--skip-current"]) == 3  # what it fell short of stays
    assert main([*relax, "--skip-current", "--friction", "0.7"]) == 0
    reported = capsys.readouterr().err
    assert "friction" in reported
    assert "0.7" in reported


def test_versions_are_those_of_what_is_loaded(monkeypatch):
    """Leave out scipy where it is installed but not used, as inside YADE."""
    assert f"scipy {metadata.version('scipy')}" in versions(yade="2023").split(", ")
    monkeypatch.delitem(sys.modules, "scipy")
    names = [text.split()[0] for text in versions(yade="2023").split(", ")]
    assert names == ["yade", "python", "granular-wave-modes", "numpy", "h5py"]
