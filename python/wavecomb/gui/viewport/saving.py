# SPDX-License-Identifier: Apache-2.0
"""Writes frames to files in the same form as `wavecomb render`."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from wavecomb.errors import WavecombError
from wavecomb.gui.viewport.display import LINEAR, NEUTRAL, Look, develop_frame
from wavecomb.gui.viewport.frames import Frame, denoised_frame
from wavecomb.image.files.image import Transfer, write_png_codes
from wavecomb.image.files.render_output import scene_metadata
from wavecomb.image.rendered import NOWHERE, Picture, in_world

if TYPE_CHECKING:
    from wavecomb._core import Scene
    from wavecomb.usd import LoadedStage

_NAMED = ("albedo", "normal", "depth", "samples", "error", "variance")


def picture_of_frame(frame: Frame, scene: Scene, loaded: LoadedStage | None) -> Picture:
    """Converts a frame to a result of `wavecomb.render`."""
    if frame.picture is not None:
        return replace(frame.picture, denoised=frame.denoised)
    stats: dict[str, Any] = {
        "cancelled": True,
        "settings": frame.setup.settings().to_dict(),
        "seconds": {"render": frame.status.get("seconds", 0.0)},
    }
    if loaded is not None:
        stats |= {"stage": str(loaded.stage_path), "camera": loaded.camera_path}
    origin = NOWHERE if loaded is None else loaded.origin
    layers = in_world(dict(frame.layers), origin)
    named: dict[str, Any] = {name: layers.pop(name, None) for name in _NAMED}
    return Picture(
        beauty=frame.beauty,
        denoised=frame.denoised,
        stats=stats,
        cancelled=True,
        aovs=layers,
        metadata=scene_metadata(scene, frame.width, frame.height, origin),
        chosen=frame.setup.aovs,
        **named,
    )


def save_frame(
    frame: Frame,
    path: str,
    scene: Scene,
    loaded: LoadedStage | None,
    look: Look,
    options: dict[str, Any],
) -> None:
    """Writes all layers of a frame (.exr) or the displayed image (.png).

    A failure leaves no partial file.

    Args:
        frame: Frame at full size.
        path: File name that ends in .exr or .png.
        scene: Scene of the frame, from which the camera matrices are written.
        loaded: Loaded stage, whose path and options are written to the header.
        look: Display settings that are applied to a .png file.
        options: Arguments of ``Picture.save``.

    Raises:
        OSError, ValueError: The file cannot be written, or an option is invalid. The message of the
            error is one line.
        WavecombError: The render has produced only a preview so far.
    """
    if frame.scale != 1:
        raise WavecombError("there is only a preview so far: save again a little later")
    if frame.setup.denoise:
        # The displayed denoised image may belong to an earlier pass.
        frame = replace(frame, denoised=denoised_frame(frame)[1])
    picture = picture_of_frame(frame, scene, loaded)
    as_rendered = look.layer in ("beauty", "denoised") and look.view in (LINEAR, NEUTRAL)
    if not path.lower().endswith(".png"):
        picture.save(path, **options)
    elif as_rendered:
        shown = picture if look.layer == "denoised" else replace(picture, denoised=None)
        transfer: Transfer = "clamp" if look.view == LINEAR else "neutral"
        shown.save(path, exposure=look.exposure, tone_map=transfer)
    else:
        write_png_codes(path, develop_frame(frame, look).shown.pixels)
