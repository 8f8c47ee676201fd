"""Table of compact samples: density, contacts, stresses and balance, measured from each file.

Below it what each stage of the longest compression among them has cost.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from analysis.estimators.layer_lattice import is_fcc
from analysis.packings.settled import MARK, why_unsettled
from analysis.paper import COORDINATION_AT_1_KPA, has_its_spheres, matching_case, stated
from analysis.table import Table
from modal.elasticity.static_velocity import static_velocity
from modal.formats.hdf5 import sha256
from modal.formats.provenance import read_provenance
from modal.packing.network import Network, read_network
from modal.packing.sample import read_sample
from modal.packing.summary import summary
from modal.preparation.relax import balance_of
from modal.tools.errors import InputError

HEADER = (
    "sample",
    "stress, Pa",
    "mu_comp",
    "e",
    "paper",
    "e of bulk",
    "Z",
    "paper",
    "Z of force-bearing",
    "rattlers",
    "settled",
    "stress x, y, z, % off",
    "walls, % off",
    "residual / mean force",
    "contacts beyond friction",
    "noise of a layer, of a sphere, m",
    "crystalline in bulk, %",
    "V_P static, m/s",
    "steps",
    "seconds",
)
NOISE = "noise_layer", "noise_sphere"
PREPARATION = "cloud", "approach", "cool", "jam"
"""Stages before the first stress, which is a stage of its own like all that follow."""


def row(path: str | Path) -> list[str]:
    """One sample as text, in the order of `HEADER`; what its file does not tell stays empty.

    Everything physical is measured from the packing itself, V_P from the springs' response to a
    steady push; only the target stress, mu_comp, the noise of a YADE run without a wave (that of
    the network exported from it, where it lies beside the sample) and the cost of making it are the
    file's word. A sample that says nothing of mu_comp and has not been given mu_wave was made with
    its friction.
    """
    sample = read_sample(path)
    network = sample.network()
    found = summary(network, sample.friction)
    _, balance = balance_of(sample, network)
    study = sample.study
    target = float(study.get("stress", np.nan))
    mu = float(study.get("mu_comp", np.nan if "mu_wave" in study else sample.friction))
    name = Path(path).name.removesuffix(".sample.h5")
    its_spheres = has_its_spheres(network)
    case = matching_case(is_fcc(network), target, mu) if its_spheres else None
    paper_e = stated("void_ratio", case)
    paper_z = COORDINATION_AT_1_KPA.get(mu) if its_spheres and target == 1e3 else None
    state = why_unsettled(network, np.nan if is_fcc(network) else target)
    off = [100 * (value / target - 1) for value in found["stress_pa"] + found["wall_stress_pa"]]
    cells = [
        name,
        _number(target, "g"),
        _number(mu, "g"),
        _number(found["void_ratio"], ".4f"),
        _paper(paper_e, ".3f", state),
        _number(found.get("void_ratio_of_bulk"), ".4f"),
        _number(found["coordination_number"], ".3f"),
        _paper(paper_z, ".2f", state),
        _number(found["coordination_number_without_rattlers"], ".3f"),
        str(found["rattlers"]),
        f"{MARK}: {state}" if state else "yes",
        ", ".join(_number(value, "+.2f") for value in off[:3]),
        ", ".join(_number(value, "+.2f") for value in off[3:]),
        _number(balance.residual, ".1e"),
        str(balance.sliding) if sample.friction > 0 else "",
        ", ".join(_number(value, ".1e") for value in _noise(path, study)),
        _number(100 * found.get("crystalline_share_of_bulk", np.nan), ".1f"),
        _number(_velocity(network), ".1f"),
    ]
    return [*cells, *(_number(study.get(name), ".0f") for name in ("steps", "seconds"))]


def _noise(path: str | Path, study: dict[str, Any]) -> list[float]:
    """What moves without a wave, m: as the network says that was exported from this sample.

    Earlier versions have written it into the sample.
    """
    exported = Path(str(path).removesuffix(".sample.h5") + ".network.h5")
    if exported.is_file():
        parents = {source.sha256 for source in read_provenance(exported).packing}
        if sha256(path) in parents:
            study = read_network(exported).study
    return [float(study[name]) for name in NOISE if name in study]


def _paper(value: float | None, form: str, state: str) -> str:
    """A number of the paper, which a state that has not settled is no answer to."""
    text = _number(value, form)
    return f"{text} (here {MARK})" if text and state else text


def _velocity(network: Network) -> float | None:
    try:
        return static_velocity(network)[0]
    except InputError:
        return None  # too short for a bulk, or with parts that nothing holds


def stages(path: str | Path) -> list[list[str]]:
    """Stage, steps, seconds, contacts at its end, steps a second, in their order."""
    study = read_sample(path).study
    names = [name.removeprefix("steps_") for name in study if name.startswith("steps_")]
    before = [name for name in PREPARATION if name in names]
    rows = []
    for name in [*before, *sorted(set(names) - set(before), key=float)]:
        steps, seconds, contacts = (
            float(study[f"{what}_{name}"]) for what in ("steps", "seconds", "contacts")
        )
        label = name if name in PREPARATION else f"{float(name):g} Pa"
        per_second = _number(steps / seconds, ".1f")
        rows.append([label, f"{steps:.0f}", f"{seconds:.0f}", f"{contacts:.0f}", per_second])
    return rows


def table(paths: list[str]) -> str:
    """Markdown table of all samples, as given, and of the longest compression's stages."""
    text = Table("Samples", HEADER, [row(path) for path in paths]).markdown()
    longest = max((stages(path) for path in paths), key=len, default=[])
    if longest:
        header = "stage", "steps", "seconds", "contacts", "steps a second"
        text += "\n" + Table("Stages", header, longest).markdown()
    return text


def _number(value: float | None, form: str) -> str:
    return "" if value is None or not np.isfinite(value) else format(float(value), form)
