# SPDX-License-Identifier: Apache-2.0
"""Tests that errors are found before loading if possible, and that messages give advice."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import forks
import numpy as np
import pytest
from parts import only_where

pytest.importorskip("wavecomb._core")
import wavecomb
from wavecomb.arguments import SYNONYMS
from wavecomb.errors import WavecombError
from wavecomb.image.files import output_file
from wavecomb.image.files.exr import write_exr

STAGE = '#usda 1.0\ndef Sphere "Ball" {}\n'


def refused(done: subprocess.CompletedProcess[str], *said: str) -> None:
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
    for one in said:
        assert one in done.stderr, done.stderr
    assert "internal" not in done.stderr


# ---- before loading ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--spp", "0"), "0 samples per pixel"),
        (("--size", "0", "10"), "size 0 x 10"),
        (("--wave-size", "3"), "wave_size"),
        (("-o", "a.jpg"), "a.jpg: the name must end in .exr"),
        (("-o", "/proc/gone/a.exr"), "/proc/gone/a.exr: cannot be written"),
        (("--png", "b.exr"), "b.exr: the name must end in .png"),
    ],
)
def test_checks_that_need_no_stage_come_first(
    tmp_path: Path, options: tuple[str, ...], said: str
) -> None:
    """Options are checked before loading, so the missing stage is not reported instead."""
    output = () if "-o" in options else ("-o", "a.exr")
    for command in (("render",), ("farm", "submit")):
        done = forks.wavecomb(*command, "gone.usda", *output, *options, cwd=tmp_path)
        refused(done, said)
        assert "gone.usda" not in done.stderr


def test_programs_are_told_before_loading_too(tmp_path: Path) -> None:
    for options, said in (({"spp": 0}, "0 samples"), ({"size": (0, 10)}, "size 0 x 10")):
        with pytest.raises(WavecombError, match=said):
            wavecomb.render(tmp_path / "gone.usda", **options)  # type: ignore[arg-type]


# ---- names ---------------------------------------------------------------------------------------

NOT_TEXT = b"a\xff\xfe"


@pytest.mark.parametrize(
    "words",
    [
        (b"render", NOT_TEXT + b".usda", b"-o", b"a.exr"),
        (b"render", b"a.usda", b"-o", NOT_TEXT + b".exr"),
        (b"render", b"a.usda", b"-o", b"a.exr", b"--png", NOT_TEXT + b".png"),
        (b"render", b"a.usda", b"-o", b"a.exr", b"--camera", b"/" + NOT_TEXT),
        (b"info", NOT_TEXT + b".usda"),
        (b"compare", NOT_TEXT + b".exr", b"b.exr"),
        (b"sheet", NOT_TEXT, b"-o", b"a.png"),
        (NOT_TEXT,),
    ],
)
def test_arguments_that_are_not_utf_8(tmp_path: Path, words: tuple[bytes, ...]) -> None:
    (tmp_path / "a.usda").write_text(STAGE)
    (tmp_path / os.fsdecode(NOT_TEXT + b".usda")).write_text(STAGE)
    done = subprocess.run(
        [sys.executable, "-m", "wavecomb", *words], cwd=tmp_path, capture_output=True, text=True,
        timeout=100,
    )  # fmt: skip
    refused(done, "a\\xff\\xfe", "is not UTF-8")
    assert sorted(os.listdir(os.fsencode(tmp_path))) == [b"a.usda", NOT_TEXT + b".usda"]


def test_a_folder_whose_name_is_not_utf_8(tmp_path: Path) -> None:
    """Relative file names in a folder whose name is not UTF-8 work, or cause one error line."""
    folder = tmp_path / os.fsdecode(NOT_TEXT)
    folder.mkdir()
    (folder / "a.usda").write_text(STAGE)
    words = ("render", "a.usda", "-o", "a.exr", "--size", "4", "4", "--spp", "1", "--quiet")
    done = forks.wavecomb(*words, cwd=folder)
    if done.returncode == 0:
        assert (folder / "a.exr").is_file() and done.stderr == ""
    else:
        refused(done, "not UTF-8")


def test_programs_and_names_that_are_not_utf_8(tmp_path: Path) -> None:
    bad = tmp_path / os.fsdecode(NOT_TEXT + b".usda")
    with pytest.raises(WavecombError, match="is not UTF-8"):
        wavecomb.load(bad)
    with pytest.raises(OSError, match="is not UTF-8"):
        write_exr(bad.with_suffix(".exr"), {"beauty": np.zeros((2, 2, 3), np.float32)})


@pytest.mark.parametrize(
    "options",
    [("-o", ".exr"), ("-o", "a.exr", "--png", ".png"), ("-o", "a.exr", "--deep", "./.exr")],
)
def test_a_name_that_is_only_an_ending(tmp_path: Path, options: tuple[str, ...]) -> None:
    (tmp_path / "a.usda").write_text(STAGE)
    done = forks.wavecomb("render", "a.usda", *options, cwd=tmp_path)
    refused(done, "is only an ending; give a name before it, such as image.")
    assert os.listdir(tmp_path) == ["a.usda"]


# ---- suggestions ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "wanted"),
    [("--smaples", "--spp"), ("--samples", "--spp"), ("--resolution", "--size"),
     ("--outptu", "--output"), ("--bounces", "--max-depth"), ("--cmaera", "--camera"),
     ("--layers", "--aov")],
)  # fmt: skip
def test_a_misspelt_option_has_a_suggestion(given: str, wanted: str) -> None:
    done = forks.wavecomb("render", "a.usda", given, "3")
    refused(done, f"No such option '{given}'; did you mean", wanted)
    assert not forks.wavecomb("render", "a.usda", "--qqqqqqq").stderr.count("did you mean")


def test_synonyms_stand_for_options_that_there_are() -> None:
    import click

    from wavecomb.cli.group import options_of
    from wavecomb.cli.render import render_command

    options = {name.lstrip("-") for name in options_of(click.Context(render_command))}
    words = {word.replace("_", "-"): one.replace("_", "-") for word, one in SYNONYMS.items()}
    assert set(words.values()) <= options
    assert not options & words.keys()


@pytest.mark.parametrize(
    ("given", "wanted"),
    [("samples", "spp=64"), ("resolution", "size=(640, 360)"), ("layers", "aovs="),
     ("aov", "aovs="), ("ray_depth", "max_depth=8"), ("cores", "threads"), ("smaples", "spp=64")],
)  # fmt: skip
def test_a_misspelt_keyword_has_a_suggestion(given: str, wanted: str) -> None:
    """Suggestions for keywords use the same synonyms as the command line."""
    with pytest.raises(wavecomb.Error, match="is no keyword; did you mean") as caught:
        wavecomb.render("gone.usda", **{given: 3})
    assert wanted in str(caught.value)


# ---- the stage -----------------------------------------------------------------------------------

TEXTURED = """#usda 1.0
def Material "M" {
    token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>
        token outputs:surface
    }
    def Shader "T" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @FOLDERwood.<UDIM>.png@
        float3 outputs:rgb
    }
}
def Mesh "Quad" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0)] (interpolation = "vertex")
    rel material:binding = </M>
}
def Mesh "Plain" {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    color3f[] primvars:displayColor = [(0, 0, 1), (1, 0, 0)] (interpolation = "vertex")
}
"""


@pytest.mark.parametrize(
    ("folder", "said"),
    [("./", "no tile wood.<UDIM>.png is in the folder {0}"),
     ("", "no tile wood.<UDIM>.png is in the folder {0}"),
     ("./tex/", "the folder of its tiles, {0}/tex, does not exist"),
     ("tex/", "the folder of its tiles, {0}/tex, does not exist")],
)  # fmt: skip
def test_messages_about_stages_name_folders_and_counts(
    tmp_path: Path, folder: str, said: str
) -> None:
    path = tmp_path / "a.usda"
    path.write_text(TEXTURED.replace("FOLDER", folder))
    lines = "\n".join(one.line() for one in wavecomb.load(path).report.warnings)
    assert said.format(tmp_path) in lines
    assert (
        "'displayColor' (vertex) has the wrong number of values, 2 where the mesh needs 3" in lines
    )


# ---- a full disk ---------------------------------------------------------------------------------

FULL = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))
import numpy as np
from wavecomb.errors import WavecombError
from wavecomb.image.files.exr import write_exr
from wavecomb.image.files.image import write_png
noise = np.random.default_rng(1).random((300, 300, 3), np.float32)
for write, name in ((lambda: write_exr(sys.argv[1] + "/a.exr", {"beauty": noise}), "a.exr"),
                    (lambda: write_png(sys.argv[1] + "/a.png", noise), "a.png")):
    try:
        write()
    except OSError as error:
        print(error)
    else:
        print("written")
"""


@only_where(sys.platform == "linux", "limits of files are as Linux has them")
def test_a_file_that_the_system_cuts_short_says_why(tmp_path: Path) -> None:
    done = forks.run(["-c", FULL, str(tmp_path)])
    assert done.returncode == 0, done.stderr
    for line, name in zip(done.stdout.splitlines(), ("a.exr", "a.png"), strict=True):
        assert line == f"{tmp_path}/{name}: cannot be written: File too large"
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Writes to ``/dev/full`` fail as on a full disk."""
    part: Any = "/dev/full"
    assert output_file.why_not_written(part, "Write error").startswith("the disk is full")
    good = tmp_path / "a"
    good.write_bytes(b"")
    assert output_file.why_not_written(good, "Write error") == "Write error"
