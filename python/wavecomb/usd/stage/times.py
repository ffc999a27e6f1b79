# SPDX-License-Identifier: Apache-2.0
"""When a stage is read."""

from __future__ import annotations

from pxr import Usd


def time_code(stage: Usd.Stage, frame: float | None) -> Usd.TimeCode:
    """A frame, else the stage's start, else the earliest sample of each attribute."""
    if frame is not None:
        return Usd.TimeCode(frame)
    if stage.HasAuthoredTimeCodeRange():
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.EarliestTime()


def code_of(frame: float | None) -> Usd.TimeCode:
    """The time of a ``frame_number``; of None that of default values."""
    return Usd.TimeCode.Default() if frame is None else Usd.TimeCode(frame)


def frame_number(time: Usd.TimeCode) -> float | None:
    """The number of a frame; None for the earliest samples or default values, which have none."""
    if time.IsDefault() or time.IsEarliestTime():
        return None
    return float(time.GetValue())
