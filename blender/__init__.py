# SPDX-License-Identifier: GPL-3.0-or-later
"""Wavecomb for Blender: a render engine that exports to USD and renders in a separate process."""

from __future__ import annotations

import bpy

from . import engine, panels, settings, standby

CLASSES = (
    settings.WavecombSettings,
    settings.WavecombPreferences,
    engine.WavecombRenderEngine,
    *panels.CLASSES,
)
_HANDLERS = (
    *((name, engine.close_sessions) for name in ("render_complete", "render_cancel", "load_pre")),
    *standby.HANDLERS.items(),
)


def register() -> None:
    """Registers the render engine, its settings and panels."""
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.wavecomb = bpy.props.PointerProperty(type=settings.WavecombSettings)
    for name, function in _HANDLERS:
        handlers = getattr(bpy.app.handlers, name)
        if function not in handlers:
            handlers.append(function)
    panels.show_common()


def unregister() -> None:
    """Removes everything that ``register`` added."""
    panels.hide_common()
    for name, function in _HANDLERS:
        handlers = getattr(bpy.app.handlers, name)
        if function in handlers:
            handlers.remove(function)
    engine.close_sessions()
    standby.stop()
    del bpy.types.Scene.wavecomb
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
