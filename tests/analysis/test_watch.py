"""The page to watch: its numbers are the files', and a browser plays it without an error."""

import base64
import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from PIL import Image
from places import SHEARED

import modal
from analysis.__main__ import main
from analysis.watch.shown_wave import slip_of_spheres
from modal.modes.mode_set import write_modes
from modal.packing.network import write_network
from modal.packing.sample import read_sample, write_sample
from modal.preparation.relax import relax
from modal.waves.motions import Pulse
from modal.waves.propagate import propagate
from modal.waves.signals import write_signals

DURATION = 4e-5


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A crystal with its wave and its modes, and the pages of both."""
    path = tmp_path_factory.mktemp("watch")
    network = modal.fcc(cells=(2, 2, 16))
    write_network(path / "fcc.network.h5", network)
    wave = propagate(network, DURATION, interval=5e-7, particles=True)
    write_signals(path / "fcc.signals.h5", wave.signals)
    modes = modal.eigenmodes(network, lowest=9, shapes=True)
    write_modes(path / "fcc.modes.h5", modes)
    for product in ("signals", "modes"):
        files = [str(path / f"fcc.{kind}.h5") for kind in (product, "network")]
        assert main(["watch", *files, "-o", str(path / f"{product}.html")]) == 0
    return path, network, wave.signals, modes


@pytest.fixture(scope="module")
def slid(tmp_path_factory):
    """The page of a wave of a third of an overlap, the wave, and its packing."""
    path = tmp_path_factory.mktemp("slid")
    sample, _ = relax(read_sample(SHEARED))
    write_sample(path / "one.sample.h5", sample)
    wave = modal.propagate(
        sample, DURATION, nonlinear=True, motion=Pulse(2.5e-7, 1e5), time_step=5e-8, particles=True
    )  # fmt: skip
    write_signals(path / "one.signals.h5", wave.signals)
    page = path / "one.html"
    files = [str(path / f"one.{kind}.h5") for kind in ("signals", "sample")]
    assert main(["watch", *files, "-o", str(page)]) == 0
    return page, wave, sample.network()


def data_of(page):
    return json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', page, re.DOTALL)[1])


def decoded(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


def test_the_page_holds_the_packing_and_its_wave(folder):
    path, network, signals, _ = folder
    data = data_of((path / "signals.html").read_text())
    place = decoded(data["position"], "<u2").reshape(-1, 3) * data["step"] + data["origin"]
    # Half a step of 16 bits over the packing's extent.
    assert abs(place - network.position).max() <= 0.501 * max(data["step"])
    assert np.allclose(decoded(data["radius"], "<f4"), network.radius, rtol=1e-6, atol=0)
    moved = decoded(data["displacement"], "<i2").reshape(len(data["time"]), -1) / 32767
    wanted = signals.particle_displacement
    assert len(data["time"]) == len(signals.time)  # fewer than the page has room for
    assert abs(moved * data["real"] - wanted).max() <= 0.501 * abs(wanted).max() / 32767
    assert np.allclose(data["time"], 1e6 * signals.time, rtol=1e-4)
    wall = np.interp(data["time"], 1e6 * signals.time, 1e9 * signals.source_displacement)
    assert data["wall_displacement"] == pytest.approx(list(wall), rel=1e-3, abs=1e-4)
    # Parseval: the spectrum's one-sided energy is that of the signal, where it is whole.
    signal = data["signals"][len(data["signals"]) // 2]
    energy = (np.array(signal["displacement"]) ** 2).sum() * 0.5  # nm^2 us
    spectrum = np.array(signal["spectrum"])
    step = data["spectrum_frequency"][1] * 1e-3  # 1/us
    both_sides = 2 * (spectrum**2).sum() - spectrum[0] ** 2
    # Up to 2.5 times the pulse's frequency, above which the pulse has little.
    assert both_sides * step == pytest.approx(energy, rel=0.01, abs=0)


def test_the_page_holds_the_modes(folder):
    path, network, _, modes = folder
    data = data_of((path / "modes.html").read_text())
    shape = decoded(data["displacement"], "<i2").reshape(9, network.n_particles, 3) / 32767
    for found, true in zip(shape, modes.mode_shape[:, :, :3], strict=True):
        true = true / np.linalg.norm(true, axis=1).max()
        assert abs(found - true).max() <= 0.501 / 32767
    assert [m["frequency"] for m in data["modes"]] == pytest.approx(modes.frequency / 1e3)
    assert data["walls"] == pytest.approx(list(network.wall_position))
    # The mean of a crystal's plane waves over layers has the shape's own largest value.
    plane = [m for m in data["modes"] if m["chi_z"] > 0.999]
    assert plane and all(m["along"] == "z" for m in plane)
    assert all(max(map(abs, m["layers"])) > 0.9 for m in plane)


def test_the_page_holds_the_contacts_and_their_forces(folder):
    """Each line joins the two centres, or a centre and the wall; widths are as the forces."""
    path, network, _, _ = folder
    contacts = data_of((path / "modes.html").read_text())["contacts"]
    first, second = (decoded(contacts[name], "<i4") for name in ("first", "second"))
    across = decoded(contacts["across"], "<i2").reshape(-1, 3) * contacts["step"]
    wall = second == -1
    assert len(first) == network.n_contacts and (wall == network.with_wall).all()
    reach = network.position[first] + across - network.position[second]
    periods = np.where(network.cell_periodic, network.cell_size, 1.0)
    off = reach - np.round(reach / periods) * np.where(network.cell_periodic, periods, 0.0)
    assert abs(off[~wall]).max() <= 0.501 * contacts["step"]
    ends = (network.position[first] + across)[wall, 2]
    assert np.isclose(ends[:, None], network.wall_position, atol=contacts["step"]).any(axis=1).all()
    force = network.force_normal / np.percentile(network.force_normal, 99)
    assert abs(decoded(contacts["force"], "u1") / 255 - np.minimum(force, 1)).max() <= 1 / 255


def test_the_page_holds_what_slip_dissipated(slid):
    """By sphere, on a logarithmic scale; over all spheres it is the slip of the energy book."""
    page, wave, network = slid
    lost = slip_of_spheres(network.n_particles, wave.signals.slip_ends, wave.signals.slip_energy)
    assert lost.sum() == pytest.approx(wave.energy[-1, 3], rel=1e-12, abs=0)
    # A contact between spheres gives half to each, one with a wall all to its sphere.
    pair = wave.signals.slip_ends.min(axis=1) >= 0
    assert pair.any() and not pair.all()
    held = np.isin(
        np.arange(network.n_particles), wave.signals.slip_ends[wave.signals.slip_ends >= 0]
    )
    assert (lost[held] > 0).all() and not lost[~held].any()
    data = data_of(page.read_text())
    deep = decoded(data["slip"], "u1") / 255
    seen = deep > 0
    shown = 10 ** (data["slip_decades"] * (deep - 1)) * lost.max()
    # Half a step of 255 over four decades.
    step = 10 ** (data["slip_decades"] / 255 / 2)
    assert seen.sum() > 20
    assert abs(np.log(shown[seen] / lost[seen])).max() <= np.log(step) * 1.001
    assert (lost[~seen] <= 1e-4 * step * lost.max()).all()
    assert f"in {len(wave.signals.slip_energy)} contacts" in data["slip_told"]


def test_nothing_comes_from_a_network(folder):
    """No element of the page loads anything; addresses stand only in texts of the libraries."""
    for name in ("signals", "modes"):
        page = (folder[0] / f"{name}.html").read_text()
        assert not re.search(r"<(script|link|img)[^>]*(src|href)=[\"'](?!data:)", page)
        assert "{{" not in re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["fcc.network.h5"], "other_product"),
        (["fcc.signals.h5", "fcc.network.h5", "--modes", "1"], "no_such_mode"),
        (["fcc.signals.h5"], "no_packing"),
    ],
)
def test_mistakes_are_one_line(folder, arguments, code, one_line):
    files = [folder[0] / a if a.endswith(".h5") else a for a in arguments]
    one_line(main, ["watch", *files, "-o", folder[0] / "no.html"], code=code)
    assert not (folder[0] / "no.html").exists()


def seen_by_a_browser(page, tmp_path):
    """The page's elements after a second and a half, and a picture of it."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("Chromium is not installed")
    picture = tmp_path / "page.png"
    options = ["--headless", "--no-sandbox", "--use-angle=swiftshader", "--mute-audio"]
    options += ["--enable-unsafe-swiftshader", "--window-size=900,700", "--disable-extensions"]
    options += ["--virtual-time-budget=1500", "--enable-logging=stderr", "--dump-dom"]
    options += [f"--user-data-dir={tmp_path / 'profile'}", f"--screenshot={picture}"]
    done = subprocess.run([browser, *options, page], capture_output=True, text=True, timeout=240)
    # Every message of the page's console is a line with this word.
    assert "CONSOLE" not in done.stderr, done.stderr
    return done.stdout, picture


def test_what_is_under_the_pointer_is_told(folder, tmp_path):
    """Over the sphere nearest to the eye: its number, its place, its recorded displacement."""
    path, network, signals, _ = folder
    points = """<script>
      playing = false;
      const all = [...Array(n).keys()].map((s) => onScreen(...position.slice(3 * s, 3 * s + 3)));
      const [clientX, clientY] = all.reduce((a, b) => (a[2] < b[2] ? a : b));
      const above = canvas.getBoundingClientRect().top;
      canvas.dispatchEvent(new PointerEvent("pointermove", { clientX, clientY: clientY + above }));
    </script></body>"""
    (tmp_path / "pointed.html").write_text(
        (path / "signals.html").read_text().replace("</body>", points)
    )
    seen, _ = seen_by_a_browser((tmp_path / "pointed.html").as_uri(), tmp_path)
    told = re.search(r"sphere (\d+), z = ([\d.]+) mm: u_z = ([-+.\de]+) nm", seen)
    number, z, motion = int(told[1]), float(told[2]), float(told[3])
    at = float(re.search(r'data-now="([\d.]+)"', seen)[1])
    assert z == pytest.approx(1e3 * network.position[number, 2], abs=0.006)
    recorded = 1e9 * signals.particle_displacement[:, number]
    # Three digits are told of numbers of 16 bits, between two recorded times.
    there = np.interp(at, np.arange(len(recorded)), recorded)
    assert motion == pytest.approx(there, rel=0.005, abs=1e9 * signals.amplitude / 3e4)


@pytest.mark.parametrize("name", ["signals", "modes", "modes#forces", "slip"])
def test_a_browser_plays_it(folder, slid, name, tmp_path):
    """Time goes on from the first drawing, and where the spheres are there are colours."""
    page = tmp_path / "page.html"
    name, _, forces = name.partition("#")
    text = slid[0].read_text() if name == "slip" else (folder[0] / f"{name}.html").read_text()
    chosen = '<script>by("colour").value = "dissipated by slip"; draw();</script></body>'
    page.write_text(text.replace("</body>", chosen) if name == "slip" else text)
    dom, picture = seen_by_a_browser(page.as_uri() + f"#{forces}" * bool(forces), tmp_path)
    (state,) = re.findall(r"<body ([^>]*)>", dom)
    drawn, now = (re.search(rf'data-{key}="([\d.]+)"', state)[1] for key in ("drawn", "now"))
    assert int(drawn) > 1 and 1 < float(now) < 60  # how many there are depends on the machine
    view = np.asarray(Image.open(picture).convert("RGB"), float)[90:380]
    assert (view.max(axis=2) < 180).sum() > 1000
    if name in ("signals", "slip"):  # a mode lacks colour twice in its period
        assert (np.ptp(view, axis=2) > 60).sum() > 200
