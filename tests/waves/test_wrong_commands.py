"""What `wave`, `response` and `moduli` cannot do is said in one line, with exit status 2."""

import pytest

import modal
from modal.__main__ import main
from modal.packing.network import write_network

PACKINGS = {
    "crystal": lambda: modal.fcc(cells=(2, 2, 6)),
    "cell": lambda: modal.fcc(cells=(1, 1, 12), periodic_z=True),
}
WRONG = [
    *(("crystal", f"wave --duration {s}", "must be positive") for s in ("-1", "0")),
    *(("crystal", f"wave --interval {s}", "must be positive") for s in ("0", "-1", "1e-3")),
    *(("crystal", f"wave --tolerance {s}", "between 0 and 1") for s in ("0", "1")),
    *(("crystal", f"wave --time-step {s}", "must be positive") for s in ("0", "-1")),
    *(("crystal", f"wave --time-step 5e-8 --interval {s}", "positive") for s in ("0", "-1")),
    *(("crystal", f"wave --{option} nan", "give a number") for option in ("interval", "time-step")),
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
    (
        "crystal",
        "wave --motion step --sweep 1e-5 --input-frequency 2e5",
        "--input-frequency: the motion is a step",
    ),
    ("crystal", "wave --motion step --sweep 1e-5 --amplitude 0", "never moves"),
    ("crystal", "wave --plane 99", "outside the cell"),
    ("crystal", "wave --plane nan", "give a number"),
    ("crystal", "wave --point -1", "the packing has 0 to"),
    ("crystal", "wave --friction 2", "of the non-linear wave"),
    ("cell", "wave", "--plane"),
    ("cell", "wave --plane 0 --direction torsion", "free sides"),
    ("crystal", "response --resolution 0", "positive number of Hz"),
    ("crystal", "response --highest 10", "must exceed the resolution"),
    ("crystal", "response --highest 2e4 --damping -0.1 0", "takes energy"),
    ("crystal", "response --damping 0.1 0 --resolution 1e-12", "fewer frequencies"),
    ("cell", "response --highest 1e4", "--plane"),
    ("crystal", "moduli --direction 0 0 0", "not all zero"),
    ("crystal", "moduli --pre-stress normal", "in a slab the springs alone"),
]


@pytest.mark.parametrize(("packing", "words", "said"), WRONG)
def test_one_line_and_no_file(packing, words, said, tmp_path, capsys):
    path, product = tmp_path / "a.network.h5", tmp_path / "a.product.h5"
    write_network(path, PACKINGS[packing]())
    command, *options = words.split()
    assert main([command, str(path), *options, "-o", str(product)]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1 and not product.exists()
