#!/usr/bin/env python3
"""Writes the RGL tensor files of data-fixtures: synthetic, deterministic, numpy alone. Run it from anywhere.

The material has a closed form, so a reader can be checked against it: a coloured diffuse part plus a microfacet lobe with the
GGX distribution (Walter et al. 2007), separable Smith shadowing and no Fresnel term,

    f = kd/pi * (1 + tilt * (wi.x + wo.x)) + ks * D(m) G1(wi) G1(wo) / (4 cos_i cos_o),

whose axes are turned by an angle about the normal and whose roughness may differ between them. `vndf` is its density of
visible normals over u = (sqrt(2 theta/pi), phi/2pi + 1/2). A value is stored at the nodes s of a grid, at the normal that the
tabulated warp gives, divided by the *interpolated* D/(4 sigma): so the file's own evaluation is exact at its nodes.
"""
import os
import struct

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
INVALID = os.path.join(HERE, "..", "invalid")
INSET = 2.0**-40  # samples of the warp keep this far from the border of the square


class Material:
    def __init__(self, alpha_x, alpha_y, turn, kd, ks, tilt=0.0):
        self.alpha = np.array([alpha_x, alpha_y])
        self.turn, self.kd, self.ks, self.tilt = turn, np.array(kd), np.array(ks), tilt

    def own_frame(self, w):
        c, s = np.cos(self.turn), np.sin(self.turn)
        return np.stack([c * w[..., 0] + s * w[..., 1], c * w[..., 1] - s * w[..., 0], w[..., 2]], -1)

    def ndf(self, m):
        q = self.own_frame(m)
        k = (q[..., 0] / self.alpha[0]) ** 2 + (q[..., 1] / self.alpha[1]) ** 2 + q[..., 2] ** 2
        return 1 / (np.pi * self.alpha.prod() * k**2)

    def sigma(self, w):
        """Projected area of the facets seen from w: cos / G1."""
        q = self.own_frame(w)
        root = np.sqrt(q[..., 2] ** 2 + (self.alpha[0] * q[..., 0]) ** 2 + (self.alpha[1] * q[..., 1]) ** 2)
        return 0.5 * (q[..., 2] + root)

    def value(self, wi, wo):
        """BRDF times cos_o, per channel."""
        m = wi + wo
        m = m / np.linalg.norm(m)
        diffuse = self.kd / np.pi * (1 + self.tilt * (wi[0] + wo[0])) * wo[2]
        # G1(w) / cos = 1 / sigma(w)
        return diffuse + self.ks * self.ndf(m) * wo[2] / (4 * self.sigma(wi) * self.sigma(wo))


def direction(theta, phi):
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], -1)


def grid(nx, ny):
    """Directions at the nodes of a grid over u."""
    theta = np.pi / 2 * np.linspace(0, 1, nx) ** 2
    phi = np.pi * (2 * np.linspace(0, 1, ny) - 1)
    return direction(theta[None, :], phi[:, None]), theta[None, :]


def bilinear(table, u):
    ny, nx = table.shape
    x, y = u[0] * (nx - 1), u[1] * (ny - 1)
    i, j = min(int(x), nx - 2), min(int(y), ny - 2)
    fx, fy = x - i, y - j
    t = table.astype(float)
    return (1 - fy) * ((1 - fx) * t[j, i] + fx * t[j, i + 1]) + fy * ((1 - fx) * t[j + 1, i] + fx * t[j + 1, i + 1])


class Warp:
    def __init__(self, table):
        self.d = table.astype(float)
        self.row = np.concatenate([np.zeros((len(self.d), 1)), np.cumsum(0.5 * (self.d[:, 1:] + self.d[:, :-1]), 1)], 1)
        total = self.row[:, -1]
        self.column = np.concatenate([[0], np.cumsum(0.5 * (total[1:] + total[:-1]))])

    def sample(self, s):
        s = np.clip(s, INSET, 1 - INSET)
        total = self.row[:, -1]
        y = s[1] * self.column[-1]
        j = min(max(np.searchsorted(self.column, y, side="right") - 1, 0), len(total) - 2)
        fy = self.root(total[j], total[j + 1], y - self.column[j])
        along = (1 - fy) * self.row[j] + fy * self.row[j + 1]
        density = (1 - fy) * self.d[j] + fy * self.d[j + 1]
        x = s[0] * along[-1]
        i = min(max(np.searchsorted(along, x, side="right") - 1, 0), len(along) - 2)
        fx = self.root(density[i], density[i + 1], x - along[i])
        return np.array([(i + fx) / (len(along) - 1), (j + fy) / (len(total) - 1)])

    @staticmethod
    def root(a, b, area):
        denominator = a + np.sqrt(max(a * a + 2 * area * (b - a), 0))
        return min(max(2 * area / denominator, 0), 1) if denominator > 0 else 0.0


def tensors(material, phi_i, theta_i, vndf_size, value_size, table_size, description):
    theta_i, phi_i = np.float32(theta_i), np.float32(phi_i)
    isotropic = len(phi_i) <= 2
    w, _ = grid(table_size, 2 if isotropic else 2 * table_size)
    ndf, sigma = np.float32(material.ndf(w)), np.float32(material.sigma(w))
    m, theta_m = grid(vndf_size, vndf_size)
    shape = (len(phi_i), len(theta_i))
    vndf = np.zeros((*shape, vndf_size, vndf_size), np.float32)
    value = np.zeros((*shape, len(material.kd), value_size, value_size), np.float32)
    valid = np.zeros((*shape, value_size, value_size), bool)
    for p, phi in enumerate(np.float64(phi_i)):
        for t, theta in enumerate(np.float64(theta_i)):
            wi = direction(theta, np.float64(phi))
            # Azimuths of m count from that of the incidence where the material is isotropic.
            zero = phi if isotropic else 0.0
            facing = direction(theta, np.float64(phi - zero))
            area = 2 * np.pi**2 * np.sqrt(theta_m / (np.pi / 2)) * np.sin(theta_m)
            visible = np.maximum(m @ facing, 0) / material.sigma(facing)
            vndf[p, t] = material.ndf(m) * visible * area
            warp = Warp(vndf[p, t])
            scale = 4 * bilinear(sigma, [np.sqrt(theta / (np.pi / 2)), phi / (2 * np.pi) + 0.5])
            for j in range(value_size):
                for i in range(value_size):
                    u = warp.sample(np.array([i, j]) / (value_size - 1))
                    normal = direction(np.pi / 2 * u[0] ** 2, np.pi * (2 * u[1] - 1) + zero)
                    wo = 2 * wi.dot(normal) * normal - wi
                    valid[p, t, j, i] = wo[2] > 0
                    if wo[2] > 0:
                        value[p, t, :, j, i] = material.value(wi, wo) * scale / bilinear(ndf, u)
    luminance = np.maximum(value.mean(axis=2), 0)
    return {
        "description": np.frombuffer(description.encode(), np.uint8), "phi_i": phi_i, "theta_i": theta_i, "sigma": sigma,
        "ndf": ndf, "vndf": vndf, "luminance": luminance, "rgb": value, "jacobian": np.array([1], np.uint8),
        "valid": np.packbits(valid),
    }


CODES = {"uint8": 1, "float32": 10, "float64": 11}


def encode(fields, align=8):
    head = 12 + 2 + 4 + sum(2 + len(k) + 2 + 1 + 8 + 8 * v.ndim for k, v in fields.items())
    header, data = [b"tensor_file\0", struct.pack("<BBI", 1, 0, len(fields))], b""
    for name, v in fields.items():
        data += b"\0" * (-(head + len(data)) % align)
        header.append(struct.pack("<H", len(name)) + name.encode())
        header.append(struct.pack("<HBQ", v.ndim, CODES[str(v.dtype)], head + len(data)))
        header.append(struct.pack(f"<{v.ndim}Q", *v.shape))
        data += np.ascontiguousarray(v).tobytes()
    return b"".join(header) + data


def write(folder, name, data):
    with open(os.path.join(folder, name), "wb") as file:
        file.write(data if isinstance(data, bytes) else encode(data))


def broken(base):
    """One file per failure, each from a small valid one."""

    def without(name):
        return {k: v for k, v in base.items() if k != name}

    def other(name, value):
        return {**base, name: value}

    def patched(find, shift, replacement):
        data = bytearray(encode(base))
        at = data.index(find) + shift
        data[at : at + len(replacement)] = replacement
        return bytes(data)

    whole = encode(base)
    yield "wrong-mark", b"tensor-file\0" + whole[12:]
    yield "version-2", whole[:12] + b"\2" + whole[13:]
    yield "empty", b""
    yield "header-cut", whole[:100]
    yield "data-cut", whole[:-40]
    yield "field-count-huge", whole[:14] + b"\xff\xff\xff\xff" + whole[18:]
    # after the name: u16 dimensions, u8 type, u64 offset, extents
    yield "shape-huge", patched(b"vndf", 15, struct.pack("<Q", 2**62))
    yield "shape-zero", patched(b"vndf", 15, struct.pack("<Q", 0))
    yield "offset-huge", patched(b"vndf", 7, struct.pack("<Q", 2**64 - 8))
    yield "type-unknown", patched(b"vndf", 6, b"\x63")
    yield "type-f64", other("vndf", np.float64(base["vndf"]))
    yield "no-vndf", without("vndf")
    yield "no-rgb", without("rgb")
    yield "no-jacobian", without("jacobian")
    yield "vndf-negative", other("vndf", -base["vndf"])
    yield "vndf-nan", other("vndf", base["vndf"] * np.float32("nan"))
    yield "vndf-zero", other("vndf", base["vndf"] * np.float32(0))
    yield "sigma-zero", other("sigma", base["sigma"] * np.float32(0))
    yield "rgb-four-channels", other("rgb", np.concatenate([base["rgb"], base["rgb"][:, :, :1]], 2))
    yield "theta-not-ascending", other("theta_i", base["theta_i"][::-1])
    yield "theta-in-degrees", other("theta_i", np.degrees(base["theta_i"]))
    # the header names `ndf` again where `rgb` stood
    yield "field-twice", whole.replace(b"rgb", b"ndf")


def main():
    right = 0.9999999 * np.pi / 2
    plain = Material(0.35, 0.35, 0.0, [0.3, 0.2, 0.1], [0.5, 0.45, 0.4])
    tiny = tensors(plain, [0.0], [0.0, 0.5, 1.0, 1.3, right], 32, 16, 24, "synthetic GGX on a diffuse base")
    write(HERE, "rgl-tiny.bsdf", tiny)
    theta = [0.0, 0.7, right]
    brushed = Material(0.5, 0.25, 0.5, [0.3, 0.2, 0.1], [0.5, 0.45, 0.4])
    turned = tensors(brushed, np.linspace(-np.pi, 0, 5), theta, 16, 8, 12, "synthetic, brushed at 30 degrees")
    write(HERE, "rgl-half-turn.bsdf", turned)
    crossed = Material(0.5, 0.25, 0.0, [0.3, 0.2, 0.1], [0.5, 0.45, 0.4])
    mirrored = tensors(crossed, np.linspace(-np.pi, -np.pi / 2, 3), theta, 16, 8, 12, "synthetic, brushed along x")
    write(HERE, "rgl-two-planes.bsdf", mirrored)
    tilted = Material(0.5, 0.25, 0.5, [0.3, 0.2, 0.1], [0.5, 0.45, 0.4], tilt=0.4)
    free = tensors(tilted, np.linspace(-np.pi, np.pi, 7), theta, 16, 8, 12, "synthetic, brushed and tilted")
    write(HERE, "rgl-full-turn.bsdf", free)
    colours = Material(0.35, 0.35, 0.0, [0.3, 0.2, 0.1, 0.05], [0.5, 0.45, 0.4, 0.3])
    spectral = tensors(colours, [0.0], theta, 16, 8, 12, "synthetic, four wavelengths")
    spectral["spectra"] = spectral.pop("rgb")
    spectral["wavelengths"] = np.float32([450, 532.5, 600, 700])
    spectral["valid"] = ~spectral["valid"]  # some files mark the other way round
    write(HERE, "rgl-spectral.bsdf", spectral)
    nano = tensors(plain, [0.0], theta, 6, 4, 6, "synthetic, as small as it gets")
    hole = {**nano, "rgb": nano["rgb"].copy()}
    hole["rgb"][0, 1, 1, 2, 1] = np.nan
    write(HERE, "rgl-one-nan.bsdf", hole)
    for name, data in broken(nano):
        write(INVALID, f"rgl-{name}.bsdf", data)


if __name__ == "__main__":
    main()
