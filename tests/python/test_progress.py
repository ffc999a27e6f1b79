# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from fake_core import install

from wavecomb.cli import main
from wavecomb.image.files.image import read_image
from wavecomb.run.progress import (
    Interrupt,
    ProgressBar,
    ProgressLines,
    keep_interrupts,
    speed,
)


def status(done: int, **other: Any) -> dict[str, Any]:
    return {
        "samples_done": done,
        "samples_total": 1000,
        "resumed_samples": 0,
        "rays": 4 * done,
        "passes": 2,
        "active_pixels": 10,
        "seconds": 2.0,
        "error": None,
        **other,
    }


def test_speed_leaves_out_what_a_checkpoint_brought() -> None:
    assert speed(status(500)) == {
        "samples_per_s": 250.0, "rays_per_s": 1000.0, "seconds_left": 2.0
    }  # fmt: skip
    assert speed(status(500, resumed_samples=300))["seconds_left"] == 5.0
    assert speed(status(0, seconds=0.0)) == {
        "samples_per_s": 0.0, "rays_per_s": 0.0, "seconds_left": None
    }  # fmt: skip


def test_lines_are_json_and_not_too_many() -> None:
    lines: list[str] = []
    progress = ProgressLines(lines.append, every=60.0)
    with progress:
        for done in range(0, 1001, 100):
            progress.show(status(done, error=0.5 if done else None))
        progress.wrote("a.ckpt")
    events = [json.loads(line) for line in lines]
    assert [event["event"] for event in events] == ["progress", "progress", "wrote"]
    assert events[0]["error"] is None
    assert events[0]["seconds_left"] is None
    assert events[1]["samples_done"] == 1000, "the end is always told"
    assert events[1]["rays_per_s"] == 2000.0
    assert events[2] == {"event": "wrote", "file": "a.ckpt"}


def test_bar_says_all_of_it() -> None:
    from rich.console import Console

    text = io.StringIO()
    console = Console(file=text, force_terminal=True, width=160)
    with ProgressBar(console) as bar:
        bar.show(status(500, error=0.0312))
    shown = text.getvalue()
    for part in ("50%", "pass 2", "250 samples/s", "1 k rays/s", "error 3.1 %", "2 s left"):
        assert part in shown, part


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupt_notes_the_first_signal(number: int) -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with Interrupt() as interrupt:
        assert not interrupt.requested
        os.kill(os.getpid(), number)
        assert interrupt.requested
        assert interrupt.signal == number
        assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


@pytest.fixture
def stage(tmp_path: Path) -> str:
    path = tmp_path / "stage.usda"
    path.write_text("#usda 1.0\n")
    return str(path)


def render(*arguments: Any) -> Any:
    return CliRunner().invoke(main, ["render", *map(str, arguments)])


def test_json_is_all_that_stdout_has(
    monkeypatch: pytest.MonkeyPatch, stage: str, tmp_path: Path
) -> None:
    install(monkeypatch)
    out = tmp_path / "a.exr"
    result = render(stage, "-o", out, "--size", 8, 8, "--progress", "json")
    assert result.exit_code == 0, result.output
    events = [json.loads(line) for line in result.stdout.splitlines()]
    assert events[-1] == {
        "event": "done", "files": [str(out)], "cancelled": False, "samples_done": 8 * 8 * 64,
        "seconds": 0.5, "error": None,
    }  # fmt: skip
    assert events[-2]["samples_done"] == events[-2]["samples_total"]


@pytest.mark.parametrize(
    ("options", "spp"),
    [
        ([], 64),
        (["--spp", 5], 5),
        (["--noise", 0.1], 1024),
        (["--noise", 0.1, "--spp", 99], 99),
        (["--adaptive", 0.1, "--max-spp", 98], 98),
        (["--time-limit", 3], 1 << 20),
        (["--time-limit", 3, "--spp", 7], 7),
        (["--time-limit", 3, "--noise", 0.1], 1 << 20),
    ],
)
def test_samples_that_an_ending_asks_for(
    monkeypatch: pytest.MonkeyPatch, stage: str, tmp_path: Path, options: list[Any], spp: int
) -> None:
    fake = install(monkeypatch)
    result = render(stage, "-o", tmp_path / "a.exr", "--size", 2, 2, "--quiet", *options)
    assert result.exit_code == 0, result.output
    assert fake.rendered[0]["spp"] == spp


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (
            ["--min-spp", 4],
            "--min-spp applies to adaptive renders: also give --adaptive or --noise",
        ),
        (["--max-spp", 4], "--max-spp applies to adaptive renders"),
        (["--noise", 0.1, "--spp", 4, "--max-spp", 5], "--spp is 4 and --max-spp 5"),
        (["--noise", 0], "must be above 0"),
        (["--time-limit", -1], "must be above 0"),
        (["--every", 5], "--every applies to checkpoints: also give --checkpoint or --resume"),
        (["--preview-every", 5], "--preview-every applies to previews: also give --preview"),
        (["--preview", "a.jpg"], "--preview a.jpg: the name must end in .exr or .png"),
        (["--resume", "none.ckpt"], "none.ckpt: no such file"),
        (["--checkpoint", "/proc/no/a.ckpt"], "cannot be written"),
    ],
)
def test_bad_options(
    monkeypatch: pytest.MonkeyPatch, stage: str, tmp_path: Path, options: list[Any], says: str
) -> None:
    fake = install(monkeypatch)
    monkeypatch.chdir(tmp_path)
    result = render(stage, "-o", "b.exr", *options)
    assert result.exit_code == 2
    assert says in result.stderr
    assert not fake.loaded


@pytest.mark.slow
def test_preview_grows(tmp_path: Path) -> None:
    pytest.importorskip("wavecomb._core")
    from wavecomb.scenes import write_scene

    write_scene("cornell", tmp_path / "a.usdc")
    preview = tmp_path / "p.png"
    result = render(
        *(tmp_path / "a.usdc", "-o", tmp_path / "a.exr", "--png", tmp_path / "a.png"),
        *("--size", 64, 64, "--time-limit", 1.0, "--preview", preview, "--preview-every", 0.2),
        *("--progress", "json"),
    )
    assert result.exit_code == 0, result.output
    wrote = [line for line in result.stdout.splitlines() if '"wrote"' in line]
    assert len(wrote) >= 3
    assert (read_image(preview) == read_image(tmp_path / "a.png")).all(), "the last is the picture"


def test_the_first_preview_shows_the_whole_image(tmp_path: Path) -> None:
    """Renders with a preview begin with short passes, which do not change the image."""
    pytest.importorskip("wavecomb._core")
    from wavecomb.image.files.image import read_layers
    from wavecomb.scenes import write_scene

    write_scene("cornell", tmp_path / "a.usdc")
    passes, images = [], []
    for more in ([], ["--preview", tmp_path / "p.exr"]):
        out, stats = tmp_path / "a.exr", tmp_path / "a.json"
        words = ["-o", out, "--size", 16, 16, "--spp", 16, "--stats", stats, *more]
        result = render(tmp_path / "a.usdc", *words)
        assert result.exit_code == 0, result.output
        passes.append(json.loads(stats.read_text())["passes"])
        images.append(read_layers(out)["beauty"])
    assert passes == [1, 5]
    assert (images[0] == images[1]).all()


def test_a_preview_may_be_linear(tmp_path: Path) -> None:
    pytest.importorskip("wavecomb._core")
    from wavecomb.image.files.image import read_layers
    from wavecomb.scenes import write_scene

    write_scene("cornell", tmp_path / "a.usdc")
    out, preview = tmp_path / "a.exr", tmp_path / "p.exr"
    result = render(
        tmp_path / "a.usdc", "-o", out, "--size", 16, 16, "--spp", 2, "--preview", preview
    )
    assert result.exit_code == 0, result.output
    assert (read_layers(preview)["beauty"] == read_layers(out)["beauty"]).all()


@pytest.mark.slow
def test_ctrl_c_while_usd_is_loaded_is_not_lost(tmp_path: Path) -> None:
    stage = tmp_path / "ball.usda"
    stage.write_text('#usda 1.0\ndef Sphere "Ball" {\n}\n')
    code = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored, if it was when we began
class AtGf:
    def find_spec(self, name, path=None, target=None):
        if name == "pxr.Gf":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, AtGf())
from wavecomb.cli import main
main(sys.argv[1:])
"""
    words = ["render", str(stage), "-o", str(tmp_path / "a.exr"), "--size", "8", "8", "--spp", "1"]
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True)
    assert (done.returncode, done.stderr.strip()) == (130, "stopped")
    assert not (tmp_path / "a.exr").exists()


def test_a_lost_interrupt_is_heeded_by_the_next_who_asks() -> None:
    """A Ctrl-C is not lost in a library that prints exceptions and continues."""
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        keep_interrupts()
        with contextlib.suppress(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        with Interrupt() as interrupt:
            assert interrupt.signal == signal.SIGINT
        with Interrupt() as interrupt:
            assert not interrupt.requested
    finally:
        signal.signal(signal.SIGINT, before)
