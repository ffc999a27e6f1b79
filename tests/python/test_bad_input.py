# SPDX-License-Identifier: Apache-2.0
"""Tests that bad input causes one clear error line, without traceback, crash or partial file."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import forks
import numpy as np
import pytest

from wavecomb.image.files.image import read_layers

pytest.importorskip("wavecomb._core")

QUAD = "[(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)]"
CAMERA = """
    def Camera "Cam" {
        float focalLength = 35
        float horizontalAperture = 35
        float verticalAperture = 35
        double3 xformOp:translate = (0, 4, 0)
        float xformOp:rotateX = -90
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
    }
"""
LIGHT = """
    def DistantLight "Sun" {
        float inputs:intensity = 3
        bool inputs:normalize = 1
        float xformOp:rotateX = -60
        uniform token[] xformOpOrder = ["xformOp:rotateX"]
    }
"""
GROUND = """
    def Mesh "Ground" {
        point3f[] points = [(-9, -1, -9), (-9, -1, 9), (9, -1, 9), (9, -1, -9)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        uniform token subdivisionScheme = "none"
    }
"""


def mesh(points: str = QUAD, counts: str = "[4]", indices: str = "[0, 3, 2, 1]") -> str:
    return f"""
    def Mesh "Bad" {{
        point3f[] points = {points}
        int[] faceVertexCounts = {counts}
        int[] faceVertexIndices = {indices}
        uniform token subdivisionScheme = "none"
    }}
"""


def write_stage(path: Path, body: str) -> Path:
    header = '#usda 1.0\n(\n    defaultPrim = "World"\n    upAxis = "Y"\n)\n'
    path.write_text(f'{header}def Xform "World" {{\n{body}\n}}\n')
    return path


def wavecomb(*arguments: object, timeout: float = 60) -> subprocess.CompletedProcess[str]:
    done = forks.wavecomb(*arguments, timeout=timeout)
    assert "Traceback" not in done.stderr
    assert done.returncode in (0, 1, 2), done.stderr
    return done


def render(stage: Path, out: Path, *options: object) -> subprocess.CompletedProcess[str]:
    return wavecomb("render", stage, "-o", out, "--size", 24, 24, "--spp", 4, *options)


def refused(done: subprocess.CompletedProcess[str], folder: Path, *names: str) -> str:
    """Asserts exit code 2, one error line with all ``names``, and no image. Returns the line."""
    assert done.returncode == 2, done.stderr
    errors = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1, done.stderr
    for name in names:
        assert name in errors[0]
    assert not list(folder.glob("*.exr"))
    assert not list(folder.glob(".*"))
    return errors[0]


def rendered(done: subprocess.CompletedProcess[str], out: Path, *names: str) -> np.ndarray:
    """Asserts exit code 0 and a warning with all ``names``. Returns the finite, nonblack image."""
    assert done.returncode == 0, done.stderr
    warnings = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
    assert len(warnings) == len(done.stderr.splitlines())
    assert not names or any(all(name in line for name in names) for line in warnings), done.stderr
    beauty = read_layers(out)["beauty"]
    assert np.isfinite(beauty).all()
    assert beauty.max() > 0
    return beauty


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out.exr"


def test_good_stage_has_nothing_to_say(tmp_path: Path, out: Path) -> None:
    stage = write_stage(tmp_path / "s.usda", mesh() + CAMERA + LIGHT)
    done = render(stage, out)
    assert done.stderr == ""
    rendered(done, out)
    assert "wrote" in done.stdout


def test_missing_stage(tmp_path: Path, out: Path) -> None:
    refused(render(tmp_path / "no.usda", out), tmp_path, "no.usda")


@pytest.mark.parametrize("name", ["s.usda", "s.usdc", "s.usd", "s.usdz", "s.txt"])
@pytest.mark.parametrize(
    "content", [b"", b"hello\n", b"#usda 1.0\ndef {", b"PXR-USDC" + b"\xff" * 99]
)
def test_no_usd_file(tmp_path: Path, out: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    refused(render(tmp_path / name, out), tmp_path, name)


def test_folder_as_stage(tmp_path: Path, out: Path) -> None:
    (tmp_path / "folder.usd").mkdir()
    refused(render(tmp_path / "folder.usd", out), tmp_path, "folder.usd")


def test_empty_stage(tmp_path: Path, out: Path) -> None:
    (tmp_path / "s.usda").write_text("#usda 1.0\n")
    done = render(tmp_path / "s.usda", out)
    rendered(done, out)
    assert "note: nothing to draw" in done.stdout


def test_mesh_without_points_is_named(tmp_path: Path, out: Path) -> None:
    stage = write_stage(tmp_path / "s.usda", mesh(points="[]") + GROUND + CAMERA + LIGHT)
    done = render(stage, out)
    rendered(done, out)
    assert "/World/Bad" in done.stdout + done.stderr


def test_no_camera_and_no_light_still_give_a_picture(tmp_path: Path, out: Path) -> None:
    stage = write_stage(tmp_path / "s.usda", mesh())
    done = render(stage, out)
    beauty = rendered(done, out)
    assert (beauty.mean(axis=2) > 0).mean() > 0.05


def test_missing_texture_is_seen(tmp_path: Path, out: Path) -> None:
    material = """
    def Material "Paint" {
        token outputs:surface.connect = </World/Paint/Surface.outputs:surface>
        def Shader "Surface" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </World/Paint/Map.outputs:rgb>
            token outputs:surface
        }
        def Shader "Map" {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @./no.png@
            float3 outputs:rgb
        }
    }
    def Mesh "Bad" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        rel material:binding = </World/Paint>
        point3f[] points = [(-9, 0, -9), (9, 0, -9), (9, 0, 9), (-9, 0, 9)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 3, 2, 1]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
        uniform token subdivisionScheme = "none"
    }
"""
    stage = write_stage(tmp_path / "s.usda", material + CAMERA + LIGHT)
    beauty = rendered(render(stage, out), out, "no.png")
    assert (beauty.max(axis=2) > 0.01).all()


@pytest.mark.parametrize(
    "bad",
    [
        mesh(points=QUAD.replace("(1, 0, 1)", "(nan, 0, 1)")),
        mesh(points=QUAD.replace("(1, 0, 1)", "(inf, 0, 1)")),
        mesh(points=QUAD.replace("(1, 0, 1)", "(1, -inf, 1)")),
        mesh(indices="[0, 3, 2, 4]"),
        mesh(indices="[0, 3, 2, -1]"),
        mesh(indices="[0, 3, 2, 2000000000]"),
        mesh(indices="[0, 3, 2]"),
        mesh(counts="[5]"),
        mesh(counts="[-4]"),
        mesh(counts="[2147483647]"),
    ],
    ids=[
        "nan", "inf", "minus inf", "index one past", "negative index", "huge index",
        "too few indices", "count too large", "negative count", "huge count",
    ],
)  # fmt: skip
def test_broken_mesh_is_named(tmp_path: Path, out: Path, bad: str) -> None:
    stage = write_stage(tmp_path / "s.usda", bad + GROUND + CAMERA + LIGHT)
    done = render(stage, out)
    if done.returncode == 0:
        rendered(done, out, "/World/Bad")
    else:
        refused(done, tmp_path, "/World/Bad")


@pytest.mark.parametrize(
    "bad",
    [
        mesh(indices="[0, 0, 0, 0]"),
        mesh(indices="[0, 1, 0, 1]"),
        mesh(points="[(0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)]"),
        mesh(points="[(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)]"),
        mesh(counts="[0]", indices="[]"),
        mesh(counts="[2, 1]", indices="[0, 1, 2]"),
    ],
    ids=["one point", "two points", "coincident", "collinear", "count 0", "edges"],
)
def test_faces_without_area_do_no_harm(tmp_path: Path, out: Path, bad: str) -> None:
    stage = write_stage(tmp_path / "s.usda", bad + GROUND + CAMERA + LIGHT)
    rendered(render(stage, out), out)


def test_singular_transform(tmp_path: Path, out: Path) -> None:
    flat = """
    def Xform "Flat" {
        double3 xformOp:scale = (1, 0, 1)
        uniform token[] xformOpOrder = ["xformOp:scale"]
""" + mesh() + "    }\n"  # fmt: skip
    stage = write_stage(tmp_path / "s.usda", flat + GROUND + CAMERA + LIGHT)
    done = render(stage, out)
    if done.returncode == 0:
        rendered(done, out)
    else:
        refused(done, tmp_path, "/World/Flat")


@pytest.mark.parametrize("scale", ["nan", "inf", "1e300"])
def test_broken_transform_is_named(tmp_path: Path, out: Path, scale: str) -> None:
    broken = f"""
    def Xform "Broken" {{
        double3 xformOp:scale = ({scale}, 1, 1)
        uniform token[] xformOpOrder = ["xformOp:scale"]
""" + mesh() + "    }\n"  # fmt: skip
    stage = write_stage(tmp_path / "s.usda", broken + GROUND + CAMERA + LIGHT)
    done = render(stage, out)
    if done.returncode == 0:
        rendered(done, out, "/World/Broken")
    else:
        refused(done, tmp_path, "/World/Broken")


def test_missing_reference_is_said(tmp_path: Path, out: Path) -> None:
    reference = '    def "Gone" (references = @./gone.usd@) {}\n'
    stage = write_stage(tmp_path / "s.usda", reference + GROUND + CAMERA + LIGHT)
    rendered(render(stage, out), out, "gone.usd")


def test_reference_to_itself(tmp_path: Path, out: Path) -> None:
    reference = '    def "Again" (references = @./s.usda@) {}\n'
    stage = write_stage(tmp_path / "s.usda", reference + GROUND + CAMERA + LIGHT)
    done = render(stage, out)
    if done.returncode == 0:
        rendered(done, out)
    else:
        refused(done, tmp_path)


@pytest.mark.parametrize("camera", ["/World/No", "/World/Ground", "World", ""])
def test_unknown_camera(tmp_path: Path, out: Path, camera: str) -> None:
    stage = write_stage(tmp_path / "s.usda", GROUND + CAMERA + LIGHT)
    refused(render(stage, out, "--camera", camera), tmp_path, camera or "camera")


@pytest.mark.parametrize(
    "options",
    [
        ("--size", 0, 0),
        ("--size", -1, 10),
        ("--size", 65536, 65536),
        ("--spp", 0),
        ("--max-depth", 1 << 40),
        ("--threads", 1 << 40),
        ("--wave-size", 1 << 40),
        ("--filter-width", 1e30),
        ("--seed", 1 << 70),
    ],
)
def test_absurd_settings(tmp_path: Path, out: Path, options: tuple[object, ...]) -> None:
    stage = write_stage(tmp_path / "s.usda", GROUND + CAMERA + LIGHT)
    refused(render(stage, out, *options), tmp_path)


def test_unwritable_output_is_found_before_rendering(tmp_path: Path) -> None:
    stage = write_stage(tmp_path / "s.usda", GROUND + CAMERA + LIGHT)
    start = time.perf_counter()
    done = render(stage, Path("/proc/no/a.exr"), "--spp", 1000000)
    assert time.perf_counter() - start < 10
    refused(done, tmp_path, "a.exr")


def test_python_script_gets_exceptions(tmp_path: Path) -> None:
    import wavecomb as module
    from wavecomb.errors import WavecombError

    with pytest.raises(WavecombError, match=r"no\.usda"):
        module.render(tmp_path / "no.usda")


@pytest.mark.slow
def test_interrupt_keeps_what_is_done(tmp_path: Path, out: Path) -> None:
    stage = write_stage(tmp_path / "s.usda", mesh() + GROUND + CAMERA + LIGHT)
    arguments = ["render", stage, "-o", out, "--size", 64, 64, "--spp", 1 << 20, "--threads", 1]
    # Pilot renders would have no samples to keep.
    arguments += ["--progress", "json", "--quality", "plain"]
    process = subprocess.Popen(
        [sys.executable, "-m", "wavecomb", *(str(argument) for argument in arguments)],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert process.stdout is not None
    assert "progress" in process.stdout.readline()
    os.kill(process.pid, signal.SIGINT)
    _, stderr = process.communicate(timeout=30)
    assert process.returncode == 130, stderr
    assert "Traceback" not in stderr
    assert "holds what was done" in stderr
    assert read_layers(out)["beauty"].max() > 0
    assert not list(tmp_path.glob(".*"))
