"""
The width of the cell
=====================

Which frequencies are the cell's, which the packing's? Packings without friction at 100 kPa in cells
of four widths W: where further waves set in, how far modes are pure P-waves, and the low-pass.

`python examples/width.py FOLDER` writes the figure and two tables into a folder. It reads
`results/width/width*.json`, results of `studies/width.yaml`, and `long/*.json` there: cells of this
study that are 72 D long, measured one by one, as the low-pass frequency needs 50 D.
"""

import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

HOME = Path(sys.argv[0]).resolve().parents[1] / "results/width"
DIAMETER = 2.54e-3  # m
PURE, MIXED = 0.9, 0.45  # chi_z of P-waves, and of modes that have hardly a direction
STEP = (0.85, 1.0), (1.0, 1.15)  # of V_S / W, where modes are counted below and above it


def width_of(nominal, void_ratio):
    """Diameters: spheres and void ratio say how wide a cell is, as its nominal shape is kept."""
    return nominal * ((1 + void_ratio) * 0.6) ** (1 / 3)


class Packing:
    """What a result has of a cell: velocities, modes with their chi_z, the wall's pulse."""

    def __init__(self, path):
        found = json.loads(path.read_text())
        self.value = {name: each["value"] for name, each in found["values"].items()}
        self.error = {name: each["error"] for name, each in found["values"].items()}
        self.nominal = float(path.stem.removeprefix("width").partition("_seed")[0])
        self.v_p, self.v_s = self.value["v_p_moduli"], self.value["v_s_moduli"]
        self.frequency, self.chi, _ = map(np.array, found["curves"]["chi_z_of_branches"])
        self.width = width_of(self.nominal, self.value["void_ratio"])
        self.unit = self.v_s / (self.width * DIAMETER)

    def mixed(self):
        """Hz from which no mode is above MIXED; NaN where some are up to the end of the list."""
        above = self.frequency[self.chi > MIXED].max()
        return above if above < self.frequency[-1] - 1e3 else np.nan


packings = [Packing(path) for path in sorted(HOME.glob("width*.json"))]
widths = np.unique([p.nominal for p in packings])


# %%
# **Cut-ons.** Waves across the cell that fit into it once have the frequencies V_S / W and V_P / W,
# and sqrt 2 V_S / W along both axes across. The table has the modes in the 15 % below and above the
# first of them, and where the last modes lie whose chi_z is above two values.

rows = []
for p in packings:
    below, above = (
        ((p.frequency > a * p.unit) & (p.frequency < b * p.unit)).sum() for a, b in STEP
    )
    row = {
        "width_over_d": p.width,
        "z": p.value["coordination"],
    }
    row |= {"v_p": p.v_p, "v_s": p.v_s, "v_s_over_w_khz": p.unit / 1e3}
    row |= {
        "root_2_v_s_over_w_khz": 2**0.5 * p.unit / 1e3,
        "v_p_over_w_khz": p.unit * p.v_p / p.v_s / 1e3,
    }
    row |= {"modes_15_percent_below": int(below), "modes_15_percent_above": int(above)}
    row |= {"last_above_0.9_khz": p.frequency[p.chi > PURE].max() / 1e3}
    row |= {"last_above_0.45_khz": p.mixed() / 1e3}
    rows.append(row)
    print({k: v if isinstance(v, str) else float(f"{v:.4g}") for k, v in row.items()})

# %%
# **The low-pass frequency** and the decay of the coherent wave by a wall's pulse, cells 72 D long.

long = []
for path in sorted((HOME / "long").glob("*.json")):
    found = json.loads(path.read_text())
    value = {name: each["value"] for name, each in found.items()}
    nominal = float(path.stem.removeprefix("width").partition("_seed")[0])
    row = {"width_over_d": width_of(nominal, value["void_ratio"]), "z": value["coordination"]}
    row |= {"v_p": value["v_p"], "v_s": value["v_s"], "low_pass_khz": value["low_pass"] / 1e3}
    row |= {"low_pass_error_khz": found["low_pass"]["error"] / 1e3}
    decay = found["attenuation"]
    for f in (17, 25, 34):
        k = int(np.argmin(abs(np.array(decay["at"]) - 1e3 * f)))
        seen = abs(decay["at"][k] / 1e3 - f) < 1
        row |= {f"attenuation_{f}_khz": value["attenuation"][k] if seen else np.nan}
        row |= {f"attenuation_{f}_khz_error": decay["error"][k] if seen else np.nan}
    long.append(row)
    print({k: float(f"{v:.4g}") for k, v in row.items()})

# %%
# **The figure.** Left: all modes below a frequency over V_S / W; right: the largest chi_z of all
# modes from a frequency on, and the first cut-on of each width.

plt.rcParams.update({"font.size": 8, "axes.linewidth": 0.6, "pdf.fonttype": 42})
plt.rcParams.update({"xtick.direction": "in", "ytick.direction": "in"})
figure, axes = plt.subplots(1, 2, figsize=(7, 2.8), layout="constrained")
styles = dict(zip(widths, ((0, (1, 1)), "-.", "--", "-"), strict=True))
for nominal, style in styles.items():
    these = [p for p in packings if p.nominal == nominal]
    one = these[0]
    ratio = np.sort(one.frequency) / one.unit
    shade = f"{0.7 * (1 - nominal / widths.max()):.2f}"
    look = {"ls": style, "color": shade, "lw": 1.2}
    axes[0].step(
        ratio, np.arange(1, len(ratio) + 1), where="post", label=f"{one.width:.0f} D", **look
    )
    at, chi = (np.concatenate([getattr(p, name) for p in these]) for name in ("frequency", "chi"))
    order = np.argsort(at)
    to_end = np.maximum.accumulate(chi[order][::-1])[::-1]
    shown = at[order] < min(p.frequency[-1] for p in these) - 1e3
    axes[1].step(at[order][shown] / 1e3, to_end[shown], where="pre", **look)
    cut_on = np.mean([p.unit for p in these]) / 1e3
    axes[1].plot([cut_on, cut_on], [0.93, 1.0], **look)
for ratio, text in ((1, "$V_S/W$"), (2**0.5, "$\\sqrt{2}\\,V_S/W$"), (1.51, "$V_P/W$")):
    axes[0].axvline(ratio, color="k", lw=0.5, ls=":")
    side = "right" if ratio < 1.5 else "left"
    axes[0].text(ratio, 1.3 if ratio < 1.2 else 2.2 if side == "right" else 1.3, text, ha=side)
axes[0].set(yscale="log", xlabel="f W / $V_S$", ylabel="modes below f", xlim=(0, 2.2))
axes[0].legend(title="W", frameon=False, fontsize=6.5, title_fontsize=7, loc="upper left")
for level in (PURE, MIXED):
    axes[1].axhline(level, color="k", lw=0.5, ls=":")
axes[1].set(xlabel="f, kHz", ylabel=r"largest $\chi_z$ from f on", xlim=(0, 24), ylim=(0.3, 1.02))
plt.show()

if __name__ == "__main__" and len(sys.argv) == 2:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "width.png", dpi=200)
    figure.savefig(folder / "width.pdf", metadata={"CreationDate": None})
    as_csv = {"index": False, "float_format": "%.4g", "na_rep": "nan"}
    for name, table in (("cut_ons", rows), ("long", long)):
        pd.DataFrame(table).to_csv(folder / f"{name}.csv", **as_csv)
