# SPDX-License-Identifier: Apache-2.0
"""Reads image files of any format and writes PNG files, by OpenImageIO.

Arrays have the shape (height, width, channels), with row 0 at the top.

Errors have a one-line message that names the file: OSError for files, ValueError for arrays.
"""

from __future__ import annotations

import functools
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
"""Tone mapping: "clamp", "neutral", or a name from ``wavecomb.ocio.tone_map``."""

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
        rgb: Linear Rec.709 colours with shape (height, width, 3).
        exposure: Exposure in stops; the image is multiplied by 2^exposure.
        tone_map: "clamp" clips values at 1. "neutral" compresses highlights towards white.
            "ocio:VIEW" applies a view of OpenColorIO. See ``display``.
        alpha: Alpha (height, width), with which the colours are premultiplied; None means that the
            image is opaque.
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
    """Writes 8-bit sRGB values (height, width, 3) to a file unchanged and atomically."""
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
    """Converts linear Rec.709 to 8-bit sRGB.

    If ``alpha`` is given, returns RGBA without premultiplication.

    Pixels with a NaN become magenta, which makes them visible. Infinities are clamped.
    """
    linear = _colours(rgb).astype(np.float32, copy=False)
    broken: NDArray[np.bool_] | None = None
    with np.errstate(over="ignore", invalid="ignore"):
        may_be_broken = not np.isfinite(linear.sum())
    if may_be_broken:
        broken = np.asarray(np.isnan(linear).any(axis=2))
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
        pixels = srgb_codes(linear)
    if broken is not None:
        pixels[broken] = _NAN_COLOUR
    if alpha is None:
        return pixels
    shares = covered if broken is None else np.where(broken[:, :, None], np.float32(1.0), covered)
    return np.concatenate([pixels, np.floor(shares * 255.0 + 0.5).astype(np.uint8)], axis=2)


def _neutral(rgb: Array) -> Array:
    """Applies Khronos PBR Neutral: keeps colours below 0.76 and desaturates highlights.

    The equations come from the reference code of "PBR Neutral" in
    https://github.com/KhronosGroup/ToneMapping.
    """
    start, desaturation, f90 = 0.8 - 0.04, 0.15, 0.04
    low = np.minimum(np.minimum(rgb[:, :, 0], rgb[:, :, 1]), rgb[:, :, 2])[:, :, None]
    offset = np.where(low < 2 * f90, low - low * low / (4 * f90), f90)
    rgb = (rgb - offset).astype(np.float32, copy=False)
    peaks = np.maximum(np.maximum(rgb[:, :, 0], rgb[:, :, 1]), rgb[:, :, 2])
    bright = peaks >= start
    peak = peaks[bright][:, None]
    d = 1.0 - start
    new_peak = 1.0 - d * d / (peak + d - start)
    g = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0)
    scaled = rgb[bright] * (new_peak / peak)
    rgb[bright] = scaled * (1.0 - g) + new_peak * g
    return rgb


def srgb_from_linear(linear: Array) -> Array:
    """Encodes values in [0, 1] with the sRGB transfer function (IEC 61966-2-1)."""
    high = 1.055 * np.power(np.maximum(linear, 0.0031308), np.float32(1 / 2.4)) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, high).astype(np.float32)


def srgb_codes(linear: Array) -> NDArray[np.uint8]:
    """Encodes values, limited to [0, 1], as 8-bit sRGB. A NaN becomes 0.

    A table of the leading bits of float32 values replaces the power function.
    """
    first_code, next_code_from = _code_tables()
    values = np.fmin(np.fmax(linear, np.float32(0.0)), np.float32(1.0))
    values = values + np.float32(0.0)  # makes -0 to 0
    bucket = values.view(np.uint32) >> _BUCKET_BITS
    codes = first_code[bucket]
    codes += values >= next_code_from[bucket]
    return codes


_BUCKET_BITS = 14
"""Number of low bits of a float32 that do not select a bucket. Buckets of 2^14 floats are narrow
enough that each contains at most two codes."""


@functools.cache
def _code_tables() -> tuple[NDArray[np.uint8], Array]:
    """Returns the smallest code of each bucket, and the value from which the next code applies."""
    one = int(np.float32(1.0).view(np.uint32))
    least, most = np.zeros(255, np.uint32), np.full(255, one, np.uint32)
    while (least < most).any():  # bisection for the smallest value of each code from 1
        middle = least + (most - least) // 2
        code = np.floor(srgb_from_linear(middle.view(np.float32)) * 255.0 + 0.5)
        reached = code >= np.arange(1, 256)
        least, most = np.where(reached, least, middle + 1), np.where(reached, middle, most)
    starts = np.arange((one >> _BUCKET_BITS) + 1, dtype=np.uint32) << _BUCKET_BITS
    first_code = np.searchsorted(least, starts, side="right")
    limits = np.append(least.view(np.float32), np.float32(np.inf))
    return first_code.astype(np.uint8), limits[first_code]


def linear_from_srgb(encoded: Array) -> Array:
    """Inverts ``srgb_from_linear``."""
    high = np.power((np.maximum(encoded, 0.04045) + 0.055) / 1.055, np.float32(2.4))
    return np.where(encoded <= 0.04045, encoded / 12.92, high).astype(np.float32)


def read_image(path: str | os.PathLike[str]) -> Array:
    """Reads an image of any format as linear float32 (height, width, channels).

    Integer files (PNG, JPEG and others) are converted from sRGB to linear values, except for alpha.
    """
    return _read(path)[0]


def read_codes(path: str | os.PathLike[str]) -> NDArray[np.uint8]:
    """Reads an image as 8-bit sRGB values (height, width, 3), composited over white.

    Raises:
        OSError: The file cannot be read. The message is one line that names the file.
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
    """Reads all layers of an image by name, such as {"beauty": (h, w, 3)}.

    ``write_exr`` uses the same names.

    The layer name is the part of a channel name before the last dot. The channels R, G, B and Y
    without a dot form the layer "beauty". Any other channel without a dot is a separate layer.
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
    """Raises OSError if an image has no pixels or needs more memory than the machine has."""
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
    """Reads pixel values (height, width, channels) in a NumPy type.

    Also returns OpenImageIO's specification.
    """
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
