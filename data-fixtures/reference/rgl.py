#!/usr/bin/env python3
"""Evaluates the anisotropic RGL files of ../measurements with Mitsuba 3 (`pip install mitsuba`), an independent reader of the
format, at fixed pseudo-random pairs of directions up to 85 degrees: one CSV a file, BRDF in 1/sr (float32)."""
import os

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
HERE = os.path.dirname(os.path.abspath(__file__))


def direction(theta, phi):
    return [float(np.sin(theta) * np.cos(phi)), float(np.sin(theta) * np.sin(phi)), float(np.cos(theta))]


def main():
    for name in ["rgl-half-turn", "rgl-two-planes", "rgl-full-turn"]:
        bsdf = mi.load_dict({"type": "measured", "filename": os.path.join(HERE, "..", "measurements", name + ".bsdf")})
        rng = np.random.default_rng(7)
        lines = [f"# evaluation of {name}.bsdf by Mitsuba {mi.__version__}", "# quantity: brdf"]
        lines.append("theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b")
        for _ in range(120):
            angles = np.round(rng.uniform([1, 0, 0, 0], [85, 360, 85, 360]), 4)
            theta_i, phi_i, theta_o, phi_o = np.radians(angles)
            si = mi.SurfaceInteraction3f()
            si.wi = mi.Vector3f(*direction(theta_i, phi_i))
            value = np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*direction(theta_o, phi_o)))) / np.cos(theta_o)
            lines.append(",".join([*(f"{a:.4f}" for a in angles), *(f"{v:.8g}" for v in value)]))
        with open(os.path.join(HERE, name + ".csv"), "w") as file:
            file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
