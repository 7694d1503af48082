#!/usr/bin/env python3
"""Draws docs/images/through.svg from the numbers of `cargo bench --bench through -- --csv through.csv`:
python3 benches/through.py through.csv docs/images/through.svg (needs matplotlib)."""
import csv
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

plt.rcParams.update({"font.size": 9, "svg.hashsalt": "goniofit", "font.family": "sans-serif"})
COLORS = ["#0072b2", "#009e73", "#e69f00", "#d55e00"]  # Okabe & Ito: safe for colour-blind readers

rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(open(sys.argv[1]))]
strong = [r for r in rows if r["electrons"] == max(r["electrons"] for r in rows)]
figure, axes = plt.subplots(figsize=(5.6, 3.4))
for aperture, color in zip(sorted({r["aperture_deg"] for r in strong}), COLORS):
    cells = sorted((r for r in strong if r["aperture_deg"] == aperture), key=lambda r: r["exponent"])
    n = [r["exponent"] for r in cells]
    axes.plot(n, [100 * abs(r["plain_bias"]) for r in cells], color=color, marker="o", markersize=4, linewidth=1.5, label=f"{aperture:g}°")
    axes.plot(n, [100 * abs(r["through_bias"]) for r in cells], color=color, marker="s", markersize=3.5, linewidth=1, linestyle="--")
    axes.plot(n, [100 * r["scatter"] for r in cells], color=color, linewidth=0.7, linestyle=":")
axes.set_xscale("log")
axes.set_yscale("log")
axes.set_xlabel("exponent n of the material")
axes.set_ylabel("fitted exponent is off by [%]")
axes.set_title("plain fit (circles), through the instrument (squares), σ of one fit (dots)", fontsize=9)
axes.legend(title="aperture", frameon=False, fontsize=8)
axes.grid(linewidth=0.3, which="major")
for side in ("top", "right"):
    axes.spines[side].set_visible(False)
figure.savefig(sys.argv[2], bbox_inches="tight", metadata={"Date": None})
