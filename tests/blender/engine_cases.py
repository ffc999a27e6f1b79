# SPDX-License-Identifier: Apache-2.0
"""Cases of ``test_engine``, run in Blender: ``python engine_cases.py CASE FOLDER``."""

from __future__ import annotations

import contextlib
import io
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
    """Renders with F12, then renders the exported stage on the command line."""
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


def stamp(folder: Path) -> None:
    """Saves an image with and without a render stamp."""
    import bpy

    scene, _ = _ball()
    render = scene.render
    render.image_settings.file_format = "PNG"
    for name in dir(render):
        if name.startswith("use_stamp_"):
            setattr(render, name, name == "use_stamp_note")
    render.stamp_font_size, render.stamp_note_text = 8, "seen"
    pixels = []
    for wanted in (False, True):
        render.use_stamp, render.filepath = wanted, str(folder / f"{wanted}.png")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(render.filepath)
        pixels.append(np.array(image.pixels[:]).reshape(image.size[1], image.size[0], 4))
    changed = np.any(np.abs(pixels[0] - pixels[1]) > 0.05, axis=2)
    emit(stamped=int(changed.sum()), others=float(1.0 - changed.mean()))


def _message(scene: Any) -> str:
    import bpy

    try:
        bpy.ops.render.render()
    except RuntimeError as error:
        return str(error)
    return ""


def errors(folder: Path) -> None:
    """Causes failures that must not end Blender."""
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


def standby(folder: Path) -> None:
    """Renders with processes that wait; ends one, changes the engine, and kills Blender."""
    import bpy

    scene, _ = _ball()
    waiting = sys.modules["wavecomb_blender.standby"]

    def process() -> int:
        bpy.context.view_layer.update()
        if waiting._started is None:
            return 0
        waiting._started.join()
        return int(waiting._started._render._process.pid)

    cold, _ = harness.render(scene, "WAVECOMB", 1)
    emit(in_background=process())
    waiting.is_wanted = lambda: True
    used: list[int] = []
    render_by = _engine().WavecombRenderEngine._render_by

    def record(self: Any, render: Any, *words: Any) -> None:
        used.append(render._process.pid)
        render_by(self, render, *words)

    _engine().WavecombRenderEngine._render_by = record
    scene.camera.update_tag()
    first = process()
    warm, _ = harness.render(scene, "WAVECOMB", 1)
    second = process()
    emit(first=first, second=second, same=bool(np.array_equal(cold, warm)))
    os.kill(second, signal.SIGKILL)
    time.sleep(0.5)
    again, _ = harness.render(scene, "WAVECOMB", 1)
    emit(used=used, after_kill=bool(np.array_equal(cold, again)))
    third = process()
    scene.render.engine = "CYCLES"
    emit(third=third, other_engine=process(), ended=not Path(f"/proc/{third}").exists())
    scene.render.engine = "WAVECOMB"
    emit(last=process())
    os.kill(os.getpid(), signal.SIGKILL)


def full(folder: Path) -> None:
    """Simulates a full disk by a limit on file sizes, for stage, correction layer and image."""
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
    """Renders a scene without a camera, which Blender itself refuses; returns the message."""
    found = _message(scene)
    if "camera" in found.lower():
        return "has no camera"
    return found


def animation(folder: Path) -> None:
    """Renders 24 frames with motion blur of an object, a deforming mesh, a light and the camera."""
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
    textures = sys.modules["wavecomb_blender.textures"]
    bakes: list[str] = []
    bake = textures.run_blender
    textures.run_blender = lambda script, words: bakes.append(script) or bake(script, words)
    scene.render.engine = "WAVECOMB"
    # Keep the baked texture of the first frame: a bake of the last frame differs slightly.
    bpy.app.handlers.render_complete.remove(_engine().close_sessions)
    bpy.ops.render.render(animation=True)
    emit(exports=count[0], bakes=len(bakes), frames=len(list(folder.glob("frame-*.exr"))))
    scene.frame_set(25)
    alone, _ = harness.render(scene, "WAVECOMB", 0)
    read = bpy.data.images.load(str(folder / "frame-0025.exr"))
    read.colorspace_settings.name = "Non-Color"
    pixels = np.empty(4 * read.size[0] * read.size[1], np.float32)
    read.pixels.foreach_get(pixels)
    last = pixels.reshape(alone.shape)[::-1]
    emit(difference=float(np.abs(last[..., :3] - alone[..., :3]).max()))


def _layers(scene: Any, file: Path) -> dict[str, np.ndarray]:
    """Renders all view layers and passes to a file; returns its channels."""
    import bpy

    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    settings.exr_codec = "NONE"
    if hasattr(settings, "use_exr_interleave"):
        settings.use_exr_interleave = True
    scene.render.filepath = str(file.with_suffix(""))
    bpy.ops.render.render(write_still=True)
    return dict(sys.modules["wavecomb_blender.exr"].read(str(file)))


def passes(folder: Path) -> None:
    """Renders all passes of two view layers (one hides an object), with border and denoising."""
    import bpy

    scene, _ = _ball(4)
    hidden = bpy.data.collections.new("hidden")
    scene.collection.children.link(hidden)
    cube = build.cube(build.principled("b", base_color=(0.1, 0.1, 0.8)), at=(0, -2, 0.4), size=0.8)
    scene.collection.objects.unlink(cube)
    hidden.objects.link(cube)
    other = scene.view_layers.new("second")
    other.layer_collection.children["hidden"].exclude = True
    names = [n for n in dir(other) if n.startswith("use_pass_")]
    supported = sys.modules["wavecomb_blender.passes"].PASSES
    chosen = [one for one in supported if one.setting in names]
    for layer in scene.view_layers:
        for one in chosen:
            setattr(layer, one.setting, True)
    scene.wavecomb.denoise = True
    found = _layers(scene, folder / "passes.exr")
    first, second = (f"{layer.name}." for layer in scene.view_layers)
    means = {n: float(np.nan_to_num(v, posinf=0.0).mean()) for n, v in found.items()}
    absent = [
        f"{layer}{one.name}.{channel}"
        for layer in (first, second)
        for one in chosen
        for channel in one.channels
        if f"{layer}{one.name}.{channel}" not in found
    ]
    noisy, clean = (found[f"{first}{n}.R"] for n in ("Noisy Image", "Combined"))
    still = ("Emit", "Trans", "Vector")
    empty = [n for n in means if means[n] == 0.0 and not any(one in n for one in still)]
    emit(absent=absent, empty=empty, denoised=float(np.abs(noisy - clean).max()))
    depth = [found[f"{layer}Depth.Z"] for layer in (first, second)]
    emit(nearer=int((depth[0] < depth[1] - 0.1).sum()), farther=int((depth[0] > depth[1]).sum()))
    scene.wavecomb.denoise = False
    whole = _layers(scene, folder / "whole.exr")[f"{first}Combined.R"]
    render = scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x = 0.25, 0.75
    render.border_min_y, render.border_max_y = 0.0, 0.5
    part = _layers(scene, folder / "part.exr")[f"{first}Combined.R"]
    height, width = whole.shape
    inside = np.s_[height // 2 :, width // 4 : 3 * width // 4]
    same = part if part.shape != whole.shape else part[inside]
    emit(border=bool(np.array_equal(same, whole[inside])), shape=list(part.shape))


def cryptomatte(folder: Path) -> None:
    """Collects Cryptomatte ids of objects, materials and assets from Cycles and Wavecomb."""
    scene, ball = _ball(4)
    ball.name = "Ball é.001"
    child = build.cube(build.principled("painted wood"), at=(2, 0, 0.5), size=0.8)
    child.parent = ball
    layer = scene.view_layers[0]
    other = scene.view_layers.new("second")
    for one in (layer, other):
        for name in ("object", "material", "asset"):
            setattr(one, f"use_pass_cryptomatte_{name}", True)
    found: dict[str, Any] = {}
    for engine in ("CYCLES", "WAVECOMB"):
        scene.render.engine = engine
        scene.cycles.samples = 4
        for name, values in _layers(scene, folder / f"{engine}.exr").items():
            if "Crypto" in name and name.endswith(("00.R", "00.r")):
                ids, counts = np.unique(values.view(np.uint32), return_counts=True)
                table = {f"{i:08x}": int(c) for i, c in zip(ids, counts, strict=True) if c > 20}
                found.setdefault(name[:-2], {})[engine] = table
    emit(passes=found)


def report(folder: Path) -> None:
    """Renders a material with a Light Path node and displacement; collects the report."""
    scene, ball = _ball(1)
    material = ball.material_slots[0].material
    node = build.add(material, "ShaderNodeLightPath")
    shader = build.shader_of(material)
    build.wire(material, node.outputs["Is Camera Ray"], shader.inputs["Roughness"])
    displace = build.add(material, "ShaderNodeDisplacement")
    output = material.node_tree.get_output_node("CYCLES")
    build.wire(material, displace.outputs[0], output.inputs["Displacement"])
    material.displacement_method = "DISPLACEMENT"
    lines = io.StringIO()
    with contextlib.redirect_stdout(lines):
        message = _message(scene)
    emit(error=message, lines=[x for x in lines.getvalue().splitlines() if "wavecomb: " in x])


def _deforming() -> None:
    """Adds a cube whose shape keys move over the frames, with a texture that is baked."""
    material = build.principled("b")
    noise = build.add(material, "ShaderNodeTexNoise")
    shader = build.shader_of(material)
    build.wire(material, noise.outputs["Color"], shader.inputs["Base Color"])
    thing = build.cube(material, at=(0, 1.5, 0.5), size=1)
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
    CASES = {
        one.__name__: one
        for one in (
            same,
            stamp,
            errors,
            standby,
            full,
            report,
            cryptomatte,
            passes,
            animation,
            blend,
        )
    }
    CASES[sys.argv[1]](Path(sys.argv[2]))
