# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of the render properties, with the names and order of Wavecomb's window."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy


class _Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = frozenset({"WAVECOMB"})
    rows: tuple[str, ...] = ()

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Returns whether Wavecomb is the render engine."""
        return context.engine == "WAVECOMB"

    def draw(self, context: Any) -> None:
        """Draws the settings of this panel."""
        layout = self.layout  # type: ignore[attr-defined]
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in self.rows:
            layout.prop(context.scene.wavecomb, name)


class WAVECOMB_PT_sampling(_Panel, bpy.types.Panel):
    """Panel of sampling and noise settings."""

    bl_label = "Sampling"
    rows = ("spp", "noise", "time_limit", "denoise", "seed")


class WAVECOMB_PT_light_paths(_Panel, bpy.types.Panel):
    """Panel of light transport settings."""

    bl_label = "Light Paths"
    rows = ("max_depth", "guiding", "transport", "clamp_indirect", "firefly", "lights")


class WAVECOMB_PT_film(_Panel, bpy.types.Panel):
    """Panel of film and motion blur settings."""

    bl_label = "Film"
    rows = ("filter", "steps")

    def draw(self, context: Any) -> None:
        """Draws the settings of this panel."""
        super().draw(context)
        render = context.scene.render
        self.layout.prop(render, "film_transparent", text="Transparent")
        self.layout.prop(render, "use_motion_blur")
        column = self.layout.column()
        column.active = render.use_motion_blur
        column.prop(render, "motion_blur_shutter")


class WAVECOMB_PT_performance(_Panel, bpy.types.Panel):
    """Panel of threads and further command-line options."""

    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012
    rows = ("threads", "arguments")


CLASSES = (
    WAVECOMB_PT_sampling,
    WAVECOMB_PT_light_paths,
    WAVECOMB_PT_film,
    WAVECOMB_PT_performance,
)

_HIDDEN = frozenset(
    {"RENDER_PT_freestyle", "VIEWLAYER_PT_layer_passes", "EEVEE_MATERIAL_PT_context_material"}
)


def _common() -> Iterator[Any]:
    """Yields the panels of Blender that also apply to Wavecomb."""
    for kind in bpy.types.Panel.__subclasses__():
        engines = getattr(kind, "COMPAT_ENGINES", None)
        if engines is None or kind.__name__ in _HIDDEN:
            continue
        if "BLENDER_RENDER" in engines or "BLENDER_EEVEE" in engines:
            yield kind


def show_common() -> None:
    """Shows Blender's own panels if Wavecomb is the render engine."""
    for kind in _common():
        kind.COMPAT_ENGINES.add("WAVECOMB")


def hide_common() -> None:
    """Undoes ``show_common``."""
    for kind in _common():
        kind.COMPAT_ENGINES.discard("WAVECOMB")
