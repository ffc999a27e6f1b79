# SPDX-License-Identifier: GPL-3.0-or-later
"""Wavecomb for Blender: a render engine that exports to USD and renders in a separate process."""

from __future__ import annotations

import bpy

from . import engine, panels, settings

CLASSES = (
    settings.WavecombSettings,
    settings.WavecombPreferences,
    engine.WavecombRenderEngine,
    *panels.CLASSES,
)
_HANDLERS = ("render_complete", "render_cancel", "load_pre")


def register() -> None:
    """Registers the render engine, its settings and panels."""
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.wavecomb = bpy.props.PointerProperty(type=settings.WavecombSettings)
    for name in _HANDLERS:
        getattr(bpy.app.handlers, name).append(engine.close_sessions)
    panels.show_common()


def unregister() -> None:
    """Removes everything that ``register`` added."""
    panels.hide_common()
    for name in _HANDLERS:
        handlers = getattr(bpy.app.handlers, name)
        if engine.close_sessions in handlers:
            handlers.remove(engine.close_sessions)
    engine.close_sessions()
    del bpy.types.Scene.wavecomb
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
