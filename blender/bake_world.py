# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders a world to an equirectangular image; runs in a separate Blender (see ``bake``)."""

from __future__ import annotations

import os
import sys

import bpy


def main(blend: str, name: str, file: str, width: int, time: float) -> None:
    """Loads the world of a .blend file into an empty scene and renders it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(blend) as (_, wanted):
        wanted.worlds = [name]
    scene = bpy.context.scene
    scene.world = bpy.data.worlds[name]
    scene.frame_set(int(time), subframe=time - int(time))
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = width, width // 2
    scene.render.resolution_percentage = 100
    scene.cycles.device = "CPU"
    scene.cycles.samples = 4
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.pixel_filter_type = "BOX"
    scene.view_settings.view_transform = "Raw"
    scene.render.dither_intensity = 0.0
    camera = bpy.data.cameras.new("panorama")
    camera.type = "PANO"
    kind = camera if hasattr(camera, "panorama_type") else camera.cycles
    kind.panorama_type = "EQUIRECTANGULAR"
    thing = bpy.data.objects.new("panorama", camera)
    # The camera looks along +X with +Z up.
    thing.rotation_euler = (1.5707963267948966, 0.0, -1.5707963267948966)
    scene.collection.objects.link(thing)
    scene.camera = thing
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = file + ".part.exr"
    bpy.ops.render.render(write_still=True)
    os.replace(file + ".part.exr", file)


if __name__ == "__main__":
    words = sys.argv[sys.argv.index("--") + 1 :]
    main(words[0], words[1], words[2], int(words[3]), float(words[4]))
