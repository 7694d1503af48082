#!/usr/bin/env python3
"""Makes three tables in the MERL format: matte, glossy and mirror.

    gen.py FOLDER

Each is a half-vector (Blinn-Phong) lobe over an Oren-Nayar base with 2 % of noise: no table that the fitted model,
Lambert + Phong, can follow exactly, as no measured one is.
"""

import os
import sys

import numpy as np

import merl

MATERIALS = {
    "matte": {"kd": [0.45, 0.30, 0.20], "ks": [0.08, 0.08, 0.08], "n": 8.0},
    "glossy": {"kd": [0.25, 0.12, 0.06], "ks": [0.05, 0.05, 0.06], "n": 300.0},
    "mirror": {"kd": [0.03, 0.03, 0.04], "ks": [0.60, 0.55, 0.50], "n": 20000.0},
}
ROUGHNESS = 0.3  # of the Oren-Nayar base, radians
NOISE = 0.02  # relative


def oren_nayar(grid):
    """The base's departure from a Lambertian, at every entry."""
    squared = ROUGHNESS**2
    a, b = 1 - 0.5 * squared / (squared + 0.33), 0.45 * squared / (squared + 0.09)
    theta_i, theta_o = (np.arccos(np.clip(c, -1, 1)) for c in (grid.cos_i, grid.cos_o))
    sines = np.sin(theta_i) * np.sin(theta_o)
    cos_phi = (grid.wi[:2] * grid.wo[:2]).sum(0) / np.maximum(sines, 1e-18)
    larger, smaller = np.maximum(theta_i, theta_o), np.minimum(theta_i, theta_o)
    return a + b * np.maximum(cos_phi, 0) * np.sin(larger) * np.tan(smaller)


def main(folder):
    os.makedirs(folder, exist_ok=True)
    grid = merl.Grid()
    base = oren_nayar(grid) / np.pi
    for seed, (name, material) in enumerate(MATERIALS.items(), start=20240):
        n = material["n"]
        lobe = (n + 2) / (2 * np.pi) * grid.cos_half**n
        brdf = np.outer(material["kd"], base) + np.outer(material["ks"], lobe)
        brdf *= 1 + NOISE * np.random.default_rng(seed).standard_normal(brdf.shape)
        merl.write(os.path.join(folder, f"{name}.binary"), np.where(grid.above_horizon, brdf / merl.SCALE, -1.0))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
