#!/usr/bin/env python3
"""Lambert + Phong by scipy's least_squares: MINPACK's Levenberg-Marquardt, analytic Jacobian, columns scaled.

    scipy_peer.py TABLE.flat SOLVES

Parameters: kd[3], ks[3], n. Prints one JSON object.
"""

import json
import sys
import time

import numpy as np
import scipy
from scipy.optimize import least_squares

import merl

START = [0.1] * 6 + [20.0]
TOLERANCE = 1e-8


class Problem:
    """Residuals cos(theta_i) (kd/pi + ks (n+2)/(2 pi) max(0, cos alpha)^n - f), channel after channel."""

    def __init__(self, cos_i, cos_alpha, brdf):
        self.cos_i = cos_i
        self.lit = cos_alpha > 0
        self.ln_alpha = np.log(np.where(self.lit, cos_alpha, 1.0))
        self.diffuse = cos_i / np.pi
        self.data = cos_i * brdf

    def lobe(self, n):
        """cos(theta_i) max(0, cos alpha)^n."""
        power = np.exp(n * self.ln_alpha)
        power[~self.lit] = 0.0
        return power * self.cos_i

    def residuals(self, p):
        glossy = (p[6] + 2) / (2 * np.pi) * self.lobe(p[6])
        out = np.empty(self.data.shape)
        for c in range(3):
            out[c] = p[c] * self.diffuse + p[3 + c] * glossy - self.data[c]
        return out.ravel()

    def jacobian(self, p):
        power = self.lobe(p[6])
        glossy = (p[6] + 2) / (2 * np.pi) * power
        slope = power / (2 * np.pi) + glossy * self.ln_alpha
        size = power.size
        out = np.zeros((3 * size, 7))
        for c in range(3):
            rows = slice(c * size, (c + 1) * size)
            out[rows, c] = self.diffuse
            out[rows, 3 + c] = glossy
            out[rows, 6] = p[3 + c] * slope
        return out


def main(path, solves):
    problem = Problem(*merl.read_flat(path))
    seconds = []
    for _ in range(solves):
        clock = time.perf_counter()
        tolerances = {"ftol": TOLERANCE, "xtol": TOLERANCE, "gtol": TOLERANCE}
        found = least_squares(
            problem.residuals, START, problem.jacobian, method="lm", x_scale="jac", max_nfev=200, **tolerances
        )
        seconds.append(time.perf_counter() - clock)
    record = {
        "version": f"scipy {scipy.__version__}, numpy {np.__version__}",
        "samples": problem.cos_i.size,
        "seconds": seconds,
        "half_cost": float(found.cost),
        "kd": found.x[:3].tolist(),
        "ks": found.x[3:6].tolist(),
        "exponent": float(found.x[6]),
        "evaluations": int(found.nfev),
        "ended": found.message,
    }
    print(json.dumps(record))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]))
