# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports the scene of a .blend file: ``python export_file.py -- FILE FOLDER [FRAME]``.

Runs in Blender or with the bpy wheel, with the scripts of the file disabled. Writes a stage to the
folder, and ``stage.json`` with the stage, options of ``wavecomb render`` and messages.
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys

import bpy


def main(blend: str, folder: str, frame: str | None) -> None:
    """Opens a file and exports its active scene and view layer."""
    here = os.path.dirname(os.path.abspath(__file__))
    bpy.ops.wm.open_mainfile(filepath=blend, load_ui=False, use_scripts=False)
    name = "wavecomb_blender"
    spec = importlib.util.spec_from_file_location(
        name, os.path.join(here, "__init__.py"), submodule_search_locations=[here]
    )
    assert spec is not None and spec.loader is not None
    package = importlib.util.module_from_spec(spec)
    sys.modules[name] = package
    spec.loader.exec_module(package)
    package.register()
    from wavecomb_blender import engine, export

    scene = bpy.context.scene
    if frame is not None:
        scene.frame_set(int(float(frame)), subframe=float(frame) % 1.0)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    size, _ = engine.image_size(scene)
    found = export.export_stage(depsgraph, export.Session(folder), size)
    options = ["--frame", repr(float(scene.frame_current_final)), *found.options]
    if scene.render.film_transparent:
        options.append("--alpha")
    row = {"stage": found.stage, "options": options, "messages": found.report.lines()}
    with open(os.path.join(folder, "stage.json"), "w", encoding="utf-8") as stream:
        json.dump(row, stream)


if __name__ == "__main__":
    words = sys.argv[sys.argv.index("--") + 1 :]
    try:
        main(words[0], words[1], words[2] if len(words) > 2 else None)
    except Exception as error:
        line = " ".join(str(error).split()) or type(error).__name__
        print(f"error: {words[0]}: {line}", file=sys.stderr)
        sys.exit(1)
    # Blender 4.2 may crash while its Python module is unloaded.
    sys.stdout.flush()
    os._exit(0)
