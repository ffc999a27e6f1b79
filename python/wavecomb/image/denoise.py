# SPDX-License-Identifier: Apache-2.0
"""Denoising with Intel Open Image Denoise, which the extra ``denoise`` installs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.extras import needed

Array = NDArray[np.float32]


def check_denoiser() -> None:
    """Raises WavecombError with installation advice if denoising is not available."""
    needed("pyoidn", "denoising", extra="denoise")


def denoise(
    beauty: Array, albedo: Array, normal: Array, *, threads: int = 0, fast: bool = False
) -> Array:
    """Denoises an image.

    Albedo and normals are first denoised themselves. They then guide the denoising of the image as
    noise-free features, as Open Image Denoise recommends.

    Args:
        beauty: Linear colours (height, width, 3). Values that are not finite are replaced.
        albedo: Albedo with shape (height, width, 3).
        normal: Means of unit normals, with shape (height, width, 3).
        threads: Number of threads; 0 uses all cores.
        fast: Whether to use a smaller network and guides that are not denoised, for previews.

    Raises:
        WavecombError: The library is missing or reports an error.
    """
    oidn = needed("pyoidn", "denoising", extra="denoise")
    with oidn.Device() as device:
        if threads > 0:
            device.set_int("numThreads", threads)
        # Do not bind the denoiser's threads to cores, where they would wait for the threads of a
        # render that runs at the same time.
        device.set_bool("setAffinity", False)
        device.commit()
        guides = {"albedo": _clean(albedo, 0.0, 1.0), "normal": _clean(normal, -1.0, 1.0)}
        images = {"color": _clean(beauty, 0.0, None)}
        if fast:
            return _filtered(oidn, device, {**images, **guides}, fast=True, hdr=True)
        guides = {name: _filtered(oidn, device, {name: one}) for name, one in guides.items()}
        return _filtered(oidn, device, {**images, **guides}, hdr=True, cleanAux=True)


def _clean(image: Array, low: float, high: float | None) -> Array:
    """Replaces values that are not finite, and clamps values to the denoiser's input range."""
    finite = np.nan_to_num(image, nan=0.0, posinf=0.0, neginf=0.0)
    return np.ascontiguousarray(np.clip(finite, low, high), dtype=np.float32)


def _filtered(
    oidn: Any, device: Any, images: dict[str, Array], *, fast: bool = False, **flags: bool
) -> Array:
    output = np.empty_like(next(iter(images.values())))
    with oidn.Filter(device, "RT") as run:
        for name, image in {**images, "output": output}.items():
            run.set_image(name, image, oidn.OIDN_FORMAT_FLOAT3)
        for name, value in flags.items():
            run.set_bool(name, value)
        if fast:
            run.set_quality(oidn.OIDN_QUALITY_FAST)
        run.commit()
        run.execute()
    if (problem := device.get_error()) is not None:
        raise WavecombError(f"denoising failed: {problem}")
    return output
