# SPDX-License-Identifier: Apache-2.0
"""Reads IES profiles: luminaire data in ANSI/IES LM-63 format."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wavecomb.usd.stage.context import LoadContext

Floats = NDArray[np.float64]

MAX_BYTES = 1 << 26
"""Largest size of a profile in bytes."""
_MAX_VALUES = 1 << 24
_WORDS = re.compile(r"[^\s,]+")
_TYPES = {1: "C", 2: "B", 3: "A"}


class IesError(ValueError):
    """Raised if an IES file is invalid; the message gives the reason."""


@dataclass(frozen=True)
class IesProfile:
    """Luminous intensity by direction, completed to the full circle.

    Attributes:
        vertical: (v,) angles from the luminaire's axis in degrees, in [0, 180], ascending.
        horizontal: (h,) angles around the axis in degrees, from 0 to 360; a single angle of 0 means
            rotational symmetry.
        candela: (h, v) intensities in candela.
    """

    vertical: Floats
    horizontal: Floats
    candela: Floats


def parse_ies(text: str) -> IesProfile:
    """Parses an LM-63 file (1986 to 2019) with photometry of type C, B or A.

    Multiplies candela by the file's multiplier, its ballast factor and its ballast-lamp factor.
    Skips ``TILT=INCLUDE`` data, which describes tilted lamps. Raises IesError if the file is
    invalid.
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    at = next((i for i, line in enumerate(lines) if line.strip().upper().startswith("TILT")), None)
    if at is None:
        raise IesError("it has no TILT line")
    tilt = lines[at].partition("=")[2].strip().upper()
    numbers = _numbers(" ".join(lines[at + 1 :]))
    if tilt == "INCLUDE":
        _take(numbers, 1, "tilt")
        pairs = _count(numbers, "tilt angles")
        _take(numbers, 2 * pairs, "tilt")
    elif tilt != "NONE":
        raise IesError(f"its tilt is in another file ({tilt or 'no name'}), which is not supported")
    _, _, factor = _take(numbers, 3, "head")
    rows, columns = _count(numbers, "vertical angles"), _count(numbers, "horizontal angles")
    kind = _TYPES.get(int(_take(numbers, 1, "head")[0]))
    if kind is None:
        raise IesError("its photometric type is not 1, 2 or 3")
    _, _, _, _, ballast, lamp, _ = _take(numbers, 7, "head")
    if rows * columns > _MAX_VALUES:
        raise IesError(f"it declares {rows} x {columns} values")
    vertical = _ascending(_take(numbers, rows, "vertical angles"), "vertical")
    horizontal = _ascending(_take(numbers, columns, "horizontal angles"), "horizontal")
    candela = _take(numbers, rows * columns, "candela").reshape(columns, rows)
    candela = np.maximum(candela * (factor * ballast * lamp), 0.0)
    if not (candela < 1e30).all():
        raise IesError("it has values that are not finite")
    if kind == "C":
        profile = _expand_c(vertical, horizontal, candela)
    else:
        profile = _resample(vertical, horizontal, candela, kind)
    low, high = profile.vertical[0], profile.vertical[-1]
    if len(profile.vertical) < 2 or not 0 <= low < high <= 180:
        raise IesError("its vertical angles do not span a part of 0 to 180 degrees")
    return profile


def _numbers(text: str) -> Iterator[float]:
    # Convert one number at a time, since a list of all numbers takes 20 times the memory of the
    # text.
    for match in _WORDS.finditer(text):
        word = match[0]
        try:
            yield float(word)
        except ValueError:
            raise IesError(f"{word[:20]!r} is not a number") from None


def _take(numbers: Iterator[float], n: int, what: str) -> Floats:
    values = np.fromiter(itertools.islice(numbers, n), np.float64)
    if len(values) < n:
        raise IesError(f"it ends within its {what}")
    return values


def _count(numbers: Iterator[float], what: str) -> int:
    n = _take(numbers, 1, "head")[0]
    if not 0 < n <= _MAX_VALUES or n != int(n):
        raise IesError(f"it declares {n:g} {what}")
    return int(n)


def _ascending(angles: Floats, what: str) -> Floats:
    if not (np.isfinite(angles).all() and (np.diff(angles) >= 0).all()):
        raise IesError(f"its {what} angles do not ascend")
    return angles


def _expand_c(vertical: Floats, horizontal: Floats, candela: Floats) -> IesProfile:
    """Completes a profile of type C by the symmetry that its range of horizontal angles implies."""
    first, last = horizontal[0], horizontal[-1]
    if len(horizontal) == 1:
        return IesProfile(vertical, np.zeros(1), candela)

    def mirrored(about: float) -> None:
        nonlocal horizontal, candela
        # Mirror all planes of constant horizontal angle except the plane of symmetry.
        inner = slice(-2, None, -1)
        horizontal = np.append(horizontal, 2 * about - horizontal[inner])
        candela = np.append(candela, candela[inner], axis=0)

    # If the horizontal angles range from 90 to 270 degrees, the intensities at the angles phi and
    # 180 - phi are equal.
    if (first, last) == (90, 270):
        both = np.append(horizontal, (180 - horizontal) % 360)
        horizontal, rows = np.unique(both, return_index=True)
        candela = np.append(candela, candela, axis=0)[rows]
        if horizontal[0] > 0:
            part = horizontal[0] / (horizontal[0] + 360 - horizontal[-1])
            seam = candela[0] * (1 - part) + candela[-1] * part
            horizontal = np.append(0.0, horizontal)
            candela = np.append(seam[None], candela, axis=0)
    elif first != 0:
        raise IesError(f"its horizontal angles begin at {first:g} degrees, which is unsupported")
    elif last == 90:
        mirrored(90)
        mirrored(180)
    elif last == 180:
        mirrored(180)
    elif last < 180:
        raise IesError(f"its horizontal angles end at {last:g} degrees, which is unsupported")
    if horizontal[-1] > 360:
        raise IesError("its horizontal angles go beyond 360 degrees")
    if horizontal[-1] < 360:
        horizontal = np.append(horizontal, 360.0)
        candela = np.append(candela, candela[:1], axis=0)
    return IesProfile(vertical, horizontal, candela)


def _resample(vertical: Floats, horizontal: Floats, candela: Floats, kind: str) -> IesProfile:
    """Resamples profiles of types A and B to type C at every degree.

    The polar axis is vertical in type A and horizontal in type B. With x to the
    side, y up and z along the luminaire's axis, the horizontal angle H and the vertical angle V of
    a direction are
        A: tan H = x / z, sin V = y        B: sin H = x, tan V = y / z.
    """
    # If the horizontal angles begin at 0, the file contains only one half of the distribution. The
    # other half is its mirror image.
    if horizontal[0] == 0 and horizontal[-1] > 0:
        horizontal = np.append(-horizontal[:0:-1], horizontal)
        candela = np.append(candela[:0:-1], candela, axis=0)
    if horizontal[0] < -90 or horizontal[-1] > 90 or vertical[0] < -90 or vertical[-1] > 90:
        raise IesError(f"its angles are no pairs of type {kind} (-90 to 90 degrees)")
    theta, phi = np.arange(181.0), np.arange(361.0)
    t, p = np.radians(theta)[None, :], np.radians(phi)[:, None]
    x, y = np.sin(t) * np.cos(p), np.sin(t) * np.sin(p)
    z = np.broadcast_to(np.cos(t), x.shape)
    if kind == "A":
        h, v = np.degrees(np.arctan2(x, z)), np.degrees(np.arcsin(np.clip(y, -1, 1)))
    else:
        h, v = np.degrees(np.arcsin(np.clip(x, -1, 1))), np.degrees(np.arctan2(y, z))
    rounding = 1e-9
    inside = (v >= vertical[0] - rounding) & (v <= vertical[-1] + rounding)
    inside &= (np.abs(h) <= 90 + rounding) & (z >= -rounding)
    if len(horizontal) > 1:
        inside &= (h >= horizontal[0] - rounding) & (h <= horizontal[-1] + rounding)

    def between(angles: Floats, x: Floats) -> tuple[NDArray[np.intp], Floats]:
        if len(angles) == 1:
            return np.zeros(x.shape, np.intp), np.zeros(x.shape)
        i = np.clip(np.searchsorted(angles, x, "right") - 1, 0, len(angles) - 2)
        width = angles[i + 1] - angles[i]
        part = np.where(width > 0, (x - angles[i]) / np.where(width > 0, width, 1), 0.0)
        return i, np.clip(part, 0, 1)

    i, a = between(horizontal, h)
    j, b = between(vertical, v)
    i1, j1 = np.minimum(i + 1, len(horizontal) - 1), np.minimum(j + 1, len(vertical) - 1)
    near = candela[i, j] * (1 - b) + candela[i, j1] * b
    far = candela[i1, j] * (1 - b) + candela[i1, j1] * b
    values = np.where(inside, near * (1 - a) + far * a, 0.0)
    values[-1] = values[0]
    return IesProfile(theta, phi, values)


class IesTable:
    """IES profiles of a scene; each file is added only once."""

    def __init__(self, context: LoadContext) -> None:
        self._builder, self._report = context.builder, context.report
        self._found: dict[str, int | IesError] = {}

    def add(self, path: str, prim: object) -> int | None:
        """Returns the id of an IES profile; warns and returns None if the file cannot be read."""
        if path not in self._found:
            self._found[path] = self._read(path)
        found = self._found[path]
        if isinstance(found, IesError):
            what = f"IES profile {path} cannot be read ({found}): the light is drawn without it"
            self._report.warn(what, prim)
            return None
        return found

    def _read(self, path: str) -> int | IesError:
        try:
            if not os.path.isfile(path) and os.path.exists(path):
                raise IesError("it is not a regular file")
            if os.path.getsize(path) > MAX_BYTES:
                raise IesError("it is too large")
            with open(path, encoding="latin-1") as file:
                profile = parse_ies(file.read(MAX_BYTES))
        except IesError as error:
            return error
        except (OSError, ValueError, MemoryError) as error:
            return IesError(getattr(error, "strerror", None) or str(error) or "out of memory")
        return self._builder.add_ies(
            profile.vertical.tolist(),
            profile.horizontal.tolist(),
            np.ascontiguousarray(profile.candela, np.float32),
        )
