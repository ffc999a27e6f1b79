# SPDX-License-Identifier: Apache-2.0
"""Files that a stage needs: layers, textures, tiles, profiles, images inside MaterialX files."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import forks
import numpy as np
import pytest
from parts import needs
from test_texture_limit import textured, write_image

from wavecomb.errors import WavecombError
from wavecomb.farm import submit
from wavecomb.farm.assets import differences, list_assets
from wavecomb.farm.folder import TODO
from wavecomb.farm.rendering import Absent, Renderer

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
    found = list_assets(str(folder / "s.usda"))
    assert {Path(one["path"]).name for one in found["files"]} == THERE
    for one in found["files"]:
        data = Path(one["path"]).read_bytes()
        assert one["bytes"] == len(data)
        assert one["sha256"] == hashlib.sha256(data).hexdigest()
    missing = " ".join(found["missing"])
    assert len(found["missing"]) == 3, missing
    for name in ("gone.png is not there: /V/A.inputs:file", "nowhere.usda", "nowhere.mtlx"):
        assert name in missing


def test_files_of_other_stages_are_not_listed(folder: Path) -> None:
    """A process keeps what it translated: each stage has its own of it."""
    (folder / "other.mtlx").write_text(LOOK.replace("b.png", "a.png"))
    (folder / "one.usda").write_text(
        '#usda 1.0\ndef "Looks" (references = @other.mtlx@</MaterialX>) {}\n'
    )
    first, second = (
        {Path(one["path"]).name for one in list_assets(str(folder / name))["files"]}
        for name in ("one.usda", "s.usda")
    )
    assert first == {"one.usda", "other.mtlx", "a.png"}
    assert second == THERE


def test_the_command_lists_them(folder: Path) -> None:
    words = ["farm", "assets", str(folder / "s.usda")]
    done = forks.wavecomb(*words, "--json", "--variant", "/V{x}=two")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert {Path(one["path"]).name for one in found["files"]} == THERE
    assert len(found["missing"]) == 2
    done = forks.wavecomb(*words)
    assert done.returncode == 2 and "3 files are missing" in done.stderr
    assert len(done.stdout.splitlines()) == len(THERE)


def test_files_that_differ(folder: Path) -> None:
    files = list_assets(str(folder / "s.usda"))["files"]
    assert differences(files, str) == []
    (folder / "a.png").write_bytes(b"other")
    (folder / "sky.png").unlink()
    said = differences(files, str)
    assert len(said) == 2 and "a.png is not what it was" in said[0]
    assert "sky.png is not on this machine: No such file" in said[1]


def test_a_texture_that_goes_while_a_job_runs(tmp_path: Path) -> None:
    """Fails its pictures by name, at once: no checker, no second try."""
    write_image(tmp_path / "a.png", np.zeros((4, 4, 3), np.uint8))
    stage = tmp_path / "s.usda"
    stage.write_text("#usda 1.0\n" + textured("M", "a.png", 1))
    jobs = {
        strict: submit(
            stage, tmp_path / "p.exr", job=tmp_path / str(strict), size=(4, 4), spp=1, strict=strict
        )
        for strict in (True, False)
    }
    (tmp_path / "a.png").unlink()
    task = jobs[True].entries(TODO)[0].task
    with pytest.raises(Absent, match=r"texture .*a\.png cannot be read"):
        Renderer(jobs[True]).do(task)
    assert not (tmp_path / "p.exr").exists()
    Renderer(jobs[False]).do(task)
    assert (tmp_path / "p.exr").exists()
    with pytest.raises(WavecombError, match=r"a\.png"):
        submit(stage, tmp_path / "q.exr")
