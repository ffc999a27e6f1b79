# SPDX-License-Identifier: Apache-2.0
"""Checks of the arguments of ``wavecomb.render``, before any work begins."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import fields
from difflib import get_close_matches
from numbers import Integral, Real
from typing import Any

from wavecomb.errors import ArgumentError
from wavecomb.load_options import LoadOptions

_OTHER_NAMES = {
    "spp": "samples sample_count samples_per_pixel pixel_samples",
    "size": "resolution res width height",
    "output": "out outfile output_file output_image destination image",
    "max_depth": "bounces max_bounces depth ray_depth",
    "region": "crop_window",
    "aov": "layers aovs passes",
    "frames": "frame_range range start_frame",
    "frame": "time",
    "time_limit": "timeout max_time",
    "denoise": "denoiser",
    "threads": "jobs cores",
    "camera": "cam",
    "noise": "variance noise_threshold error_threshold",
    "checkpoint": "snapshot",
    "resume": "continue",
    "stats": "statistics",
    "quiet": "silent",
}
"""For each option, the names of the same option in other renderers and tools."""

SYNONYMS = {word: name for name, words in _OTHER_NAMES.items() for word in words.split()}
"""Maps names from other renderers to options of Wavecomb, with "_" for hyphens."""

_KEYWORDS = {"aov": "aovs"}
"""Command-line options whose Python keyword has another name."""

_EXAMPLES = {
    "size": "size=(640, 360)", "spp": "spp=64", "aovs": 'aovs=["depth", "normal"]',
    "max_depth": "max_depth=8", "camera": 'camera="/World/Camera"', "frame": "frame=101.0",
}  # fmt: skip


_ELSEWHERE = ("width", "height", "spp", "policy", "costs", "size")
"""Settings and load options that ``render`` declares as parameters and not as ``**options``."""


def keywords() -> set[str]:
    """Returns the names in ``RenderKeywords`` (keywords.pyi), from the tables that define them."""
    from wavecomb.options import settings

    return {*settings(), *(one.name for one in fields(LoadOptions)), "region"} - {*_ELSEWHERE}


def check_source(source: Any, *, also: Iterable[str] = ()) -> None:
    """Raises ArgumentError unless a source is a path or stage, or has an attribute in ``also``."""
    if isinstance(source, (str, os.PathLike)) or hasattr(source, "GetRootLayer"):
        return
    if not any(hasattr(source, name) for name in also):
        raise ArgumentError(
            f"{type(source).__name__}: is nothing to read; give a file, such as "
            'wavecomb.load("shot.usd"), or a Usd.Stage'
        )


def check_arguments(size: Any, spp: Any, aovs: Any, options: Mapping[str, Any]) -> None:
    """Checks the types of arguments and the names of keywords.

    Args:
        size: Width and height, or None.
        spp: Samples per pixel.
        aovs: Names of layers, or None.
        options: Further keywords.

    Raises:
        ArgumentError: The message names the argument and has an example.
    """
    names = keywords()
    for name in options:
        if name not in names:
            raise _unknown(name, names)
    if size is not None and not _is_pair(size):
        raise _wrong("size", size, "width and height in pixels")
    if isinstance(spp, bool) or not isinstance(spp, Integral):
        raise _wrong("spp", spp, "a whole number of samples per pixel")
    if isinstance(aovs, (str, bytes)) or not (aovs is None or isinstance(aovs, Iterable)):
        raise _wrong("aovs", aovs, "a list of names")
    from wavecomb.options import settings

    kinds: dict[str, tuple[Any, str]] = {
        "integer": (Integral, "a whole number"), "number": (Real, "a number"),
        "flag": (bool, "True or False"), "choice": (str, "a text"), "text": (str, "a text"),
    }  # fmt: skip
    for name, value in options.items():
        row = settings().get(name)
        if row is None or value is None:
            continue
        kind, what = kinds[row.kind]
        if not isinstance(value, kind) or (kind is not bool and isinstance(value, bool)):
            default = row.default if row.default is not None else 1
            raise _wrong(name, value, what, f"{name}={default!r}")
        _check_range(name, value)


def _check_range(name: str, value: Any) -> None:
    """Raises ArgumentError if a number is outside the range in the settings table."""
    from wavecomb.options import settings

    row = settings()[name]
    if row.kind not in ("integer", "number") or (value == 0 and row.zero):
        return
    if row.least is None or row.most is None:
        return
    if row.least <= value <= row.most:
        return
    limits = f"from {row.least:.12g} to {row.most:.12g}"
    example = _EXAMPLES.get(name, f"{name}={row.default if row.default is not None else 1!r}")
    raise _wrong(name, value, limits, example)


def _is_pair(size: Any) -> bool:
    try:
        width, height = size
    except (TypeError, ValueError):
        return False
    return all(isinstance(edge, Integral) for edge in (width, height))


def _wrong(name: str, value: Any, what: str, example: str = "") -> ArgumentError:
    return ArgumentError(f"{name}={value!r}: must be {what}, such as {example or _EXAMPLES[name]}")


def _unknown(name: str, known: set[str]) -> ArgumentError:
    meant = {one: one for one in (*known, *_EXAMPLES)}
    for word, option in SYNONYMS.items():
        keyword = _KEYWORDS.get(option, option)
        if keyword in meant:
            meant.setdefault(word, keyword)
    near = [name] if name in meant else get_close_matches(name, meant, n=1, cutoff=0.7)
    wanted = next((meant[one] for one in near), None)
    if wanted is None:
        return ArgumentError(f"{name}: is no keyword of render(); docs/command-line.md lists them")
    return ArgumentError(f"{name}: is no keyword; did you mean {_EXAMPLES.get(wanted, wanted)}?")
