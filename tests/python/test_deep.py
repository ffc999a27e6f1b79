# SPDX-License-Identifier: Apache-2.0
"""Tests that deep images flatten to the beauty, and that OpenImageIO reads their files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from click.testing import CliRunner
from parts import only_where
from stopping import StopAt
from usd_recorder import write

import wavecomb
from wavecomb import vdb
from wavecomb.cli import main

_core = pytest.importorskip("wavecomb._core")

SIZE, SPP = (40, 30), 16
CAMERA = """#usda 1.0
( upAxis = "Y" )
def Camera "Cam" {
    float focalLength = 30
    float fStop = 2
    float focusDistance = 8
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
LIT = """
def RectLight "Key" {
    float inputs:intensity = 20
    float3 xformOp:rotateXYZ = (-40, 0, 0)
    double3 xformOp:translate = (0, 5, 5)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def Sphere "Ball" { color3f[] primvars:displayColor = [(0.9, 0.4, 0.2)] }
def Mesh "Veil" (
    prepend apiSchemas = ["MaterialBindingAPI"]
) {
    rel material:binding = </Veil/Look>
    point3f[] points = [(-2, -1, 2), (1, -1, 2.4), (1, 1, 2.4), (-2, 1, 2)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    def Material "Look" {
        token outputs:surface.connect = </Veil/Look/S.outputs:surface>
        def Shader "S" {
            uniform token info:id = "UsdPreviewSurface"
            float inputs:opacity = 0.4
            token outputs:surface
        }
    }
}
"""
HAIR = """
def BasisCurves "Hair" {{
    uniform token type = "linear"
    int[] curveVertexCounts = [{counts}]
    point3f[] points = [{points}]
    float[] widths = [0.03] ( interpolation = "constant" )
    color3f[] primvars:displayColor = [(0.3, 0.2, 0.1)]
}}
"""
GLOWING = """
def Mesh "{name}" (
    prepend apiSchemas = ["MaterialBindingAPI"]
) {{
    rel material:binding = </{name}/Look>
    point3f[] points = [{points}]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    def Material "Look" {{
        token outputs:surface.connect = </{name}/Look/S.outputs:surface>
        def Shader "S" {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0, 0, 0)
            float inputs:ior = 1
            color3f inputs:emissiveColor = {color}
            token outputs:surface
        }}
    }}
}}
"""
CLOUD = """
def Volume "Cloud" {
    rel field:density = </Cloud/density>
    double3 xformOp:translate = (-1, -1, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def OpenVDBAsset "density" { asset filePath = @./a.vdb@ }
}
"""


def _hair() -> str:
    rng = np.random.default_rng(5)
    roots = rng.uniform((-1.5, -1, 1), (1.5, 0, 1.8), (120, 3))
    tips = roots + rng.uniform((-0.2, 0.5, -0.2), (0.2, 1.2, 0.2), (120, 3))
    points = ", ".join(f"({x:.3f}, {y:.3f}, {z:.3f})" for pair in zip(roots, tips, strict=True)
                       for x, y, z in pair)  # fmt: skip
    return HAIR.format(counts=", ".join(["2"] * 120), points=points)


def _render(stage: Path, **options: Any) -> wavecomb.Picture:
    asked: dict[str, Any] = {"size": SIZE, "spp": SPP, "aovs": ["alpha", "deep"], **options}
    return wavecomb.render(stage, **asked)


def _flat_of(picture: wavecomb.Picture) -> np.ndarray[Any, Any]:
    """Returns beauty without the background, and alpha."""
    colours = picture.beauty - picture.aovs.get("lpe_background", 0)
    return np.concatenate([colours, picture.aovs["alpha"][:, :, None]], axis=2)


def _flattened(deep: oiio.ImageBuf) -> np.ndarray[Any, Any]:
    """Returns R, G, B and A as OpenImageIO flattens them."""
    flat = oiio.ImageBufAlgo.flatten(deep)
    assert not flat.has_error, flat.geterror()
    names = list(flat.spec().channelnames)
    return flat.get_pixels()[:, :, [names.index(name) for name in "RGBA"]]


def _check(picture: wavecomb.Picture, folder: Path) -> None:
    """Asserts that a deep image and its file flatten to beauty and alpha."""
    assert picture.deep is not None
    wanted = _flat_of(picture)
    scale = np.maximum(1.0, wanted)
    assert (abs(picture.deep.flat() - wanted) <= 1e-5 * scale).all()
    file = picture.save_deep(folder / "deep.exr")
    deep = oiio.ImageBuf(str(file))
    assert deep.deep and deep.spec().channelnames == ("R", "G", "B", "A", "Z", "ZBack")
    assert (abs(_flattened(deep) - wanted) <= 1e-4 * scale).all()


@pytest.fixture(scope="module")
def lit(tmp_path_factory: pytest.TempPathFactory) -> wavecomb.Picture:
    return _render(write(tmp_path_factory.mktemp("lit"), CAMERA + LIT + _hair()))


def test_surfaces_cut_outs_and_hair_flatten_to_the_picture(
    lit: wavecomb.Picture, tmp_path: Path
) -> None:
    _check(lit, tmp_path)
    assert lit.deep is not None
    assert lit.deep.counts.max() > 3 and lit.deep.counts.min() == 0
    alpha, z, back = lit.deep.samples[:, 3], lit.deep.samples[:, 4], lit.deep.samples[:, 5]
    assert (alpha > 0).all() and (alpha <= 1).all() and (z == back).all()
    assert z.min() > 3 and z.max() < 9


def test_depths_of_a_pixel_are_in_order(lit: wavecomb.Picture) -> None:
    assert lit.deep is not None
    first = np.cumsum(lit.deep.counts) - lit.deep.counts.ravel()
    steps = np.diff(lit.deep.samples[:, 4])
    inside = np.setdiff1d(np.arange(1, len(lit.deep.samples)), first) - 1
    assert (steps[inside] > 0).all()


def test_few_samples_add_up_as_many_do(tmp_path: Path) -> None:
    stage = write(tmp_path, CAMERA + LIT + _hair())
    for options in ({"deep_samples": 2}, {"deep_tolerance": 0.0, "deep_samples": 64}):
        picture = _render(stage, **options)
        assert picture.deep is not None and picture.deep.counts.max() <= options["deep_samples"]
        _check(picture, tmp_path)


def test_every_schedule_gives_the_same_bits(lit: wavecomb.Picture, tmp_path: Path) -> None:
    assert lit.deep is not None
    stage = write(tmp_path, CAMERA + LIT + _hair())
    for schedule in (
        {"integrator": "reference"},
        {"threads": 1, "wave_size": 64, "policy": "material"},
        {"lanes": 1, "ray_order": "morton"},
    ):
        other = _render(stage, **schedule)
        assert other.deep is not None
        assert other.deep.counts.tobytes() == lit.deep.counts.tobytes(), schedule
        assert other.deep.samples.tobytes() == lit.deep.samples.tobytes(), schedule
        assert other.beauty.tobytes() == lit.beauty.tobytes(), schedule


def test_it_changes_no_bit_of_the_beauty(lit: wavecomb.Picture, tmp_path: Path) -> None:
    plain = _render(write(tmp_path, CAMERA + LIT + _hair()), aovs=["alpha"])
    assert plain.deep is None and plain.beauty.tobytes() == lit.beauty.tobytes()


@only_where(vdb.is_there(), "this build is without OpenVDB")
def test_a_volume_has_thickness(tmp_path: Path) -> None:
    values = np.full((8, 8, 8, 8), 0.8, np.float16)
    cells = [[x, y, z] for x in range(2) for y in range(2) for z in range(2)]
    vdb.write(tmp_path / "a.vdb", [{
        "name": "density", "origins": np.array(cells, np.int32) * 8, "values": values,
        "index_to_object": np.diag([0.125, 0.125, 0.125, 1.0]),
    }])  # fmt: skip
    stage = write(tmp_path, CAMERA + LIT + CLOUD)
    picture = _render(stage, spp=64, deep_samples=64)
    _check(picture, tmp_path)
    assert picture.deep is not None
    thick = picture.deep.samples[:, 5] - picture.deep.samples[:, 4]
    assert (thick >= 0).all() and (thick > 0).any()
    assert (thick <= 0.0101 * picture.deep.samples[:, 5]).mean() > 0.9
    other = _render(stage, spp=64, deep_samples=64, integrator="reference")
    assert other.deep is not None
    assert other.deep.samples.tobytes() == picture.deep.samples.tobytes()


def test_two_halves_merge_to_the_whole(tmp_path: Path) -> None:
    """Deep renders of two emissive cards merge to the render of both."""
    cards = GLOWING.format(
        name="A", points="(-2, -1, 1), (1, -1, 1), (1, 1.2, 1), (-2, 1, 1)", color="(0.9, 0.2, 0.1)"
    ) + GLOWING.format(
        name="B", points="(-1, -2, -1), (3, -2, -1), (2.5, 2, -1), (-1, 2, -1)",
        color="(0.1, 0.3, 0.8)",
    )  # fmt: skip
    stage = write(tmp_path, CAMERA + cards)
    whole = _render(stage, aovs=["alpha", "deep", "lpe:background=CB"])
    halves = [_render(stage, mask=[f"/{name}"]) for name in "AB"]
    files = [str(half.save_deep(tmp_path / f"{k}.exr")) for k, half in enumerate(halves)]
    merged = oiio.ImageBufAlgo.deep_merge(*map(oiio.ImageBuf, files))
    assert not merged.has_error, merged.geterror()
    found, wanted = _flattened(merged), _flat_of(whole)
    # A pixel with edges of both cards does not determine how they overlap.
    partial = [(h.aovs["alpha"] > 0) & (h.aovs["alpha"] < 1) for h in halves]
    two_edges = partial[0] & partial[1]
    overlap = (halves[0].aovs["alpha"] > 0) & (halves[1].aovs["alpha"] > 0)
    assert overlap.sum() > 50 and two_edges.mean() < 0.05
    assert (overlap & partial[0] & ~partial[1]).sum() > 5
    assert abs(found - wanted)[~two_edges].max() <= 1e-4


def test_the_command_writes_it(tmp_path: Path) -> None:
    stage, file = write(tmp_path, CAMERA + LIT), tmp_path / "shot.deep.exr"
    run = CliRunner().invoke(
        main,
        ["render", str(stage), "-o", str(tmp_path / "shot.exr"), "--deep", str(file), "--size",
         "32", "24", "--region", "4", "3", "20", "15", "--crop", "--spp", "4", "--half",
         "--deep-samples", "3", "--quiet"],
    )  # fmt: skip
    assert run.exit_code == 0, run.output
    spec = oiio.ImageInput.open(str(file)).spec()
    assert spec.deep and (spec.x, spec.y, spec.width, spec.height) == (4, 3, 16, 12)
    assert (spec.full_width, spec.full_height) == (32, 24)
    assert str(spec.channelformats[0]) == "half" and str(spec.channelformats[4]) == "float"
    assert "wavecomb:settings" in {one.name for one in spec.extra_attribs}
    flat = oiio.ImageInput.open(str(tmp_path / "shot.exr")).spec().channelnames
    assert not any("deep" in name for name in flat)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--deep", "a.png"], "--deep a.png: the name must end in .exr"),
        (["--deep", "a.exr", "--firefly", "reweight"], "give firefly keep"),
        (["--deep", "a.exr", "--transport", "light"], "does not go with the AOV deep"),
        (["--deep", "a.exr", "--film-memory", "0.01"], "--deep needs all of it at once"),
        (["--deep", "a.exr", "--deep-samples", "65"], "deep_samples"),
        (["--aov", "deep"], "give --deep FILE.exr"),
    ],
)
def test_what_cannot_be_is_refused(options: list[str], says: str, tmp_path: Path) -> None:
    stage = write(tmp_path, CAMERA + LIT)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        run = CliRunner().invoke(
            main, ["render", str(stage), "-o", "b.exr", "--spp", "1", *options]
        )
    assert run.exit_code == 2 and says in run.stderr, run.stderr
    assert len(run.stderr.strip().splitlines()) == 1 or "Usage" in run.stderr


@pytest.mark.slow
def test_it_goes_on_from_a_checkpoint(tmp_path: Path) -> None:
    """Resuming with other thread counts and wave sizes gives the same bits as one run."""
    scene = wavecomb.load(write(tmp_path, CAMERA + LIT + _hair())).scene
    settings: dict[str, Any] = {
        **{"width": 48, "height": 40, "spp": 400, "aovs": ["alpha", "deep"], "deep_samples": 5}
    }
    whole = _core.render(scene, _core.Settings(**settings))
    state: dict[str, Any] | None = None
    for run in range(100):
        watcher = StopAt(run % 2)
        how = {"threads": 1 + run % 2, "wave_size": (64, 4096)[run % 2]}
        part = _core.Settings(**settings, **how)
        result = _core.render(scene, part, watcher=watcher, state=state, interval=0.02)
        state = watcher.state
        if not result.cancelled:
            break
    assert run > 0 and not result.cancelled
    for one, other in zip(whole.deep, result.deep, strict=True):
        assert np.array_equal(one, other)
    counts, _ = whole.deep
    assert state is not None and state["film.deep"].size == counts.size + 40 * counts.sum()
    for bad in (state["film.deep"][:-1], np.full_like(state["film.deep"], 255)):
        with pytest.raises(_core.Error, match="start anew"):
            _core.render(scene, _core.Settings(**settings), state={**state, "film.deep": bad})


def test_the_command_goes_on(tmp_path: Path) -> None:
    stage, state = write(tmp_path, CAMERA + LIT), str(tmp_path / "a.ckpt")

    def run(*options: str) -> Any:
        words = ["render", str(stage), "-o", str(tmp_path / "a.exr"), "--quiet"]
        return CliRunner().invoke(main, [*words, *options])

    def deep(name: str, *options: str) -> Any:
        file = str(tmp_path / name)
        done = run("--deep", file, *options)
        assert done.exit_code == 0, done.output
        return oiio.ImageBuf(file)

    size = ("--size", "32", "24", "--spp")
    deep("half.exr", *size, "4", "--checkpoint", state)
    refused = run("--resume", state)
    assert refused.exit_code == 2 and "also give --deep FILE.exr" in refused.stderr
    more = deep("more.exr", "--resume", state, "--spp", "8")
    whole = deep("whole.exr", *size, "8")
    assert np.array_equal(_flattened(more), _flattened(whole))
    plain = str(tmp_path / "b.ckpt")
    assert run(*size, "4", "--checkpoint", plain).exit_code == 0
    refused = run("--resume", plain, "--deep", str(tmp_path / "no.exr"))
    assert refused.exit_code == 2 and "has no deep samples" in refused.stderr


def test_farms_refuse_it(tmp_path: Path) -> None:
    stage = write(tmp_path, CAMERA + LIT)
    run = CliRunner().invoke(
        main,
        ["farm", "submit", str(stage), "-o", str(tmp_path / "a.exr"), "--deep",
         str(tmp_path / "b.exr"), "--on", "none"],
    )  # fmt: skip
    assert run.exit_code == 2 and "--deep: is not for a farm" in run.stderr


def test_flat_readers_say_what_it_is(lit: wavecomb.Picture, tmp_path: Path) -> None:
    file = lit.save_deep(tmp_path / "deep.exr")
    run = CliRunner().invoke(main, ["compare", str(file), str(file)])
    assert run.exit_code == 2 and "several in depth" in run.stderr
