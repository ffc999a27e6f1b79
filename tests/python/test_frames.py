# SPDX-License-Identifier: Apache-2.0
"""Tests sequences: parsing of frame ranges, and frames that equal single renders."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from pxr import Sdf, Usd, UsdGeom, UsdLux
from usd_recorder import Recorder

import wavecomb
from wavecomb.cli import main
from wavecomb.errors import WavecombError
from wavecomb.run.frame_names import fill, frame_text, has_place, parse_frames
from wavecomb.run.sequence import Frames
from wavecomb.usd import LoadReport, load_stage, open_stage
from wavecomb.usd.stage.frame_cache import AnimatedAttributes, FrameCache

SMALL = {"size": (24, 24), "spp": 1}


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("7", (7,)),
        ("1-4", (1, 2, 3, 4)),
        ("1-8x3", (1, 4, 7)),
        ("3-1", (3, 2, 1)),
        ("1,5,9", (1, 5, 9)),
        ("-2-1", (-2, -1, 0, 1)),
        ("-5--9x2", (-5, -7, -9)),
        ("1-1.5x0.1", (1, 1.1, 1.2, 1.3, 1.4, 1.5)),
        (".5, 1-2 ,1", (0.5, 1, 2)),
        ([3, 1.25], (3, 1.25)),
    ],
)
def test_frames_are_read(text, frames):
    assert parse_frames(text) == frames


@pytest.mark.parametrize("text", ["", "a", "1-", "1-5x0", "1-5x-1", "5x2", "1--", "1..2", "1-9e9"])
def test_what_is_no_frames_is_named(text):
    with pytest.raises(WavecombError, match="frames"):
        parse_frames(text)
    with pytest.raises(WavecombError, match="more than 1,000,000"):
        parse_frames("1-9999999")


@pytest.mark.parametrize(
    ("pattern", "frame", "name"),
    [
        ("o/a.####.exr", 7, "o/a.0007.exr"),
        ("a.#.exr", 123, "a.123.exr"),
        ("a.####.exr", -7, "a.-0007.exr"),
        ("a.##.exr", 1.25, "a.01.25.exr"),
        ("a%04d.png", 7, "a0007.png"),
        ("a%04d.png", -7, "a-007.png"),
        ("a%d.png", 7, "a7.png"),
        ("a<frame>.png", -0.5, "a-0.5.png"),
        ("x##/a.exr", 7, "x##/a.exr"),
    ],
)
def test_names_of_frames(pattern, frame, name):
    assert fill(pattern, frame) == name
    assert has_place(pattern) == (fill(pattern, 7) != pattern)


def test_frames_as_text_are_exact():
    assert [frame_text(f) for f in (1.0, 0.1, -2.5, 1e-7, 1e20)] == [
        "1",
        "0.1",
        "-2.5",
        "0.0000001",
        "1" + 20 * "0",
    ]


def cube(stage, path, x, colour):
    prim = UsdGeom.Mesh.Define(stage, path)
    prim.CreatePointsAttr([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    prim.CreateFaceVertexCountsAttr([4])
    prim.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    prim.CreateSubdivisionSchemeAttr("none")
    prim.CreateDisplayColorAttr([colour])
    prim.AddTranslateOp().Set((x, 0, 0))
    return prim


@pytest.fixture
def shot(tmp_path):
    """Three squares and a camera. Tests add animation to the stage."""
    path = tmp_path / "shot.usda"
    stage = Usd.Stage.CreateNew(str(path))
    for i, colour in enumerate([(1, 0, 0), (0, 1, 0), (0, 0, 1)]):
        cube(stage, f"/World/Q{i}", 2.5 * (i - 1), colour)
    camera = UsdGeom.Camera.Define(stage, "/World/Rig/Camera")
    camera.AddTranslateOp().Set((0, 0, 12))
    camera.CreateClippingRangeAttr((0.1, 100))
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(4)
    return stage


def ramp(attribute, values):
    for frame, value in enumerate(values, 1):
        attribute.Set(value, frame)


def vary_camera(stage):
    rig = UsdGeom.Xform.Define(stage, "/World/Rig")
    ramp(rig.AddTranslateOp().GetAttr(), [(x, 0, 0) for x in (0.0, 0.5, 1.0, 1.5)])
    ramp(UsdGeom.Camera.Get(stage, "/World/Rig/Camera").CreateFocalLengthAttr(), [40, 50, 60, 70])


def vary_lens(stage):
    """Makes the camera invalid in one frame and disables depth of field in the next frame."""
    camera = UsdGeom.Camera.Get(stage, "/World/Rig/Camera")
    ramp(camera.CreateFocalLengthAttr(), [50, 0, 50, 50])
    ramp(camera.CreateFStopAttr(), [0.5, 0.5, 0, 2])
    camera.CreateFocusDistanceAttr(11)


def vary_object(stage):
    ramp(
        stage.GetPrimAtPath("/World/Q1").GetAttribute("xformOp:translate"),
        [(0, y, 0) for y in (0, 0.5, 1, 1.5)],
    )


def vary_points(stage):
    points = UsdGeom.Mesh.Get(stage, "/World/Q1").GetPointsAttr()
    for frame in range(1, 5):
        points.Set([(-1, -1, 0), (1, -1, 0), (frame, 1, 0), (-1, frame, 0)], frame)


def vary_visibility(stage):
    ramp(
        UsdGeom.Imageable.Get(stage, "/World/Q1").CreateVisibilityAttr(),
        ["inherited", "invisible", "inherited", "invisible"],
    )


def vary_inherited_colour(stage):
    UsdGeom.Mesh.Get(stage, "/World/Q1").GetDisplayColorAttr().Block()
    world = UsdGeom.PrimvarsAPI(stage.DefinePrim("/World", "Xform"))
    primvar = world.CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, "constant")
    ramp(primvar.GetAttr(), [[(x, 1, 0)] for x in (0, 0.3, 0.6, 1)])


def vary_light(stage):
    light = UsdLux.SphereLight.Define(stage, "/World/Light")
    light.AddTranslateOp().Set((0, 4, 4))
    ramp(light.CreateIntensityAttr(), [10, 20, 30, 40])


def subdivide(stage):
    """Turns two of the squares into subdivision surfaces, one of which has several colours."""
    for i in (0, 2):
        UsdGeom.Mesh.Get(stage, f"/World/Q{i}").GetSubdivisionSchemeAttr().Set("catmullClark")
    colours = UsdGeom.Mesh.Get(stage, "/World/Q2").GetDisplayColorPrimvar()
    colours.Set([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)])
    colours.SetInterpolation("vertex")


def vary_near_surfaces(stage):
    """Moves the camera closer, so that surfaces grow from a few pixels to many pixels."""
    subdivide(stage)
    ramp(
        UsdGeom.Xformable.Get(stage, "/World/Rig/Camera")
        .GetPrim()
        .GetAttribute("xformOp:translate"),
        [(0, 0, z) for z in (80, 40, 12, 11.9)],
    )


def vary_beside_surfaces(stage):
    subdivide(stage)
    vary_object(stage)


def vary_nothing(stage):
    pass


CHANGES = [
    vary_camera,
    vary_lens,
    vary_object,
    vary_points,
    vary_visibility,
    vary_inherited_colour,
    vary_light,
    vary_near_surfaces,
    vary_beside_surfaces,
    vary_nothing,
]


@pytest.mark.parametrize("vary", CHANGES)
def test_each_frame_is_what_it_is_alone(shot, vary):
    vary(shot)
    shot.Save()
    path = shot.GetRootLayer().realPath
    seen = []
    for frame, picture in wavecomb.render_frames(path, "1-4", **SMALL):
        alone = wavecomb.render(path, frame=frame, **SMALL)
        assert np.array_equal(picture.beauty, alone.beauty), frame
        assert np.array_equal(picture.depth, alone.depth)
        assert picture.stats["warnings"] == alone.stats["warnings"]
        assert picture.stats["unsupported"] == alone.stats["unsupported"]
        assert picture.metadata["wavecomb:scene"] == alone.metadata["wavecomb:scene"]
        seen.append(picture.beauty.tobytes())
    assert len(set(seen)) == {vary_nothing: 1, vary_visibility: 2}.get(vary, 4)


@pytest.mark.parametrize("vary", CHANGES)
def test_what_only_moves_views(shot, vary):
    vary(shot)
    assert AnimatedAttributes(shot).is_view_only == (
        vary in (vary_camera, vary_lens, vary_near_surfaces, vary_nothing)
    )


def test_a_camera_that_carries_something_is_no_view_only(shot):
    vary_camera(shot)
    cube(shot, "/World/Rig/Flag", 0, (1, 1, 1))
    assert not AnimatedAttributes(shot).is_view_only


def test_what_a_shader_reads_of_a_rig_is_no_view_only(shot):
    vary_camera(shot)
    shader = shot.DefinePrim("/World/Look/S", "Shader")
    shader.CreateAttribute("inputs:roughness", Sdf.ValueTypeNames.Float).SetConnections(
        [Sdf.Path("/World/Rig/Camera.focalLength")]
    )
    assert not AnimatedAttributes(shot).is_view_only


def test_arrays_that_do_not_change_are_shared(shot):
    vary_object(shot)
    shot.Save()
    opening = LoadReport()
    stage = open_stage(Path(shot.GetRootLayer().realPath))

    class Shares(Recorder):
        def share_texture(self, scene, texture):
            return self.add_texture(scene.textures[texture]["pixels"], srgb=False)

    cache = FrameCache(stage, opening)
    one, two = (
        load_stage(stage, frame=frame, cache=cache, builder_factory=Shares).scene
        for frame in (1, 2)
    )
    for name in ("Q0", "Q2"):
        assert one.mesh(name)["positions"] is two.mesh(name)["positions"]
    assert one.mesh("Q1")["positions"] is not two.mesh("Q1")["positions"]


def test_scene_and_hierarchy_stay_where_the_camera_moves(shot):
    vary_camera(shot)
    shot.Save()
    frames = Frames(shot.GetRootLayer().realPath)
    settings = wavecomb.Settings(width=8, height=8, spp=1)
    build = []
    for frame in (1, 2, 3):
        loaded = frames.load(frame)
        assert loaded.frame == frame
        build.append(frames.stats(frames.render(settings))["seconds"]["build"])
    assert build[0] > 0 and build[1:] == [0, 0]


def test_levels_of_surfaces_follow_the_camera(shot):
    """The scene is rebuilt only in frames where a surface needs further refinement."""
    vary_near_surfaces(shot)
    shot.Save()
    frames = Frames(shot.GetRootLayer().realPath, size=(100, 100))
    settings = wavecomb.Settings(width=8, height=8, spp=1)
    triangles, build = [], []
    for frame in (1, 2, 3, 4):
        triangles.append(frames.load(frame).scene.triangles)
        build.append(frames.stats(frames.render(settings))["seconds"]["build"] > 0)
    assert triangles[0] < triangles[1] < triangles[2] == triangles[3]
    assert build == [True, True, True, False]


def test_refined_surfaces_are_shared_beside_what_moves(shot):
    vary_beside_surfaces(shot)
    stage = Usd.Stage.Open(shot.GetRootLayer())
    cache = FrameCache(stage, LoadReport())
    made = []

    class Counts(Recorder):
        def make_surfaces(self, surfaces, threads=0):
            made.append(len(surfaces))
            return super().make_surfaces(surfaces, threads)

        def share_texture(self, scene, texture):
            return self.add_texture(scene.textures[texture]["pixels"], srgb=False)

    for frame in (1, 2):
        load_stage(stage, frame=frame, cache=cache, subdivision=2, builder_factory=Counts)
    # In the second frame, only the surface with vertex colours is refined again.
    assert made == [2, 1]


def test_value_clips(tmp_path):
    """Points from value clips, each of which covers two frames."""
    for number, height in ((1, 1.0), (2, 3.0)):
        clip = Usd.Stage.CreateNew(str(tmp_path / f"clip{number}.usda"))
        points = UsdGeom.Mesh.Define(clip, "/Clip").CreatePointsAttr()
        for frame in (1, 2, 3, 4):
            points.Set([(0, 0, 0), (1, 0, 0), (0, height * frame, 0)], frame)
        clip.Save()
    stage = Usd.Stage.CreateNew(str(tmp_path / "clips.usda"))
    mesh = UsdGeom.Mesh.Define(stage, "/Model")
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreatePointsAttr()
    api = Usd.ClipsAPI(mesh)
    api.SetClipPrimPath("/Clip")
    api.SetClipAssetPaths([Sdf.AssetPath(f"./clip{n}.usda") for n in (1, 2)])
    api.SetClipActive([(1, 0), (3, 1)])
    api.SetClipTimes([(1, 1), (4, 4)])
    stage.Save()
    path = tmp_path / "clips.usda"
    assert not AnimatedAttributes(open_stage(path)).is_view_only
    tops = []
    for frame in (1, 2, 3, 4):
        scene = load_stage(path, frame=frame, builder_factory=Recorder).scene
        tops.append(float(scene.mesh("Model")["positions"][2, 1]))
    assert tops == [1, 2, 9, 12]
    pictures = dict(wavecomb.render_frames(path, "2-3", **SMALL))
    alone = wavecomb.render(path, frame=3, **SMALL)
    assert np.array_equal(pictures[3].beauty, alone.beauty)
    assert not np.array_equal(pictures[2].beauty, alone.beauty)


def run(*arguments):
    return CliRunner().invoke(main, ["render", *map(str, arguments)])


def test_the_command_writes_and_skips(shot, tmp_path):
    vary_camera(shot)
    shot.Save()
    path = shot.GetRootLayer().realPath
    small = ("--size", 24, 24, "--spp", 1)
    out, png, stats = (tmp_path / f"a.##.{kind}" for kind in ("exr", "png", "json"))
    asked = (path, "-o", out, "--png", png, "--stats", stats, *small)
    done = run(*asked, "--frames", "1-3x2")
    assert done.exit_code == 0, done.output
    assert "frame 3 (2 of 2)" in done.output
    assert {p.name for p in tmp_path.glob("a.*")} == {
        f"a.0{frame}.{kind}" for frame in (1, 3) for kind in ("exr", "png", "json")
    }
    assert json.loads((tmp_path / "a.03.json").read_text())["seconds"]["build"] == 0
    os.unlink(tmp_path / "a.03.png")
    before = (tmp_path / "a.01.exr").stat().st_mtime_ns
    lines = run(*asked, "--frames", "1-3x2", "--skip-existing", "--progress", "json")
    assert lines.exit_code == 0, lines.output
    events = [json.loads(line) for line in lines.stdout.splitlines()]
    assert [e["frame"] for e in events if e["event"] == "frame"] == [3]
    assert (tmp_path / "a.01.exr").stat().st_mtime_ns == before
    assert (tmp_path / "a.03.png").exists()
    one = tmp_path / "one.exr"
    assert run(path, "-o", one, "--frame", 3, *small).exit_code == 0
    assert wavecomb.compare(tmp_path / "a.03.exr", one).equal


def test_bad_sequences(shot, tmp_path):
    shot.Save()
    path = shot.GetRootLayer().realPath
    out, plain = tmp_path / "a.#.exr", tmp_path / "a.exr"
    for arguments, says in (
        ((path, "-o", plain, "--frames", "1-2"), "say where the frame goes"),
        ((path, "-o", out, "--png", tmp_path / "a.png", "--frames", "1-2"), "--png"),
        ((path, "-o", out, "--frames", "1-2", "--frame", "1"), "give one of them"),
        ((path, "-o", out, "--frames", "x"), "no frame or range"),
        ((path, "-o", out, "--skip-existing"), "give --frames"),
        ((path, "-o", out, "--frames", "1", "--resume", "a.ckpt"), "--resume"),
    ):
        result = run(*arguments)
        assert result.exit_code == 2 and says in result.output, result.output
        assert result.output.count("\n") == 1
    assert not list(tmp_path.glob("a*"))


def test_a_frame_that_fails_is_named(shot, tmp_path, monkeypatch):
    vary_object(shot)
    shot.Save()
    out = tmp_path / "a.#.exr"
    real = Frames.load

    def fails(self, frame, **options):
        if frame == 2:
            raise WavecombError("/World/Q1: broken")
        return real(self, frame, **options)

    monkeypatch.setattr(Frames, "load", fails)
    path = shot.GetRootLayer().realPath
    result = run(path, "-o", out, "--frames", "1-3", "--size", 8, 8, "--spp", 1)
    assert result.exit_code == 2
    assert "error: frame 2: /World/Q1: broken" in result.output
    assert sorted(p.name for p in tmp_path.glob("a.*")) == ["a.1.exr"]


def test_a_stopped_frame_is_not_written(shot, tmp_path, monkeypatch):
    shot.Save()
    out = tmp_path / "a.#.exr"
    real = Frames.render
    calls = []

    def stops(self, settings, *arguments, watcher, **named):
        calls.append(1)
        if len(calls) == 2:
            settings = wavecomb.Settings(width=64, height=64, spp=1 << 20)
            monkeypatch.setattr(watcher, "_is_stopped", lambda: True)
        return real(self, settings, *arguments, watcher=watcher, **named)

    monkeypatch.setattr(Frames, "render", stops)
    path = shot.GetRootLayer().realPath
    result = run(path, "-o", out, "--frames", "1-3", "--size", 8, 8, "--spp", 1)
    assert result.exit_code == 130
    assert "stopped in frame 2" in result.output and "1 of 3 frames" in result.output
    assert sorted(p.name for p in tmp_path.glob("a.*")) == ["a.1.exr"]
