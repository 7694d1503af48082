#!/usr/bin/env python3
"""Writes the measurement fixtures beside it. Deterministic; needs nothing but Python.

Every file lists the same reflectance, f = KD/pi + KS (N+2)/(2 pi) max(0, r.wo)^N with r the mirror image of wi (in the flat
world its two-dimensional counterpart), so that a reader can be checked value by value.
"""
import math
import os

KD, KS, N = 0.2, 0.3, 20.0
HERE = os.path.dirname(os.path.abspath(__file__))


def direction(theta, phi):
    """Unit vector at angles in degrees."""
    t, p = math.radians(theta), math.radians(phi)
    return (math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t))


def brdf(wi, wo):
    """1/sr."""
    cos_a = -wi[0] * wo[0] - wi[1] * wo[1] + wi[2] * wo[2]
    return KD / math.pi + KS * (N + 2) / (2 * math.pi) * (cos_a**N if cos_a > 0 else 0.0)


def brdf2d(theta_i, theta_o):
    """1/rad."""
    cos_a = math.cos(math.radians(theta_i + theta_o))
    norm = math.gamma((N + 3) / 2) / (math.sqrt(math.pi) * math.gamma((N + 2) / 2))
    return KD / 2 + KS * norm * (cos_a**N if cos_a > 0 else 0.0)


def write(name, text, crlf=False, bom=False):
    if crlf:
        text = text.replace("\n", "\r\n")
    data = text.encode()
    with open(os.path.join(HERE, name), "wb") as out:
        out.write((b"\xef\xbb\xbf" if bom else b"") + data)


def pairs():
    for ti in (0, 20, 40, 60):
        for to in range(0, 81, 20):
            for po in range(0, 181, 45):
                yield ti, 0, to, po


def csv_everything():
    lines = ["# made by make.py", "# quantity: brdf",
             "weight,common_2_b,sigma_a,theta_o_deg,a,phi_o_deg,b,common_1_a,common_1_b,sigma_b,theta_i_deg,phi_i_deg,common_2_a"]
    for ti, pi, to, po in pairs():
        f = brdf(direction(ti, pi), direction(to, po))
        w = math.sin(math.radians(to)) + 0.1
        lines.append(f"{w!r},0.5,{0.01 * f!r},{to},{f!r},{po},{2 * f!r},{0.02 * f!r},{0.04 * f!r},{0.02 * f!r},{ti},{pi},-0.25")
    write("every-column-in-any-order.csv", "\n".join(lines) + "\n")


def csv_brdf_cos():
    lines = ["# quantity: brdf_cos", "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,650nm"]
    for ti, pi, to, po in pairs():
        wo = direction(to, po)
        lines.append(f"{ti},{pi},{to},{po},{brdf(direction(ti, pi), wo) * wo[2]!r}")
    lines.append("20,0,90,0,0.01")
    lines.append("20,0,100,0,0.01")
    write("brdf-cos-crlf-bom.csv", "\n".join(lines) + "\n", crlf=True, bom=True)


def csv_masks():
    write("masked-values.csv", "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n"
          "0,0,10,0,0.1,,-0.001\n0,0,20,0,nan,0.2,inf\n-30,0,-20,0,0.1,0.1,0.1\n")


def csv_flat():
    lines = ["# dimension: 2", "theta_i_deg,theta_o_deg,r"]
    lines += [f"{ti},{to},{brdf2d(ti, to)!r}" for ti in (-60, 0, 30) for to in range(-90, 90, 15)]
    write("in-plane-flat-world.csv", "\n".join(lines) + "\n")


def alta():
    head = "# made by make.py\n"
    rows = []
    for ti, _, to, po in pairs():
        x, y = math.radians(to) * math.cos(math.radians(po)), math.radians(to) * math.sin(math.radians(po))
        wo = direction(to, po)
        rows.append(f"{math.radians(ti)!r} {x!r} {y!r}\t{brdf(direction(ti, 0), wo) * wo[2]!r}")
    rows.append(f"{math.radians(20)!r} {math.pi / 2!r} 0.0\t0.01")
    write("projected-brdf-cos.alta", head + "#DIM 3 1\n#VS 0\n#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI\n"
          "#PARAM_OUT INV_STERADIAN_COSINE_FACTOR\n" + "\n".join(rows) + "\n")
    rows = []
    for ti, _, to, po in pairs():
        f = brdf(direction(ti, 0), direction(to, po))
        rows.append(f"{math.radians(to)!r} {math.radians(ti)!r} {math.radians(po)!r} {f!r} {0.9 * f!r} {1.1 * f!r}")
    write("view-light-dphi-intervals.alta", head + "#DIM 3 1\n#VS 2\n#PARAM_IN ISOTROPIC_TV_TL_DPHI\n" + "\n".join(rows) + "\n")
    rows = []
    for th in range(0, 90, 10):
        w = direction(th, 0)
        rows.append(f"{w[2]!r} " + " ".join(repr(s * brdf(w, w)) for s in (1, 2, 3)))
    write("half-angle-cosine-rgb.alta", head + "#DIM 1 3\n#PARAM_IN COS_TH\n#PARAM_OUT RGB_COLOR\n" + "\n".join(rows) + "\n")


def zemax():
    incidence, azimuth, radial = (0, 30, 60), range(0, 181, 15), range(0, 91, 5)
    out = ["# Light source: laser (532 nm), synthetic", "Source\tMeasured", "Symmetry\tPlaneSymmetrical",
           "SpectralContent\tMonochrome", "ScatterType\tBRDF", "SampleRotation\t1", "0",
           f"AngleOfIncidence\t{len(incidence)}", "\t".join(map(str, incidence)),
           f"ScatterAzimuth\t{len(azimuth)}", "\t".join(map(str, azimuth)),
           f"ScatterRadial\t{len(radial)}", "\t".join(map(str, radial)), "", "Monochrome", "DataBegin"]
    for ti in incidence:
        wi = direction(ti, 180)
        m, e1 = direction(ti, 0), direction(ti - 90, 0)  # e1 points from the mirror direction to the normal
        total, rows = 0.0, []
        for a in azimuth:
            row = []
            for r in radial:
                c, s = math.cos(math.radians(r)), math.sin(math.radians(r))
                ca, sa = math.cos(math.radians(a)), math.sin(math.radians(a))
                wo = (c * m[0] + s * ca * e1[0], -s * sa, c * m[2] + s * ca * e1[2])
                row.append(brdf(wi, wo) if wo[2] > 1e-9 else 0.0)
            rows.append("\t".join(f"{v:.6e}" for v in row))
        steps = 400
        for j in range(steps):
            for k in range(steps):
                wo = direction(90 * (j + 0.5) / steps, 360 * (k + 0.5) / steps)
                total += brdf(wi, wo) * wo[2] * math.sqrt(1 - wo[2] ** 2)
        out.append(f"TIS\t{total * (math.pi / 2 / steps) * (2 * math.pi / steps):.6f}")
        out += rows
    write("plane-symmetrical.zemax.bsdf", "\n".join(out + ["DataEnd"]) + "\n")


def fred():
    out = ["type bsdf_data", "format angles=deg bsdf=value scale=0.5"]
    for ti in (0, 30, 60):
        wi = direction(ti, 180)
        out.append(f"{ti}\t0")
        for to in range(0, 81, 10):
            for po in range(0, 181, 15) if to else (0,):
                if to == ti and po > 150:
                    continue  # the source is in the detector's way
                out.append(f"{to}\t{po}\t{2 * brdf(wi, direction(to, po)):.9e}")
    write("grid.fred.txt", "\n".join(out) + "\n")
    # The pole once for every azimuth; the block at 30 degrees is complete.
    out = ["type bsdf_data", "format angles=deg bsdf=value scale=1"]
    for ti in (0, 30, 60):
        out.append(f"{ti}\t0")
        for to in range(0, 81, 10):
            for po in range(0, 181, 15):
                if to == ti and po > 150 and ti != 30:
                    continue
                out.append(f"{to}\t{po}\t{brdf(direction(ti, 180), direction(to, po)):.9e}")
    write("grid-pole-for-every-azimuth.fred.txt", "\n".join(out) + "\n")
    out = ["type bsdf_data", "format angles=deg bsdf=value scale=1"]
    for ti in (15, 45):
        out.append(f"{ti}\t0")
        out += [f"{to}\t{po}\t{brdf(direction(ti, 180), direction(to, po)):.9e}" for po in (0, 180) for to in range(0, 81, 10)]
    write("in-plane-two-azimuths.fred.txt", "\n".join(out) + "\n")
    out = ["type bsdf_data", "format angles=deg bsdf=value scale=1"]
    for ti in (15, 45):
        out.append(f"{ti}\t0")
        out += [f"{to}\t0\t{brdf(direction(ti, 180), direction(to, 0)):.9e}" for to in range(-80, 81, 10)]
    write("in-plane.fred.txt", "\n".join(out) + "\n")


if __name__ == "__main__":
    csv_everything()
    csv_brdf_cos()
    csv_masks()
    csv_flat()
    alta()
    zemax()
    fred()
