"""`wave`, `response`, `moduli`: the digits of the functions; what they cannot do is one line."""

import h5py
import numpy as np
import pytest
from refusals import refusal

import modal
from analysis.__main__ import main as analysis_main
from modal.__main__ import main
from modal.packing.network import write_network
from modal.system.damping import ContactDamping
from modal.waves.motions import Pulse, SampledMotion, chirp, step
from modal.waves.response import read_response
from modal.waves.signals import read_signals
from modal.waves.sources import Plane, Point

PACKINGS = {
    "crystal": lambda: modal.fcc(cells=(2, 2, 6)),
    "cell": lambda: modal.fcc(cells=(1, 1, 12), periodic_z=True),
}
TABLE = SampledMotion([0, 2e-6], [0, 1e-9])
DAMPING = ContactDamping(0.05, 0.03)
PUSH = "--amplitude 2.5e-9 --input-frequency 1e5"
TWO_CYCLES = {"motion": Pulse(2.5e-9, 1e5, cycles=2), "direction": "x"}
SWEPT = "--last-frequency 2e5 --sweep 1e-5"
TURNED = "--point 3 --direction torsion"
TURNS = {"source": Point(3), "direction": "torsion"}
OPENED = "--plane 0.01 --direction y"
OPENS = {"source": Plane(0.01), "direction": "y"}
SAME = [
    ("crystal", "wave", {}),
    ("crystal", "wave --time-step 5e-8 --particles", {"time_step": 5e-8, "particles": True}),
    ("crystal", "wave --time-step 3e-7 --interval 1.2e-6", {"time_step": 3e-7, "interval": 1.2e-6}),
    ("crystal", "wave --motion-file wall.txt --whole", {"motion": TABLE, "whole": True}),
    ("crystal", f"wave --cycles 2 --direction x {PUSH}", TWO_CYCLES),
    ("crystal", f"wave --motion chirp {SWEPT} {PUSH}", {"motion": chirp(2.5e-9, 1e5, 2e5, 1e-5)}),
    (
        "crystal",
        "wave --motion step --sweep 1e-5 --amplitude 2.5e-9",
        {"motion": step(2.5e-9, 1e-5)},
    ),
    ("crystal", "wave --amplitude 1e-9 --input-frequency 2e5", {"motion": Pulse(1e-9, 2e5)}),
    ("crystal", "wave --damping 0.05 0.03", {"damping": DAMPING}),
    ("crystal", f"wave {TURNED} --particles", TURNS | {"particles": True}),
    ("cell", f"wave {OPENED} --particles", OPENS | {"particles": True}),
    ("crystal", "response --resolution 5e3", {"resolution": 5e3}),
    ("crystal", f"response --highest 2e4 {TURNED}", {"highest": 2e4} | TURNS),
    ("crystal", "response --highest 2e4 --damping 0.05 0.03", {"highest": 2e4, "damping": DAMPING}),
    ("cell", f"response --highest 2e4 {OPENED}", {"highest": 2e4} | OPENS),
]


@pytest.mark.parametrize(("packing", "words", "settings"), SAME)
def test_file_and_numbers_are_those_of_the_function(
    packing, words, settings, tmp_path, printed, one_line, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    network = PACKINGS[packing]()
    command, *options = words.split()
    write_network("a.network.h5", network)
    np.savetxt("wall.txt", np.column_stack([TABLE.time, TABLE.value]))
    if command == "wave":
        options += ["--duration", "2e-5"]
    result = printed(command, "a.network.h5", *options, "-o", "a.h5")
    if command == "wave":
        wave = modal.propagate(network, 2e-5, **settings)
        recording = wave.signals
        products = wave.products
        read = read_signals("a.h5", of_any_source=True)
        assert result.get("truncation", wave.truncation) == wave.truncation
        assert result.get("computed_one_of_equal_parts", 1) == wave.repeats
    else:
        recording = modal.frequency_response(network, **settings)
        products = recording.products
        read = read_response("a.h5")
        check_printed_response(result, recording)
    assert result["products_with_k"] == products
    for name, value in vars(recording).items():
        if name not in ("run_time", "products"):
            assert np.array_equal(getattr(read, name), value), name
    check_unit("a.h5", command, settings.get("direction"))
    if recording.from_wall_to_wall:
        return
    if command == "response":
        with refusal("no_gain"):
            recording.gain  # noqa: B018
    else:
        check_other_source("a.h5", settings["direction"], one_line)


def check_printed_response(result, response):
    maxima = None
    if response.from_wall_to_wall:
        maxima = response.gain_maxima().tolist()
    assert result.get("gain_maxima_hz") == maxima
    damping = None
    if response.damping is not None:
        damping = [0.05, 0.03]
    assert result.get("damping") == damping


def check_unit(path, command, direction):
    """Check the unit of displacements: rad of torsion, and per metre of a response."""
    unit = "rad" if direction == "torsion" else "m"
    if command == "response":
        unit += "/m"
    with h5py.File(path) as file:
        assert file["layers/displacement"].attrs["units"] == unit


def check_other_source(path, direction, one_line):
    """Refuse waves that are not from wall to wall where velocities are measured."""
    with refusal("other_source"):
        read_signals(path)
    figure = ["figure", "signals", "a.network.h5", path]
    one_line(analysis_main, figure, code="not_from_wall_to_wall")
    export = ["export", "a.network.h5", path, "-o", "a.xyz"]
    if direction == "torsion":
        one_line(main, export, code="torsion")
    else:
        assert main(export) == 0


WRONG = [
    ("crystal", "wave --interval -1e-30", "interval_or_tolerance"),
    ("crystal", "wave --interval 0", "interval_or_tolerance"),
    ("crystal", "wave --interval 1e-3", "interval_or_tolerance"),
    ("crystal", "wave --tolerance 0", "interval_or_tolerance"),
    ("crystal", "wave --tolerance 1", "interval_or_tolerance"),
    ("crystal", "wave --time-step -1e-30", "time_step"),
    ("crystal", "wave --time-step 3e-7 --interval 1e-6", "time_step"),
    ("crystal", "wave --damping -0.1 0", "damping_ratio"),
    ("crystal", "wave --damping 0.05 0.03 --time-step 1e-7", "damping"),
    ("crystal", "wave --cycles 0", "cycles"),
    ("crystal", "wave --motion step", "missing_option"),
    ("crystal", "wave --motion chirp --sweep 1e-5", "missing_option"),
    ("crystal", "wave --sweep 1e-5", "foreign_option"),
    ("crystal", "wave --motion step --sweep 0", "rise_time"),
    ("crystal", "wave --motion step --motion-file x.txt", "command_line"),
    ("crystal", "wave --motion-file still.txt", "no_wave"),
    ("crystal", "wave --motion-file still.txt --amplitude 1e-9", "foreign_option"),
    ("crystal", "wave --plane 99", "plane_outside_cell"),
    ("crystal", "wave --point -1", "no_such_sphere"),
    ("crystal", "wave --friction 2", "option_of_other_wave"),
    ("cell", "wave", "no_source_wall"),
    ("cell", "wave --plane 0 --direction torsion", "torsion_of_periods"),
    ("crystal", "response --resolution 0", "resolution_or_tolerance"),
    # Some 1e12 frequencies: 1e13 bytes for each receiver.
    ("crystal", "response --resolution 1e-6", "too_large"),
    ("crystal", "response --highest 10 --resolution 1e3", "highest_frequency"),
    ("crystal", "response --highest 1e9", "highest_frequency"),
    ("crystal", "response --damping 0.1 0 --resolution 1e-12", "too_large"),
    ("cell", "response --highest 1e4", "no_source_wall"),
    ("crystal", "moduli --pre-stress normal", "pre_stress"),
]
"""A packing, a command of a careless user, and the code of its refusal."""


@pytest.mark.parametrize(("packing", "words", "code"), WRONG)
def test_one_line_and_no_file(packing, words, code, tmp_path, one_line, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_network("a.network.h5", PACKINGS[packing]())
    (tmp_path / "still.txt").write_text("0 0\n1e-5 0\n")
    command, *options = words.split()
    one_line(main, [command, "a.network.h5", *options, "-o", "a.product.h5"], code=code)
    assert not (tmp_path / "a.product.h5").exists()


def test_unstable_time_step_is_named(tmp_path, one_line):
    """Name the step, the largest that divides the interval: a quarter of it."""
    path = tmp_path / "a.network.h5"
    write_network(path, PACKINGS["crystal"]())
    words = "--time-step 3e-7 --interval 1e-6 --duration 1e-5"
    one_line(main, ["wave", path, *words.split()], "2.5e-07", code="time_step")


@pytest.mark.parametrize("missing", ["--sweep", "--last-frequency"])
def test_missing_option_of_a_motion_is_named(missing, tmp_path, one_line):
    path = tmp_path / "a.network.h5"
    write_network(path, PACKINGS["crystal"]())
    motion = {"--sweep": "step", "--last-frequency": "chirp --sweep 1e-5"}[missing]
    one_line(main, ["wave", path, "--motion", *motion.split()], missing, code="missing_option")
