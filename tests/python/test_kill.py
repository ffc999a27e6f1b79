# SPDX-License-Identifier: Apache-2.0
"""Tests kill -9 at random moments: files are complete or absent, and later runs still work."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from parts import needs
from test_texture_limit import MOVING_CAMERA, textured, write_image

from wavecomb.image.files.image import read_layers
from wavecomb.run.checkpoint import load_checkpoint

pytestmark = needs("wavecomb._core")

KILLS = 25
"""Number of kills of each kind of render; 100 in total."""


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from wavecomb.scenes import write_scene

    path: Path = tmp_path_factory.mktemp("stages") / "cornell.usdc"
    write_scene("cornell", path)
    return path


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nine squares with 7 MB of noise textures in front of a moving camera."""
    folder = tmp_path_factory.mktemp("pictures")
    noise = np.random.default_rng(3)
    text = "#usda 1.0\n"
    for i in range(9):
        write_image(folder / f"{i}.png", noise.integers(0, 256, (512, 512, 3), np.uint8))
        at = f"({i % 3 - 1.5}, {i // 3 - 1.5}, -3)\n"
        text += textured(f"M{i}", f"{i}.png", 1).replace("(0, 0, -1)\n", at)
    path = folder / "stage.usda"
    path.write_text(text + MOVING_CAMERA)
    return path


@dataclass(frozen=True)
class Kind:
    """A way to render.

    Attributes:
        stage: Name of the fixture that writes the stage.
        options: Options of the command.
        frames: Frames of a sequence; if empty, the render resumes from a checkpoint.
        sandbox: Value of WAVECOMB_SANDBOX.
    """

    stage: str
    options: tuple[str, ...]
    frames: tuple[int, ...] = ()
    sandbox: str = "off"

    def outputs(self, name: str) -> list[str]:
        """Returns the names of the files that the render writes."""
        return [f"{name}.{frame}.exr" for frame in self.frames] or [f"{name}.exr"]


LIMITED = ("--texture-limit", "2")
KINDS = {
    "noise": Kind("box", ("--noise", "0.01", "--max-spp", "1024")),
    "adaptive": Kind("box", ("--adaptive", "0.02", "--max-spp", "1024"), sandbox="auto"),
    "texture limit": Kind("pictures", ("--spp", "256", *LIMITED)),
    "sequence": Kind("pictures", ("--spp", "32", *LIMITED), (1, 2, 3), sandbox="auto"),
}


def processes_below(folder: Path) -> list[str]:
    """Returns command lines of processes whose arguments or environment contain the folder."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_bytes() + (entry / "environ").read_bytes()
        except OSError:
            continue
        if os.fsencode(folder) in words and int(entry.name) != os.getpid():
            found.append(f"{entry.name}: {words[:200]!r}")
    return found


class Killer:
    """Starts one render repeatedly and kills it at random moments."""

    def __init__(self, kind: Kind, stage: Path, folder: Path, seed: int) -> None:
        self.kind, self.stage = kind, stage
        self.folder, self.temporary = folder / "out", folder / "tmp"
        self.folder.mkdir()
        self.temporary.mkdir()
        self.random = random.Random(seed)
        self.checkpoint = self.folder / "a.ckpt"
        start = time.monotonic()
        process = self.start("whole")
        _, errors = process.communicate()
        assert process.returncode == 0, errors
        self.whole_s = time.monotonic() - start

    def start(self, name: str) -> subprocess.Popen[str]:
        """Starts the render command, which resumes from the files that already exist."""
        out = self.folder / (f"{name}.#.exr" if self.kind.frames else f"{name}.exr")
        words = [str(self.stage), "-o", str(out), "--size", "48", "48", "--threads", "1"]
        words += [*self.kind.options]
        if self.kind.frames:
            words += ["--frames", f"{self.kind.frames[0]}-{self.kind.frames[-1]}"]
            words += ["--skip-existing"] if name != "whole" else []
        elif name != "whole":
            known = "--resume" if self.checkpoint.exists() else "--checkpoint"
            words += [known, str(self.checkpoint), "--every", "0.01"]
        return subprocess.Popen(
            [sys.executable, "-m", "wavecomb", "render", *words, "--quiet"],
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ
            | {
                "TMPDIR": str(self.temporary),
                "WAVECOMB_SANDBOX": self.kind.sandbox,
            },
        )

    def kill(self, times: int) -> int:
        """Kills the render a number of times.

        Returns how often the render ended before it was killed.
        """
        killed = ended = 0
        while killed < times:
            process = self.start("a")
            # Kill at times from the first steps of the render to shortly after its end.
            time.sleep(self.random.uniform(0.02, 1.1) * self.whole_s)
            process.kill()
            _, errors = process.communicate()
            assert process.returncode in (0, -signal.SIGKILL), errors
            killed += process.returncode != 0
            self.look()
            if process.returncode == 0:  # If the process ended before the signal, start another
                # one.
                ended += 1
                assert all((self.folder / name).exists() for name in self.kind.outputs("a"))
                for name in self.kind.outputs("a"):
                    (self.folder / name).unlink()
                self.checkpoint.unlink(missing_ok=True)
        return ended

    def look(self) -> None:
        """Asserts that all files are complete and that no process still runs."""
        deadline = time.monotonic() + 20
        while left := processes_below(self.temporary):
            assert time.monotonic() < deadline, left
            time.sleep(0.05)
        if self.checkpoint.exists():
            load_checkpoint(self.checkpoint)
        names = zip(self.kind.outputs("whole"), self.kind.outputs("a"), strict=True)
        for whole, name in names:
            if (self.folder / name).exists():
                same_pictures(self.folder / whole, self.folder / name)

    def finish(self) -> None:
        """Lets the render end, and asserts that its result equals an undisturbed render's."""
        process = self.start("a")
        _, errors = process.communicate()
        assert process.returncode == 0, errors
        self.look()
        expected = {*self.kind.outputs("whole"), *self.kind.outputs("a")}
        expected |= set() if self.kind.frames else {"a.ckpt"}
        assert set(os.listdir(self.folder)) == expected, "nothing is left over"


def same_pictures(one: Path, two: Path) -> None:
    first, second = read_layers(one), read_layers(two)
    assert list(first) == list(second)
    for layer, pixels in first.items():
        assert pixels.tobytes() == second[layer].tobytes(), (two, layer)


Start = Callable[[str, int], Killer]


@pytest.fixture
def start(request: pytest.FixtureRequest, tmp_path: Path) -> Start:
    """A function that returns a ``Killer`` for a kind of render, after one undisturbed render."""

    def make(name: str, seed: int) -> Killer:
        kind = KINDS[name]
        return Killer(kind, request.getfixturevalue(kind.stage), tmp_path, seed)

    return make


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_kill_a_few_times(kind: str, start: Start) -> None:
    killer = start(kind, 1)
    killer.kill(2)
    killer.finish()


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_kill_a_hundred_times(kind: str, start: Start) -> None:
    killer = start(kind, 2)
    killer.kill(KILLS)
    killer.finish()
