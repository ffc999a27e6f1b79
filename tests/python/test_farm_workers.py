# SPDX-License-Identifier: Apache-2.0
"""Workers: whole jobs by the command, workers that are killed, refused or stopped."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import forks
import numpy as np
import pytest
from farm_jobs import cornell_in, processes_of, same, wait_for
from parts import needs
from test_texture_limit import MOVING_CAMERA, textured, write_image

from wavecomb import farm
from wavecomb.farm.files import write_json
from wavecomb.farm.folder import DONE, TODO
from wavecomb.version import version

pytestmark = [needs("wavecomb._core"), pytest.mark.slow]

SMALL = ("--size", "48", "32", "--spp", "4", "--threads", "1")


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cornell_in(tmp_path_factory.mktemp("farm"))


@pytest.fixture(scope="module")
def moving(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A picture on a square, before a camera that moves."""
    folder = tmp_path_factory.mktemp("moving")
    noise = np.random.default_rng(3)
    write_image(folder / "a.png", noise.integers(0, 256, (64, 64, 3), np.uint8))
    text = "#usda 1.0\n" + textured("M", "a.png", 1) + MOVING_CAMERA
    path = folder / "stage.usda"
    path.write_text(text)
    return path


def run(*words: str | Path) -> subprocess.CompletedProcess[str]:
    """The command, and how it ends."""
    return forks.wavecomb(*words, timeout=200)


def test_one_picture_by_two_workers(stage: Path, tmp_path: Path) -> None:
    layers = ("crypto", "depth", "position", "light_groups", "error")
    words = (*SMALL, *(word for name in layers for word in ("--aov", name)), "--png")
    done = run(
        "farm", "submit", stage, "-o", tmp_path / "a.exr", *words, tmp_path / "a.png",
        "--tiles", "2x2", "--on", "local:2", "--json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["state"] == "done" and said["tasks"][DONE] == 5
    one = forks.wavecomb(
        "render", str(stage), "-o", str(tmp_path / "b.exr"), *words, str(tmp_path / "b.png")
    )
    assert one.returncode == 0, one.stderr
    same(tmp_path / "a.exr", tmp_path / "b.exr")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    folder = farm.Folder(tmp_path / "a.farm")
    assert folder.assets()[0]["path"] == str(stage)
    assert not processes_of(folder.path)


def test_frames_of_a_stage(moving: Path, tmp_path: Path) -> None:
    """Failures of one do not stop the others; retry mends them."""
    names = tmp_path / "a.##.exr"
    words = ("--frames", "1-4", *SMALL, "--stats", tmp_path / "a.##.json")
    (tmp_path / "a.03.exr").mkdir()
    job = tmp_path / "job"
    made = run("farm", "submit", moving, "-o", names, *words, "--job", job, "--on", "none")
    assert made.returncode == 2 and "a.03.exr: is a folder" in made.stderr
    (tmp_path / "a.03.exr").rmdir()
    made = run("farm", "submit", moving, "-o", names, *words, "--job", job, "--on", "none")
    assert made.returncode == 0 and "wavecomb farm worker" in made.stdout, made.stderr
    (tmp_path / "a.03.exr").mkdir()
    done = run("farm", "resume", job)
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
    assert "3 of 4 pictures are written; failed: frame 3:" in done.stderr
    assert "a.03.exr" in run("farm", "logs", job).stdout
    (tmp_path / "a.03.exr").rmdir()
    assert run("farm", "retry", job, "000002.0000", "--quiet").returncode == 0
    one = forks.wavecomb(
        "render", str(moving), "-o", str(tmp_path / "b.##.exr"), *map(str, words[:-2])
    )
    assert one.returncode == 0, one.stderr
    for frame in range(1, 5):
        same(tmp_path / f"a.{frame:02}.exr", tmp_path / f"b.{frame:02}.exr")
        assert (
            json.loads((tmp_path / f"a.{frame:02}.json").read_text())["counts"]["samples"] == 6144
        )


def test_a_stop_keeps_what_is_done(stage: Path, tmp_path: Path) -> None:
    """SIGTERM: a checkpoint, with which the next worker goes on, and no try is counted."""
    folder = farm.submit(
        stage, tmp_path / "a.exr", size=(64, 64), spp=1500, threads=1, strict=False
    )
    words = [sys.executable, "-m", "wavecomb", "farm", "worker", str(folder.path)]
    worker = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)

    def progress() -> bool:
        found = farm.status(folder, tasks=False)["workers"]
        return bool(found and found[0]["share"])

    wait_for(progress)
    worker.terminate()
    worker.communicate(timeout=60)
    assert worker.returncode == 143
    entry = folder.entries(TODO)[0]
    assert entry.attempt == 1 and folder.checkpoint(entry.task).exists()
    assert run("farm", "cancel", folder.path).returncode == 0
    assert farm.status(folder)["state"] == "cancelled"
    idle = run("farm", "worker", folder.path, "--json")
    assert idle.returncode == 0 and json.loads(idle.stdout).keys() == {"worker"}
    assert run("farm", "resume", folder.path, "--threads", "2").returncode == 0
    assert "goes on after" in folder.logs(entry.task.id)


def test_a_foreign_worker_is_refused(stage: Path, tmp_path: Path) -> None:
    folder = farm.submit(stage, tmp_path / "a.exr", size=(8, 8), spp=1, strict=False)
    write_json(
        folder.path / "class.json",
        {"version": version(), "isa": "avx9", "library": "1", "probe": "2"},
    )
    done = run("farm", "worker", folder.path)
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
    assert "is of another class: its instruction set is" in done.stderr and "avx9" in done.stderr
    assert folder.entries(TODO)[0].attempt == 1, "another may do it"


def test_missing_files(moving: Path, tmp_path: Path) -> None:
    """Named when a job is submitted, and by a worker that lacks them; never a checker."""
    text = moving.read_text()
    broken = tmp_path / "stage.usda"
    broken.write_text(text)
    words = ("farm", "submit", broken, "-o", tmp_path / "a.exr", *SMALL)
    done = run(*words)
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
    assert "a.png" in done.stderr and not (tmp_path / "a.farm").exists()
    listed = run("farm", "assets", broken)
    assert listed.returncode == 2 and "missing: file a.png" in listed.stderr
    image = tmp_path / "a.png"
    image.write_bytes((moving.parent / "a.png").read_bytes())
    assert run(*words, "--on", "none").returncode == 0
    image.write_bytes((moving.parent / "a.png").read_bytes() + b" ")
    done = run("farm", "worker", tmp_path / "a.farm")
    assert done.returncode == 2 and "a.png is not what it was" in done.stderr
    image.unlink()
    assert run(*words, "--no-strict", "--job", tmp_path / "other").returncode == 0


def test_what_the_command_refuses(stage: Path, tmp_path: Path) -> None:
    for words, said in (
        (("--on", "cloud"), "--on cloud"),
        (("--tiles", "0x3"), "--tiles 0x3"),
        (("--time-limit", "3"), "--time-limit"),
        (("--noise", "0.1", "--tiles", "2x2"), "--noise 0.1"),
        (("--resume", "x.ckpt"), "--resume"),
        (("--film-memory", "3"), "--film-memory"),
        (("--isa", "x86-64-v9"), "--isa x86-64-v9"),
    ):
        done = forks.wavecomb("farm", "submit", str(stage), "-o", str(tmp_path / "a.exr"), *words)
        assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
        assert said in done.stderr
    assert not list(tmp_path.iterdir())


def test_other_schedulers(stage: Path, tmp_path: Path) -> None:
    """What they are given runs the same workers."""
    folder = farm.submit(stage, tmp_path / "a.exr", size=(16, 16), spp=1, tiles="2x1", strict=False)
    script, template = tmp_path / "a.sh", tmp_path / "a.json"
    done = run("farm", "export", folder.path, "--slurm", script, "--openjd", template)
    assert done.returncode == 0, done.stderr
    ran = subprocess.run(
        ["bash", str(script)],
        env={**os.environ, "SLURM_ARRAY_TASK_ID": "1", "SLURM_CPUS_PER_TASK": "1"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ran.returncode == 0, ran.stderr
    assert farm.status(folder)["state"] == "done" and (tmp_path / "a.exr").exists()
    steps = json.loads(template.read_text())["steps"]
    again = steps[0]["script"]["actions"]["onRun"]
    ended = subprocess.run([again["command"], *again["args"]], capture_output=True, timeout=60)
    assert ended.returncode == 0, "a worker that comes late ends at once"


@needs("openjd.cli")
def test_open_job_description(stage: Path, tmp_path: Path) -> None:
    """`openjd run` has the same workers run; its second step writes what is left."""
    folder = farm.submit(stage, tmp_path / "a.exr", size=(16, 16), spp=1, strict=False)
    template = tmp_path / "a.json"
    words = ("--openjd", template, "--workers", "2")
    assert run("farm", "export", folder.path, *words).returncode == 0
    ran = subprocess.run(
        [sys.executable, "-c", "from openjd.cli import main; main()", "run", str(template)],
        capture_output=True,
        text=True,
        timeout=120,
        cwd=tmp_path,
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert (tmp_path / "a.exr").exists() and farm.status(folder)["state"] == "done"


def test_by_ssh(stage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker for each host: what stands for ssh here runs the command, as its end would."""
    programs = tmp_path / "bin"
    programs.mkdir()
    ssh = programs / "ssh"
    ssh.write_text(f'#!/bin/sh\necho "$3" >> {tmp_path}/hosts\nexec sh -c "$4"\n')
    ssh.chmod(0o755)
    monkeypatch.setenv("PATH", f"{programs}:{os.environ['PATH']}")
    folder = farm.submit(
        stage, tmp_path / "a.exr", size=(16, 16), spp=1, tiles="2x1", threads=1, strict=False
    )
    done = run("farm", "resume", folder.path, "--on", "ssh:one,me@two")
    assert done.returncode == 0, done.stderr
    assert sorted((tmp_path / "hosts").read_text().split()) == ["me@two", "one"]
    ssh.write_text("#!/bin/sh\necho 'ssh: no such host' >&2\nexit 255\n")
    (tmp_path / "a.exr").unlink()
    done = run("farm", "resume", folder.path, "--on", "ssh:one")
    assert done.returncode == 2 and done.stderr == "error: ssh: no such host\n"
    done = run("farm", "resume", folder.path, "--on", "ssh:-oProxyCommand=x")
    assert done.returncode == 2 and "--on ssh:-oProxy" in done.stderr
