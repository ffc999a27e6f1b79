# SPDX-License-Identifier: Apache-2.0
"""Tests of loading: images that are read ahead, threads and memory."""

from __future__ import annotations

import cProfile
import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import only_where
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt
from usd_recorder import Recorder

import wavecomb
from wavecomb.image.files.image import write_png
from wavecomb.usd import load_stage
from wavecomb.usd.geometry.primvar import authored_names
from wavecomb.usd.geometry.shapes import read_shape
from wavecomb.usd.materials import pixels
from wavecomb.usd.materials.pixels import Image, ReadAhead, TextureError, is_finite

LINUX = only_where(sys.platform == "linux", "reads /proc")


def textured_stage(folder: Path) -> Path:
    """Writes nine quads with eight images: one missing, one broken, one in two colour spaces."""
    rng = np.random.default_rng(7)
    for k in range(6):
        write_png(folder / f"{k}.png", rng.random((16 + k, 20, 3)).astype(np.float32))
    (folder / "6.png").write_bytes((folder / "5.png").read_bytes()[:100])
    stage = Usd.Stage.CreateNew(str(folder / "stage.usda"))
    uses = [(f"{k}.png", "sRGB") for k in range(8)] + [("0.png", "raw")]
    for k, (name, space) in enumerate(uses):
        mesh = UsdGeom.Mesh.Define(stage, f"/World/Quad{k}")
        mesh.CreatePointsAttr([(0, 0, k), (1, 0, k), (1, 1, k), (0, 1, k)])
        mesh.CreateFaceVertexCountsAttr([4])
        mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
        material = UsdShade.Material.Define(stage, f"/World/Looks/M{k}")
        image = UsdShade.Shader.Define(stage, f"/World/Looks/M{k}/Image")
        image.CreateIdAttr("UsdUVTexture")
        image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"./{name}")
        image.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set(space)
        shader = UsdShade.Shader.Define(stage, f"/World/Looks/M{k}/Surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        colour = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
        colour.ConnectToSource(image.ConnectableAPI(), "rgb")
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    stage.Save()
    return folder / "stage.usda"


def test_reading_ahead_changes_nothing(tmp_path: Path) -> None:
    path = textured_stage(tmp_path)
    loads = []
    for threads in (1, 3):
        recorder = Recorder()
        loads.append(
            (recorder, load_stage(path, threads=threads, builder_factory=lambda r=recorder: r))
        )
    (one, a), (many, b) = loads
    assert a.report.lines() == b.report.lines()
    assert len(one.textures) == len(many.textures) == 9
    for x, y in zip(one.textures, many.textures, strict=True):
        assert x["srgb"] == y["srgb"] and np.array_equal(x["pixels"], y["pixels"])
    warnings = [line for line in b.report.lines() if "cannot be read" in line]
    assert len(warnings) == 2 and any("no such file" in line for line in warnings)
    assert not Sdf.Layer.Find(str(path))  # the layer is closed even if reading failed
    assert not [t for t in threading.enumerate() if t.name.startswith("wavecomb-image")]


def test_few_images_lie_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []

    def fake(path: str) -> Image:
        read.append(path)
        if path == "bad":
            raise TextureError("broken")
        return Image(np.full((1, 1, 3), len(path), np.uint8))

    monkeypatch.setattr(pixels, "read_image", fake)
    ahead = ReadAhead(2)
    ahead.want(["a", "bad", *(f"image{k}" for k in range(20))])
    deadline = time.monotonic() + 10
    while len(read) < 3 and time.monotonic() < deadline:
        time.sleep(0.001)
    time.sleep(0.02)
    assert sorted(read) == ["a", "bad", "image0"]
    assert ahead.read("image19").channels == 3
    with pytest.raises(TextureError, match="broken"):
        ahead.read("bad")
    for k in range(19):
        assert ahead.read(f"image{k}").take()[0, 0, 0] == len(f"image{k}")
    ahead.close()
    assert len(read) == len(set(read)) == 22


def test_help_imports_little() -> None:
    code = (
        "import sys\nfrom wavecomb.cli import main\n"
        "try: main(['render', '--help'])\nexcept SystemExit: pass\n"
        "heavy = {'numpy', 'pxr', 'OpenImageIO', 'rich'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
        "names = 'bench', 'compare', 'info', 'merge', 'scene', 'view'\n"
        "others = {f'wavecomb.cli.{name}' for name in names}\n"
        "others &= set(sys.modules)\n"
        "assert not others, others"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def calls_to_read(path: Path, count: int, kind: str) -> int:
    """Counts the Python calls made by reading a stage of cubes or meshes."""
    stage = Usd.Stage.CreateNew(str(path))
    material = UsdShade.Material.Define(stage, "/Grey")
    shader = UsdShade.Shader.Define(stage, "/Grey/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    for i in range(count):
        if kind == "cube":
            prim = UsdGeom.Cube.Define(stage, f"/Cube{i}")
            prim.CreateSizeAttr(1.5)
        else:
            prim = UsdGeom.Mesh.Define(stage, f"/Mesh{i}")
            prim.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
            prim.CreateFaceVertexCountsAttr([4])
            prim.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
            prim.CreateSubdivisionSchemeAttr("none")
            UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)
        prim.AddTranslateOp().Set(Gf.Vec3d(2.0 * i, 0.0, 0.0))
    stage.Save()
    profile = cProfile.Profile()
    wavecomb.load(path)  # exclude imports and the filling of caches from the count
    with profile:
        wavecomb.load(path)
    return sum(entry.callcount for entry in profile.getstats())


@pytest.mark.parametrize(("kind", "most"), [("cube", 106), ("mesh", 121)])
def test_a_prim_takes_few_calls(kind: str, most: int, tmp_path: Path) -> None:
    few, many = (calls_to_read(tmp_path / f"{n}.usdc", n, kind) for n in (100, 300))
    assert (many - few) / 200 < most


def test_finite_pixels_are_told_by_their_bits() -> None:
    halves = np.arange(1 << 16, dtype=np.uint16).view(np.float16)
    for value in halves:
        assert is_finite(np.array([[1, value, -2]], np.float16)) == bool(np.isfinite(value))
    edges = [0x7F7FFFFF, 0x7F800000, 0x7F800001, 0xFF7FFFFF, 0xFF800000, 0xFFC00000, 0x80000000]
    for value in np.array(edges, np.uint32).view(np.float32):
        assert is_finite(np.array([[1, value, -2]], np.float32)) == bool(np.isfinite(value))
        turned = np.array([[1, value], [0, -2]], np.float32).T[:, ::-1]
        assert is_finite(turned) == bool(np.isfinite(value))
    assert is_finite(np.zeros((0, 3), np.float16))


def test_shapes_of_equal_size_share_their_arrays() -> None:
    stage = Usd.Stage.CreateInMemory()
    cubes = [UsdGeom.Cube.Define(stage, f"/Cube{i}") for i in range(3)]
    cubes[2].CreateSizeAttr(3.0)
    cubes[1].CreateSizeAttr(2.0)
    cubes[1].CreateOrientationAttr("leftHanded")
    plane, time = UsdGeom.Plane.Define(stage, "/Plane").GetPrim(), Usd.TimeCode.Default()
    one, turned, large = (
        read_shape(cube.GetPrim(), time, authored_names(cube.GetPrim())) for cube in cubes
    )
    assert one is not None and turned is not None and large is not None
    assert one.positions is turned.positions
    np.testing.assert_array_equal(one.normals, -turned.normals)
    assert large.positions.max() == 1.5 and one.positions.max() == 1.0
    assert read_shape(plane, time, frozenset()) is read_shape(plane, time, frozenset())


def big_mesh(path: Path, side: int, smooth: bool) -> None:
    """Writes a wavy square of 2 side^2 triangles, or of subdivided quads if ``smooth`` is set."""
    u = np.linspace(-1, 1, side + 1, dtype=np.float32)
    x, z = np.meshgrid(u, u)
    points = np.stack([x, 0.1 * np.sin(9 * x) * np.cos(7 * z), z], -1).reshape(-1, 3)
    a = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    b, c, d = a + side + 1, a + side + 2, a + 1
    faces = np.stack([a, b, c, d] if smooth else [a, b, d, d, b, c], -1).ravel().astype(np.int32)
    corners = 4 if smooth else 3
    stage = Usd.Stage.CreateNew(str(path))
    mesh = UsdGeom.Mesh.Define(stage, "/Terrain")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces))
    counts = np.full(len(faces) // corners, corners, np.int32)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(counts))
    mesh.CreateSubdivisionSchemeAttr("catmullClark" if smooth else "none")
    stage.Save()


MEASURE = """
import json, os, sys
import wavecomb.usd.stage.load
from wavecomb import _core, api
from wavecomb.run.settings import make_settings

def memory(key):
    lines = open("/proc/self/status").read().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(key))

def cpu():
    tasks = {}
    for task in os.listdir("/proc/self/task"):
        with open(f"/proc/self/task/{task}/schedstat") as file:
            tasks[task] = int(file.read().split()[0])
    return tasks

imports = memory("VmRSS")
loaded = wavecomb.load(sys.argv[1])
after = memory("VmRSS")
shares = {}
for threads in (1, 2):
    before = cpu()
    settings = make_settings((64, 64), 1, threads=threads)
    result = _core.render(loaded.scene, settings)
    spent = [ns - before.get(task, 0) for task, ns in cpu().items()]
    shares[threads] = max(spent) / sum(spent)
stats = result.stats
print(json.dumps({"imports": imports, "load": after, "peak": memory("VmHWM"),
                  "parts": stats["memory_bytes"], "reported": stats["peak_rss_bytes"],
                  "shares": shares}))
"""


@LINUX
@pytest.mark.slow
@pytest.mark.parametrize("smooth", [False, True])
def test_memory_and_threads_of_a_big_mesh(tmp_path: Path, smooth: bool) -> None:
    """Peak memory is at most 1.5 times the arrays and the BVH, whose build uses all threads."""
    pytest.importorskip("wavecomb._core")
    stage = tmp_path / "big.usdc"
    big_mesh(stage, 900, smooth)
    run = subprocess.run(
        [sys.executable, "-c", MEASURE, str(stage)], capture_output=True, text=True, check=True
    )
    got: dict[str, Any] = json.loads(run.stdout)
    parts = got["parts"]
    vertices, triangles = 901 * 901, 2 * 900 * 900
    assert parts["meshes"] == 12 * vertices * (2 if smooth else 1) + 12 * triangles
    assert parts["accelerator"] > 32 * triangles
    assert got["reported"] == pytest.approx(got["peak"], rel=0.05)
    # Only one set of arrays is in memory after loading.
    assert got["load"] - got["imports"] < 1.4 * parts["meshes"] + 10e6
    assert got["peak"] - got["imports"] <= 1.5 * sum(parts.values())
    # The calling thread also assembles the image, a tenth of so short a render.
    assert got["shares"]["1"] > 0.8
    assert got["shares"]["2"] < 0.75


MANY = """
import numpy as np
from wavecomb import _core

def memory(key):
    lines = open("/proc/self/status").read().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(key))

count = 400_000
builder = _core.SceneBuilder(1)
group = builder.add_group("group")
triangle = np.eye(3, dtype=np.float32)
builder.add_to_group(group, builder.add_mesh(triangle, np.array([[0, 1, 2]], np.uint32)))
places = np.tile(np.eye(4, dtype=np.float32), (count // 8, 1, 1))
before = memory("VmRSS")
for _ in range(8):
    builder.add_instances(0, group, places)
scene = builder.build()
print((memory("VmHWM") - before) / count)
"""


@LINUX
@pytest.mark.slow
def test_instances_are_not_held_twice_while_a_scene_is_made() -> None:
    """An instance needs about 150 bytes, since the builder frees its copies early."""
    pytest.importorskip("wavecomb._core")
    run = subprocess.run([sys.executable, "-c", MANY], capture_output=True, text=True, check=True)
    assert 100 < float(run.stdout) < 260, run.stdout


@pytest.mark.slow
def test_what_is_loaded_only_when_it_is_needed(tmp_path: Path) -> None:
    """OpenImageIO is imported only to read an image, and Rich only for a terminal."""
    path = tmp_path / "stage.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.Sphere.Define(stage, "/Ball")
    stage.Save()
    code = """
import json, sys
from wavecomb import _core, api
from wavecomb.run.settings import make_settings
from wavecomb.cli.reporting import make_reporter
from wavecomb.run.progress import Interrupt
from wavecomb.run.callbacks import Watcher
loaded = api.load(sys.argv[1])
with Interrupt(), make_reporter(None, quiet=False).rendering() as bar:
    _core.render(loaded.scene, make_settings((8, 8), 1), watcher=Watcher(reporter=bar))
print(json.dumps([name for name in ("OpenImageIO", "rich") if name in sys.modules]))
"""
    unforced = {k: v for k, v in os.environ.items() if k not in ("FORCE_COLOR", "TTY_COMPATIBLE")}
    command = [sys.executable, "-c", code, str(path)]
    found = {}
    for force in ("", "1"):
        run = subprocess.run(
            command,
            capture_output=True,
            text=True,
            check=True,
            env={**unforced, **({"FORCE_COLOR": force} if force else {})},
        )
        found[force] = json.loads(run.stdout)
    assert found == {"": [], "1": ["rich"]}


@LINUX
@pytest.mark.slow
def test_what_a_frame_does_not_need_is_not_in_memory() -> None:
    """Other frames of a cache, and payloads outside of a mask, are not in memory (60 MB each)."""
    pytest.importorskip("wavecomb._core")
    command = [sys.executable, "benchmarks/large_stages.py", "--gb", "0.06", "--points", "20000"]
    root = Path(__file__).resolve().parents[2]
    run = subprocess.run(command, capture_output=True, text=True, check=True, cwd=root)
    for line, name in zip(run.stdout.splitlines()[1:], ("cache", "parts"), strict=True):
        kind, size, _, peak, _, alone = line.replace(",", "").split()
        assert kind == name and float(size) > 0.05
        assert float(peak) - float(alone) < 16, line
