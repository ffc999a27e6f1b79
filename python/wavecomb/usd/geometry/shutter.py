# SPDX-License-Identifier: Apache-2.0
"""Motion blur: the shutter interval, and animated transforms sampled over it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom

from wavecomb.errors import WavecombError
from wavecomb.usd.materials.network import number
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.stage.time_codes import frame_number

Matrices = NDArray[np.float64]

MAX_STEPS = 64
"""Maximum number of motion steps that the user may request."""

_CHOICES = (2, 3, 4, 5, 8)
"""Numbers of motion steps that are tried in ascending order unless the user requests a number."""

_BEND = 5e-3
"""Largest deviation from linear motion between steps, as a fraction of the whole motion."""


@dataclass(frozen=True)
class Blur:
    """Motion blur options.

    Attributes:
        shutter: Opening and closing time relative to the frame, in time codes; None uses the
            camera's.
        steps: Number of motion steps of every animated object; None chooses up to 8 as needed.
        off: Whether motion blur is disabled.
    """

    shutter: tuple[float, float] | None = None
    steps: int | None = None
    off: bool = False

    @classmethod
    def chosen(
        cls, shutter: Any = None, motion_blur: bool = True, steps: int | None = None
    ) -> Blur:
        """Creates the options; raises WavecombError if values are invalid."""
        if shutter is not None:
            good = len(shutter) == 2 and all(np.isfinite(value) for value in shutter)
            if not good or shutter[1] < shutter[0]:
                raise WavecombError(
                    f"shutter {' '.join(map(str, shutter))}: must be two numbers, when it opens "
                    "and when it closes, in time codes from the frame"
                )
        if steps is not None and not 2 <= steps <= MAX_STEPS:
            raise WavecombError(f"motion steps {steps}: must be from 2 to {MAX_STEPS}")
        return cls(shutter, steps, not motion_blur)


class Track:
    """Animated transform from a prim to its group (the world or a prototype)."""

    __slots__ = ("_above", "_known", "_motion", "_parent", "_prim")

    def __init__(
        self, motion: Motion, prim: Usd.Prim, parent: Track | None, above: Gf.Matrix4d
    ) -> None:
        self._motion = motion
        self._prim = prim
        self._parent = parent
        self._above = above
        self._known: dict[float, Gf.Matrix4d] = {}

    def at(self, time: float) -> Gf.Matrix4d:
        """Returns the transform at a time code."""
        matrix = self._known.get(time)
        if matrix is None:
            own, _ = self._motion.xforms(time).GetLocalTransformation(self._prim)
            matrix = own * (self._above if self._parent is None else self._parent.at(time))
            self._known[time] = matrix
        return matrix

    def steps(self) -> Matrices | None:
        """Returns transforms (s, 4, 4) at equal steps over the shutter; None if all are equal."""
        return self._motion.steps(lambda time: np.array(self.at(time)))


class Motion:
    """The shutter interval, with functions that sample animated values over it.

    Attributes:
        frame: Time code of the frame, at which values that are not animated are read.
        open, close: Time codes at which the shutter opens and closes.
        middle: Time code halfway between ``open`` and ``close``, at which lights are read.
    """

    def __init__(self, frame: float, interval: tuple[float, float], steps: int | None) -> None:
        """``steps`` is the number of motion steps; None chooses up to 8 as needed."""
        self.frame = frame
        self.open, self.close = interval
        self.middle = 0.5 * (self.open + self.close)
        self._steps = steps
        self._caches: dict[float, UsdGeom.XformCache] = {}

    @property
    def shutter(self) -> tuple[float, float]:
        """Opening and closing time relative to the frame, in time codes."""
        return self.open - self.frame, self.close - self.frame

    def xforms(self, time: float) -> UsdGeom.XformCache:
        """Returns the cache of transforms at a time code."""
        cache = self._caches.get(time)
        if cache is None:
            cache = self._caches[time] = UsdGeom.XformCache(Usd.TimeCode(time))
        return cache

    def track_of(self, prim: Usd.Prim, parent: Track | None, above: Gf.Matrix4d) -> Track | None:
        """Returns the animated transform of a prim; None if the prim is static.

        Args:
            prim: An Xformable prim.
            parent: Animated transform of the prim's parent; None if the parent is static or the
                prim resets the transform stack.
            above: Transform of the prim's parent if the parent is static.
        """
        if parent is None and not UsdGeom.Xformable(prim).TransformMightBeTimeVarying():
            return None
        return Track(self, prim, parent, above)

    def times(self, count: int) -> list[float]:
        """Returns the time codes of ``count`` equal steps from shutter opening to closing."""
        return [float(t) for t in np.linspace(self.open, self.close, count)]

    def sampled(self, attributes: Sequence[Usd.Attribute], least: int = 2) -> list[float]:
        """Returns at most 8 step times, which include the attributes' time samples if possible."""
        interval = Gf.Interval(self.open, self.close, False, False)
        inside = {t for a in attributes for t in a.GetTimeSamplesInInterval(interval)}
        return self.fitting(sorted(inside), least)

    def fitting(self, samples: Sequence[float], least: int = 2) -> list[float]:
        """Returns the fewest equal steps that include all time ``samples``, or 8 steps."""
        if self._steps is not None:
            return self.times(self._steps)
        share = (np.asarray(samples, np.float64) - self.open) / (self.close - self.open)
        for count in range(least, _CHOICES[-1]):
            place = share * (count - 1)
            if np.abs(place - np.round(place)).max(initial=0.0) < 1e-3:
                return self.times(count)
        return self.times(_CHOICES[-1])

    def steps(self, matrices: Callable[[float], Matrices]) -> Matrices | None:
        """Samples matrices (..., 4, 4) at s equal steps; returns None if they are static.

        Unless the user sets the number of steps, the function uses the fewest steps whose linear
        interpolation is close to the motion.
        """
        choices = _CHOICES if self._steps is None else (self._steps,)
        for count in choices:
            times = self.times(count)
            values = np.stack([matrices(time) for time in times])
            if count == choices[-1]:
                break
            between = np.stack([matrices(0.5 * (a + b)) for a, b in pairwise(times)])
            if _is_straight(values, between):
                break
        return None if (values == values[:1]).all() else values


def _is_straight(values: Matrices, between: Matrices) -> bool:
    """Returns whether linear interpolation of steps is close to the samples ``between`` them."""
    off = np.abs(between - 0.5 * (values[1:] + values[:-1]))
    span = np.abs(values - values[:1])
    size = np.abs(values[..., :3, :3]).max()
    travel = span[..., 3, :3].max()
    return bool(
        off[..., :3, :3].max() <= _BEND * size
        and off[..., 3, :3].max() <= _BEND * travel + 1e-12 * np.abs(values[..., 3, :3]).max()
    )


def find_motion(
    camera: Usd.Prim | None, time: Usd.TimeCode, blur: Blur, report: LoadReport
) -> Motion | None:
    """Returns the shutter interval; None if motion blur is off or the interval is empty.

    Args:
        camera: Camera whose shutter:open and shutter:close are used, relative to the frame.
        time: Time code of the frame.
        blur: Motion blur options, whose shutter overrides the camera's.
        report: Collects warnings.
    """
    shutter = blur.shutter
    if blur.off:
        return None
    if shutter is not None:
        opens, closes = shutter
    elif camera is not None:
        lens = UsdGeom.Camera(camera)
        opens = number(lens.GetShutterOpenAttr().Get(time), 0.0)
        closes = number(lens.GetShutterCloseAttr().Get(time), 0.0)
        if closes < opens:
            report.warn("camera's shutter closes before it opens: no motion blur", camera.GetPath())
    else:
        return None
    if not closes > opens:
        return None
    frame = frame_number(time)
    if frame is None:
        if shutter is not None:
            report.note("no motion blur: the stage has no time codes; choose a frame")
        return None
    return Motion(frame, (frame + opens, frame + closes), blur.steps)
