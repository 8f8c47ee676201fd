"""`wave`, `response`, `moduli`: the digits of the functions; what they cannot do is one line."""

import h5py
import numpy as np
import pytest

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
TURNED, TURNS = "--point 3 --direction torsion", {"source": Point(3), "direction": "torsion"}
OPENED, OPENS = "--plane 0.01 --direction y", {"source": Plane(0.01), "direction": "y"}
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


@pytest.mark.two_ways
@pytest.mark.parametrize(("packing", "words", "settings"), SAME)
def test_file_and_numbers_are_those_of_the_function(
    packing, words, settings, tmp_path, capsys, printed, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    network, (command, *options) = PACKINGS[packing](), words.split()
    write_network("a.network.h5", network)
    np.savetxt("wall.txt", np.column_stack([TABLE.time, TABLE.value]))
    length = ["--duration", "2e-5"] if command == "wave" else []
    said = printed(command, "a.network.h5", *options, *length, "-o", "a.h5")
    turns, waves = settings.get("direction") == "torsion", command == "wave"
    if waves:
        found = modal.propagate(network, 2e-5, **settings)
        own, read = found.signals, read_signals("a.h5", of_any_source=True)
        told = found.truncation, found.repeats
        named = "truncation", "computed_one_of_equal_parts"
        assert tuple(map(said.get, named, told)) == told
    else:
        own = found = modal.frequency_response(network, **settings)
        read = read_response("a.h5")
        maxima = found.gain_maxima().tolist() if found.from_wall_to_wall else None
        assert said.get("gain_maxima_hz") == maxima
        assert said.get("damping", 0) == (0 if found.damping is None else [0.05, 0.03])
    assert said["products_with_k"] == found.products
    for name, value in vars(own).items():
        if name not in ("run_time", "products"):
            assert np.array_equal(getattr(read, name), value), name
    with h5py.File("a.h5") as file:
        unit = file["layers/displacement"].attrs["units"]
    assert unit == ("rad" if turns else "m") + ("" if waves else "/m")
    if own.from_wall_to_wall:
        return
    if not waves:
        with pytest.raises(modal.InputError, match="no stress on both"):
            own.gain  # noqa: B018
        return
    with pytest.raises(modal.InputError, match="not of a wave from wall to wall"):
        read_signals("a.h5")
    assert analysis_main(["figure", "signals", "a.network.h5", "a.h5"]) == 2
    assert "reads no other" in capsys.readouterr().err
    assert main(["export", "a.network.h5", "a.h5", "-o", "a.xyz"]) == 2 * turns
    assert ("turns" in capsys.readouterr().err) is turns


WRONG = [
    *(("crystal", f"wave --interval {s}", "must be positive") for s in ("-1e-30", "0", "1e-3")),
    *(("crystal", f"wave --tolerance {s}", "between 0 and 1") for s in ("0", "1")),
    ("crystal", "wave --time-step -1e-30", "must be positive"),
    # The step named divides the interval: four of them.
    ("crystal", "wave --time-step 3e-7 --interval 1e-6", "2.5e-07"),
    ("crystal", "wave --damping -0.1 0", "takes energy"),
    ("crystal", "wave --damping 0.05 0.03 --time-step 1e-7", "leapfrog"),
    ("crystal", "wave --cycles 0", "whole number"),
    ("crystal", "wave --motion step", "needs --sweep"),
    ("crystal", "wave --motion chirp --sweep 1e-5", "needs --last-frequency"),
    ("crystal", "wave --sweep 1e-5", "the motion is a pulse"),
    ("crystal", "wave --motion step --sweep 0", "above 0"),
    ("crystal", "wave --motion step --motion-file x.txt", "not allowed with argument --motion"),
    ("crystal", "wave --motion-file still.txt", "never moves"),
    ("crystal", "wave --motion-file still.txt --amplitude 1e-9", "the motion is a file"),
    ("crystal", "wave --plane 99", "outside the cell"),
    ("crystal", "wave --point -1", "the packing has 0 to"),
    ("crystal", "wave --friction 2", "of the non-linear wave"),
    ("cell", "wave", "--plane"),
    ("cell", "wave --plane 0 --direction torsion", "free sides"),
    ("crystal", "response --resolution 0", "positive number of Hz"),
    # Some 1e12 frequencies: 1e13 bytes for each receiver.
    ("crystal", "response --resolution 1e-6", "coarser resolution"),
    ("crystal", "response --highest 10 --resolution 1e3", "must exceed the resolution"),
    ("crystal", "response --highest 1e9", "times that of the highest mode"),
    ("crystal", "response --damping 0.1 0 --resolution 1e-12", "fewer frequencies"),
    ("cell", "response --highest 1e4", "--plane"),
    ("crystal", "moduli --pre-stress normal", "in a slab the springs alone"),
]


@pytest.mark.parametrize(("packing", "words", "said"), WRONG)
def test_one_line_and_no_file(packing, words, said, tmp_path, one_line, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_network("a.network.h5", PACKINGS[packing]())
    (tmp_path / "still.txt").write_text("0 0\n1e-5 0\n")
    command, *options = words.split()
    one_line(main, [command, "a.network.h5", *options, "-o", "a.product.h5"], said)
    assert not (tmp_path / "a.product.h5").exists()
