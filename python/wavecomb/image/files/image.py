# SPDX-License-Identifier: Apache-2.0
"""Reads image files of any format and writes PNG files, by OpenImageIO.

Arrays are (height, width, channels), with row 0 at the top.

Errors are OSError (for the file) or ValueError (for arrays) with a one-line message that names the
file.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from wavecomb import ocio
from wavecomb.image.files.exr import bands_of, channel_names, write_bands, write_exr
from wavecomb.image.files.output_file import check_name, check_regular, one_line, problem_of
from wavecomb.machine import memory_bytes
from wavecomb.run import aovs

__all__ = [
    "channel_names",
    "display",
    "linear_from_srgb",
    "read_image",
    "read_layers",
    "read_metadata",
    "srgb_from_linear",
    "write_exr",
    "write_png",
]

Array = NDArray[np.float32]
Transfer = Literal["clamp", "neutral"] | str
"""Tone mapping: "clamp", "neutral", or a result of ``wavecomb.ocio.tone_map``."""

_HALF_MAX = 65504.0
_NAN_COLOUR = (255, 0, 255)


def write_png(
    path: str | os.PathLike[str],
    rgb: NDArray[Any],
    *,
    exposure: float = 0.0,
    tone_map: Transfer = "clamp",
    alpha: NDArray[Any] | None = None,
) -> None:
    """Writes an 8-bit sRGB image atomically.

    Args:
        path: File name that ends in .png.
        rgb: Linear Rec.709 (height, width, 3).
        exposure: Exposure in stops; the image is multiplied by 2^exposure.
        tone_map: "clamp" clips at 1; "neutral" rolls highlights off towards white; "ocio:VIEW" is a
            view of OpenColorIO. See ``display``.
        alpha: (height, width) alpha of premultiplied colours; None means an opaque image.
    """
    name = os.fspath(path)
    if Path(name).suffix.lower() != ".png":
        raise ValueError(f"{name}: the name of a PNG file must end in .png")
    linear = _colours(rgb)
    bands = (
        display(
            linear[rows], exposure=exposure, tone_map=tone_map,
            alpha=None if alpha is None else alpha[rows],
        )
        for rows in bands_of(linear.shape[0])
    )  # fmt: skip
    write_bands(name, png_spec(*linear.shape[:2], has_alpha=alpha is not None), bands)


def write_png_codes(path: str | os.PathLike[str], codes: NDArray[np.uint8]) -> None:
    """Writes 8-bit sRGB codes (height, width, 3) unchanged and atomically."""
    name = os.fspath(path)
    pixels = _colours(codes)
    spec = png_spec(*pixels.shape[:2])
    write_bands(name, spec, (pixels[rows] for rows in bands_of(pixels.shape[0])))


def png_spec(height: int, width: int, *, has_alpha: bool = False) -> Any:
    """Returns OpenImageIO's specification of a PNG file with 8-bit sRGB colours."""
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(width, height, 4 if has_alpha else 3, "uint8")
    # PNG stores unpremultiplied colours; the caller has already divided by alpha.
    if has_alpha:
        spec.attribute("oiio:UnassociatedAlpha", 1)
    spec.attribute("oiio:ColorSpace", "sRGB")
    spec.attribute("Software", "Wavecomb")
    return spec


def _colours(rgb: NDArray[Any]) -> NDArray[Any]:
    pixels = np.asarray(rgb)
    if pixels.ndim != 3 or pixels.shape[2] != 3:
        raise ValueError(f"a colour image has the shape (height, width, 3), not {pixels.shape}")
    return pixels


def display(
    rgb: NDArray[Any],
    *,
    exposure: float = 0.0,
    tone_map: Transfer = "clamp",
    alpha: NDArray[Any] | None = None,
) -> NDArray[np.uint8]:
    """Converts linear Rec.709 to 8-bit sRGB, or to unpremultiplied RGBA if ``alpha`` is given.

    Pixels with a NaN become magenta to be visible; infinities are clamped.
    """
    linear = _colours(rgb).astype(np.float32, copy=False)
    broken = np.isnan(linear).any(axis=2)
    linear = np.nan_to_num(linear, nan=0.0, posinf=_HALF_MAX, neginf=0.0)
    linear = np.clip(linear * np.float32(2.0**exposure), 0.0, np.float32(1e30))
    if alpha is not None:
        covered = np.clip(np.nan_to_num(alpha), 0.0, 1.0).astype(np.float32)[:, :, None]
        linear = np.divide(linear, covered, out=linear, where=covered > 0)
    pixels: NDArray[np.uint8]
    if tone_map.startswith(ocio.PREFIX):
        pixels = ocio.mapped(np.minimum(linear, _HALF_MAX), tone_map)
    else:
        if tone_map == "neutral":
            linear = _neutral(linear)
        elif tone_map != "clamp":
            raise ValueError(f"tone map {tone_map!r} is none of clamp, neutral, ocio:VIEW")
        encoded = srgb_from_linear(np.clip(linear, 0.0, 1.0))
        pixels = np.floor(encoded * 255.0 + 0.5).astype(np.uint8)
    pixels[broken] = _NAN_COLOUR
    if alpha is None:
        return pixels
    shares = np.where(np.asarray(broken)[:, :, None], np.float32(1.0), covered)
    return np.concatenate([pixels, np.floor(shares * 255.0 + 0.5).astype(np.uint8)], axis=2)


def _neutral(rgb: Array) -> Array:
    """Applies Khronos PBR Neutral: keeps colours below 0.76 and desaturates highlights.

    Equations from the reference of https://github.com/KhronosGroup/ToneMapping, "PBR Neutral".
    """
    start, desaturation, f90 = 0.8 - 0.04, 0.15, 0.04
    low = rgb.min(axis=2, keepdims=True)
    offset = np.where(low < 2 * f90, low - low * low / (4 * f90), f90)
    rgb = rgb - offset
    peak = rgb.max(axis=2, keepdims=True)
    d = 1.0 - start
    new_peak = 1.0 - d * d / (np.maximum(peak, start) + d - start)
    g = 1.0 - 1.0 / (desaturation * (np.maximum(peak, start) - new_peak) + 1.0)
    scaled = rgb * (new_peak / np.maximum(peak, 1e-6))
    rolled = scaled * (1.0 - g) + new_peak * g
    return np.where(peak < start, rgb, rolled).astype(np.float32)


def srgb_from_linear(linear: Array) -> Array:
    """Encodes values in [0, 1] with the sRGB transfer function (IEC 61966-2-1)."""
    high = 1.055 * np.power(np.maximum(linear, 0.0031308), np.float32(1 / 2.4)) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, high).astype(np.float32)


def linear_from_srgb(encoded: Array) -> Array:
    """Inverts ``srgb_from_linear``."""
    high = np.power((np.maximum(encoded, 0.04045) + 0.055) / 1.055, np.float32(2.4))
    return np.where(encoded <= 0.04045, encoded / 12.92, high).astype(np.float32)


def read_image(path: str | os.PathLike[str]) -> Array:
    """Reads an image of any format as linear float32 (height, width, channels).

    Treats integer files (PNG, JPEG ...) as sRGB and linearises them, except alpha.
    """
    return _read(path)[0]


def read_codes(path: str | os.PathLike[str]) -> NDArray[np.uint8]:
    """Reads an 8-bit image as displayed on white: (height, width, 3).

    Raises:
        OSError: The file cannot be read; the one-line message names it.
    """
    codes, spec = _pixels(path, "uint8")
    alpha = spec.alpha_channel
    colours = codes[:, :, :3] if codes.shape[2] >= 3 else np.repeat(codes[:, :, :1], 3, axis=2)
    if alpha < 0:
        return np.ascontiguousarray(colours)
    share = codes[:, :, alpha : alpha + 1].astype(np.float32) / np.float32(255.0)
    mixed: NDArray[np.uint8] = (share * colours + (1.0 - share) * 255.0 + 0.5).astype(np.uint8)
    return mixed


def read_layers(path: str | os.PathLike[str]) -> dict[str, Array]:
    """Reads an image by layers, named as in ``write_exr``: {"beauty": (h, w, 3), ...}.

    The layer is the part of a channel's name before the last dot. R, G, B and Y without a dot are
    "beauty"; any other channel without a dot is a separate layer.
    """
    pixels, names = _read(path)
    groups: dict[str, list[int]] = {}
    for k, name in enumerate(names):
        layer, dot, _ = name.rpartition(".")
        if not dot:
            layer = "beauty" if name in {"R", "G", "B", "Y"} else name
        groups.setdefault(layer, []).append(k)
    order = {letter: k for k, letter in enumerate(["R", "G", "B", "A"])}
    for ids in groups.values():
        ids.sort(key=lambda k: order.get(names[k].rpartition(".")[2], len(order)))
    known = aovs.layer_order()
    names_in_order = sorted(groups, key=lambda name: known.index(name) if name in known else 99)
    return {name: np.ascontiguousarray(pixels[:, :, groups[name]]) for name in names_in_order}


def read_metadata(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Reads the attributes of an image file."""
    source = _open(os.fspath(path))
    values = {attribute.name: attribute.value for attribute in source.spec().extra_attribs}
    source.close()
    return values


def _open(name: str) -> Any:
    import OpenImageIO as oiio

    check_name(name)
    if not Path(name).exists():
        raise FileNotFoundError(f"{name}: no such file")
    if Path(name).is_dir():
        raise IsADirectoryError(f"{name}: is a folder, not an image")
    check_regular(name)
    hints = oiio.ImageSpec()
    hints.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(name, hints)
    if source is None:
        raise OSError(f"{name}: cannot be read as an image: {one_line(problem_of(oiio), name)}")
    return source


def _check_size(name: str, spec: Any) -> None:
    """Raises OSError for an image without pixels, or too large for this machine's memory."""
    if min(spec.width, spec.height, spec.nchannels) < 1 or spec.depth > 1 or spec.deep:
        raise OSError(f"{name}: has no pixels, or several in depth")
    # Reading needs memory for the float image, for a copy of it that is split into layers, and for
    # OpenImageIO's buffers.
    needed = 3 * 4 * spec.width * spec.height * spec.nchannels
    there = memory_bytes()
    if there is not None and needed > there:
        raise OSError(
            f"{name}: says that it has {spec.width} x {spec.height} pixels with {spec.nchannels} "
            f"channels, which takes {needed / 2**30:.0f} GiB; this machine has "
            f"{there / 2**30:.0f}"
        )


def _pixels(path: str | os.PathLike[str], kind: str) -> tuple[NDArray[Any], Any]:
    """Reads values of a NumPy type (height, width, channels) and OpenImageIO's specification."""
    name = os.fspath(path)
    source = _open(name)
    try:
        spec = source.spec()
        _check_size(name, spec)
        pixels = source.read_image(0, 0, 0, spec.nchannels, "uint8" if kind == "uint8" else "float")
        if pixels is None:
            raise OSError(f"{name}: is damaged: {one_line(problem_of(source), name)}")
    finally:
        source.close()
    return np.asarray(pixels, kind).reshape(spec.height, spec.width, spec.nchannels), spec


def _read(path: str | os.PathLike[str]) -> tuple[Array, list[str]]:
    import OpenImageIO as oiio

    image, spec = _pixels(path, "float32")
    if spec.format.basetype not in (oiio.HALF, oiio.FLOAT, oiio.DOUBLE):
        colour = [k for k in range(spec.nchannels) if k != spec.alpha_channel]
        image[:, :, colour] = linear_from_srgb(image[:, :, colour])
    return image, list(spec.channelnames)
