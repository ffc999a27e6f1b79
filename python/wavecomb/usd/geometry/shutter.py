# SPDX-License-Identifier: Apache-2.0
"""The shutter, and where things are while it is open."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom

from wavecomb.errors import WavecombError
from wavecomb.usd.looks.network import number
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.stage.times import frame_number

Matrices = NDArray[np.float64]

MOST_STEPS = 64
"""Steps that may be asked for."""

_CHOICES = (2, 3, 4, 5, 8)
"""Steps that are tried where none are asked for: as few as show the motion."""

_BEND = 5e-3
"""How far straight lines between steps may be from the motion, as a share of what moves."""


@dataclass(frozen=True)
class Blur:
    """How motion is blurred.

    Attributes:
        shutter: When it opens and closes, time codes from the frame; None: as the camera says.
        steps: Of every motion; None: as many as each needs, up to 8.
        off: Not at all.
    """

    shutter: tuple[float, float] | None = None
    steps: int | None = None
    off: bool = False

    @classmethod
    def chosen(
        cls, shutter: Any = None, motion_blur: bool = True, steps: int | None = None
    ) -> Blur:
        """As options say; raises WavecombError where they cannot be meant."""
        if shutter is not None:
            good = len(shutter) == 2 and all(np.isfinite(value) for value in shutter)
            if not good or shutter[1] < shutter[0]:
                raise WavecombError(
                    f"shutter {' '.join(map(str, shutter))}: must be two numbers, when it opens "
                    "and when it closes, in time codes from the frame"
                )
        if steps is not None and not 2 <= steps <= MOST_STEPS:
            raise WavecombError(f"motion steps {steps}: must be from 2 to {MOST_STEPS}")
        return cls(shutter, steps, not motion_blur)


class Track:
    """The transform of a prim within its group, which changes over time."""

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
        """The transform at a time code."""
        matrix = self._known.get(time)
        if matrix is None:
            own, _ = self._motion.xforms(time).GetLocalTransformation(self._prim)
            matrix = own * (self._above if self._parent is None else self._parent.at(time))
            self._known[time] = matrix
        return matrix

    def steps(self) -> Matrices | None:
        """(s, 4, 4) at equal steps over the shutter; None where nothing moves after all."""
        return self._motion.steps(lambda time: np.array(self.at(time)))


class Motion:
    """What is asked of a stage while the shutter is open.

    Attributes:
        frame: Time code of what does not move.
        open, close: Time codes.
        middle: Between them: the time of lights.
    """

    def __init__(self, frame: float, interval: tuple[float, float], steps: int | None) -> None:
        """``steps``: of every motion; None: as many as each needs, up to 8."""
        self.frame = frame
        self.open, self.close = interval
        self.middle = 0.5 * (self.open + self.close)
        self._steps = steps
        self._caches: dict[float, UsdGeom.XformCache] = {}

    @property
    def shutter(self) -> tuple[float, float]:
        """When it opens and closes, time codes from the frame."""
        return self.open - self.frame, self.close - self.frame

    def xforms(self, time: float) -> UsdGeom.XformCache:
        """Transforms at a time code."""
        cache = self._caches.get(time)
        if cache is None:
            cache = self._caches[time] = UsdGeom.XformCache(Usd.TimeCode(time))
        return cache

    def follow(self, prim: Usd.Prim, parent: Track | None, above: Gf.Matrix4d) -> Track | None:
        """The track of a prim under one that has one or has not; None: it stands still.

        Args:
            prim: With a transform.
            parent: Track of what is above it; None also where the prim resets its transform.
            above: Transform of what is above it where that stands still.
        """
        if parent is None and not UsdGeom.Xformable(prim).TransformMightBeTimeVarying():
            return None
        return Track(self, prim, parent, above)

    def times(self, count: int) -> list[float]:
        """Time codes of ``count`` equal steps."""
        return [float(t) for t in np.linspace(self.open, self.close, count)]

    def sampled(self, attributes: Sequence[Usd.Attribute], least: int = 2) -> list[float]:
        """Steps that hit the samples of attributes within the shutter, where 8 can."""
        interval = Gf.Interval(self.open, self.close, False, False)
        inside = {t for a in attributes for t in a.GetTimeSamplesInInterval(interval)}
        return self.fitting(sorted(inside), least)

    def fitting(self, samples: Sequence[float], least: int = 2) -> list[float]:
        """The fewest steps that have all ``samples`` among them; 8 where no fewer do."""
        if self._steps is not None:
            return self.times(self._steps)
        share = (np.asarray(samples, np.float64) - self.open) / (self.close - self.open)
        for count in range(least, _CHOICES[-1]):
            place = share * (count - 1)
            if np.abs(place - np.round(place)).max(initial=0.0) < 1e-3:
                return self.times(count)
        return self.times(_CHOICES[-1])

    def steps(self, matrices: Callable[[float], Matrices]) -> Matrices | None:
        """Matrices (..., 4, 4) of a time at equal steps (s, ..., 4, 4); None: they stand still.

        As few steps as come close to the motion by straight lines, unless a number is set.
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
    """Whether what is between steps is where straight lines put it."""
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
    """The motion to be blurred: None where the shutter is open for no time.

    Args:
        camera: Whose shutter:open and shutter:close count, relative to the frame.
        time: The frame.
        blur: May have another shutter.
        report: For what is odd.
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
