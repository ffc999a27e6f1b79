# SPDX-License-Identifier: Apache-2.0
"""Tests that names of image files in a stage cannot lead out of the chosen folder."""

import os
from pathlib import Path

import pytest
from click.testing import CliRunner

from wavecomb.cli import main

STAGE = """#usda 1.0
(renderSettingsPrimPath = "/Render/S")
def Sphere "Ball" {{
    double radius = 1
}}
def Scope "Render" {{
    def RenderSettings "S" {{
        rel products = [</Render/One>]
        uniform int2 resolution = (4, 4)
    }}
    def RenderProduct "One" {{
        token productName = "{name}"
    }}
}}
"""
BEFORE = b"a picture that someone needs"


def render(stage: Path, *more: object) -> tuple[int, str]:
    arguments = ["render", str(stage), "--spp", "1", "--isolate", "off", *map(str, more)]
    result = CliRunner().invoke(main, arguments)
    assert "Traceback" not in result.output
    return result.exit_code, result.stderr


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A working folder beside a folder with an image of the user."""
    work, mine = tmp_path / "work", tmp_path / "mine"
    work.mkdir()
    mine.mkdir()
    (mine / "best.exr").write_bytes(BEFORE)
    monkeypatch.chdir(work)
    return tmp_path


def stage_named(place: Path, name: str) -> Path:
    path = place / "stage.usda"
    path.write_text(STAGE.format(name=name))
    return path


@pytest.mark.parametrize(
    "name", ["../mine/best.exr", "{mine}/best.exr", "link/best.exr", "best.exr", "a/../../best.exr"]
)
@pytest.mark.parametrize("options", [(), ("--output-dir", "{work}"), ("--frames", "1-2")])
def test_a_product_stays_below_the_folder(place, name, options):
    work, mine = place / "work", place / "mine"
    (work / "link").symlink_to(mine)
    (work / "best.exr").symlink_to(mine / "best.exr")
    options = [option.format(work=work) for option in options]
    if "--frames" in options:
        name = name.replace("best", "best.####")
        (mine / "best.0002.exr").write_bytes(BEFORE)
        (work / "best.0002.exr").symlink_to(mine / "best.0002.exr")
    code, stderr = render(stage_named(place, name.format(mine=mine)), *options)
    assert code == 2
    assert stderr.startswith("error: /Render/One: productName ") and stderr.count("\n") == 1
    assert f"leaves the folder {work}" in stderr
    assert (mine / "best.exr").read_bytes() == BEFORE
    assert set(os.listdir(mine)) <= {"best.exr", "best.0002.exr"}
    assert set(os.listdir(work)) <= {"link", "best.exr", "best.0002.exr"}


def test_what_stays_below_is_written(place):
    (place / "work" / "pictures").mkdir()
    stage = stage_named(place, "pictures/../pictures/one.exr")
    assert render(stage) == (0, "")
    assert (place / "work/pictures/one.exr").stat().st_size > 100
    # An absolute name is allowed below --output-dir.
    stage = stage_named(place, str(place / "mine/two.exr"))
    assert render(stage, "--output-dir", place) == (0, "")
    assert (place / "mine/two.exr").stat().st_size > 100
    # A name given by the user may be anywhere.
    stage = stage_named(place, "../mine/best.exr")
    assert render(stage, "-o", place / "mine/three.exr") == (0, "")
    assert (place / "mine/three.exr").stat().st_size > 100
    assert (place / "mine/best.exr").read_bytes() == BEFORE


def test_the_folder_is_for_names_of_the_stage(place):
    code, stderr = render(stage_named(place, "a.exr"), "-o", "b.exr", "--output-dir", place)
    assert code == 2 and stderr.startswith("error: --output-dir is for pictures that the stage")
