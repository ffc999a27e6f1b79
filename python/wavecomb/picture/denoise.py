# SPDX-License-Identifier: Apache-2.0
"""Denoising by Intel Open Image Denoise, by way of the extra ``denoise``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.extras import needed

Array = NDArray[np.float32]


def check_denoiser() -> None:
    """Raises WavecombError that says what to install, unless pictures can be denoised here."""
    needed("pyoidn", "denoising", extra="denoise")


def denoise(beauty: Array, albedo: Array, normal: Array, *, threads: int = 0) -> Array:
    """A picture without its noise.

    Albedo and normals are denoised first, each by itself, and then guide the picture as clean ones:
    what Open Image Denoise recommends for the most detail.

    Args:
        beauty: (height, width, 3), linear; values that are not finite are filled in.
        albedo: (height, width, 3), of what is seen.
        normal: (height, width, 3), means of unit vectors.
        threads: 0: all.

    Raises:
        WavecombError: The library is missing, or fails.
    """
    oidn = needed("pyoidn", "denoising", extra="denoise")
    with oidn.Device() as device:
        if threads > 0:
            device.set_int("numThreads", threads)
        device.commit()
        guides = {
            name: _filtered(oidn, device, {name: _clean(image, low, 1.0)})
            for name, image, low in (("albedo", albedo, 0.0), ("normal", normal, -1.0))
        }
        images = {"color": _clean(beauty, 0.0, None), **guides}
        return _filtered(oidn, device, images, hdr=True, cleanAux=True)


def _clean(image: Array, low: float, high: float | None) -> Array:
    """Finite values within the range that the filter reads."""
    finite = np.nan_to_num(image, nan=0.0, posinf=0.0, neginf=0.0)
    return np.ascontiguousarray(np.clip(finite, low, high), dtype=np.float32)


def _filtered(oidn: Any, device: Any, images: dict[str, Array], **flags: bool) -> Array:
    output = np.empty_like(next(iter(images.values())))
    with oidn.Filter(device, "RT") as run:
        for name, image in {**images, "output": output}.items():
            run.set_image(name, image, oidn.OIDN_FORMAT_FLOAT3)
        for name, value in flags.items():
            run.set_bool(name, value)
        run.commit()
        run.execute()
    if (problem := device.get_error()) is not None:
        raise WavecombError(f"denoising failed: {problem}")
    return output
