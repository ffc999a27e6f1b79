# SPDX-License-Identifier: Apache-2.0
"""Cases of ``test_engine``, run in Blender: ``python engine_cases.py CASE FOLDER``."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import build  # noqa: E402
import harness  # noqa: E402
import numpy as np  # noqa: E402


def emit(**row: Any) -> None:
    """Prints a row of results, which the test parses."""
    print("ROW " + json.dumps(row), flush=True)


def _engine() -> Any:
    return sys.modules["wavecomb_blender.engine"]


def _ball(spp: int = 16) -> Any:
    scene = harness.prepare(spp)
    build.studio()
    thing = build.sphere(build.principled(base_color=(0.7, 0.2, 0.1)))
    scene.render.engine = "WAVECOMB"
    return scene, thing


def same(folder: Path) -> None:
    """Renders by F12, then renders the exported stage by the command line."""
    scene, _ = _ball()
    engine = _engine()
    kept: dict[str, Any] = {}
    start = engine.Render

    class Recorded(start):  # type: ignore[misc,valid-type]
        def begin(self, arguments: list[str]) -> None:
            stage = Path(arguments[0]).parent
            shutil.copytree(stage, folder / "stage")
            kept["arguments"] = arguments
            super().begin(arguments)

    engine.Render = Recorded
    image, _ = harness.render(scene, "WAVECOMB", 1)
    arguments = kept["arguments"]
    file = str(folder / "again.exr")
    words = [str(folder / "stage" / "stage.usda"), "-o", file, *arguments[3:]]
    subprocess.run([os.environ["WAVECOMB"], "render", *words], check=True, capture_output=True)
    channels = sys.modules["wavecomb_blender.exr"].read(file)
    again = np.stack([channels[c] for c in "RGB"], axis=-1)
    emit(same=bool(np.array_equal(again, image[..., :3])))


def _message(scene: Any) -> str:
    import bpy

    try:
        bpy.ops.render.render()
    except RuntimeError as error:
        return str(error)
    return ""


def errors(folder: Path) -> None:
    """Failures that must not end Blender."""
    scene, _ = _ball()
    program = os.environ["WAVECOMB"]
    os.environ["WAVECOMB"] = str(folder / "nothing")
    emit(program=_message(scene))
    os.environ["WAVECOMB"] = program
    camera, scene.camera = scene.camera, None
    engine = _engine()
    emit(camera=_direct(engine, scene))
    scene.camera = camera
    scene.wavecomb.spp = 1 << 16
    start = engine.Render

    class Killed(start):  # type: ignore[misc,valid-type]
        def __init__(self, *words: Any) -> None:
            super().__init__(*words)
            pid = self._process.pid

            def end() -> None:
                time.sleep(2.0)
                os.kill(pid, signal.SIGKILL)

            threading.Thread(target=end).start()

    engine.Render = Killed
    emit(killed=_message(scene))
    engine.Render = start
    scene.wavecomb.spp = 1
    emit(alive=_message(scene) == "")


def full(folder: Path) -> None:
    """A full disk: files of the stage, then the image, exceed the largest size of a file."""
    import resource

    scene, thing = _ball(1)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    thing.modifiers.new("subdivision", "SUBSURF").render_levels = 2
    for name, size in (("stage", 100_000), ("correction", 4_000), ("image", 10_000_000)):
        if name == "image":
            scene.render.resolution_x = scene.render.resolution_y = 1200
        if name == "correction":
            thing.hide_render = True
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
        emit(**{name: _message(scene)})
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    scene.render.resolution_x, scene.render.resolution_y = harness.SIZE
    thing.hide_render = False
    emit(alive=_message(scene) == "")


def _direct(engine: Any, scene: Any) -> str:
    """Returns the message for a scene without camera, which Blender refuses before the engine."""
    found = _message(scene)
    if "camera" in found.lower():
        return "has no camera"
    return found


def animation(folder: Path) -> None:
    """24 frames with motion blur of a moving object, a deforming mesh, a light and the camera."""
    import bpy

    scene, thing = _ball(4)
    scene.render.resolution_x, scene.render.resolution_y = 48, 36
    _deforming()
    for one in (scene.camera, next(o for o in scene.objects if o.type == "LIGHT")):
        for frame in (1, 27):
            one.location.x += 0.2
            one.keyframe_insert("location", frame=frame)
    for frame, x in ((1, -1.0), (27, 1.0)):
        thing.location.x = x
        thing.keyframe_insert("location", frame=frame)
    scene.render.use_motion_blur = True
    scene.frame_start, scene.frame_end = 2, 25
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(folder / "frame-")
    export = sys.modules["wavecomb_blender.export"]
    count = [0]
    original = export.export_geometry

    def counted(*words: Any) -> None:
        count[0] += 1
        original(*words)

    export.export_geometry = counted
    scene.render.engine = "WAVECOMB"
    bpy.ops.render.render(animation=True)
    emit(exports=count[0], frames=len(list(folder.glob("frame-*.exr"))))
    scene.frame_set(25)
    alone, _ = harness.render(scene, "WAVECOMB", 0)
    read = bpy.data.images.load(str(folder / "frame-0025.exr"))
    read.colorspace_settings.name = "Non-Color"
    pixels = np.empty(4 * read.size[0] * read.size[1], np.float32)
    read.pixels.foreach_get(pixels)
    last = pixels.reshape(alone.shape)[::-1]
    emit(difference=float(np.abs(last[..., :3] - alone[..., :3]).max()))


def _deforming() -> None:
    """Adds a cube whose shape keys move over the frames."""
    thing = build.cube(build.principled("b", base_color=(0.2, 0.5, 0.2)), at=(0, 1.5, 0.5), size=1)
    thing.shape_key_add(name="rest")
    key = thing.shape_key_add(name="wide")
    for point in key.data:
        point.co.x *= 2.0
    for frame, value in ((1, 0.0), (27, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)


def blend(folder: Path) -> None:
    """Saves a file with a script that must not run."""
    import bpy

    _ball()
    text = bpy.data.texts.new("startup.py")
    text.write(f"open({str(folder / 'executed')!r}, 'w')")
    text.use_module = True
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "a.blend"))
    emit(python=sys.executable)


if __name__ == "__main__":
    CASES = {"same": same, "errors": errors, "full": full, "animation": animation, "blend": blend}
    CASES[sys.argv[1]](Path(sys.argv[2]))
