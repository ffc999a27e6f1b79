# SPDX-License-Identifier: Apache-2.0
"""Tests the alpha of shadow catchers against renders with and without the other objects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from usd_recorder import write

import wavecomb
from wavecomb.cli import main
from wavecomb.image.files.image import read_layers

SIZE, SPP = (80, 60), 16
STAGE = """#usda 1.0
( upAxis = "Y" )
def Camera "Cam" {
    float focalLength = 30
    double3 xformOp:translate = (0, 3, 8)
    float3 xformOp:rotateXYZ = (-20, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
}
def DistantLight "Sun" {
    float inputs:intensity = 30000
    float inputs:angle = 0.5
    float3 xformOp:rotateXYZ = (-60, 20, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
def Mesh "Floor" {
    SAYS
    point3f[] points = [(-9, -1, -9), (-9, -1, 9), (9, -1, 9), (9, -1, -9)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
}
def Xform "Set" {
    def Sphere "Ball" { bool primvars:wavecomb:visibility:shadow = 1 }
}
"""


def _stage(folder: Path, says: str = "") -> Path:
    return write(folder, STAGE.replace("SAYS", says))


def _render(stage: Path, **options: Any) -> wavecomb.Picture:
    return wavecomb.render(
        stage,
        # The brightness of the image, which changes with visibility, affects shadow roulette.
        **{"size": SIZE, "spp": SPP, "aovs": ["alpha", "direct"], "shadow_roulette": "off"},
        **options,
    )


@pytest.fixture(scope="module")
def caught(tmp_path_factory: pytest.TempPathFactory) -> wavecomb.Picture:
    return _render(_stage(tmp_path_factory.mktemp("caught")), catchers=["/Floor"])


def test_only_the_shadow_shows(caught: wavecomb.Picture, tmp_path: Path) -> None:
    stage = _stage(tmp_path)
    ball = _render(stage, holdouts=["/Floor"]).aovs["alpha"]
    whole = _render(stage, max_depth=1)
    alone = _render(stage, max_depth=1, mask=["/Floor", "/Sun", "/Cam"])
    clear = ball == 0
    assert not caught.beauty[clear].any()
    # The sun is the only light, so lit points are bright and others are black.
    dark = 1 - whole.beauty.sum(axis=2) / np.maximum(alone.beauty.sum(axis=2), 1e-9)
    floor = clear & (alone.aovs["alpha"] == 1)
    alpha = caught.aovs["alpha"]
    shadow = floor & (dark > 0.99)
    assert shadow.sum() > 20 and alpha[shadow].min() > 0.85
    lit = floor & (dark == 0)
    assert lit.sum() > 100 and alpha[lit].max() < 0.12
    direct = _render(stage, catchers=["/Floor"], max_depth=1).aovs["alpha"]
    assert direct[lit].max() == 0 and direct[shadow].min() > 0.98
    assert alpha[ball == 1].min() == 1 and alpha.max() <= 1


def test_what_is_not_a_catcher_looks_as_ever(caught: wavecomb.Picture, tmp_path: Path) -> None:
    whole = _render(_stage(tmp_path))
    ball = _render(_stage(tmp_path), holdouts=["/Floor"]).aovs["alpha"] == 1
    assert ball.any()
    np.testing.assert_array_equal(caught.beauty[ball], whole.beauty[ball])


def test_the_stage_says_it(caught: wavecomb.Picture, tmp_path: Path) -> None:
    said = _render(_stage(tmp_path, "bool primvars:wavecomb:catcher = 1"))
    assert said.aovs["alpha"].tobytes() == caught.aovs["alpha"].tobytes()


def test_every_schedule_gives_the_same_bits(caught: wavecomb.Picture, tmp_path: Path) -> None:
    stage = _stage(tmp_path)
    for schedule in ({"integrator": "reference"}, {"threads": 1, "wave_size": 64, "lanes": 1}):
        other = _render(stage, catchers=["/Floor"], **schedule)
        assert other.aovs["alpha"].tobytes() == caught.aovs["alpha"].tobytes(), schedule
        assert other.beauty.tobytes() == caught.beauty.tobytes(), schedule


def test_the_command_and_sequences(caught: wavecomb.Picture, tmp_path: Path) -> None:
    stage, size = _stage(tmp_path), [str(edge) for edge in SIZE]
    words = ["render", str(stage), "--catcher", "/Floor", "--size", *size, "--spp", str(SPP)]
    run = CliRunner().invoke(main, [*words, "-o", str(tmp_path / "a.exr"), "--quiet"])
    assert run.exit_code == 0, run.output
    layers = read_layers(tmp_path / "a.exr")
    np.testing.assert_array_equal(layers["alpha"][:, :, 0], caught.aovs["alpha"])
    run = CliRunner().invoke(
        main, [*words, "-o", str(tmp_path / "b.#.exr"), "--frames", "1-2", "--quiet"]
    )
    assert run.exit_code == 0, run.output
    for frame in (1, 2):
        layers = read_layers(tmp_path / f"b.{frame}.exr")
        np.testing.assert_array_equal(layers["alpha"][:, :, 0], caught.aovs["alpha"])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--time-limit", "5"], "--time-limit"),
        (["--noise", "0.1"], "--noise"),
        (["--checkpoint", "a.ckpt"], "--checkpoint"),
        (["--deep", "a.exr"], "--deep"),
        (["--allocate", "error"], "--allocate"),
    ],
)
def test_what_does_not_go_with_it(options: list[str], says: str, tmp_path: Path) -> None:
    stage = _stage(tmp_path)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        run = CliRunner().invoke(
            main, ["render", str(stage), "-o", "b.exr", "--catcher", "/Floor", *options]
        )
    assert run.exit_code == 2 and f"shadow catchers cannot be combined with {says}" in run.stderr
    assert not (tmp_path / "b.exr").exists()


def test_a_catcher_that_is_not_there(tmp_path: Path) -> None:
    run = CliRunner().invoke(
        main,
        ["render", str(_stage(tmp_path)), "-o", str(tmp_path / "a.exr"), "--catcher", "/No"],
    )
    assert run.exit_code == 2 and "--catcher /No: there is no such prim" in run.stderr


def test_a_loaded_stage_is_refused(tmp_path: Path) -> None:
    loaded = wavecomb.load(_stage(tmp_path), catchers=["/Floor"])
    assert loaded.catchers == ("/Floor",)
    with pytest.raises(wavecomb.WavecombError, match="take three renders"):
        wavecomb.render(loaded, size=SIZE, spp=1)
