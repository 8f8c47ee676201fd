"""Contacts at the friction limit that slip: every command is that of kt = 0."""

from dataclasses import replace

import numpy as np
import pytest
from changes import stiffer
from packings import polydisperse

from modal.packing.network import write_network

SLAB = polydisperse(n=40)
"""One contact in five slides."""


def without_kt(network):
    smooth = stiffer(network, 1, ~network.sliding)
    return replace(smooth, sliding=np.zeros(network.n_contacts, bool))


PULSE = ["--duration", "2e-5", "--input-frequency", "1e5", "--interval", "1e-6"]
"""Defaults follow from the elastic springs, whatever slips."""
ANSWERS = {
    "modes": (["--lowest", "20"], "frequency_hz"),
    "count": (["--at", "2e4", "1e5", "2e5"], "count_below"),
    "density": (["--at", "2e4", "1e5"], "estimated_count_below"),
    "wave": (PULSE, "truncation"),
    "response": (["--highest", "5e4"], "largest_gain"),
    "moduli": ([], "stiffness_pa"),
}
"""Of each command its options, and the numbers that say with which springs it was computed."""


@pytest.mark.parametrize("name", ANSWERS)
def test_every_command_has_the_answer_of_no_tangential_spring(name, tmp_path, printed):
    """Compare bits with a packing without the tangential springs; the elastic answer differs."""
    arguments, key = ANSWERS[name]
    answers = []
    path = str(tmp_path / "a.network.h5")
    for network, options in ((SLAB, ["--sliding", "slip"]), (without_kt(SLAB), []), (SLAB, [])):
        write_network(path, network)
        answers.append(printed(name, path, *arguments, *options)[key])
    assert answers[0] == answers[1] != answers[2]
