"""Golden numbers for harness/tests/metrics.rs, from published implementations.

    python3 -m venv venv && venv/bin/pip install flip-evaluator scikit-image numpy
    venv/bin/python metrics.py > metrics.txt

The image pairs use whole-number arithmetic and one division, so that the Rust test makes the same floats.
"""

import platform
from importlib.metadata import version

import flip_evaluator as flip
import numpy as np
from skimage.metrics import (
    mean_squared_error,
    peak_signal_noise_ratio,
    structural_similarity,
)

PPD = 67.02064


def ldr(width, height):
    y, x, c = np.mgrid[0:height, 0:width, 0:3]
    ref = ((x * (3 + c) + y * (5 - c)) % 32) / 40 + ((x // 8 + y // 8) % 2) * 0.15
    test = np.clip(ref * 0.93 + ((x * x + 7 * y + 11 * c) % 13) / 130, 0, 1)
    return ref.astype(np.float32), test.astype(np.float32)


def hdr(width, height):
    y, x, c = np.mgrid[0:height, 0:width, 0:3]
    ref, _ = ldr(width, height)
    ref = ref.astype(np.float64)
    spot = 30 / (1 + ((x - 20) ** 2 + (y - 15) ** 2) / 4)
    ref = 0.02 + 2 * ref * ref + spot
    test = ref * np.where(x > 40, 1.1, 0.97) + ((x * y) % 7) / 70
    return ref.astype(np.float32), test.astype(np.float32)


print(f"# python {platform.python_version()}, " + ", ".join(
    f"{p} {version(p)}" for p in ["numpy", "scikit-image", "flip-evaluator"]))
for width, height in [(61, 47), (60, 46)]:
    for name, (ref, test) in [("ldr", ldr(width, height)), ("hdr", hdr(width, height))]:
        r, t = ref.astype(np.float64), test.astype(np.float64)
        peak = float(r.max())
        print(f"[{name} {width}x{height}]")
        print(f"mae = {np.abs(t - r).mean():.9g}")
        print(f"mse = {mean_squared_error(r, t):.9g}")
        print(f"rel_mse = {((t - r) ** 2 / (r * r + 0.01)).mean():.9g}")
        print(f"psnr = {peak_signal_noise_ratio(r, t, data_range=peak):.9g}")
        ssim = structural_similarity(r, t, data_range=peak, channel_axis=2, gaussian_weights=True,
                                     sigma=1.5, use_sample_covariance=False)
        print(f"ssim = {ssim:.9g}")
        if name == "ldr":
            error, mean, _ = flip.evaluate(ref, test, "LDR", inputsRGB=True, applyMagma=False,
                                           parameters={"ppd": PPD})
            print(f"flip_ldr = {mean:.9g}")
            print(f"flip_ldr_max = {error.max():.9g}")
        else:
            error, mean, used = flip.evaluate(ref, test, "HDR", applyMagma=False, parameters={"ppd": PPD})
            print(f"flip_hdr = {mean:.9g}")
            print(f"flip_hdr_max = {error.max():.9g}")
            print(f"start_exposure = {used['startExposure']:.9g}")
            print(f"stop_exposure = {used['stopExposure']:.9g}")
            print(f"exposures = {used['numExposures']}")
