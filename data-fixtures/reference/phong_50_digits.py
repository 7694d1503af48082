#!/usr/bin/env python3
"""Writes phong_50_digits.json: reference values of the normalised Phong lobe, computed with 50 digits by mpmath.

    python3 phong_50_digits.py > phong_50_digits.json

Deterministic; needs mpmath only. What the file holds is said in README.md beside it.
"""

import json
import sys

from mpmath import acos, cos, cot, log, mp, mpf, pi, quad, sin, sqrt

mp.dps = 50

EXPONENTS = [0.0, 1e-6, 1.0, 1e3, 1e6, 1e8]
ALPHAS = [
    ("0", mpf(0)),
    ("1e-9", mpf("1e-9")),
    ("1e-6", mpf("1e-6")),
    ("1e-3", mpf("1e-3")),
    ("0.1", mpf("0.1")),
    ("1", mpf(1)),
    ("1.5", mpf("1.5")),
    ("pi/2 - 1e-6", pi / 2 - mpf("1e-6")),
    ("pi/2 - 1e-12", pi / 2 - mpf("1e-12")),
    ("pi/2 + 1e-12", pi / 2 + mpf("1e-12")),
    ("pi/2 + 1e-6", pi / 2 + mpf("1e-6")),
]
THETAS_DEG = [("0", mpf(0)), ("20", mpf(20)), ("60", mpf(60)), ("85", mpf(85)), ("89.9", mpf("89.9")),
              ("90 - 1e-6", 90 - mpf("1e-6")), ("90 - 1e-9", 90 - mpf("1e-9"))]
PHI_I = mpf("0.3")
# Turn of wo about the mirror direction, from the direction towards the normal (rad).
TURNS = [mpf(0), mpf("1.2")]
SMALLEST = mpf("1e-290")

ALBEDO_THETAS_DEG = ["0", "10", "30", "60", "80", "85", "89", "89.9", "89.999999"]
ALBEDO_EXPONENTS = ["0", "0.01", "1", "10", "100", "1e3", "1e4", "1e5", "1e6", "1e8"]


def rounded(v):
    """The nearest f64 of every component, as Python floats."""
    return [float(x) for x in v]


def exact(v):
    return [mpf(x) for x in v]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def vectors(theta, alpha, turn):
    """wi at polar angle theta, wo at the angle alpha from the mirror direction r; unit vectors, rounded to f64."""
    st, ct, sp, cp = sin(theta), cos(theta), sin(PHI_I), cos(PHI_I)
    wi = [st * cp, st * sp, ct]
    r = [-st * cp, -st * sp, ct]
    # Unit tangents at r: `up` towards the normal, `side` along the horizon.
    up = [ct * cp, ct * sp, st]
    side = [-sp, cp, mpf(0)]
    wi64 = rounded(wi)
    if alpha == 0:
        return wi64, [-wi64[0], -wi64[1], wi64[2]]  # the mirror image of the rounded wi itself
    wo = [cos(alpha) * a + sin(alpha) * (cos(turn) * b + sin(turn) * c) for a, b, c in zip(r, up, side)]
    return wi64, rounded(wo)


def decimal(x, digits=25):
    """`digits` significant digits; numbers below 1e-290 in magnitude are written as the string "tiny"."""
    if x == 0:
        return "0"
    return "tiny" if abs(x) < SMALLEST else mp.nstr(x, digits, strip_zeros=False, min_fixed=1, max_fixed=0)


def lobe(n, wi, wo):
    """(n + 2)/(2π)·(r·wo)ⁿ and its derivative by n, for exactly these vectors; 0 where r·wo ≤ 0 or below the horizon."""
    wi, wo, n = exact(wi), exact(wo), mpf(n)
    cos_alpha = dot([-wi[0], -wi[1], wi[2]], wo)
    if cos_alpha <= 0 or wi[2] <= 0 or wo[2] <= 0:
        return mpf(0), mpf(0)
    power = mp.exp(n * log(cos_alpha))
    return (n + 2) / (2 * pi) * power, (1 + (n + 2) * log(cos_alpha)) / (2 * pi) * power


def lobe_entries():
    for theta_name, theta_deg in THETAS_DEG:
        for alpha_name, alpha in ALPHAS:
            for turn in TURNS:
                wi, wo = vectors(theta_deg * pi / 180, alpha, turn)
                if alpha == 0 and turn != 0:
                    continue
                mirrored = [-wi[0], -wi[1], wi[2]]
                values = [lobe(n, wi, wo) for n in EXPONENTS]
                yield {
                    "theta_i_deg": theta_name,
                    "alpha": alpha_name,
                    "turn": mp.nstr(turn, 3),
                    "wi": wi,
                    "wo": wo,
                    "cos_alpha": decimal(dot(exact(mirrored), exact(wo))),
                    "value": [decimal(v) for v, _ in values],
                    "d_exponent": [decimal(d) for _, d in values],
                }


def ring(theta, alpha):
    """∫ cosθo dψ over the part above the horizon of the ring at the angle alpha about the mirror direction."""
    if theta + alpha <= pi / 2 or theta == 0:
        return 2 * pi * cos(theta) * cos(alpha)
    x = -cot(theta) * cot(alpha)
    psi = acos(x)
    # sinψ0 from (1 − x)(1 + x), 1 + x without cancellation: 1 − cotθ cotα = −cos(θ + α)/(sinθ sinα).
    sin_psi = sqrt((1 - x) * -cos(theta + alpha) / (sin(theta) * sin(alpha)))
    return 2 * (psi * cos(theta) * cos(alpha) + sin(theta) * sin(alpha) * sin_psi)


def albedo(theta, n):
    """(n + 2)/(2π) ∫ cosⁿα sinα ring(α) dα over α in [0, π/2], cut where the integrand changes its nature."""
    start = pi / 2 - theta
    scale = 1 / sqrt(n + 1)
    cuts = sorted({c for c in [mpf(0), start, pi / 2, *(k * scale for k in (mpf(1) / 4, 1, 2, 4, 8, 16, 24)),
                               *(start * k for k in (2, 4, 16, 64, 256, 1024, 10**4, 10**5, 10**6, 10**7))]
                   if 0 <= c <= pi / 2})

    def integrand(a):
        # π/2 in 50 digits may lie beyond π/2.
        return mp.exp(n * log(cos(a))) * sin(a) * ring(theta, a) if cos(a) > 0 else mpf(0)

    value, error = quad(integrand, cuts, error=True)
    factor = (n + 2) / (2 * pi)
    return factor * value, factor * error


def albedo_entries():
    for theta_deg in ALBEDO_THETAS_DEG:
        for n in ALBEDO_EXPONENTS:
            value, error = albedo(mpf(theta_deg) * pi / 180, mpf(n))
            assert error < mpf("1e-20"), (theta_deg, n, error)
            yield {"theta_deg": theta_deg, "exponent": n, "albedo": mp.nstr(value, 18, strip_zeros=False)}


def check_albedo():
    """Laws that hold exactly: 1 at normal incidence, (1 + cosθ)/2 for n = 0; and an integral taken another way."""
    for n in ["0", "1", "1e4"]:
        assert abs(albedo(mpf(0), mpf(n))[0] - 1) < mpf("1e-25")
    for theta in ["0.3", "1.2", "1.57"]:
        theta = mpf(theta)
        assert abs(albedo(theta, mpf(0))[0] - (1 + cos(theta)) / 2) < mpf("1e-25")
    # In spherical coordinates about the normal, the azimuth integral by quadrature too, cut where r·wo = 0.
    digits, mp.dps = mp.dps, 20
    for n, theta in [(2, mpf("1.1")), (3, mpf("0.6")), (400, mpf("1.5"))]:
        def over_azimuth(t):
            c, s = cos(theta) * cos(t), sin(theta) * sin(t)
            end = pi if c >= s else acos(-c / s)
            return 2 * quad(lambda p: (c + s * cos(p)) ** n, [0, end / 32, end / 8, end / 2, end]) * cos(t) * sin(t)

        other = (mpf(n) + 2) / (2 * pi) * quad(over_azimuth, sorted([mpf(0), pi / 2 - theta, mpf(1), mpf("1.3"), pi / 2]))
        difference = abs(other - albedo(theta, mpf(n))[0])
        assert difference < mpf("1e-14"), (n, theta, difference)
    mp.dps = digits


def main():
    check_albedo()
    document = {
        "about": "Normalised Phong lobe (n+2)/(2pi)(r.wo)^n, its derivative by n, and its directional albedo; see README.md",
        "exponents": EXPONENTS,
        "lobe": list(lobe_entries()),
        "albedo": list(albedo_entries()),
    }
    lines = [json.dumps({k: document[k] for k in ("about", "exponents")})[:-1] + ',', '"lobe": [']
    lines.append(",\n".join(json.dumps(e) for e in document["lobe"]))
    lines += ['],', '"albedo": [', ",\n".join(json.dumps(e) for e in document["albedo"]), "]}"]
    text = "\n".join(lines) + "\n"
    assert json.loads(text) == document
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
