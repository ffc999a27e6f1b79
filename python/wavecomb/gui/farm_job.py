# SPDX-License-Identifier: Apache-2.0
"""Describes the window's stage, edits and settings as a farm job (``farm.from_json``)."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavecomb.errors import WavecombError
from wavecomb.gui.scene.edit_layer import save_edits
from wavecomb.gui.setup import Setup
from wavecomb.options import settings

if TYPE_CHECKING:
    from wavecomb.gui.scene.stage_edits import StageEdits
    from wavecomb.gui.viewport.session import Session

_NOT_FOR_A_FARM = ("time_limit",)


def changed_settings(setup: Setup) -> dict[str, Any]:
    """Returns the settings that differ from their defaults.

    Leaves out image size and sample counts.
    """
    rows = settings()
    return {
        one.name: getattr(setup, one.name)
        for one in fields(setup)
        if one.name in rows
        and one.name not in ("width", "height", "spp", "threads", *_NOT_FOR_A_FARM)
        and getattr(setup, one.name) != rows[one.name].default
    }


def describe(session: Session, edits: StageEdits | None, output: str) -> dict[str, Any]:
    """Describes a farm job that renders the stage as the viewport shows it.

    Edits of the stage are saved as a layer over the stage, in the folder of the output image.

    Args:
        session: Session of the viewport.
        edits: Edits of the session's stage.
        output: Path of the output image.

    Raises:
        WavecombError: No stage is open, the view is not through a camera, or edits cannot be saved.
    """
    source, setup = session.source, session.setup
    if source is None:
        raise WavecombError("there is no stage: open one first")
    if Path(output).suffix.lower() != ".exr":
        raise WavecombError(f"{output or 'Picture'}: give a file that ends in .exr")
    if setup.own_policy is not None:
        raise WavecombError("a Python policy exists only in this window; choose another")
    if session.pose is not None and session.pose.path is None:
        raise WavecombError("the view is free, and a job needs a camera: choose one of the stage")
    stage = str(source.path)
    if edits is not None and edits.lines():
        if edits.values:
            raise WavecombError(
                f"{len(edits.values)} edit(s) cannot be saved in a layer, so a job would lack them"
            )
        target = Path(output.replace("#", "") or "shot").with_suffix(".edits.usda")
        stage = str(save_edits(edits.stage, target))
    options: dict[str, Any] = {
        "size": [setup.width, setup.height], "spp": setup.spp, "aovs": list(setup.aovs),
        "denoise": setup.denoise, **changed_settings(setup),
    }  # fmt: skip
    if setup.region is not None:
        options["region"] = list(setup.region)
    if session.pose is not None and session.pose.path is not None:
        options["camera"] = session.pose.path
    for name, value in (
        ("frame", source.time), ("variants", dict(source.variants or {}) or None),
        ("purposes", list(source.purposes) if source.purposes else None),
    ):  # fmt: skip
        if value is not None:
            options[name] = value
    return {"stage": stage, "output": output, "options": options}
