# SPDX-License-Identifier: Apache-2.0
"""Tests commands and code that new users type first, including typical mistakes."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from fake_core import Fake, install
from parts import needs

import wavecomb
from wavecomb.cli import main
from wavecomb.image.files.image import display, read_codes, read_image

ROOT = Path(__file__).resolve().parents[2]
REAL = needs("wavecomb._core", "pxr", "OpenImageIO")


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Fake:
    return install(monkeypatch)


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("stage.usda").write_text("#usda 1.0\n")
    return "stage.usda"


def run(*arguments: Any, columns: int = 100) -> Result:
    words = [str(argument) for argument in arguments]
    return CliRunner().invoke(main, words, terminal_width=columns)


# ---- help ----------------------------------------------------------------------------------------


@REAL
@pytest.mark.parametrize("columns", [60, 100])
def test_help_is_in_groups_and_fits_a_screen(columns: int) -> None:
    text = run("render", "--help", columns=columns).stdout
    titles = re.findall(r"^([A-Z][a-z ]+):$", text, re.MULTILINE)
    groups = ["Most used", "Output", "Quality", "Camera", "Stage", "Layers", "Light transport"]
    assert titles[: len(groups) + 1] == [*groups, "Performance"]
    assert len(text.splitlines()) <= (52 if columns == 100 else 75)
    assert text.index("--size") < text.index("Output:") < text.index("--stats")
    assert "--help-all" in text and "--wave-size" not in text
    body = text.partition("Examples:")[0]
    assert [line for line in body.splitlines() if len(line) > columns] == []


@REAL
def test_all_options_are_in_the_long_help() -> None:
    from wavecomb.cli.command import GROUPS
    from wavecomb.cli.render import render_command

    text = run("render", "--help-all").stdout
    context = render_command.make_context("render", ["x.usd"], resilient_parsing=True)
    options = [one for one in render_command.get_params(context) if hasattr(one, "hidden")]
    for option in options:
        if not option.hidden and "--help" not in option.opts:
            assert option.opts[-1] in text, option.name
    submit = run("farm", "submit", "--help").stdout
    assert "This command:" in submit and "--tiles" in submit
    named = " ".join(f"{common} {rare}" for common, rare in GROUPS.values()).split()
    assert len(named) == len(set(named)), "an option is in one group"
    assert set(named) - {str(one.name) for one in options} <= {"as_json"}
    allowed = {line.split()[0] for line in text.splitlines() if "[x>=0]" in line and "--" in line}
    assert "--min-spp" not in allowed


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ("--samples", "--spp"), ("--resolution", "--size"), ("--width", "--size"),
        ("--output-file", "--output"), ("--smaples", "--spp"),
    ],
)  # fmt: skip
def test_names_of_other_programs_lead_to_ours(fake: Fake, given: str, wanted: str) -> None:
    result = run("render", "x.usd", given, "4")
    assert result.exit_code == 2
    assert f"did you mean {wanted}" in result.stderr


# ---- sizes and files -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "size"),
    [
        (["--size", "64x36"], (64, 36)), (["--size", "64", "36"], (64, 36)),
        (["--size=64x36"], (64, 36)), (["--size", "50%"], (300, 300)), ([], (600, 600)),
    ],
)  # fmt: skip
def test_spellings_of_a_size(
    fake: Fake, stage: str, words: list[str], size: tuple[int, int]
) -> None:
    result = run("render", stage, "-o", "a.exr", "--spp", 1, *words)
    assert result.exit_code == 0, result.output
    assert (fake.rendered[0]["width"], fake.rendered[0]["height"]) == size


@pytest.mark.parametrize("size", ["64", "64x", "0%", "x%"])
def test_a_size_that_is_none(fake: Fake, stage: str, size: str) -> None:
    result = run("render", stage, "-o", "a.exr", "--size", size)
    assert result.exit_code == 2
    assert "such as 640x360, or a percentage, such as 50%" in result.stderr


@pytest.mark.parametrize("words", [["-o", "new/a.png"], ["--png", "new/a.png"]])
def test_a_png_alone(fake: Fake, stage: str, words: list[str]) -> None:
    result = run("render", stage, "--size", "8x6", *words)
    assert result.exit_code == 0, result.output
    assert os.listdir("new") == ["a.png"], "the folder is made, and nothing else is written"
    assert read_image("new/a.png").shape == (6, 8, 3)
    assert "wrote new/a.png" in result.stdout


def test_options_of_an_exr_need_one(fake: Fake, stage: str) -> None:
    result = run("render", stage, "-o", "a.png", "--half")
    assert result.exit_code == 2 and "give -o FILE.exr" in result.stderr
    result = run("render", stage, "-o", "a.png", "--png", "b.png")
    assert result.exit_code == 2 and "--png b.png" in result.stderr


# ---- OpenColorIO ---------------------------------------------------------------------------------

CONFIG = """ocio_profile_version: 2
roles: {default: linear, scene_linear: linear}
displays:
  sRGB:
    - !<View> {name: AgX, colorspace: agx}
    - !<View> {name: Plain, colorspace: linear}
  Cinema:
    - !<View> {name: Film, colorspace: linear}
colorspaces:
  - !<ColorSpace> {name: linear, aliases: [lin_rec709], isdata: false}
  - !<ColorSpace>
      name: agx
      from_scene_reference: !<MatrixTransform> {matrix: [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 1]}
"""  # noqa: E501


@REAL
def test_png_through_a_view(
    fake: Fake, stage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("config.ocio").write_text(CONFIG)
    monkeypatch.setenv("OCIO", str(tmp_path / "config.ocio"))
    grey = np.full((2, 2, 3), 0.5, np.float32)
    assert display(grey, tone_map="ocio:AgX")[0, 0, 0] == 64
    assert display(grey, tone_map="ocio:Film|Cinema", exposure=-1.0)[0, 0, 0] == 64
    result = run("render", stage, "-o", "a.png", "--size", "8x6", "--ocio-view", "agx")
    assert result.exit_code == 0, result.output
    run("render", stage, "-o", "b.png", "--size", "8x6", "--ocio-view", "Plain")
    agx, plain = read_codes("a.png").astype(int), read_codes("b.png").astype(int)
    assert (np.abs(2 * agx - plain) <= 1)[plain < 255].all() and (plain != agx).any()
    for words, says in (
        (["--ocio-view", "Filmic"], "there are AgX, Plain"),
        (["--ocio-view", "AgX", "--ocio-display", "TV"], "there are sRGB, Cinema"),
        (["--ocio-display", "sRGB"], "is for --ocio-view"),
        (["--ocio-view", "AgX", "--tone-map", "neutral"], "give one"),
    ):
        result = run("render", stage, "-o", "a.png", *words)
        assert result.exit_code == 2 and says in result.stderr, result.stderr


# ---- summary -------------------------------------------------------------------------------------


def test_the_summary_is_short_and_verbose_has_the_rest(fake: Fake, stage: str) -> None:
    words = ("render", stage, "-o", "a.exr", "--size", "8x6", "--spp", 4)
    short = run(*words).stdout.splitlines()
    starts = [line.split()[0] for line in short]
    assert starts[:3] == ["time", "samples", "memory"] and starts[-1] == "wrote"
    assert "load" in short[0] and "writing" in short[0]
    assert "4 per pixel" in short[1]
    assert "phase" not in "\n".join(short)
    assert "rays" in run(*words, "--verbose").stdout


def test_progress_at_60_columns_has_a_bar_and_whole_seconds() -> None:
    import io

    from rich.console import Console

    from wavecomb.run.progress import ProgressBar

    text = io.StringIO()
    console = Console(file=text, force_terminal=True, width=60)
    status = {
        "samples_done": 500, "samples_total": 1000, "resumed_samples": 0, "rays": 2000, "passes": 2,
        "active_pixels": 10, "seconds": 12.3, "error": None,
    }  # fmt: skip
    with ProgressBar(console) as bar:
        bar.show(status)
    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text.getvalue())
    assert "13 s left" in shown and "50%" in shown and shown.count("━") >= 10


def test_work_after_the_render_is_named() -> None:
    import io

    from rich.console import Console

    from wavecomb.cli.reporting import Summary

    text = io.StringIO()
    summary = Summary(Console(file=text, force_terminal=True, width=60))
    for what in ("denoising", "writing"):
        with summary.working(what):
            pass
        assert what in text.getvalue()


# ---- Python --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keywords", "says"),
    [
        ({"size": "64x36"}, "size='64x36': must be width and height in pixels, such as size=("),
        ({"size": 64}, "size=64: must be"),
        ({"width": 64}, "width: is no keyword; did you mean size=(640, 360)?"),
        ({"aovs": "depth"}, "aovs='depth': must be a list of names, such as aovs=["),
        ({"samples": 1}, "samples: is no keyword; did you mean spp=64?"),
        ({"smaples": 4}, "smaples: is no keyword; did you mean spp=64?"),
        ({"spp": 1.5}, "spp=1.5: must be a whole number"),
        ({"max_depth": "8"}, "max_depth='8': must be a whole number, such as max_depth=8"),
        ({"spp": 0}, "0 samples per pixel"),
        ({"max_depth": -1}, "max_depth=-1: must be from 0 to 4096, such as max_depth=8"),
        ({"max_depth": 4097}, "max_depth=4097: must be from 0 to 4096, such as max_depth=8"),
        ({"seed": 2**32}, "seed=4294967296: must be from 0 to 4294967295, such as seed=0"),
        ({"noise": 1.5}, "noise=1.5: must be from 0 to 1, such as noise="),
        ({"wave_size": 8}, "wave_size=8: must be from 64 to 1048576, such as wave_size="),
    ],
)
@REAL
def test_mistakes_are_one_error_before_any_work(keywords: dict[str, Any], says: str) -> None:
    with pytest.raises(wavecomb.Error) as caught:
        wavecomb.render("no such file.usd", **keywords)
    assert says in str(caught.value)


@REAL
def test_every_error_is_a_wavecomb_error(tmp_path: Path) -> None:
    from wavecomb import _core

    assert issubclass(_core.Error, wavecomb.Error) and issubclass(_core.Error, ValueError)
    with pytest.raises(wavecomb.Error):
        wavecomb.SceneBuilder().add_light("sun", np.eye(4))
    with pytest.raises(wavecomb.Error, match="no such file"):
        wavecomb.load("no such file.usd")
    with pytest.raises(wavecomb.Error, match="is nothing to read"):
        wavecomb.load(5)  # type: ignore[arg-type]


@REAL
def test_a_first_image_in_three_lines() -> None:
    image = wavecomb.render(wavecomb.scenes.cornell(), size=(32, 24), spp=4)
    assert np.asarray(image) is image.beauty
    assert np.asarray(image, np.float64).shape == (24, 32, 3)
    assert np.array(image, copy=True) is not image.beauty
    assert image.beauty.mean() > 0.01


@REAL
def test_a_stage_in_memory_with_unsaved_edits(tmp_path: Path) -> None:
    from pxr import UsdGeom

    stage = wavecomb.scenes.cornell()
    target = stage.GetEditTarget()
    loaded = wavecomb.load(stage)
    text = repr(loaded)
    assert "\n" not in text and len(text) < 160 and "30 triangles, 4 materials, 1 light," in text
    before = wavecomb.render(stage, size=(32, 24), spp=4)
    again = wavecomb.render(loaded, size=(32, 24), spp=4)
    assert wavecomb.compare(before, again).equal
    UsdGeom.Imageable(stage.GetPrimAtPath("/World/Objects/TallBlock")).MakeInvisible()
    after = wavecomb.render(stage, size=(32, 24), spp=4)
    assert not wavecomb.compare(before, after).equal
    assert stage.GetEditTarget() == target
    file = tmp_path / "a.usda"
    stage.Export(str(file))
    assert wavecomb.compare(after, wavecomb.render(file, size=(32, 24), spp=4)).equal
    opened = wavecomb.usd.open_stage(str(file))
    assert wavecomb.compare(after, wavecomb.render(opened, size=(32, 24), spp=4)).equal


@REAL
def test_a_renderer_is_edited_by_prim() -> None:
    renderer = wavecomb.Renderer(wavecomb.scenes.cornell(), size=(32, 24))
    assert "/World/Looks/Red" in renderer.materials
    first = renderer.render(spp=4)
    light = next(iter(renderer.lights))
    moved = np.array(renderer.scene.light(0)["transform"])
    moved[3, 0] += 100.0
    for change in (
        {"materials": {"/World/Looks/Red": {"base_color": (0.1, 0.1, 0.9)}}},
        {"lights": {light: {"color": (1.0, 2.0, 8.0)}}},
        {"lights": {light: {"transform": moved}}},
        {"moves": {"/World/Objects/TallBlock": translation(40.0, 20.0, 60.0)}},
        {"camera": {"lens_radius": 5.0, "focus_distance": 900.0}},
    ):
        before = renderer.render(spp=4)
        renderer.edit(**change)
        image = renderer.render(spp=4)
        assert not wavecomb.compare(before, image).equal, change
        assert image.stats["seconds"]["build"] == 0.0
    fresh = wavecomb.render(renderer.scene, size=(32, 24), spp=4)
    assert wavecomb.compare(image, fresh).equal
    assert not wavecomb.compare(first, image).equal
    with pytest.raises(wavecomb.Error, match="no material /World/Looks/Rad; there are /World/"):
        renderer.edit(materials={"/World/Looks/Rad": {}})
    with pytest.raises(wavecomb.Error, match="no object or light is at or below prim '/World/No'"):
        renderer.edit(moves={"/World/No": np.eye(4)})
    with pytest.raises(wavecomb.Error, match="4 x 4"):
        renderer.edit(moves={"/World/Objects": [1.0, 2.0]})
    with pytest.raises(wavecomb.Error, match="smaples"):
        renderer.render(smaples=4)


def translation(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[3, :3] = x, y, z
    return matrix


MOVED = """#usda 1.0
( upAxis = "Y" )
def Xform "Set" {
    double3 xformOp:translate = (%s, 0, %s)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Camera "Camera" {
        float focalLength = 35
        double3 xformOp:translate = (0, 1, 9)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Plane "Floor" {
        double width = 9
        double length = 9
        token axis = "Y"
    }
    def Sphere "Ball" {
        double radius = 1
        double3 xformOp:translate = (%s, 1, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "Lamp" {
        double3 xformOp:translate = (%s, 4, 1)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def SphereLight "Light" {
            float inputs:intensity = 40
        }
    }
}
"""


@REAL
@pytest.mark.parametrize("at", [0.0, 5e8])
def test_a_moved_prim_is_where_the_stage_would_put_it(tmp_path: Path, at: float) -> None:
    here, there = tmp_path / "here.usda", tmp_path / "there.usda"
    here.write_text(MOVED % (at, -at, 0, 0))
    there.write_text(MOVED % (at, -at, 1.5, -2))
    renderer = wavecomb.Renderer(here, size=(48, 36))
    before = renderer.render(spp=64)
    moves = {"/Set/Ball": translation(1.5, 0, 0), "/Set/Lamp": translation(-2, 0, 0)}
    renderer.edit(moves=moves)
    image, expected = renderer.render(spp=64), wavecomb.render(there, size=(48, 36), spp=64)
    difference = np.abs(np.asarray(image) - np.asarray(expected))
    assert difference.mean() < 1e-3 * np.asarray(expected).mean(), "rounding only"
    assert np.abs(np.asarray(before) - np.asarray(expected)).mean() > 1e-2
    renderer.edit(moves=dict.fromkeys(moves, np.eye(4)))
    difference = np.abs(np.asarray(renderer.render(spp=64)) - np.asarray(before))
    assert difference.mean() < 1e-3 * np.asarray(before).mean()


@REAL
def test_the_keywords_for_type_checkers_are_the_real_ones() -> None:
    from wavecomb.arguments import keywords as known

    stub = ast.parse(Path(wavecomb.__file__).with_name("keywords.pyi").read_text())
    classes = [one for one in stub.body if isinstance(one, ast.ClassDef)]
    assert [one.name for one in classes][::2] == ["StageKeywords", "SettingKeywords"]
    rows = [row for one in classes[::2] for row in one.body if isinstance(row, ast.AnnAssign)]
    assert {ast.unparse(row.target) for row in rows} == known()


@needs("mypy")
@pytest.mark.slow
def test_type_checkers_find_misspelt_keywords(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(
        "import wavecomb\n"
        "wavecomb.render('a.usd', seed=3, camera='/Cam', guiding='on')\n"
        "wavecomb.render('a.usd', smaples=4)\n"
        "wavecomb.render('a.usd', guiding='maybe')\n"
        "wavecomb.load('a.usd', frme=3)\n"
    )
    done = subprocess.run(
        [
            sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"),
            "--cache-dir", str(ROOT / ".mypy_cache"), str(program),
        ],
        capture_output=True, text=True, cwd=ROOT, check=False,
    )  # fmt: skip
    lines = {int(found) for found in re.findall(r"program\.py:(\d+): error", done.stdout)}
    assert lines == {3, 4, 5}, done.stdout


@pytest.mark.slow
@REAL
@pytest.mark.parametrize("name", ["edit_and_render.py", "no_usd.py", "stage_in_memory.py"])
def test_the_examples_run(name: str, tmp_path: Path) -> None:
    text, count = re.subn(r"spp=\d+", "spp=1", (ROOT / "examples" / name).read_text("utf-8"))
    assert count > 0, "a single sample suffices here"
    program = tmp_path / name
    program.write_text(text, "utf-8")
    subprocess.run([sys.executable, str(program)], cwd=tmp_path, check=True)
    assert any(file.suffix == ".png" for file in tmp_path.iterdir())
