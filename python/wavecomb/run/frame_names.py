# SPDX-License-Identifier: Apache-2.0
"""Parses frame ranges, and inserts frame numbers into file names."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from decimal import Decimal, InvalidOperation

from wavecomb.errors import WavecombError

MAX_FRAMES = 1_000_000

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
_RANGE = re.compile(rf"({_NUMBER})(?:-({_NUMBER}))?(?:x({_NUMBER}))?")
_PLACE = re.compile(
    r"<frame>|(?P<hashes>#+)|%(?P<zero>0?)(?P<width>\d*)d"
    r"|\$F(?P<houdini>\d*)(?![A-Za-z\d])|\$\{F(?P<braced>\d*)\}"
)


def parse_frames(text: str | Iterable[float]) -> tuple[float, ...]:
    """Returns the frames of a range in the given order, without duplicates.

    Args:
        text: Comma-separated list of frames and ranges, such as ``1,5,9``, ``1-48``, ``1-48x2``
            (every second frame), ``48-1`` (backwards), ``-10--2`` (negative frames) or ``1-2x0.25``
            (fractional frames). A number is also valid.

    >>> parse_frames("1-7x3,-2--1,0.5")
    (1.0, 4.0, 7.0, -2.0, -1.0, 0.5)

    Raises:
        WavecombError: The text is not a valid frame range.
    """
    if not isinstance(text, str):
        text = ",".join(f"{float(frame):f}" for frame in text)
    frames: dict[float, None] = {}
    for part in text.split(","):
        for frame in _range(part.strip(), text):
            frames[float(frame)] = None
            if len(frames) > MAX_FRAMES:
                raise WavecombError(f"frames {text}: more than {MAX_FRAMES:,} frames")
    return tuple(frames)


def _range(part: str, text: str) -> Iterable[Decimal]:
    """Yields the frames of a number or range, in exact decimal arithmetic."""
    match = _RANGE.fullmatch(part)
    if match is None:
        raise WavecombError(
            f"frames {text}: {part!r} is no frame or range; write 1-48, 1-48x2, 1,5,9 or -2--1"
        )
    try:
        first, *others = (None if group is None else Decimal(group) for group in match.groups())
    except InvalidOperation:
        raise WavecombError(f"frames {text}: {part!r} has too many digits") from None
    assert first is not None
    last, step = others
    if last is None:
        if step is not None:
            raise WavecombError(f"frames {text}: {part!r} has a step and no end; write 1-48x2")
        yield first
        return
    step = Decimal(1) if step is None else step
    if step <= 0:
        raise WavecombError(f"frames {text}: the step of {part!r} must be above 0")
    count = int(abs(last - first) / step)
    if count >= MAX_FRAMES:
        raise WavecombError(f"frames {text}: more than {MAX_FRAMES:,} frames")
    sign = 1 if last >= first else -1
    for i in range(count + 1):
        yield first + sign * i * step


def frame_text(frame: float) -> str:
    """Formats a frame number.

    >>> frame_text(7.0), frame_text(-0.25)
    ('7', '-0.25')
    """
    text = f"{Decimal(repr(float(frame))):f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def has_place(pattern: str) -> bool:
    """Returns whether a file name contains a placeholder for the frame number."""
    return _PLACE.search(os.path.basename(pattern)) is not None


def matching(pattern: str) -> dict[float, str]:
    """Returns the existing files that match a name with a frame placeholder, sorted by frame.

    If two files have the same frame number (``a.7.exr``, ``a.0007.exr``), the result contains the
    name that ``fill`` returns.

    Raises:
        OSError: The folder cannot be read.
    """
    folder, name = os.path.split(pattern)
    text, end = "", 0
    for place in _PLACE.finditer(name):
        text += re.escape(name[end : place.start()]) + r"([+-]?\d+(?:\.\d+)?)"
        end = place.end()
    shape = re.compile(text + re.escape(name[end:]))
    found: dict[float, str] = {}
    for file in sorted(os.listdir(folder or os.curdir)):
        match = shape.fullmatch(file)
        if match is None or len({float(group) for group in match.groups()}) != 1:
            continue
        frame, path = float(match[1]), os.path.join(folder, file)
        if frame not in found or path == fill(pattern, frame):
            found[frame] = path
    return dict(sorted(found.items()))


def fill(pattern: str, frame: float) -> str:
    """Returns the file name for a frame.

    In the last path element, ``####`` is replaced by the frame number with four digits, ``%04d`` by
    the frame number with four characters including the sign, and ``<frame>`` by the number without
    padding. Houdini's ``$F4`` and ``${F4}`` mean the same as ``####``, and ``$F`` means the same as
    ``<frame>``. Fractional frame numbers keep their decimals.

    >>> fill("out/a.####.exr", 7), fill("a%04d.png", -7), fill("a_<frame>.exr", 1.5)
    ('out/a.0007.exr', 'a-007.png', 'a_1.5.exr')
    >>> fill("a.$F4.exr", 7), fill("a_${F}b.exr", 7)
    ('a.0007.exr', 'a_7b.exr')
    """
    folder, name = os.path.split(pattern)
    whole, point, decimals = frame_text(abs(frame)).partition(".")
    sign = "-" if frame < 0 else ""

    def text_of(place: re.Match[str]) -> str:
        if place["width"] is not None:
            width = int(place["width"] or 0)
            signed = sign + whole
            return (
                (signed.zfill(width) if place["zero"] else signed.rjust(width)) + point + decimals
            )
        digits = len(place["hashes"] or "") or int(place["houdini"] or place["braced"] or 0)
        return sign + whole.zfill(digits) + point + decimals

    return os.path.join(folder, _PLACE.sub(text_of, name))
