# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of scenes and preferences of the extension."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty


class WavecombSettings(bpy.types.PropertyGroup):
    """Render settings, named as in Wavecomb's window."""

    spp: IntProperty(  # type: ignore[valid-type]
        name="Samples", description="Samples per pixel; with a noise target the most", default=64,
        min=1, max=1 << 20,
    )  # fmt: skip
    preview_spp: IntProperty(name="Viewport Samples", default=16, min=1)  # type: ignore[valid-type]
    noise: FloatProperty(  # type: ignore[valid-type]
        name="Noise Target", description="Sample until the mean relative error of the image is "
        "this or less; 0 disables it", default=0.0, min=0.0, max=1.0, precision=3,
    )  # fmt: skip
    time_limit: FloatProperty(  # type: ignore[valid-type]
        name="Time Limit", description="Seconds after which rendering stops; 0 means none",
        default=0.0, min=0.0, subtype="TIME_ABSOLUTE",
    )  # fmt: skip
    denoise: BoolProperty(  # type: ignore[valid-type]
        name="Denoise", description="Denoise the image; the noisy one becomes a pass",
    )  # fmt: skip
    max_depth: IntProperty(  # type: ignore[valid-type]
        name="Max Depth", description="Maximum number of scattering events of a path; one more "
        "than Cycles' bounces", default=8, min=1, max=1024,
    )  # fmt: skip
    guiding: EnumProperty(  # type: ignore[valid-type]
        name="Path Guiding", description="Bounces also follow the learned incident light",
        items=[(k, k.capitalize(), "") for k in ("auto", "on", "off")], default="auto",
    )  # fmt: skip
    transport: EnumProperty(  # type: ignore[valid-type]
        name="Caustics", description="Where paths start: at the camera, or also at the lights, "
        "which finds caustics", default="auto",
        items=[
            ("auto", "Automatic", ""), ("path", "Camera Paths", ""),
            ("bdpt", "Bidirectional", ""), ("light", "Light Paths", ""),
        ],
    )  # fmt: skip
    clamp_indirect: FloatProperty(  # type: ignore[valid-type]
        name="Clamp Indirect", description="Maximum luminance of an indirect contribution; 0 "
        "disables it", default=0.0, min=0.0,
    )  # fmt: skip
    firefly: EnumProperty(  # type: ignore[valid-type]
        name="Fireflies", description="Treatment of samples much brighter than others",
        items=[("keep", "Keep", ""), ("reweight", "Reweight", "")], default="keep",
    )  # fmt: skip
    filter: EnumProperty(  # type: ignore[valid-type]
        name="Pixel Filter",
        items=[
            ("blackman-harris", "Blackman-Harris", ""), ("gaussian", "Gaussian", ""),
            ("box", "Box", ""),
        ],
        default="blackman-harris",
    )  # fmt: skip
    lights: EnumProperty(  # type: ignore[valid-type]
        name="Light Shapes", description="Whether camera and mirrors see the shapes of lights, "
        "and whether these block other light",
        items=[
            (
                "auto", "By Ray Visibility",
                "Reflections show the lights that the camera does not see",
            ),
            ("visible", "Visible", ""), ("hidden", "Hidden", ""),
        ],
        default="auto",
    )  # fmt: skip
    seed: IntProperty(name="Seed", default=0, min=0)  # type: ignore[valid-type]
    threads: IntProperty(  # type: ignore[valid-type]
        name="Threads", description="Number of threads; 0 means all", default=0, min=0
    )
    steps: IntProperty(  # type: ignore[valid-type]
        name="Motion Steps", description="Samples of moving objects over the shutter interval",
        default=3, min=2, max=16,
    )  # fmt: skip
    arguments: StringProperty(  # type: ignore[valid-type]
        name="Arguments", description="Further options of `wavecomb render`"
    )


class WavecombPreferences(bpy.types.AddonPreferences):
    """Preferences of the extension."""

    bl_idname = __package__

    program: StringProperty(  # type: ignore[valid-type]
        name="Program", description="The program wavecomb or its Python; empty searches PATH",
        subtype="FILE_PATH",
    )  # fmt: skip
    keep_files: BoolProperty(  # type: ignore[valid-type]
        name="Keep Stages", description="Keep the exported stage after a render, for bug reports"
    )

    def draw(self, context: Any) -> None:
        """Draws the preferences."""
        self.layout.prop(self, "program")
        self.layout.prop(self, "keep_files")


def preferences() -> Any:
    """Returns the preferences; None if Blender does not list the extension."""
    found = bpy.context.preferences.addons.get(__package__ or "")
    return found.preferences if found is not None else None


def program() -> str:
    """Returns the program ``wavecomb`` of the preferences, or else of the variable WAVECOMB."""
    import os

    chosen = preferences()
    return (chosen.program if chosen is not None else "") or os.environ.get("WAVECOMB", "")
