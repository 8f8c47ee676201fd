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
    """Return a folder with a crystal, its wave, its modes and the pages of both; then all three."""
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
def slipping(tmp_path_factory):
    """Return the page of a wave with slip, the wave, and its packing.

    The amplitude is a third of an overlap.
    """
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
    """Return the data of a page, given as its text."""
    return json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', page, re.DOTALL)[1])


def decoded(text, kind):
    """Return the array of numbers of a NumPy type in base64."""
    return np.frombuffer(base64.b64decode(text), kind)


HALF_STEP = 0.501
"""Largest error of a rounded number, in steps of its last digit; a thousandth for round-off."""


@pytest.fixture(scope="module")
def wave_data(folder):
    """Return the data of the page of the wave."""
    return data_of((folder[0] / "signals.html").read_text())


@pytest.fixture(scope="module")
def mode_data(folder):
    """Return the data of the page of the modes."""
    return data_of((folder[0] / "modes.html").read_text())


def test_the_page_holds_the_packing(folder, wave_data):
    """Read positions in steps of 16 bits over the extent of the packing."""
    network = folder[1]
    step = wave_data["step"]
    position = decoded(wave_data["position"], "<u2").reshape(-1, 3) * step + wave_data["origin"]
    assert abs(position - network.position).max() <= HALF_STEP * max(step)
    radius = decoded(wave_data["radius"], "<f4")
    assert np.allclose(radius, network.radius, rtol=1e-6, atol=0)


def test_the_page_holds_the_displacements_of_the_wave(folder, wave_data):
    """Read displacements in steps of 1 / 32767 of the largest; all times have room on the page."""
    signals = folder[2]
    times = wave_data["time"]
    share = decoded(wave_data["displacement"], "<i2").reshape(len(times), -1) / 32767
    exact = signals.particle_displacement
    assert len(times) == len(signals.time)
    assert np.allclose(times, 1e6 * signals.time, rtol=1e-4)
    error = abs(share * wave_data["real"] - exact).max()
    assert error <= HALF_STEP * abs(exact).max() / 32767
    wall = np.interp(times, 1e6 * signals.time, 1e9 * signals.source_displacement)
    assert wave_data["wall_displacement"] == pytest.approx(list(wall), rel=1e-3, abs=1e-4)


def test_the_spectrum_on_the_page_has_the_energy_of_its_signal(wave_data):
    """Compare by Parseval's theorem.

    The spectrum ends at 2.5 times the pulse's frequency; the pulse has less than a hundredth of its
    energy above.
    """
    signal = wave_data["signals"][len(wave_data["signals"]) // 2]
    interval = 0.5  # us
    energy = (np.array(signal["displacement"]) ** 2).sum() * interval  # nm^2 us
    spectrum = np.array(signal["spectrum"])
    frequency_step = wave_data["spectrum_frequency"][1] * 1e-3  # 1/us
    both_sides = 2 * (spectrum**2).sum() - spectrum[0] ** 2
    assert both_sides * frequency_step == pytest.approx(energy, rel=0.01, abs=0)


def test_the_page_holds_the_shapes_of_the_modes(folder, mode_data):
    """Read shapes in steps of 1 / 32767 of their largest displacement."""
    _, network, _, modes = folder
    shapes = decoded(mode_data["displacement"], "<i2").reshape(9, network.n_particles, 3) / 32767
    for shape, exact in zip(shapes, modes.mode_shape[:, :, :3], strict=True):
        exact = exact / np.linalg.norm(exact, axis=1).max()
        assert abs(shape - exact).max() <= HALF_STEP / 32767
    frequencies = [mode["frequency"] for mode in mode_data["modes"]]
    assert frequencies == pytest.approx(modes.frequency / 1e3)
    assert mode_data["walls"] == pytest.approx(list(network.wall_position))


def test_the_page_holds_the_layers_of_plane_modes(mode_data):
    """Average over layers: a plane wave of a crystal keeps its largest value there."""
    plane = [mode for mode in mode_data["modes"] if mode["chi_z"] > 0.999]
    assert plane
    for mode in plane:
        assert mode["along"] == "z"
        assert max(map(abs, mode["layers"])) > 0.9


@pytest.fixture(scope="module")
def contacts(mode_data):
    """Return the ends (m,), branch vectors (m, 3), m, and forces (m,) of the lines of a page.

    A branch vector is rounded to a whole number of `step`; the force is one of 255 widths.
    """
    lines = mode_data["contacts"]
    return {
        "first": decoded(lines["first"], "<i4"),
        "second": decoded(lines["second"], "<i4"),
        "branch": decoded(lines["across"], "<i2").reshape(-1, 3) * lines["step"],
        "step": lines["step"],
        "force": decoded(lines["force"], "u1") / 255,
    }


def test_the_page_holds_all_contacts(folder, contacts):
    network = folder[1]
    assert len(contacts["first"]) == network.n_contacts
    assert ((contacts["second"] == -1) == network.with_wall).all()


def test_lines_of_contacts_join_the_centres(folder, contacts):
    """Subtract whole periods of the cell, which a line may cross."""
    network = folder[1]
    pairs = contacts["second"] >= 0
    end = network.position[contacts["first"]] + contacts["branch"]
    error = (end - network.position[contacts["second"]])[pairs]
    periods = np.where(network.cell_periodic, network.cell_size, np.inf)
    shift = np.where(network.cell_periodic, np.round(error / periods) * network.cell_size, 0.0)
    assert abs(error - shift).max() <= HALF_STEP * contacts["step"]


def test_lines_of_wall_contacts_end_at_a_wall(folder, contacts):
    network = folder[1]
    at_wall = contacts["second"] == -1
    ends = (network.position[contacts["first"]] + contacts["branch"])[at_wall, 2]
    near = np.isclose(ends[:, None], network.wall_position, atol=contacts["step"])
    assert near.any(axis=1).all()


def test_widths_of_lines_are_the_forces(folder, contacts):
    """Scale with the 99th percentile of the forces, and cut off what is larger."""
    force = folder[1].force_normal
    share = np.minimum(force / np.percentile(force, 99), 1)
    assert abs(contacts["force"] - share).max() <= 1 / 255


def slip_losses(wave, network):
    """Return the energy (n,), J, that slip dissipated at each sphere."""
    signals = wave.signals
    return slip_of_spheres(network.n_particles, signals.slip_ends, signals.slip_energy)


def test_slip_of_spheres_adds_up_to_that_of_the_energy_balance(slipping):
    _, wave, network = slipping
    assert slip_losses(wave, network).sum() == pytest.approx(wave.energy[-1, 3], rel=1e-12, abs=0)


def test_slip_belongs_to_the_spheres_of_slipping_contacts(slipping):
    """Give half to each sphere of a pair, and all of a wall's contact to its sphere."""
    _, wave, network = slipping
    ends = wave.signals.slip_ends
    between_spheres = ends.min(axis=1) >= 0
    assert between_spheres.any()
    assert not between_spheres.all()
    slips = np.isin(np.arange(network.n_particles), ends[ends >= 0])
    losses = slip_losses(wave, network)
    assert (losses[slips] > 0).all()
    assert not losses[~slips].any()


def test_the_page_holds_what_slip_dissipated(slipping):
    """Read energies on a logarithmic scale of 255 steps over four decades."""
    page, wave, network = slipping
    losses = slip_losses(wave, network)
    data = data_of(page.read_text())
    decades = data["slip_decades"]
    level = decoded(data["slip"], "u1") / 255
    shown = level > 0
    assert shown.sum() > 20
    energy = 10 ** (decades * (level - 1)) * losses.max()
    half_step = 10 ** (decades / 255 / 2)
    error = abs(np.log(energy[shown] / losses[shown])).max()
    assert error <= np.log(half_step) * 1.001
    # What is not shown lies below the scale.
    assert (losses[~shown] <= 1e-4 * half_step * losses.max()).all()
    assert f"in {len(wave.signals.slip_energy)} contacts" in data["slip_told"]


def test_the_page_loads_nothing(folder):
    """Find no element that loads a file; addresses are only in texts of the libraries."""
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
    files = [folder[0] / word if word.endswith(".h5") else word for word in arguments]
    one_line(main, ["watch", *files, "-o", folder[0] / "no.html"], code=code)
    assert not (folder[0] / "no.html").exists()


BROWSER_OPTIONS = [
    "--headless",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--mute-audio",
    "--enable-unsafe-swiftshader",
    "--window-size=900,700",
    "--disable-extensions",
    # Milliseconds.
    "--virtual-time-budget=1500",
    "--enable-logging=stderr",
    "--dump-dom",
]


def open_in_browser(page, tmp_path):
    """Return the elements of a page after a second and a half, and the path of its picture."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("Chromium is not installed")
    picture = tmp_path / "page.png"
    output = [f"--user-data-dir={tmp_path / 'profile'}", f"--screenshot={picture}"]
    command = [browser, *BROWSER_OPTIONS, *output, page]
    process = subprocess.run(command, capture_output=True, text=True, timeout=240)
    # Every message of the page's console is a line with this word.
    assert "CONSOLE" not in process.stderr, process.stderr
    return process.stdout, picture


POINT_AT_NEAREST_SPHERE = """<script>
      playing = false;
      const all = [...Array(n).keys()].map((s) => onScreen(...position.slice(3 * s, 3 * s + 3)));
      const [clientX, clientY] = all.reduce((a, b) => (a[2] < b[2] ? a : b));
      const above = canvas.getBoundingClientRect().top;
      canvas.dispatchEvent(new PointerEvent("pointermove", { clientX, clientY: clientY + above }));
    </script></body>"""


def test_the_sphere_under_the_pointer_is_described(folder, tmp_path):
    """Read number, height and recorded displacement of the sphere nearest to the eye."""
    path, network, signals, _ = folder
    page = tmp_path / "pointed.html"
    text = (path / "signals.html").read_text()
    page.write_text(text.replace("</body>", POINT_AT_NEAREST_SPHERE))
    elements, _ = open_in_browser(page.as_uri(), tmp_path)
    label = re.search(r"sphere (\d+), z = ([\d.]+) mm: u_z = ([-+.\de]+) nm", elements)
    number = int(label[1])
    height = float(label[2])
    displacement = float(label[3])
    # Two decimals of a millimetre, and 16 bits over the length.
    assert height == pytest.approx(1e3 * network.position[number, 2], abs=0.006)
    record = float(re.search(r'data-now="([\d.]+)"', elements)[1])
    recorded = 1e9 * signals.particle_displacement[:, number]
    # Three digits of numbers of 16 bits, between two recorded times.
    expected = np.interp(record, np.arange(len(recorded)), recorded)
    assert displacement == pytest.approx(expected, rel=0.005, abs=1e9 * signals.amplitude / 3e4)


CHOOSE_SLIP = '<script>by("colour").value = "dissipated by slip"; draw();</script></body>'


@pytest.mark.parametrize("name", ["signals", "modes", "modes#forces", "slip"])
def test_a_browser_plays_it(folder, slipping, name, tmp_path):
    """Draw several pictures from the first on, with colours where the spheres are."""
    page = tmp_path / "page.html"
    product, _, fragment = name.partition("#")
    if product == "slip":
        page.write_text(slipping[0].read_text().replace("</body>", CHOOSE_SLIP))
    else:
        page.write_text((folder[0] / f"{product}.html").read_text())
    address = page.as_uri()
    if fragment:
        address += f"#{fragment}"
    elements, picture = open_in_browser(address, tmp_path)
    (state,) = re.findall(r"<body ([^>]*)>", elements)
    drawn = int(re.search(r'data-drawn="([\d.]+)"', state)[1])
    now = float(re.search(r'data-now="([\d.]+)"', state)[1])
    # How many pictures there are depends on the machine.
    assert drawn > 1
    assert 1 < now < 60
    view = np.asarray(Image.open(picture).convert("RGB"), float)[90:380]
    dark = view.max(axis=2) < 180
    assert dark.sum() > 1000
    # A mode lacks colour twice in its period.
    if product in ("signals", "slip"):
        coloured = np.ptp(view, axis=2) > 60
        assert coloured.sum() > 200


TURN_BY_KEYS = """<script>
      playing = false;
      const seen = () => camera.position.toArray().map((x) => x.toFixed(9)).join();
      const views = [(home(), seen())];
      for (const key of ["ArrowLeft", "ArrowUp", "+", "Home"]) {
        by("stage").dispatchEvent(new KeyboardEvent("keydown", { key }));
        views.push(seen());
      }
      document.body.dataset.views = new Set(views).size;
      document.body.dataset.back = views[0] === views[4];
    </script></body>"""


def test_keys_turn_and_zoom_the_packing(folder, tmp_path):
    page = tmp_path / "keys.html"
    text = (folder[0] / "modes.html").read_text()
    page.write_text(text.replace("</body>", TURN_BY_KEYS))
    elements, _ = open_in_browser(page.as_uri(), tmp_path)
    (state,) = re.findall(r"<body ([^>]*)>", elements)
    assert 'data-views="4"' in state
    assert 'data-back="true"' in state


@pytest.mark.parametrize("name", ["signals", "modes"])
def test_every_control_of_the_page_has_a_name(folder, name):
    """A name is a label around the control, a text in it, or `aria-label`."""
    page = (folder[0] / f"{name}.html").read_text().split("<script>")[0]
    labelled = {
        re.search(r'<(?:input|select) id="(\w+)"', label)[1]
        for label in re.findall(r"<label.*?</label>", page, re.DOTALL)
    }
    controls = re.findall(r'<(?:input|select) id="(\w+)"([^>]*)>', page)
    assert len(controls) > 8
    for control, attributes in controls:
        assert control in labelled or "aria-label" in attributes, control
    assert 'id="stage" tabindex="0" role="application"' in page
    assert '<html lang="en">' in page
