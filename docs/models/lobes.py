#!/usr/bin/env python3
"""Draws lambert.svg and phong.svg, the polar plots of the model pages: python3 lobes.py (needs numpy and matplotlib)."""
import os

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
plt.rcParams.update({"font.size": 9, "svg.hashsalt": "goniofit", "font.family": "sans-serif"})
COLORS = ["#0072b2", "#d55e00", "#009e73"]  # Okabe & Ito: safe for colour-blind readers


def page(name, curves, theta_i, title):
    figure, axes = plt.subplots(figsize=(5.2, 3.0), subplot_kw={"projection": "polar"})
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    axes.set_thetalim(-np.pi / 2, np.pi / 2)
    theta = np.linspace(-np.pi / 2, np.pi / 2, 2001)
    top = 0.0
    for (label, f), color in zip(curves, COLORS):
        value = f(theta)
        top = max(top, value.max())
        axes.plot(theta, value, color=color, label=label, linewidth=1.6)
    axes.annotate("", xy=(0, 0), xytext=(-theta_i, 1.05 * top), arrowprops={"arrowstyle": "->", "color": "#666666"})
    axes.text(-theta_i - 0.12, 0.95 * top, "wi", color="#666666", ha="right")
    axes.set_rlim(0, 1.12 * top)
    axes.set_rticks(np.round(np.array([0.5, 1.0]) * top, 2))
    axes.set_rlabel_position(-60)
    axes.set_title(title, fontsize=9)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, -0.14), ncol=len(curves), frameon=False)
    axes.grid(linewidth=0.4)
    figure.savefig(os.path.join(HERE, name), bbox_inches="tight", metadata={"Date": None})


def phong(n, theta_i):
    return lambda theta: (n + 2) / (2 * np.pi) * np.clip(np.cos(theta - theta_i), 0, None) ** n


THETA_I = np.radians(40)
page("lambert.svg", [("weight 1", lambda t: np.full_like(t, 1 / np.pi)), ("weight 0.5", lambda t: np.full_like(t, 0.5 / np.pi))],
     THETA_I, "f(wi, wo) in the plane of incidence [1/sr], θi = 40°")
page("phong.svg", [(f"n = {n}", phong(n, THETA_I)) for n in (4, 8, 16)],
     THETA_I, "f(wi, wo) in the plane of incidence [1/sr], weight 1, θi = 40°")
