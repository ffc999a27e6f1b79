# SPDX-License-Identifier: GPL-3.0-or-later
"""Provides Blender's images to the renderer as files."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from .context import Translation
from .usda import safe_name

SPACES = {
    "sRGB": "srgb_texture",
    "Linear Rec.709": "lin_rec709",
    "Linear": "lin_rec709",
    "scene_linear": "lin_rec709",
    "Non-Color": "raw",
    "Raw": "raw",
    "ACEScg": "acescg",
    "ACES2065-1": "lin_ap0",
    "Linear CIE-XYZ D65": "lin_ciexyzd65",
    "Linear Rec.2020": "lin_rec2020",
    "Linear DCI-P3 D65": "lin_p3d65",
    "Rec.1886": "g24_rec709",
}
"""Colour spaces of OpenUSD by their names in Blender."""

READABLE = (
    ".png", ".jpg", ".jpeg", ".exr", ".hdr", ".tif", ".tiff", ".tga", ".bmp", ".webp", ".jp2",
)  # fmt: skip


def file_of(into: Translation, image: Any, associate: bool = False) -> str | None:
    """Returns a file with the pixels of an image; None, after a message, if there is none.

    An image that is packed, generated, painted on or of an unusual format is saved to the folder
    of the stage.

    Args:
        into: State of the scene translation.
        image: The image.
        associate: Whether colours are multiplied by alpha, as Cycles does with straight alpha
            where nothing uses the node's alpha. Colours are multiplied as stored, before they are
            converted to linear values.
    """
    import bpy

    if image.source in ("SEQUENCE", "MOVIE"):
        into.report.miss(f"image {image.source.lower()}", image.name)
        return None
    path = os.path.abspath(bpy.path.abspath(image.filepath, library=image.library))
    if image.source == "TILED":
        head, dot, tail = path.rpartition("<UDIM>")
        if dot and any(os.path.exists(f"{head}{tile.number}{tail}") for tile in image.tiles):
            return path
        into.report.miss("packed or missing UDIM tiles", image.name)
        return None
    alpha = _alpha_of(image) if associate else None
    if alpha is not None:
        return _saved(into, image, alpha)
    on_disk = image.source == "FILE" and not image.packed_files and not image.is_dirty
    if on_disk and path.lower().endswith(READABLE):
        if os.path.isfile(path):
            return path
        into.report.miss(f"missing image file {path}", image.name)
        return None
    return _saved(into, image)


def _alpha_of(image: Any) -> np.ndarray | None:
    """Returns the alpha of each pixel, or None if no colour has to be multiplied by alpha."""
    if image.alpha_mode != "STRAIGHT" or image.channels != 4 or not image.size[0]:
        return None
    pixels = np.empty(4 * image.size[0] * image.size[1], np.float32)
    image.pixels.foreach_get(pixels)
    alpha = pixels[3::4]
    return alpha if float(alpha.min()) < 1.0 else None


def _saved(into: Translation, image: Any, alpha: np.ndarray | None = None) -> str | None:
    if not image.has_data:
        # Blender loads an image when a pixel of the image is read.
        _ = image.pixels[:1] if image.size[0] else None
    if not image.size[0]:
        into.report.miss("image without pixels", image.name)
        return None
    ending = ".exr" if image.is_float else ".png"
    kind = "image" if alpha is None else "associated"
    file = into.file(f"{kind}-{safe_name(image.name)}-{image.session_uid}{ending}")
    if os.path.exists(file):
        return file
    copy = image.original.copy() if image.is_evaluated else image.copy()
    try:
        if alpha is not None:
            pixels = np.empty(4 * len(alpha), np.float32)
            copy.pixels.foreach_get(pixels)
            colours = pixels.reshape(-1, 4)
            colours[:, :3] *= alpha[:, None]
            colours[:, 3] = 1.0
            copy.pixels.foreach_set(pixels)
        copy.file_format = "OPEN_EXR" if image.is_float else "PNG"
        copy.save(filepath=file)
    except RuntimeError as error:
        into.report.miss(f"image that cannot be saved ({error})", image.name)
        return None
    finally:
        _remove(copy)
    return file


def _remove(image: Any) -> None:
    import bpy

    bpy.data.images.remove(image)


def space_of(into: Translation, image: Any) -> str:
    """Returns the colour space of an image as a token of OpenUSD."""
    name = str(image.colorspace_settings.name)
    if name not in SPACES:
        into.report.approximate(f"colour space {name} of an image (read as sRGB)", image.name)
    return SPACES.get(name, "srgb_texture")
