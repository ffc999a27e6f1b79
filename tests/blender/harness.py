# SPDX-License-Identifier: Apache-2.0
"""Renders a Blender scene with Cycles and with Wavecomb, and compares the images in blocks."""

from __future__ import annotations

import importlib.util
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
SIZE = (96, 72)
BLOCK = 12
DEPTH = 8
"""Scattering events of a path."""

Image = np.ndarray


def load_extension() -> Any:
    """Imports and registers the extension of this checkout."""
    if "wavecomb_blender" in sys.modules:
        return sys.modules["wavecomb_blender"]
    folder = ROOT / "blender"
    spec = importlib.util.spec_from_file_location(
        "wavecomb_blender", folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["wavecomb_blender"] = module
    spec.loader.exec_module(module)
    module.register()
    return module


def prepare(spp: int) -> Any:
    """Empties Blender and sets both engines to the same integrator; returns the scene."""
    load_extension()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    load_extension()
    scene = bpy.context.scene
    if not hasattr(scene, "wavecomb"):
        sys.modules["wavecomb_blender"].register()
    render, cycles = scene.render, scene.cycles
    render.resolution_x, render.resolution_y = SIZE
    render.resolution_percentage = 100
    render.use_compositing = render.use_sequencer = False
    render.dither_intensity = 0.0
    scene.view_settings.view_transform = "Raw"
    cycles.device = "CPU"
    cycles.samples = spp
    cycles.use_denoising = cycles.use_adaptive_sampling = cycles.use_guiding = False
    cycles.light_sampling_threshold = 0.0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0
    cycles.pixel_filter_type = "BOX"
    bounces = DEPTH - 1
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = bounces
    cycles.transmission_bounces = cycles.volume_bounces = bounces
    cycles.transparent_max_bounces = 64
    scene.cycles_curves.shape = "THICK"
    scene.wavecomb.spp = spp
    scene.wavecomb.max_depth = DEPTH
    scene.wavecomb.filter = "box"
    return scene


def result_of(scene: Any) -> Image:
    """Returns (height, width, 4) values of the last render, top row first."""
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, "result.exr")
        bpy.data.images["Render Result"].save_render(file, scene=scene)
        read = bpy.data.images.load(file)
        read.colorspace_settings.name = "Non-Color"
        read.alpha_mode = "CHANNEL_PACKED"
        width, height = read.size
        pixels = np.empty(width * height * 4, np.float32)
        read.pixels.foreach_get(pixels)
        bpy.data.images.remove(read)
    return pixels.reshape(height, width, 4)[::-1].copy()


def render(scene: Any, engine: str, seed: int) -> tuple[Image, float]:
    """Renders the scene; returns the image and the render time in seconds."""
    scene.render.engine = engine
    scene.cycles.seed = scene.wavecomb.seed = seed
    start = time.perf_counter()
    bpy.ops.render.render()
    return result_of(scene), time.perf_counter() - start


def compare(cycles: list[Image], wavecomb: list[Image]) -> dict[str, float]:
    """Compares the block means of Cycles and Wavecomb renders, each with two seeds.

    Returns:
        ``ratio``: Mean of Wavecomb divided by the mean of Cycles. ``noise``: Standard error of
            ``ratio``.
        ``colour``: Largest deviation of a channel's ratio from 1.
        ``outside``: Fraction of blocks that differ by more than 2 % and four standard errors.
        ``worst``: Largest relative difference of a block.
        ``alpha``: Largest difference of a block's alpha.
    """
    a, b = (np.mean(images, axis=0)[..., :3].astype(np.float64) for images in (cycles, wavecomb))
    half = [0.5 * (one[0] - one[1])[..., :3].astype(np.float64) for one in (cycles, wavecomb)]
    mean = max(float(a.mean()), 1e-9)
    ratio = float(b.mean()) / mean
    channels = [
        float(b[..., i].mean() / a[..., i].mean())
        for i in range(3)
        if a[..., i].mean() > 0.02 * mean
    ]
    blocks = [_blocks(image) for image in (a, b)]
    # Estimate the noise of each block from the difference between two half renders. Pool the
    # estimates over all blocks, in proportion to brightness.
    errors = [_blocks(one) for one in half]
    own = np.sqrt(errors[0] ** 2 + errors[1] ** 2)
    pooled = np.sqrt(np.mean((own / (blocks[0] + 0.05 * mean)) ** 2)) * (blocks[0] + 0.05 * mean)
    sigma = np.sqrt(0.5 * own**2 + 0.5 * pooled**2)
    difference = np.abs(blocks[1] - blocks[0])
    outside = difference > 0.02 * blocks[0] + 4.0 * sigma + 1e-3 * mean
    relative = np.where(difference > 4.0 * sigma, difference / (blocks[0] + 0.05 * mean), 0.0)
    alphas = [_blocks(np.mean(images, axis=0)[..., 3:]) for images in (cycles, wavecomb)]
    return {
        "ratio": ratio,
        "noise": float(np.sqrt(sum(float(one.mean()) ** 2 for one in half)) / mean),
        "colour": max((abs(c - 1.0) for c in channels), default=0.0),
        "outside": float(outside.mean()),
        "worst": float(relative.max()),
        "alpha": float(np.abs(alphas[0] - alphas[1]).max()),
    }


def _blocks(image: Image) -> np.ndarray:
    height, width, depth = image.shape
    rows, columns = height // BLOCK, width // BLOCK
    cut = image[: rows * BLOCK, : columns * BLOCK]
    return cut.reshape(rows, BLOCK, columns, BLOCK, depth).mean((1, 3))


def to_display(image: Image) -> np.ndarray:
    """Returns 8-bit sRGB values, top row first."""
    x = np.clip(np.nan_to_num(image[..., :3]), 0.0, 1.0)
    x = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    return (255.0 * x + 0.5).astype(np.uint8)
