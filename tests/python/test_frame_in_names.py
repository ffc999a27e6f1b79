# SPDX-License-Identifier: Apache-2.0
"""Tests frame numbers in the names of single images, formatted as by usdrecord and husk."""

from __future__ import annotations

from pathlib import Path

import forks
import pytest

from wavecomb.run.frame_names import fill, has_place, matching

pytest.importorskip("wavecomb._core")

STAGE = """#usda 1.0
(
    renderSettingsPrimPath = "/Render/S"
    {start}
)
def DomeLight "dome" {{}}
def Sphere "s" {{}}
def Scope "Render" {{
    def RenderSettings "S" {{
        rel products = [</Render/P>]
        int2 resolution = (4, 4)
    }}
    def RenderProduct "P" {{
        token productName = "p.####.exr"
    }}
}}
"""
TIMES = "startTimeCode = 12\n    endTimeCode = 20"


def stage(folder: Path, start: str = "") -> Path:
    path = folder / "s.usda"
    path.write_text(STAGE.format(start=start))
    return path


@pytest.mark.parametrize(
    ("start", "options", "files"),
    [
        ("", (), ["p.0001.exr"]),
        (TIMES, (), ["p.0012.exr"]),
        (TIMES, ("--frame", "7"), ["p.0007.exr"]),
        ("", ("--frame", "-1.5", "-o", "x.%04d.exr"), ["x.-001.5.exr"]),
        (TIMES, ("-o", "x_$F4.exr", "--png", "x.<frame>.png", "--stats", "${F}.json"),
         ["12.json", "x.12.png", "x_0012.exr"]),
        ("", ("--frame", "7", "-o", "x.##.exr", "--split-aovs", "--checkpoint", "c.#.ckpt"),
         ["c.7.ckpt", "x.07.R.exr"]),
        ("", ("--frames", "3", "-o", "x.##.exr"), ["x.03.exr"]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("sandbox", ["on", "off"])
def test_a_single_image_fills_in_its_frame(
    tmp_path: Path, start: str, options: tuple[str, ...], files: list[str], sandbox: str
) -> None:
    path = stage(tmp_path, start)
    words = ("render", str(path), "--spp", "1", "--quiet", "--aov", "beauty", *options)
    if sandbox == "off":
        words += ("--sandbox", "off")
    done = forks.wavecomb(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = sorted(one.name for one in tmp_path.iterdir() if one != path)
    if "--split-aovs" in options:
        assert found[0] == files[0] and all(one.startswith("x.07.") for one in found[1:])
    else:
        assert found == files


def test_a_checkpoint_goes_on_at_its_frame(tmp_path: Path) -> None:
    path = stage(tmp_path)
    words = ("render", str(path), "--quiet", "-o", "x.####.exr", "--spp")
    done = forks.wavecomb(*words, "1", "--frame", "7", "--checkpoint", "a.ckpt", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (tmp_path / "x.0007.exr").unlink()
    done = forks.wavecomb(*words, "2", "--resume", "a.ckpt", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "x.0007.exr").is_file()


def test_places_of_houdini(tmp_path: Path) -> None:
    for name, filled in (
        ("a.$F4.exr", "a.0012.exr"), ("a.$F.exr", "a.12.exr"), ("a${F3}b.exr", "a012b.exr"),
    ):  # fmt: skip
        assert has_place(name) and fill(name, 12) == filled
        (tmp_path / filled).touch()
        assert matching(str(tmp_path / name))[12.0].endswith(filled)
    for name in ("a.$FF.exr", "$Frank.exr", "cost$.exr", "a${FILE}.exr"):
        assert not has_place(name) and fill(name, 12) == name
