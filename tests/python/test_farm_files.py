# SPDX-License-Identifier: Apache-2.0
"""Tests the list of files that a stage needs, such as layers, textures and IES profiles."""

from __future__ import annotations

import dataclasses
import hashlib
import os
from pathlib import Path

import numpy as np
import pytest
from parts import needs
from test_texture_limit import textured, write_image

from wavecomb.errors import WavecombError
from wavecomb.farm import submit
from wavecomb.farm.job import Task
from wavecomb.farm.rendering import Renderer, check_files, list_files

pytestmark = needs("wavecomb._core", "MaterialX")

LOOK = """<?xml version="1.0"?>
<materialx version="1.38">
  <nodegraph name="NG">
    <image name="img" type="color3"><input name="file" type="filename" value="b.png"/></image>
    <output name="out" type="color3" nodename="img"/>
  </nodegraph>
  <standard_surface name="SR" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="NG" output="out"/>
  </standard_surface>
  <surfacematerial name="M" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="SR"/>
  </surfacematerial>
</materialx>
"""
SUB = """#usda 1.0
def DomeLight "D" {
    asset inputs:texture:file = @sky.png@
}
"""
STAGE = """#usda 1.0
( subLayers = [@sub.usda@] )
def "Looks" (references = @look.mtlx@</MaterialX>) {}
def Material "M" {
    def Shader "T" {
        asset inputs:file = @t.<UDIM>.png@
    }
    def Shader "S" {
        asset inputs:file.timeSamples = {1: @a.png@, 2: @c.png@}
    }
}
def SphereLight "L" {
    asset inputs:shaping:ies:file = @lamp.ies@
}
def "V" (
    variants = { string x = "one" }
    prepend variantSets = "x"
) {
    variantSet "x" = {
        "one" {
            def Shader "A" {
                asset inputs:file = @gone.png@
            }
        }
        "two" {
            def Shader "A" {
                asset inputs:file = @v.png@
            }
        }
    }
}
def "R" (references = @nowhere.usda@) {}
def "N" (references = @nowhere.mtlx@) {}
"""
THERE = {
    *("a.png", "b.png", "c.png", "v.png", "t.1001.png", "t.1002.png", "sky.png"),
    *("lamp.ies", "look.mtlx", "sub.usda", "s.usda"),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in THERE:
        if name.endswith(".png"):
            write_image(tmp_path / name, np.full((4, 4, 3), len(name), np.uint8))
    for name, text in (("lamp.ies", "x"), ("look.mtlx", LOOK), ("sub.usda", SUB)):
        (tmp_path / name).write_text(text)
    (tmp_path / "s.usda").write_text(STAGE)
    return tmp_path


def test_all_files_are_listed(folder: Path) -> None:
    found, lacking = list_files(str(folder / "s.usda"), None, None)
    assert {Path(one.path).name for one in found} == THERE
    for one in found:
        data = Path(one.path).read_bytes()
        assert one.bytes == len(data) and one.mtime_ns == os.stat(one.path).st_mtime_ns
        assert one.sha256 == hashlib.sha256(data).hexdigest()
    missing = " ".join(lacking)
    assert len(lacking) == 3, missing
    for name in ("gone.png does not exist: /V/A.inputs:file", "nowhere.usda", "nowhere.mtlx"):
        assert name in missing


@pytest.mark.parametrize(
    ("name", "why"),
    [("./none.<UDIM>.png", "no tile none.<UDIM>.png is in the folder {0}"),
     ("tex/t.<UDIM>.png", "the folder of its tiles, {0}/tex, does not exist")],
)  # fmt: skip
def test_missing_tiles_name_their_folder(tmp_path: Path, name: str, why: str) -> None:
    stage = tmp_path / "a.usda"
    stage.write_text(f'#usda 1.0\ndef Shader "T" {{\n    asset inputs:file = @{name}@\n}}\n')
    (line,) = list_files(str(stage), None, None)[1]
    assert line.endswith(f"({why.format(tmp_path)}): /T.inputs:file")
    assert line.startswith(f"texture {tmp_path}/")


def test_files_of_other_stages_are_not_listed(folder: Path) -> None:
    """A process caches translated MaterialX files, but lists them per stage."""
    (folder / "other.mtlx").write_text(LOOK.replace("b.png", "a.png"))
    (folder / "one.usda").write_text(
        '#usda 1.0\ndef "Looks" (references = @other.mtlx@</MaterialX>) {}\n'
    )
    first, second = (
        {Path(one.path).name for one in list_files(str(folder / name), None, None)[0]}
        for name in ("one.usda", "s.usda")
    )
    assert first == {"one.usda", "other.mtlx", "a.png"}
    assert second == THERE


def test_variants_decide_what_is_missing(folder: Path) -> None:
    found, lacking = list_files(str(folder / "s.usda"), {"/V{x}": "two"}, None)
    assert {Path(one.path).name for one in found} == THERE and len(lacking) == 2


def test_files_that_differ(tmp_path: Path) -> None:
    """Files are compared by content, unless size and time are equal."""
    for name in ("a.png", "b.png"):
        write_image(tmp_path / name, np.zeros((4, 4, 3), np.uint8))
    stage = tmp_path / "s.usda"
    stage.write_text("#usda 1.0\n" + textured("M", "a.png", 1) + textured("N", "b.png", 1))
    job = submit(stage, tmp_path / "p.exr", size=(4, 4), spp=1).job
    check_files(job)
    os.utime(tmp_path / "a.png")
    check_files(job)
    good = (tmp_path / "a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(good[:-1] + b"x")
    (tmp_path / "b.png").unlink()
    with pytest.raises(WavecombError) as caught:
        check_files(job)
    assert "a.png is not what it was when the job was submitted" in str(caught.value)
    assert "b.png is not on this machine: No such file" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_texture_that_goes_while_a_job_runs(tmp_path: Path) -> None:
    """Instead of drawing a placeholder, the images fail with the name of the missing texture."""
    write_image(tmp_path / "a.png", np.zeros((4, 4, 3), np.uint8))
    stage = tmp_path / "s.usda"
    stage.write_text("#usda 1.0\n" + textured("M", "a.png", 1))
    job = submit(stage, tmp_path / "p.exr", size=(4, 4), spp=1).job
    (tmp_path / "a.png").unlink()
    part = tmp_path / "part.exr"
    with pytest.raises(WavecombError, match=r"texture .*a\.png cannot be read.*--no-strict"):
        Renderer(job).render(Task(0, 0), part, "wavecomb-test")
    assert not part.exists()
    renderer = Renderer(dataclasses.replace(job, strict=False))
    renderer.render(Task(0, 0), part, "wavecomb-test")
    assert part.exists() and "a.png" in " ".join(renderer.warnings)
    with pytest.raises(WavecombError, match=r"a\.png"):
        submit(stage, tmp_path / "q.exr")
