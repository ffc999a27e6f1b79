# SPDX-License-Identifier: Apache-2.0
"""Tests `wavecomb farm` from end to end: equal images, resuming, tiles by other schedulers."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import forks
import pytest
from farm_jobs import cornell_in, left_behind, processes_of, same
from parts import needs

from wavecomb import farm
from wavecomb.farm.job import Task
from wavecomb.farm.machine_class import machine_class

pytestmark = needs("wavecomb._core", "distributed", "cryptography")

SMALL = ("--size", "48", "32", "--spp", "4", "--threads", "1")


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cornell_in(tmp_path_factory.mktemp("farm"))


def run(*words: str | Path) -> subprocess.CompletedProcess[str]:
    """Runs the command and returns its exit code and output."""
    return forks.wavecomb(*words, timeout=200)


def one_line(done: subprocess.CompletedProcess[str], *said: str) -> None:
    """Asserts that a command ended and printed one line on standard error."""
    assert done.returncode == 2 and done.stderr.count("\n") == 1, done.stderr
    for text in said:
        assert text in done.stderr, done.stderr


@pytest.mark.slow
def test_one_image_by_two_workers(stage: Path, tmp_path: Path) -> None:
    """The image uses a guiding field that is trained once for all tiles."""
    layers = ("crypto", "depth", "position", "light_groups", "error")
    guided = ("--size", "48", "32", "--spp", "96", "--threads", "1", "--guiding", "on")
    words = (*guided, *(word for name in layers for word in ("--aov", name)), "--png")
    done = run(
        "farm", "submit", stage, "-o", tmp_path / "a.exr", *words, tmp_path / "a.png",
        "--tiles", "2x2", "--on", "local:2", "--json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout.splitlines()[-1])
    assert said["state"] == "done" and said["tasks"] == {"all": 4, "done": 4}
    one = run("render", stage, "-o", tmp_path / "b.exr", *words, tmp_path / "b.png")
    assert one.returncode == 0, one.stderr
    same(tmp_path / "a.exr", tmp_path / "b.exr")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    folder = farm.Folder(tmp_path / "a.farm")
    assert folder.job.files[0].path == str(stage)
    assert not processes_of(folder.path) and not left_behind(tmp_path)


@pytest.mark.slow
def test_frames_where_one_fails(stage: Path, tmp_path: Path) -> None:
    """The farm writes the frames without errors. Resuming renders only missing or damaged files."""
    names, job = tmp_path / "a.##.exr", tmp_path / "job"
    words = ("--frames", "1-3", *SMALL, "--stats", tmp_path / "a.##.json")
    made = run("farm", "submit", stage, "-o", names, *words, "--job", job, "--on", "none")
    assert made.returncode == 0 and "3 tasks" in made.stdout, made.stderr
    (tmp_path / "a.03.exr").mkdir()
    done = run("farm", "resume", job)
    one_line(done, "2 of 3 images are written", "failed: frame 3:", "a.03.exr", "farm resume")
    assert farm.status(farm.Folder(job)).as_dict()["images"] == {"all": 3, "done": 2}
    (tmp_path / "a.03.exr").rmdir()
    first = (tmp_path / "a.01.exr").read_bytes()
    (tmp_path / "a.01.exr").write_bytes(first[: len(first) // 2])
    untouched = (tmp_path / "a.02.exr").stat().st_mtime_ns
    said = run("farm", "status", job)
    assert "1 of 3 images are written, 2 of 3 tiles" in said.stdout, said.stdout
    done = run("farm", "resume", job, "--quiet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "a.02.exr").stat().st_mtime_ns == untouched
    one = run("render", stage, "-o", tmp_path / "b.##.exr", *words[:-2])
    assert one.returncode == 0, one.stderr
    for frame in range(1, 4):
        same(tmp_path / f"a.{frame:02}.exr", tmp_path / f"b.{frame:02}.exr")
        counts = json.loads((tmp_path / f"a.{frame:02}.json").read_text())["counts"]
        assert counts["samples"] == 6144
    again = run("farm", "resume", job)
    assert again.returncode == 0 and "3 of 3 images are written in" in again.stdout


@pytest.mark.slow
def test_a_stage_that_changed_is_rendered_again(stage: Path, tmp_path: Path) -> None:
    here = tmp_path / "s.usda"
    here.write_text(f'#usda 1.0\n( subLayers = [@{stage}@] )\nover "X" {{}}\n')
    words = ("farm", "submit", here, "-o", tmp_path / "a.exr", *SMALL, "--tiles", "2x1")
    assert run(*words, "--on", "none").returncode == 0
    folder = farm.Folder(tmp_path / "a.farm")
    assert run("farm", "task", folder.path, "--tile", "1/2").returncode == 0
    part = folder.part(Task(0, 0))
    assert part.exists() and farm.status(folder).tasks_done == 1
    here.write_text(here.read_text().replace('over "X" {}', 'over "Y" {}'))
    done = run("farm", "task", folder.path, "--tile", "2/2")
    one_line(done, "s.usda is not what it was when the job was submitted")
    done = run("farm", "resume", folder.path)
    assert done.returncode == 0 and "1 files of the stage have changed" in done.stdout
    one = run("render", here, "-o", tmp_path / "b.exr", *SMALL)
    assert one.returncode == 0
    same(tmp_path / "a.exr", tmp_path / "b.exr")


@pytest.mark.slow
def test_tiles_by_another_queue(stage: Path, tmp_path: Path) -> None:
    """Renders each tile by `render --tile`, in any order, and runs `farm assemble` at the end."""
    words = (*SMALL, "--aov", "crypto", "--png", tmp_path / "a.##.png", "--frames", "1-2")
    names = ("render", stage, "-o", tmp_path / "a.##.exr", *words)
    for tile in ("3/3", "1/3"):
        done = run(*names, "--tile", tile)
        assert done.returncode == 0, done.stderr
    one_line(run("farm", "assemble", tmp_path / "a.01.exr"), "tiles are missing", "tile-2-of-3")
    assert run(*names, "--tile", "2/3").returncode == 0
    second = tmp_path / "a.02.tile-2-of-3.exr"
    good = second.read_bytes()
    second.write_bytes(good[:-40] + bytes(40))
    done = run("farm", "assemble", tmp_path / "a.01.exr", tmp_path / "a.02.exr")
    one_line(done, "a.02.tile-2-of-3.exr: is damaged")
    assert (tmp_path / "a.01.exr").exists() and not (tmp_path / "a.02.exr").exists()
    other = run(*names[:-1], "2", "--tile", "2/3", "--spp", "8")
    assert other.returncode == 0
    one_line(run("farm", "assemble", tmp_path / "a.02.exr"), "is of other settings, files or mach")
    second.write_bytes(good)
    assert run("farm", "assemble", tmp_path / "a.02.exr").returncode == 0
    one = run("render", stage, "-o", tmp_path / "b.##.exr", *words[:-4], "--frames", "1-2")
    assert one.returncode == 0, one.stderr
    for frame in ("01", "02"):
        same(tmp_path / f"a.{frame}.exr", tmp_path / f"b.{frame}.exr")
        assert (tmp_path / f"a.{frame}.png").exists()
    assert not list(tmp_path.glob("*tile*")) and not left_behind(tmp_path)
    one_line(run("farm", "assemble", tmp_path / "a.01.exr"), "has no tiles beside it")


def test_what_tiles_refuse(stage: Path, tmp_path: Path) -> None:
    for words, said in (
        (("--tile", "9/8"), "--tile 9/8: must be I/N"),
        (("--tile", "64"), "tiles inside the file are --exr-tile"),
        (("--tile", "1/99999"), "--tile: 99999 tiles do not fit"),
        (("--tile", "1/2", "--noise", "0.1", "--spp", "32"), "--noise 0.1"),
        (("--tile", "1/2", "--time-limit", "3"), "--time-limit"),
        (("--tile", "1/2", "--checkpoint", str(tmp_path / "x")), "--checkpoint: is not for --tile"),
    ):
        one_line(run("render", stage, "-o", tmp_path / "a.exr", *SMALL, *words), said)
    one_line(run("render", stage, "--tile", "1/2"), "--tile: needs -o")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_tasks_of_a_job_by_another_queue(stage: Path, tmp_path: Path) -> None:
    words = ("--frames", "1-2", *SMALL, "--tiles", "2x1", "--on", "none")
    assert run("farm", "submit", stage, "-o", tmp_path / "a.#.exr", *words).returncode == 0
    job = tmp_path / "a.farm"
    for image, tile in ((1, "1/2"), (1, "2/2"), (2, "1/2")):
        done = run("farm", "task", job, "--image", str(image), "--tile", tile)
        assert done.returncode == 0, done.stderr
    part = farm.Folder(job).part(Task(0, 0))
    before = part.stat().st_mtime_ns
    assert run("farm", "task", job, "--tile", "1/2").returncode == 0
    assert part.stat().st_mtime_ns == before, "it was there"
    one_line(run("farm", "assemble", job), "frame 2, tile 2 of 2: not rendered")
    assert (tmp_path / "a.1.exr").exists() and not (tmp_path / "a.2.exr").exists()
    for words, said in (
        (("--image", "3"), "--image 3: the job has 2"),
        (("--tile", "1/3"), "--tile 1/3: images of this job have 2"),
    ):
        one_line(run("farm", "task", job, *words), said)
    assert run("farm", "resume", job).returncode == 0 and (tmp_path / "a.2.exr").exists()


@pytest.mark.slow
def test_missing_files(stage: Path, tmp_path: Path) -> None:
    here = tmp_path / "s.usda"
    here.write_text(
        f"#usda 1.0\n( subLayers = [@{stage}@] )\n"
        'def DomeLight "D" {\n asset inputs:texture:file = @gone.png@\n}\n'
    )
    words = ("farm", "submit", here, "-o", tmp_path / "a.exr", *SMALL, "--on", "none")
    one_line(run(*words), "file gone.png does not exist: /D.inputs:texture:file (--no-strict")
    assert not (tmp_path / "a.farm").exists()
    assert run(*words, "--no-strict").returncode == 0
    done = run("farm", "task", tmp_path / "a.farm")
    assert done.returncode == 0 and "warning: " in done.stderr and "gone.png" in done.stderr
    assert run("farm", "assemble", tmp_path / "a.farm").returncode == 0
    assert (tmp_path / "a.exr").exists()


@pytest.mark.slow
def test_what_the_command_refuses(stage: Path, tmp_path: Path) -> None:
    for words, said in (
        (("--checkpoint", str(tmp_path / "x")), "--checkpoint: is not for a farm"),
        (("--preview", str(tmp_path / "x.png")), "--preview: is not for a farm"),
        (("--costs", str(tmp_path / "x.json")), "--costs: is not for a farm"),
        (("--tiles", "0x2"), "--tiles 0x2"),
        (("--noise", "0.1", "--tiles", "2x2"), "--noise 0.1"),
        (("--map", "a=b"), "--map a=b: must be FROM=TO"),
        (("--isa", "z80"), "--isa z80: there are"),
        (("--on", "ssh:one"), "--on ssh:one: must be local"),
        (("--on", "dask:10.0.0.1:8786"), "can run code"),
    ):
        done = run("farm", "submit", stage, "-o", tmp_path / "a.exr", *words)
        one_line(done, said)
    assert not list(tmp_path.iterdir())
    one_line(run("farm", "submit", tmp_path / "no.usd", "-o", tmp_path / "a.exr"), "no.usd")
    gone = ("worker", "cancel", "retry", "logs", "assets", "certificates")
    for command in gone:
        assert run("farm", command, tmp_path).returncode == 2
    said = run("farm", "--help").stdout
    assert not any(f"\n  {command} " in said for command in (*gone, "plan"))


@pytest.mark.slow
def test_a_size_in_percent(stage: Path, tmp_path: Path) -> None:
    words = ("-o", tmp_path / "a.exr", "--size", "12.5%", "--on", "none", "--job", tmp_path / "job")
    done = run("farm", "submit", stage, *words)
    assert done.returncode == 0, done.stderr
    settings = farm.Folder(tmp_path / "job").job.shots[0].settings
    assert (settings["width"], settings["height"]) == (75, 75)


PLANTED = 'from pathlib import Path\nPath(__file__).with_name("RAN").touch()\nraise SystemExit\n'


@pytest.mark.slow
def test_modules_in_the_working_folder_never_run(stage: Path, tmp_path: Path) -> None:
    """Unlike Dask, Wavecomb must not put the working folder on the workers' module path."""
    place = tmp_path / "cwd"
    place.mkdir()
    for name in ("json", "signal", "struct", "yaml", "distributed", "wavecomb", "numpy", "pxr"):
        (place / f"{name}.py").write_text(PLANTED)
    words = ("farm", "submit", str(stage), "-o", "a.exr", *SMALL, "--on", "local:2")
    program = "from wavecomb.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-I", "-c", program, *words], cwd=place, capture_output=True, text=True,
        timeout=200,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (place / "a.exr").exists() and not (place / "RAN").exists()


@pytest.mark.slow
@needs("openjd.cli")
@pytest.mark.parametrize("name", ["plain", "with {{Param.Job}} and `touch RAN`; $(touch RAN)"])
def test_open_job_description(stage: Path, tmp_path: Path, name: str) -> None:
    """`openjd run` renders a task for each tile and assembles the images at the end."""
    place = tmp_path / name
    place.mkdir()
    words = ("--frames", "1-2", *SMALL, "--tiles", "2x1", "--on", "none")
    done = run("farm", "submit", stage, "-o", place / "a.#.exr", *words)
    assert done.returncode == 0, done.stderr
    template = tmp_path / "a.json"
    assert run("farm", "export", place / "a.farm", "--openjd", template).returncode == 0
    value = json.loads(template.read_text())
    texts = json.dumps([value["name"], value["steps"]])
    assert str(tmp_path) not in texts, "names are values of parameters only"
    ran = subprocess.run(
        [sys.executable, "-c", "from openjd.cli import main; main()", "run", str(template)],
        capture_output=True, text=True, timeout=200, cwd=tmp_path,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert (place / "a.1.exr").exists() and farm.status(
        farm.Folder(place / "a.farm")
    ).state == "done"
    assert not (tmp_path / "RAN").exists()


@pytest.mark.slow
def test_names_with_line_breaks(stage: Path, tmp_path: Path) -> None:
    place = tmp_path / "a\ntouch RAN\n{{x}}"
    place.mkdir()
    shutil.copy(stage, place / "s\n#SBATCH.usdc")
    words = (*SMALL, "--tiles", "2x1", "--on", "local:2", "--quiet")
    done = run("farm", "submit", place / "s\n#SBATCH.usdc", "-o", place / "a.exr", *words)
    assert done.returncode == 0, done.stderr
    assert (place / "a.exr").exists()
    exported = run("farm", "export", place / "a.farm", "--openjd", tmp_path / "x.json")
    if exported.returncode == 0:
        found = json.loads((tmp_path / "x.json").read_text())["parameterDefinitions"]
        assert found[0]["default"] == str(place / "a.farm")
    else:
        one_line(exported, "the data model refuses this job")


@pytest.mark.slow
def test_path_maps(stage: Path, tmp_path: Path) -> None:
    """Path maps apply to the stage, all files that it names, and the images."""
    first, other = tmp_path / "here", tmp_path / "elsewhere"
    (first / "out").mkdir(parents=True)
    shutil.copy(stage, first / "box.usdc")
    (first / "s.usda").write_text(f"#usda 1.0\n( subLayers = [@{first}/box.usdc@] )\n")
    one = run("render", first / "s.usda", "-o", tmp_path / "one.exr", *SMALL)
    assert one.returncode == 0, one.stderr
    words = ("farm", "submit", first / "s.usda", "-o", first / "out" / "a.exr", *SMALL)
    assert run(*words, "--tiles", "2x1", "--on", "none").returncode == 0
    first.rename(other)
    job = other / "out" / "a.farm"
    one_line(run("farm", "resume", job), "s.usda")
    done = run("farm", "resume", job, "--on", "local:2", "--map", f"{first}={other}")
    assert done.returncode == 0, done.stderr
    but = ("wavecomb:render_seconds", "DateTime", "wavecomb:scene")
    same(other / "out" / "a.exr", tmp_path / "one.exr", but)
    assert not first.exists()


@pytest.mark.slow
def test_parts_of_another_class_do_not_count(stage: Path, tmp_path: Path) -> None:
    words = (*SMALL, "--tiles", "2x1", "--on", "none")
    assert run("farm", "submit", stage, "-o", tmp_path / "a.exr", *words).returncode == 0
    folder = farm.Folder(tmp_path / "a.farm")
    from wavecomb.farm.rendering import Renderer

    renderer = Renderer(folder.job, threads=1)
    renderer.render(Task(0, 0), folder.part(Task(0, 0)), "wavecomb-other")
    renderer.render(Task(0, 1), folder.part(Task(0, 1)), machine_class())
    assert farm.status(folder).tasks_done == 1, "of one class at most"
    one_line(run("farm", "assemble", folder.path), "of another class of machines")
    assert not (tmp_path / "a.exr").exists()
    assert os.listdir(folder.path / "parts") == ["000000"]
