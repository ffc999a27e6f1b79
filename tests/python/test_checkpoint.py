# SPDX-License-Identifier: Apache-2.0
"""Tests that a render that was stopped in any way resumes with the same result."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import forks
import numpy as np
import pytest
from click.testing import CliRunner, Result
from stopping import StopAt

import wavecomb
from wavecomb.cli import main
from wavecomb.errors import WavecombError
from wavecomb.image.files.image import read_layers
from wavecomb.run.aovs import core_aovs
from wavecomb.run.checkpoint import load_checkpoint, save_checkpoint

_core = pytest.importorskip("wavecomb._core")

LAYERS = ("beauty", "albedo", "normal", "depth", "samples")


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from wavecomb.scenes import write_scene

    path: Path = tmp_path_factory.mktemp("stages") / "cornell.usdc"
    write_scene("cornell", path)
    return path


@pytest.fixture(scope="module")
def cornell(stage: Path) -> Any:
    return wavecomb.load(stage)


@pytest.mark.slow
@pytest.mark.parametrize(
    "ending",
    [
        {"spp": 200},
        {"noise": 0.03, "spp": 1024},
        {"adaptive": 0.04, "spp": 1024},
        {"allocate": "error", "spp": 200},
        {"allocate": "efficiency", "spp": 200},
        {"allocate": "error", "guiding": "on", "roulette": "efficient", "spp": 120},
        pytest.param({"spp": 700}, marks=pytest.mark.long),
        pytest.param({"noise": 0.015, "spp": 4096}, marks=pytest.mark.long),
        pytest.param({"adaptive": 0.02, "spp": 4096}, marks=pytest.mark.long),
    ],
)
def test_resumed_is_uninterrupted(cornell: Any, ending: dict[str, Any]) -> None:
    settings = _core.Settings(width=48, height=40, error=True, aovs=list(core_aovs()), **ending)
    whole = _core.render(cornell.scene, settings)
    state: dict[str, Any] | None = None
    runs = 0
    for _ in range(200):
        watcher = StopAt(random.Random(runs).randrange(2) if runs else 0)
        changed = _core.Settings(
            width=48, height=40, error=True, aovs=list(core_aovs()), **ending,
            threads=1 + runs % 2, wave_size=(64, 4096, 1000)[runs % 3],
        )  # fmt: skip
        result = _core.render(cornell.scene, changed, watcher=watcher, state=state, interval=0.03)
        state = watcher.state
        runs += 1
        if not result.cancelled:
            break
    assert not result.cancelled
    assert runs > 1, "or nothing was resumed"
    for layer in (*LAYERS, "error", "variance"):
        assert getattr(result, layer).tobytes() == getattr(whole, layer).tobytes(), layer
    assert len(whole.aovs) >= 12
    for name, aov in whole.aovs.items():
        if name != "cost":  # a measured time
            assert result.aovs[name].tobytes() == aov.tobytes(), name
    assert result.stats["resumed_samples"] > 0


@pytest.mark.slow
@pytest.mark.parametrize("spp", [200, pytest.param(800, marks=pytest.mark.long)])
def test_snapshots_change_nothing(cornell: Any, spp: int) -> None:
    class Often:
        taken = 0

        def progress(self, status: dict[str, Any]) -> str:
            assert 0 <= status["samples_done"] <= status["samples_total"]
            return "snapshot"

        def snapshot(self, snapshot: Any) -> None:
            assert np.isfinite(snapshot.beauty()).all()
            self.taken += 1

    settings = _core.Settings(width=64, height=64, spp=spp)
    watcher = Often()
    watched = _core.render(cornell.scene, settings, watcher=watcher)
    assert watcher.taken > 2
    assert watched.beauty.tobytes() == _core.render(cornell.scene, settings).beauty.tobytes()


@pytest.mark.slow
def test_a_limit_is_kept_by_a_render_that_had_none(cornell: Any) -> None:
    """A render resumed with a time limit observes it even within a pass of 2^14 samples."""
    settings = {"width": 64, "height": 64, "noise": 0.001, "min_spp": 1 << 14, "spp": 1 << 15,
                "quality": "plain"}  # fmt: skip
    begun = StopAt(0)
    _core.render(cornell.scene, _core.Settings(**settings), watcher=begun)
    pixels = np.dtype([("sum", "f8", 3), ("samples", "u4"), ("", "u4")])
    done = begun.state["film.pixels"].view(pixels)["samples"]
    assert begun.state["pass.target"] == 1 << 14 and done.max() > 0
    limited = _core.Settings(**settings, time_limit=0.5)
    state, least = begun.state, done.min()
    for _ in range(2):
        ended = StopAt(1000)
        result = _core.render(cornell.scene, limited, watcher=ended, state=state)
        assert result.stats["seconds"]["render"] < 2
        assert result.samples.min() > least
        state, least = ended.state, result.samples.min()


@pytest.mark.slow
def test_more_is_to_come_when_a_render_goes_on(cornell: Any) -> None:
    settings = _core.Settings(width=48, height=40, noise=0.0001, spp=1 << 16)
    begun = StopAt(2)
    _core.render(cornell.scene, settings, watcher=begun)
    begun.state["pass.target"] = 1 << 14

    class First:
        def __init__(self) -> None:
            self.status: dict[str, Any] = {}

        def progress(self, status: dict[str, Any]) -> str:
            self.status = self.status or status
            return "stop"

        def snapshot(self, snapshot: Any) -> None:
            pass

    first = First()
    _core.render(cornell.scene, settings, watcher=first, state=begun.state)
    assert first.status["samples_total"] == 48 * 40 << 14


def test_what_a_watcher_throws_comes_out(cornell: Any) -> None:
    class Broken:
        def __init__(self, where: str) -> None:
            self.where = where

        def progress(self, status: dict[str, Any]) -> str:
            if self.where == "progress":
                raise RuntimeError("no more")
            return "snapshot" if self.where == "snapshot" else "dance"

        def snapshot(self, snapshot: Any) -> None:
            raise RuntimeError("no more")

    settings = _core.Settings(width=64, height=64, spp=1 << 20)
    for where, says in (("progress", "no more"), ("snapshot", "no more"), ("answer", "dance")):
        with pytest.raises((RuntimeError, _core.Error), match=says):
            _core.render(cornell.scene, settings, watcher=Broken(where))


def test_checkpoint_and_resume_from_python(cornell: Any, tmp_path: Path) -> None:
    file = tmp_path / "a.ckpt"
    settings: dict[str, Any] = {"size": (24, 24), "error": True}
    half = wavecomb.render(cornell, spp=64, checkpoint=file, **settings)
    assert file.exists()
    # A render that is not adaptive can be resumed with more samples.
    more = wavecomb.render(cornell, spp=128, resume=file, **settings)
    whole = wavecomb.render(cornell, spp=128, **settings)
    assert more.beauty.tobytes() == whole.beauty.tobytes()
    assert more.stats["resumed_samples"] == half.samples.sum()
    # Resuming a finished render adds no samples.
    again = wavecomb.render(cornell, spp=64, resume=file, **settings)
    assert again.beauty.tobytes() == half.beauty.tobytes()
    assert again.stats["counts"]["samples"] == 0
    with pytest.raises(WavecombError, match="was made with spp 64, and this render has 32"):
        wavecomb.render(cornell, spp=32, resume=file, **settings)


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"size": (24, 23)}, "size 24 x 24, and this render has 24 x 23"),
    ({"seed": 1}, "seed 0, and this render has 1"),
    ({"max_depth": 3}, "max-depth 8, and this render has 3"),
    ({"filter_width": 2.0}, "filter-width 3.0, and this render has 2.0"),
    ({"filter": "box"}, "filter blackman-harris, and this render has box"),
    ({"noise": 0.1}, "noise 0.0, and this render has"),
    ({"error": True}, "error False, and this render has True"),
]


def test_refusals_name_the_difference(cornell: Any, tmp_path: Path) -> None:
    file = tmp_path / "a.ckpt"
    plain: dict[str, Any] = {"size": (24, 24), "spp": 16}
    wavecomb.render(cornell, checkpoint=file, **plain)
    for settings, says in REFUSED:
        with pytest.raises(WavecombError, match=says):
            wavecomb.render(cornell, resume=file, **{**plain, **settings})
    wavecomb.render(cornell, resume=file, threads=1, wave_size=64, policy="none", **plain)


def test_fingerprint_knows_the_parts() -> None:
    def build(**other: Any) -> dict[str, str]:
        builder = wavecomb.SceneBuilder()
        pixels = np.full((4, 4, 3), other.get("texel", 100), np.uint8)
        texture = builder.add_texture(pixels, srgb=True)
        material = builder.add_material(
            "diffuse",
            roughness=other.get("roughness", 0.5),
            textures={"base_color": {"texture": texture, "channel": "rgb"}},
            name=other.get("name", "paint"),
        )
        points = np.array([[0, 0, -2], [1, 0, -2], [0, other.get("y", 1), -2]], np.float32)
        mesh = builder.add_mesh(points, np.array([[0, 1, 2]], np.uint32), material=material)
        builder.add_to_group(0, mesh)
        builder.add_light("dome", np.eye(4), color=(other.get("light", 1.0), 1, 1))
        width = other.get("width", 0.5)
        builder.set_camera(np.eye(4), window=(-width, width, -0.5, 0.5))
        fingerprint: dict[str, str] = builder.build().fingerprint()
        return fingerprint

    plain = build()
    assert build() == plain
    for change, part in (
        ({"y": 2}, "geometry"),
        ({"roughness": 0.25}, "materials"),
        ({"texel": 101}, "textures"),
        ({"light": 2.0}, "lights"),
        ({"width": 0.6}, "camera"),
        ({"name": "varnish"}, "names"),
    ):
        other = build(**change)
        assert {name for name in plain if other[name] != plain[name]} == {part}


def test_damaged_files_are_refused(cornell: Any, tmp_path: Path) -> None:
    file = tmp_path / "a.ckpt"
    wavecomb.render(cornell, size=(24, 24), spp=16, checkpoint=file)
    whole = file.read_bytes()
    checkpoint = load_checkpoint(file)
    for name, content in {
        "cut": whole[: len(whole) // 2],
        "empty": b"",
        "other": b"PK\x03\x04 but no archive",
        "text": b"hello",
        "flipped": whole[:5000] + bytes([whole[5000] ^ 1]) + whole[5001:],
    }.items():
        broken = tmp_path / f"{name}.ckpt"
        broken.write_bytes(content)
        with pytest.raises(WavecombError, match=f"{name}.ckpt: is not a checkpoint, or is damaged"):
            load_checkpoint(broken)
    with pytest.raises(FileNotFoundError, match="no such file"):
        load_checkpoint(tmp_path / "none.ckpt")
    save_checkpoint(file, {**checkpoint.header, "format": 99}, checkpoint.state)
    with pytest.raises(WavecombError, match="format 99 and was written by Wavecomb"):
        load_checkpoint(file)


def test_state_of_another_film_is_refused(cornell: Any) -> None:
    watcher = StopAt(0)
    _core.render(cornell.scene, _core.Settings(width=8, height=8, spp=1), watcher=watcher)
    with pytest.raises(_core.Error, match="of a different image"):
        _core.render(cornell.scene, _core.Settings(width=8, height=9, spp=1), state=watcher.state)
    with pytest.raises(_core.Error, match=r"no 'film\.errors'"):
        _core.render(
            cornell.scene,
            _core.Settings(width=8, height=8, spp=1, error=True),
            state=watcher.state,
        )


# ---- the command line ----------------------------------------------------------------------------


def command(stage: Path, *arguments: Any) -> list[str]:
    words = ("render", stage, *arguments, "--size", 64, 64, "--threads", 1)
    return [sys.executable, "-m", "wavecomb", *map(str, words)]


def run(*words: Any) -> subprocess.CompletedProcess[str]:
    return forks.run(command(*words)[1:], timeout=300)


def invoke(*words: Any, code: int = 0) -> Result:
    """Runs the command in this process, with the interface of ``run``."""
    result = CliRunner().invoke(main, command(*words)[3:])
    assert result.exit_code == code, result.output
    return result


@pytest.mark.slow
def test_signals_save(stage: Path, tmp_path: Path) -> None:
    out, file = tmp_path / "a.exr", tmp_path / "a.ckpt"
    for number, code in ((signal.SIGTERM, 143), (signal.SIGINT, 130)):
        file.unlink(missing_ok=True)
        process = subprocess.Popen(
            command(
                stage,
                "-o",
                out,
                "--spp",
                100_000,
                "--checkpoint",
                file,
                "--progress",
                "json",
                "--quality",
                "plain",
            ),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert process.stdout is not None
        first = json.loads(process.stdout.readline())
        assert first["event"] == "progress"
        process.send_signal(number)
        rest, errors = process.communicate(timeout=60)
        assert process.returncode == code, errors
        events = [json.loads(line) for line in rest.splitlines()]
        assert {"event": "wrote", "file": str(file)} in events
        assert events[-1]["event"] == "done"
        assert events[-1]["cancelled"] is True
        samples = read_layers(out)["samples"]
        assert load_checkpoint(file).state["pass.target"] >= samples.max() > 0
        assert "a.exr holds what was done" in errors


@pytest.mark.slow
def test_resume_takes_settings_from_the_checkpoint(stage: Path, tmp_path: Path) -> None:
    one, two, file = tmp_path / "1.exr", tmp_path / "2.exr", tmp_path / "a.ckpt"
    done = run(stage, "-o", one, "--noise", 0.08, "--seed", 9, "--checkpoint", file)
    assert done.returncode == 0, done.stderr
    done = run(stage, "-o", two, "--resume", file)
    assert done.returncode == 0, done.stderr
    assert "resumed after" in done.stdout
    assert "mean relative error" in done.stdout
    first, second = read_layers(one), read_layers(two)
    assert list(first) == list(second)
    assert {"error", "variance"} < set(first)
    for layer, pixels in first.items():
        assert pixels.tobytes() == second[layer].tobytes(), layer
    refused = run(stage, "-o", two, "--resume", file, "--seed", 8)
    assert refused.returncode == 2
    assert refused.stderr == (
        f"error: {file}: was made with seed 9, and this render has 8; give that, or start anew\n"
    )


def test_resumed_files_have_the_same_layers(stage: Path, tmp_path: Path) -> None:
    one, two, file = tmp_path / "1.exr", tmp_path / "2.exr", tmp_path / "a.ckpt"
    for aovs in (["error", "uv"], ["guide_albedo"], ["crypto"]):
        chosen = [word for aov in aovs for word in ("--aov", aov)]
        invoke(stage, "-o", one, "--spp", 16, *chosen, "--checkpoint", file)
        invoke(stage, "-o", two, "--resume", file)
        assert list(read_layers(one)) == list(read_layers(two))
    more = ["--compression", "dwaa", "--spp", 1 << 20]
    refused = invoke(stage, "-o", two, "--resume", file, *more, code=2)
    assert "compression dwaa would spoil CryptoObject00" in refused.stderr


def test_a_timed_render_is_not_resumed_without_end(stage: Path, tmp_path: Path) -> None:
    out, file = tmp_path / "a.exr", tmp_path / "a.ckpt"
    invoke(stage, "-o", out, "--time-limit", 0.1, "--checkpoint", file)
    refused = invoke(stage, "-o", out, "--resume", file, code=2)
    assert refused.stderr == (
        f"error: {file}: is of a render that a time limit was to end: give --time-limit or --spp\n"
    )
    invoke(stage, "-o", out, "--resume", file, "--time-limit", 0.1)


@pytest.mark.slow
def test_a_disk_that_is_full_does_not_end_a_render(cornell: Any, tmp_path: Path) -> None:
    from wavecomb.run.callbacks import CheckpointSink, Watcher

    warnings: list[str] = []
    sink = CheckpointSink(tmp_path / "gone" / "a.ckpt", 0.0, {})
    watcher = Watcher([sink], warn=warnings.append)
    settings = _core.Settings(width=64, height=64, spp=400)
    result = _core.render(cornell.scene, settings, watcher=watcher)
    assert not result.cancelled
    assert len(warnings) == 1, "once, however often it fails"
    assert "gone" in warnings[0]


def test_a_file_that_is_no_checkpoint_is_kept(stage: Path, tmp_path: Path) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("mine")
    refused = run(stage, "-o", tmp_path / "a.exr", "--checkpoint", file)
    assert refused.returncode == 2
    assert "notes.txt: exists and is not a checkpoint" in refused.stderr
    assert file.read_text() == "mine"
