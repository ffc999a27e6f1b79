# SPDX-License-Identifier: Apache-2.0
"""Tests images for compositing: a dome hidden from the camera, and alpha in every file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import wavecomb
from wavecomb.cli import main
from wavecomb.image.files.image import display, read_image, read_layers

pytest.importorskip("wavecomb._core")

STAGE = """#usda 1.0
def DomeLight "Sky" {
    color3f inputs:color = (0.5, 1, 2)
}
def DistantLight "Sun" {
    float inputs:angle = 20
    float3 xformOp:rotateXYZ = (-8, 180, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
def Sphere "Ball" {
    double radius = 1
    color3f[] primvars:displayColor = [(0.8, 0.2, 0.1)]
}
def Camera "Cam" {
    float focalLength = 20
    double3 xformOp:translate = (0, 0, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
SIZE = (24, 16)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("alpha") / "stage.usda"
    path.write_text(STAGE)
    return path


def render(stage: Path, **settings: Any) -> wavecomb.Picture:
    return wavecomb.render(stage, **{"size": SIZE, "spp": 16, "max_depth": 4, **settings})


def test_it_is_the_picture_without_what_is_behind(stage: Path) -> None:
    clear = render(stage, alpha=True)
    whole = render(stage, aovs=["beauty", "alpha"])
    alpha = clear.aovs["alpha"]
    assert np.array_equal(alpha, whole.aovs["alpha"])
    assert (clear.beauty[alpha == 0] == 0).all() and (alpha == 0).sum() > 100
    full = alpha == 1
    assert full.sum() > 20 and np.array_equal(clear.beauty[full], whole.beauty[full])
    assert (clear.beauty <= whole.beauty + 1e-6).all()
    # The difference is the light of the dome and of the sun's disc.
    edge = (alpha > 0) & (alpha < 1)
    assert edge.any() and (clear.beauty[edge] < whole.beauty[edge]).all()


def test_one_picture_whatever_the_schedule(stage: Path) -> None:
    first = render(stage, alpha=True, aovs=["light_groups", "lpe:all=C.*"])
    ways: list[dict[str, Any]] = [
        {"integrator": "reference"}, {"wave_size": 64, "threads": 1}, {"lanes": 1},
    ]  # fmt: skip
    for way in ways:
        other = render(stage, alpha=True, aovs=["light_groups", "lpe:all=C.*"], **way)
        assert np.array_equal(first.beauty, other.beauty)
        assert all(np.array_equal(first.aovs[k], other.aovs[k]) for k in first.aovs)
    assert first.aovs["lpe_all"] == pytest.approx(first.beauty, rel=1e-5, abs=1e-7)


def test_files_have_it_as_their_formats_say(stage: Path, tmp_path: Path) -> None:
    clear = render(stage, alpha=True)
    assert list(clear.layers())[:2] == ["beauty", "A"] and "alpha" not in clear.layers()
    clear.save(tmp_path / "a.exr")
    clear.save(tmp_path / "a.png")
    read = read_layers(tmp_path / "a.exr")
    assert np.array_equal(read["beauty"], clear.beauty)
    assert np.array_equal(read["A"][:, :, 0], clear.aovs["alpha"])
    png = read_image(tmp_path / "a.png")
    assert png.shape == (SIZE[1], SIZE[0], 4)
    alpha = clear.aovs["alpha"]
    assert png[:, :, 3] == pytest.approx(alpha, abs=0.5 / 255 + 1e-6)
    covered = alpha > 0.5
    straight = np.clip(clear.beauty[covered] / alpha[covered][:, None], 0, 1)
    assert png[covered][:, :3] == pytest.approx(straight, abs=0.01)
    split = clear.save(tmp_path / "s.exr", split=True)
    assert tmp_path / "s.exr" in split and "A" in read_layers(tmp_path / "s.exr")
    asked = render(stage, alpha=True, aovs=["beauty", "alpha"])
    assert {"A", "alpha"} <= set(asked.layers())


def test_display_divides_by_it() -> None:
    rgb = np.full((1, 2, 3), 0.25, np.float32)
    codes = display(rgb, alpha=np.array([[0.25, 0.0]], np.float32))
    assert codes[0, 0].tolist() == [255, 255, 255, 64]
    assert codes[0, 1, 3] == 0


def test_the_command_writes_it_whole_and_in_bands(stage: Path, tmp_path: Path) -> None:
    words = ["render", str(stage), "--size", "64", "64", "--spp", "4", "--alpha"]
    for name, more in (("whole", []), ("bands", ["--film-memory", "0.3"])):
        files = ["-o", str(tmp_path / f"{name}.exr"), "--png", str(tmp_path / f"{name}.png")]
        done = CliRunner().invoke(main, [*words, *files, *more])
        assert done.exit_code == 0, done.output
    for ending in ("exr", "png"):
        whole, bands = (read_image(tmp_path / f"{name}.{ending}") for name in ("whole", "bands"))
        assert np.array_equal(whole, bands, equal_nan=True)
