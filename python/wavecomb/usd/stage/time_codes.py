# SPDX-License-Identifier: Apache-2.0
"""Time codes at which a stage is read."""

from __future__ import annotations

from pxr import Usd


def time_code(stage: Usd.Stage, frame: float | None) -> Usd.TimeCode:
    """Returns a frame's time code.

    For None, returns the stage's start or, without a time range, the earliest time.
    """
    if frame is not None:
        return Usd.TimeCode(frame)
    if stage.HasAuthoredTimeCodeRange():
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.EarliestTime()


def code_of(frame: float | None) -> Usd.TimeCode:
    """Returns the time code of a ``frame_number``; None means default values."""
    return Usd.TimeCode.Default() if frame is None else Usd.TimeCode(frame)


def frame_number(time: Usd.TimeCode) -> float | None:
    """Returns the number of a frame; None for earliest samples or default values."""
    if time.IsDefault() or time.IsEarliestTime():
        return None
    return float(time.GetValue())
