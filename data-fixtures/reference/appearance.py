"""Numbers of the reference programs for two pictures that a formula makes: ꟻLIP by flip-evaluator 1.7 (its authors' package), SSIM by
scikit-image 0.26. They stand in the tests of src/image/appearance.rs.

    pip install flip-evaluator scikit-image numpy && python3 appearance.py
"""

import flip_evaluator
import numpy as np
from skimage.metrics import structural_similarity

WIDTH, HEIGHT = 48, 40


def pictures(steepness):
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(float)
    channel = [0.5 + 0.4 * np.sin(0.7 * x + c) * np.cos(0.3 * y - c) for c in range(3)]
    reference = np.stack(channel, -1) * np.exp2(steepness * x / WIDTH)[..., None]
    test = reference * (0.9 + 0.1 * np.sin(1.3 * x + 0.5 * y))[..., None]
    return test, reference


def srgb(x):
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-30) ** (1 / 2.4) - 0.055)


test, reference = pictures(0)
ldr = flip_evaluator.evaluate(srgb(reference).astype(np.float32), srgb(test).astype(np.float32), "LDR", applyMagma=False)
y = np.array([0.2126, 0.7152, 0.0722])
ssim = structural_similarity(
    srgb(test @ y), srgb(reference @ y), data_range=1, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
)
hdr_test, hdr_reference = pictures(9)
hdr = flip_evaluator.evaluate(hdr_reference.astype(np.float32), hdr_test.astype(np.float32), "HDR", applyMagma=False)
print(f"LDR mean {ldr[1]:.7f} max {ldr[0].max():.7f}, HDR mean {hdr[1]:.7f} max {hdr[0].max():.7f}, SSIM {ssim:.9f}")
