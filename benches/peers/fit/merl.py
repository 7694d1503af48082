"""The MERL grid: directions of its entries, and the two files that the comparison works on.

MERL `.binary`: int32 90, 90, 180, then three planes (red, green, blue) of float64, all little-endian, entry
phi_d + 180 (theta_d + 90 theta_h). BRDF (1/sr) = stored * SCALE; a stored negative is invalid. Entries are taken at the
centre of their bins.

Flat file, what the peers read: int64 N, int64[N] entry, float64[N] cos(theta_i), float64[N] cos(alpha), float64[3][N]
BRDF, of the N samples that count. alpha is the angle between the outgoing direction and the mirrored incident one.
"""

import numpy as np

SHAPE = (90, 90, 180)  # theta_h, theta_d, phi_d
SCALE = np.array([1.0, 1.15, 1.66])[:, None] / 1500.0
MAX_ANGLE_DEG = 80.0


class Grid:
    """Cosines at the centre of every entry."""

    def __init__(self):
        half, diff, azimuth = (np.arange(n) + 0.5 for n in SHAPE)
        theta_h = np.radians((half / SHAPE[0]) ** 2 * 90.0)
        theta_h, theta_d, phi_d = (
            a.ravel() for a in np.meshgrid(theta_h, np.radians(diff), np.radians(azimuth), indexing="ij")
        )
        # The difference vector, turned about y by theta_h, is the incident direction; its mirror image at the half
        # vector is the outgoing one.
        x, y, z = np.sin(theta_d) * np.cos(phi_d), np.sin(theta_d) * np.sin(phi_d), np.cos(theta_d)
        cos_h, sin_h = np.cos(theta_h), np.sin(theta_h)
        half = np.stack([sin_h, np.zeros_like(sin_h), cos_h])
        self.wi = np.stack([cos_h * x + sin_h * z, y, cos_h * z - sin_h * x])
        self.wo = 2.0 * (self.wi * half).sum(0) * half - self.wi
        self.cos_half = cos_h
        self.cos_i, self.cos_o = self.wi[2], self.wo[2]
        self.cos_alpha = 2.0 * self.cos_i * self.cos_o - (self.wi * self.wo).sum(0)
        self.above_horizon = (self.cos_i > 0) & (self.cos_o > 0)
        limit = np.cos(np.radians(MAX_ANGLE_DEG)) - 1e-12  # the limit itself counts, whatever its rounding
        self.within_angle = (self.cos_i >= limit) & (self.cos_o >= limit)


def read(path):
    """Stored values, (3, entries)."""
    shape = tuple(np.fromfile(path, "<i4", 3))
    if shape != SHAPE:
        raise ValueError(f"{path}: a grid of {shape}, not {SHAPE}")
    return np.fromfile(path, "<f8", offset=12).reshape(3, -1)


def write(path, stored):
    """Writes stored values, (3, entries)."""
    with open(path, "wb") as out:
        np.array(SHAPE, "<i4").tofile(out)
        np.ascontiguousarray(stored, "<f8").tofile(out)


def flatten(grid, stored, path):
    """Writes the flat file. False, and none written, where the channels are not valid at the same entries: the peers
    know one set of samples.
    """
    valid = (stored >= 0) & grid.within_angle
    if not (valid == valid[0]).all():
        return False
    keep = np.flatnonzero(valid[0])
    with open(path, "wb") as out:
        np.array([keep.size], "<i8").tofile(out)
        keep.astype("<i8").tofile(out)
        for row in (grid.cos_i[keep], grid.cos_alpha[keep], (stored * SCALE)[:, keep]):
            np.ascontiguousarray(row, "<f8").tofile(out)
    return True


def read_flat(path):
    """cos(theta_i) and cos(alpha), (N,), and the BRDF, (3, N)."""
    rows = np.fromfile(path, "<f8", offset=8).reshape(6, -1)
    return rows[1], rows[2], rows[3:]
