# SPDX-License-Identifier: Apache-2.0
"""Tests that decompression bombs end the child process with one line (``--memory-limit``)."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from parts import only_where
from pxr import Usd, UsdGeom, Vt

import wavecomb
from wavecomb import WavecombError
from wavecomb.run.isolation import memory

pytestmark = only_where(sys.platform == "linux", "the limit is Linux's")

LIMIT_MB = 400


PEAK_OF = """
import resource, subprocess, sys

code = subprocess.run(sys.argv[1:]).returncode
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
sys.exit(code)
"""
"""Runs a command in a new process and prints the peak memory of its children in KB."""


def run(*words: object, limit: float = LIMIT_MB) -> subprocess.CompletedProcess[str]:
    """Runs the command. The last line of the output is the command's peak memory in KB."""
    command = [sys.executable, "-m", "wavecomb", *map(str, words), "--memory-limit", str(limit)]
    return subprocess.run(
        [sys.executable, "-c", PEAK_OF, *command],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


def packed_indices(folder: Path) -> list[object]:
    """Writes 400 MB of indices compressed to 130 KB. Returns a command that reads the indices."""
    stage = Usd.Stage.CreateNew(str(folder / "bomb.usdc"))
    mesh = UsdGeom.Mesh.Define(stage, "/M")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.zeros((3, 3), np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(1, 3, np.int32)))
    zeros = np.broadcast_to(np.zeros(1, np.int32), 100_000_000)
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(zeros)))
    stage.Save()
    assert (folder / "bomb.usdc").stat().st_size < 200_000
    return ["render", folder / "bomb.usdc", "-o", folder / "o.exr"]


def packed_texture(folder: Path) -> list[object]:
    """Writes 320 MB of pixels compressed to a few MB. Returns a command that reads the pixels."""
    spec = oiio.ImageSpec(9000, 9000, 4, "uint8")
    output = oiio.ImageOutput.create(str(folder / "t.tif"))
    spec.attribute("compression", "zip")
    assert output.open(str(folder / "t.tif"), spec)
    band = np.zeros((1000, 9000, 4), np.uint8)
    for row in range(0, 9000, 1000):
        assert output.write_scanlines(row, row + 1000, 0, band)
    output.close()
    (folder / "s.usda").write_text(
        '#usda 1.0\ndef DomeLight "D" {\n    asset inputs:texture:file = @t.tif@\n}\n'
        'def Sphere "S" {\n    double radius = 1\n}\n'
    )
    return ["render", folder / "s.usda", "-o", folder / "o.exr"]


def large_picture(folder: Path) -> list[object]:
    """Writes a small stage.

    Returns a command that renders the stage with a film that is too large.
    """
    (folder / "s.usda").write_text('#usda 1.0\ndef Sphere "S" {\n    double radius = 1\n}\n')
    return ["render", folder / "s.usda", "-o", folder / "o.exr", "--size", 6000, 6000]


def large_merge(folder: Path) -> list[object]:
    """Writes images of 190 MB compressed to a few KB. Returns a command that merges the images."""
    for name in "ab":
        spec = oiio.ImageSpec(4000, 4000, 3, "float")
        spec.attribute("compression", "zip")
        spec.attribute("wavecomb:settings", '{"width": 4000, "height": 4000, "seed": 1}')
        spec.attribute("wavecomb:seeds", f"[{ord(name)}]")
        output = oiio.ImageOutput.create(str(folder / f"{name}.exr"))
        assert output.open(str(folder / f"{name}.exr"), spec)
        for row in range(0, 4000, 1000):
            output.write_scanlines(row, row + 1000, 0, np.zeros((1000, 4000, 3), np.float32))
        output.close()
    return ["merge", folder / "a.exr", folder / "b.exr", "-o", folder / "o.exr"]


@pytest.mark.slow
@pytest.mark.parametrize("bomb", [packed_indices, packed_texture, large_picture, large_merge])
def test_bombs_are_one_line(tmp_path: Path, bomb: Callable[[Path], list[object]]) -> None:
    command = bomb(tmp_path)
    before = sorted(os.listdir(tmp_path))
    done = run(*command)
    lines = done.stderr.strip().splitlines()
    assert done.returncode == 2 and len(lines) == 1, done.stderr
    assert lines[0].startswith("error: ") and "emory" in lines[0], done.stderr
    assert f"{LIMIT_MB} MB (--memory-limit)" in lines[0]
    assert sorted(os.listdir(tmp_path)) == before
    assert int(done.stdout.split()[-1]) < 1.4e6


@pytest.mark.slow
def test_a_sound_stage_fits(tmp_path: Path) -> None:
    (tmp_path / "s.usda").write_text('#usda 1.0\ndef Sphere "S" {\n    double radius = 1\n}\n')
    done = run("info", tmp_path / "s.usda")
    assert done.returncode == 0, done.stderr


def test_what_a_limit_cannot_be(tmp_path: Path) -> None:
    done = run("info", tmp_path / "s.usda", limit=5)
    assert (done.returncode, done.stderr) == (
        2, "error: memory limit 5 MB: give at least 256 MB\n",
    )  # fmt: skip
    done = run("info", tmp_path / "s.usda", "--isolate", "off")
    assert done.returncode == 2 and "leave --isolate off out" in done.stderr


def test_the_machine_s_limit_is_that_of_its_group(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = memory.memory_bytes()
    assert machine is not None and 0 < memory.machine_limit() <= machine
    group = tmp_path / "a" / "b"
    group.mkdir(parents=True)
    (group / "memory.max").write_text("max\n")
    (tmp_path / "a" / "memory.max").write_text("300000000\n")
    monkeypatch.setattr(memory, "_CGROUP", tmp_path)
    read = Path.read_text
    monkeypatch.setattr(
        Path, "read_text",
        lambda p, **k: "0::/a/b\n" if str(p) == "/proc/self/cgroup" else read(p, **k),
    )  # fmt: skip
    assert memory.machine_limit() == 300_000_000


def test_a_damaged_value_is_not_taken_for_a_bomb(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory.progress_notes, "is_expendable", lambda: True)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (10**10, 10**10))
    error = ValueError("exception thrown unpacking a value, returning an empty VtValue")
    assert not memory.is_exhausted(error, lambda: 100_000)
    assert memory.is_exhausted(error, lambda: 2_000_000)
    assert not memory.is_exhausted(ValueError("other"), lambda: 2_000_000)
    assert memory.is_exhausted(MemoryError(), int)


def test_meshes_that_cannot_fit_are_told_before_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "large.usdc"))
    mesh = UsdGeom.Mesh.Define(stage, "/M")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.zeros((100_000, 3), np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(1, 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.arange(3, dtype=np.int32)))
    stage.Save()
    file = tmp_path / "large.usdc"
    wavecomb.load(file)
    monkeypatch.setattr(memory, "available_bytes", lambda: 1_000_000)
    with pytest.raises(WavecombError, match=r"large.usdc: .*100,000 points .* 2 MB where 1 MB"):
        wavecomb.load(file)
