# SPDX-License-Identifier: Apache-2.0
"""Tests the Blender render engine: images, errors, cancelling, animation and .blend files."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
Run = Callable[..., "subprocess.CompletedProcess[str]"]


def _rows(done: subprocess.CompletedProcess[str]) -> dict[str, object]:
    lines = [line for line in done.stdout.splitlines() if line.startswith("ROW ")]
    assert lines, done.stdout[-2000:] + done.stderr[-2000:]
    found: dict[str, object] = {}
    for line in lines:
        found |= json.loads(line[4:])
    return found


def test_command_line_writes_the_same_image(blender: Run, tmp_path: Path) -> None:
    """A render with F12 and ``wavecomb render`` of the exported stage give the same values."""
    row = _rows(blender(str(HERE / "engine_cases.py"), "same", str(tmp_path)))
    assert row["same"] is True


def test_images_are_stamped(blender: Run, tmp_path: Path) -> None:
    """Blender writes its stamp into a saved image, and leaves the rest as it is."""
    row = _rows(blender(str(HERE / "engine_cases.py"), "stamp", str(tmp_path)))
    assert int(str(row["stamped"])) > 30
    assert float(str(row["others"])) > 0.3


def test_errors_are_one_line(blender: Run, tmp_path: Path) -> None:
    """A missing program, a missing camera and a killed process do not end Blender."""
    row = _rows(blender(str(HERE / "engine_cases.py"), "errors", str(tmp_path)))
    assert "Wavecomb was not found" in str(row["program"])
    assert "has no camera" in str(row["camera"])
    assert "SIGKILL" in str(row["killed"])
    assert row["alive"] is True


def test_a_process_waits_for_the_next_render(blender: Run, tmp_path: Path) -> None:
    """A waiting process renders the same image, is replaced, and ends with engine or Blender."""
    row = _rows(blender(str(HERE / "engine_cases.py"), "standby", str(tmp_path)))
    assert row["in_background"] == 0
    used = row["used"]
    assert isinstance(used, list) and len(used) == 2
    assert used[0] == row["first"] != 0
    assert row["second"] not in (0, *used)
    assert row["same"] is True
    assert row["after_kill"] is True
    assert row["third"] != 0
    assert row["other_engine"] == 0
    assert row["ended"] is True
    last = Path("/proc", str(row["last"]))
    assert row["last"] != 0
    for _ in range(200):
        if not last.exists():
            return
        time.sleep(0.1)
    raise AssertionError(f"process {row['last']} outlives Blender")


def test_full_disk_is_one_line(blender: Run, tmp_path: Path) -> None:
    """On a full disk, each failed write gives one error line, and Blender continues."""
    row = _rows(blender(str(HERE / "engine_cases.py"), "full", str(tmp_path)))
    for name in ("stage", "correction", "image"):
        lines = [line for line in str(row[name]).splitlines() if line.startswith("Error: ")]
        assert len(lines) == 1, row[name]
        assert "Wavecomb: " in lines[0], row[name]
        assert "too large" in lines[0] or "disk" in lines[0], row[name]
    assert row["alive"] is True


def test_report_lists_what_is_missing(blender: Run, tmp_path: Path) -> None:
    """The report has one line for an unsupported node and one for an approximation."""
    row = _rows(blender(str(HERE / "engine_cases.py"), "report", str(tmp_path)))
    assert row["error"] == ""
    lines = row["lines"]
    assert isinstance(lines, list) and len(lines) == 2, lines
    assert "not supported: node Light Path" in lines[0] and "material" in lines[0]
    assert "approximated: displacement (a bump instead): material" in lines[1]


def test_cryptomatte_has_the_ids_of_cycles(blender: Run, tmp_path: Path) -> None:
    """Cryptomatte ids of the first rank equal Cycles' ids and cover the same number of pixels."""
    row = _rows(blender(str(HERE / "engine_cases.py"), "cryptomatte", str(tmp_path)))
    passes = row["passes"]
    assert isinstance(passes, dict) and len(passes) == 6
    for name, tables in passes.items():
        assert tables["CYCLES"].keys() == tables["WAVECOMB"].keys(), name
        for one, count in tables["CYCLES"].items():
            assert abs(tables["WAVECOMB"][one] - count) <= 0.03 * count + 10, (name, one)


def test_passes_of_two_view_layers(blender: Run, tmp_path: Path) -> None:
    """Every pass is written and not empty; layers, denoising and border have an effect."""
    row = _rows(blender(str(HERE / "engine_cases.py"), "passes", str(tmp_path)))
    assert row["absent"] == []
    assert row["empty"] == []
    assert float(str(row["denoised"])) > 0.0
    assert int(str(row["nearer"])) > 100
    assert row["farther"] == 0
    assert row["border"] is True, row["shape"]


def test_animation_exports_geometry_once(blender: Run, tmp_path: Path) -> None:
    """Frames with motion blur reuse the exported geometry; each equals a frame rendered alone."""
    row = _rows(blender(str(HERE / "engine_cases.py"), "animation", str(tmp_path)))
    assert row["frames"] == 24
    assert row["exports"] == 1
    assert row["bakes"] == 1
    assert float(str(row["difference"])) < 1e-6


def test_blend_file(blender: Run, tmp_path: Path) -> None:
    """``wavecomb render scene.blend`` exports with scripts disabled."""
    done = blender(str(HERE / "engine_cases.py"), "blend", str(tmp_path))
    python = str(_rows(done)["python"])
    environment = {**os.environ, "WAVECOMB_BLENDER": python}
    wavecomb = str(Path(sys.prefix, "bin", "wavecomb"))
    words = [wavecomb, "render", "a.blend", "-o", "a.exr", "--spp", "4", "--size", "64x48"]
    made = subprocess.run(
        words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert made.returncode == 0, made.stderr
    assert (tmp_path / "a.exr").exists()
    assert not (tmp_path / "executed").exists()


@pytest.mark.parametrize("content", [b"", b"BLENDER-v501nonsense"])
def test_broken_blend_file_is_one_line(blender: Run, tmp_path: Path, content: bytes) -> None:
    """A .blend file that Blender cannot open causes one error line."""
    done = blender(str(HERE / "engine_cases.py"), "blend", str(tmp_path))
    python = str(_rows(done)["python"])
    (tmp_path / "b.blend").write_bytes(content)
    made = subprocess.run(
        [str(Path(sys.prefix, "bin", "wavecomb")), "render", "b.blend", "-o", "b.exr"],
        cwd=tmp_path, env={**os.environ, "WAVECOMB_BLENDER": python}, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert made.returncode == 2
    assert len(made.stderr.strip().splitlines()) == 1
