# SPDX-License-Identifier: Apache-2.0
"""A frame without its noise. No Qt."""

from __future__ import annotations

from typing import Any

from wavecomb.gui.viewport.frames import Frame


def denoised_frame(frame: Frame) -> tuple[Frame, Any]:
    """A frame and its beauty by Open Image Denoise; None where it lacks the layers for that."""
    from wavecomb.picture.denoise import denoise

    albedo = frame.layers.get("guide_albedo")
    normal = frame.layers.get("guide_normal")
    if albedo is None or normal is None:
        return frame, None
    return frame, denoise(frame.beauty, albedo, normal, threads=frame.setup.threads)
