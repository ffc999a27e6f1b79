# SPDX-License-Identifier: Apache-2.0
"""Tests that special files, such as FIFOs, are refused in one line, without any waiting."""

from __future__ import annotations

import hashlib
import os
import subprocess
import threading
from pathlib import Path
from typing import Any

import forks
import pytest

pytest.importorskip("wavecomb._core")
import wavecomb
from wavecomb.errors import WavecombError

LIMIT_S = 40


@pytest.fixture
def fifo(tmp_path: Path) -> Any:
    def make(name: str) -> Path:
        os.mkfifo(tmp_path / name)
        return tmp_path / name

    return make


def stage(folder: Path, body: str = "", head: str = "") -> Path:
    path = folder / "s.usda"
    path.write_text(f'#usda 1.0\n({head})\n{body}\ndef Sphere "Ball" {{}}\n')
    return path


def run(*words: object, folder: Path) -> subprocess.CompletedProcess[str]:
    return forks.wavecomb(*words, cwd=folder, timeout=LIMIT_S)


SMALL = ("--size", "4", "4", "--spp", "1", "--quiet")


def refused(done: subprocess.CompletedProcess[str], *said: str) -> None:
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
    for one in (*said, "regular file"):
        assert one in done.stderr, done.stderr


@pytest.mark.parametrize("command", ["render", "info"])
def test_a_stage_that_is_a_fifo(tmp_path: Path, fifo: Any, command: str) -> None:
    words = ("-o", "a.exr", *SMALL) if command == "render" else ()
    refused(run(command, fifo("a.usda"), *words, folder=tmp_path), "a.usda")
    good = stage(tmp_path)
    done = run(command, good, *words, "--session-layer", fifo("b.usda"), folder=tmp_path)
    refused(done, "b.usda")


LAYERS = {
    "sublayer": ("", "subLayers = [@f.usda@]"),
    "reference": ('def "A" (references = @./f.usda@) {}', ""),
    "payload": ('def "A" (payload = @f.usda@) {}', ""),
    "reference of a reference": ('def "A" (references = @between.usda@) {}', ""),
}


@pytest.mark.parametrize("way", LAYERS)
@pytest.mark.parametrize("isolate", ["on", "off"])
def test_a_layer_that_is_a_fifo(tmp_path: Path, fifo: Any, way: str, isolate: str) -> None:
    fifo("f.usda")
    (tmp_path / "between.usda").write_text(
        '#usda 1.0\n(defaultPrim = "B")\ndef "B" (references = @f.usda@) {}\n'
    )
    path = stage(tmp_path, *LAYERS[way])
    done = run("info", path, "--isolate", isolate, folder=tmp_path)
    refused(done, "f.usda", "between.usda" if "of a" in way else "s.usda")


@pytest.mark.parametrize("busy_threads", [0, 1])
@pytest.mark.slow
def test_a_program_that_loads_such_a_stage(tmp_path: Path, fifo: Any, busy_threads: int) -> None:
    """Threads that compute something else must not hide that the thread of `load` waits."""
    fifo("f.usda")
    done = threading.Event()

    def compute() -> None:
        while not done.is_set():
            hashlib.pbkdf2_hmac("sha256", b"", b"", 20_000)  # releases the interpreter

    threads = [threading.Thread(target=compute) for _ in range(busy_threads)]
    for thread in threads:
        thread.start()
    try:
        with pytest.raises(WavecombError, match=r"s\.usda: names the layer .*f\.usda.*FIFO"):
            wavecomb.load(stage(tmp_path, *LAYERS["reference"]))
    finally:
        done.set()
        for thread in threads:
            thread.join()


MATERIAL = """
def Material "M" {{
    token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S" {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>
        token outputs:surface
    }}
    def Shader "T" {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        float3 outputs:rgb
    }}
}}
def Mesh "Quad" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    rel material:binding = </M>
}}
"""
OTHERS = {
    "texture": ("f.png", MATERIAL.format(file="f.png")),
    "texture in tiles": ("f.1001.png", MATERIAL.format(file="f.<UDIM>.png")),
    "MaterialX": ("f.mtlx", 'def "A" (references = @f.mtlx@</MaterialX>) {}'),
    "volume": (
        "f.vdb",
        'def Volume "V" {\n    rel field:density = </V/D>\n'
        'def OpenVDBAsset "D" {\n asset filePath = @f.vdb@\n token fieldName = "density"\n}\n}',
    ),
    "profile": ("f.ies", 'def SphereLight "L" (prepend apiSchemas = ["ShapingAPI"]) '
                "{ asset inputs:shaping:ies:file = @f.ies@\n }"),
}  # fmt: skip


@pytest.mark.parametrize("kind", OTHERS)
def test_other_files_of_a_stage(tmp_path: Path, fifo: Any, kind: str) -> None:
    """The image is drawn without the file and with a warning, or the stage is refused."""
    name, body = OTHERS[kind]
    fifo(name)
    done = run("render", stage(tmp_path, body), "-o", "a.exr", *SMALL, folder=tmp_path)
    assert done.returncode in (0, 2) and name in done.stderr, done.stderr
    assert "regular file" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "words",
    [
        ("render", "s.usda", "-o", "a.exr", "--resume", "f"),
        ("render", "s.usda", "-o", "a.exr", "--learn-from", "f", "--guiding", "on"),
        ("render", "s.usda", "-o", "a.exr", "--costs", "f.json"),
        ("compare", "f.exr", "f.exr"),
        ("merge", "f.exr", "f.exr", "-o", "a.exr"),
        ("sheet", "f.exr", "-o", "a.png"),
        ("bench", "run", "f.toml", "-o", "out"),
    ],
)
def test_files_that_options_name(tmp_path: Path, fifo: Any, words: tuple[str, ...]) -> None:
    stage(tmp_path)
    name = next(word for word in words if word.startswith("f"))
    fifo(name)
    refused(run(*words, folder=tmp_path), name)
