# SPDX-License-Identifier: Apache-2.0
"""Tests farm jobs: tiles, keys, part files, assembled images and damaged jobs."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from farm_jobs import MACHINE, cornell_in, left_behind, render_all, same, work
from parts import needs

import wavecomb
from wavecomb.errors import WavecombError
from wavecomb.farm import Folder, status, submit
from wavecomb.farm.assembly import NarrowBorder, check_cover, finish_image, is_finished, join
from wavecomb.farm.job import Job, Task
from wavecomb.farm.planning import refresh, with_files
from wavecomb.farm.rendering import Renderer
from wavecomb.farm.tile_file import InvalidTile, has_tile, load_tile, read_tile
from wavecomb.farm.tiling import (
    border,
    choose_tiles,
    error_checks,
    grown,
    layout,
    max_error_checks,
    parse_tile,
    tiles_of,
)
from wavecomb.image.files.image import read_layers
from wavecomb.run.aovs import names

pytestmark = needs("wavecomb._core")


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cornell_in(tmp_path_factory.mktemp("farm"))


def job(stage: Path, folder: Path, **options: Any) -> Folder:
    options = {"size": (40, 24), "spp": 4, "tiles": "3x2", **options}
    name = "a.#.exr" if "frames" in options else "a.exr"
    return submit(stage, folder / name, **options)


# ---- tiles ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("tiles", [(1, 1), (3, 2), (7, 5), (100, 100)])
@pytest.mark.parametrize("region", [(0, 0, 40, 24), (5, 7, 12, 9), (3, 3, 4, 4)])
def test_tiles_cover_a_region(region: tuple[int, int, int, int], tiles: tuple[int, int]) -> None:
    check_cover(region, tiles_of(region, tiles))


@pytest.mark.parametrize(
    ("tiles", "said"),
    [
        ([(0, 0, 4, 2)], "no tile has the pixel 0, 2"),
        ([(0, 0, 4, 3), (0, 2, 4, 4)], "lies over another"),
        ([(0, 0, 4, 4), (0, 0, 5, 4)], "leaves the image"),
    ],
)
def test_a_cover_with_a_fault(tiles: list[Any], said: str) -> None:
    with pytest.raises(WavecombError, match=said):
        check_cover((0, 0, 4, 4), tiles)


def test_tiles_that_are_chosen() -> None:
    full = [(0, 0, 1920, 1080)]
    assert choose_tiles(full, 48, 4, False) == (1, 1), "whole frames are distributed"
    columns, rows = choose_tiles(full, 1, 4, False)
    assert 12 <= columns * rows <= 24 and columns > rows
    assert choose_tiles(full, 1, 4, True) == (1, 1)
    assert choose_tiles([(0, 0, 100, 60)], 1, 64, False) == (1, 1), "not below 64 pixels"


@pytest.mark.parametrize("count", [1, 2, 3, 7, 8, 12, 97])
def test_a_layout_has_as_many_tiles_as_asked_for(count: int) -> None:
    region = (0, 0, 192, 108)
    assert len(tiles_of(region, layout(count, region))) == count
    assert parse_tile(f"{count}/{count}") == (count - 1, count)
    with pytest.raises(WavecombError, match="do not fit into 2 x 2 pixels"):
        layout(5, (0, 0, 2, 2))
    for text in ("0/4", "5/4", "x", "1", "-1/4", "1/4\n"):
        with pytest.raises(WavecombError, match="must be I/N"):
            parse_tile(text)


def test_a_border_is_good_for_all_looks(stage: Path) -> None:
    """An adaptive render that never converges makes at most ``max_error_checks`` error checks."""
    settings = {"spp": 200, "min_spp": 16}
    picture = wavecomb.render(stage, size=(8, 8), adaptive=1e-6, **settings)
    assert error_checks(settings) < picture.stats["passes"] <= max_error_checks(settings)
    assert border({**settings, "adaptive": 0.1}, 3) == 14 and border(settings, 3) == 0
    assert grown((4, 0, 8, 4), 3, (0, 0, 9, 9)) == (1, 0, 9, 7)


# ---- jobs ----------------------------------------------------------------------------------------


def test_a_folder_is_whole_or_absent(stage: Path, tmp_path: Path) -> None:
    folder = job(stage, tmp_path)
    assert Folder(folder.path).job == folder.job
    assert len(list(folder.job.tasks())) == folder.job.task_count() == 6
    with pytest.raises(WavecombError, match="already exists"):
        job(stage, tmp_path)
    assert sorted(os.listdir(tmp_path)) == ["a.farm"] and os.listdir(folder.path) == ["job.json"]
    with pytest.raises(WavecombError, match="is no folder of a job"):
        Folder(tmp_path)


def test_an_old_job_is_refused_in_one_line(tmp_path: Path) -> None:
    old = {"kind": "wavecomb-farm-job", "format": 1, "id": "x", "version": "0.1.0", "shots": []}
    (tmp_path / "job.json").write_text(json.dumps(old))
    with pytest.raises(WavecombError) as caught:
        Folder(tmp_path)
    said = str(caught.value)
    assert "job.json: is a job of format 1" in said and "\n" not in said
    assert said.endswith("submit the job again")


CHANGES: dict[str, Any] = {
    "no shots": {"shots": []},
    "no images": {"images": []},
    "no tiles": {"tiles": [0, 1]},
    "too many tiles": {"tiles": [10_000, 1]},
    "tiles that are no numbers": {"tiles": ["3", 2]},
    "one tile number": {"tiles": [3]},
    "an image of no shot": {"images": [[7, None]]},
    "a negative shot": {"images": [[-1, None]]},
    "a frame that is none": {"images": [[0, "one"]]},
    "a frame that is not finite": {"images": [[0, float("inf")]]},
    "no tries": {"tries": 0},
    "no patience": {"hang_s": 0},
    "files that are none": {"files": [3]},
    "files without hashes": {"files": [{"path": "x"}]},
    "a tone map that is none": {"tone_map": "loud"},
    "a field too few": {"stage": ...},
    "too many tasks": {"images": [[0, n] for n in range(40_000)], "tiles": [6, 1]},
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_damaged_job_is_one_line(stage: Path, tmp_path: Path, change: str) -> None:
    folder = job(stage, tmp_path)
    value = {**json.loads((folder.path / "job.json").read_text()), **CHANGES[change]}
    value = {name: entry for name, entry in value.items() if entry is not ...}
    (folder.path / "job.json").write_text(json.dumps(value))
    with pytest.raises(WavecombError, match=r"job\.json: is damaged: ") as caught:
        Folder(folder.path)
    assert "\n" not in str(caught.value) and "submit the job again" in str(caught.value)


@pytest.mark.parametrize(
    "settings",
    [{"width": 0}, {"width": 1 << 20}, {"region": [5, 5, 5, 9]}, {"region": [0, 0, 99, 9]},
     {"height": None}, {"region": "x"}],
)  # fmt: skip
def test_a_shot_that_is_damaged(stage: Path, tmp_path: Path, settings: dict[str, Any]) -> None:
    folder = job(stage, tmp_path)
    value = json.loads((folder.path / "job.json").read_text())
    value["shots"][0]["settings"] |= settings
    with pytest.raises(WavecombError, match="x: is damaged"):
        Job.of(value, "x")


def test_a_job_reads_back_as_it_is(stage: Path, tmp_path: Path) -> None:
    folder = job(stage, tmp_path, frames="1-2")
    found = folder.job
    again = Job.of(json.loads(json.dumps(found.as_json())), "x")
    assert again == found and again.id == found.id
    assert found.title(1, 3) == "frame 2, tile 4 of 6" and found.title(0) == "frame 1"
    assert dataclasses.replace(found, tiles=(100, 1)).tile_count(0) == 40


def test_what_a_farm_refuses(stage: Path, tmp_path: Path) -> None:
    for options, said in (
        ({"time_limit": 5.0}, "--time-limit"),
        ({"noise": 0.1, "spp": 64}, "--noise 0.1: applies to the whole image"),
        ({"allocate": "error", "spp": 64}, "--allocate error"),
        ({"roulette": "cost-aware", "costs": "measured"}, "--costs measured"),
    ):
        with pytest.raises(WavecombError, match=said):
            job(stage, tmp_path, **options)
    assert job(stage, tmp_path, noise=0.1, spp=64, tiles="auto").job.tiles == (1, 1)


# ---- keys ----------------------------------------------------------------------------------------


def test_a_key_names_all_that_decides_pixels(stage: Path, tmp_path: Path) -> None:
    found = job(stage, tmp_path, frames="1-2").job
    task = Task(0, 0)
    key = found.tile_key(task, MACHINE)
    shot = found.shots[0]
    others = [
        found.tile_key(Task(0, 1), MACHINE),
        found.tile_key(Task(1, 0), MACHINE),
        found.tile_key(task, "another machine"),
        dataclasses.replace(found, version="0").tile_key(task, MACHINE),
        dataclasses.replace(found, files=()).tile_key(task, MACHINE),
        dataclasses.replace(found, learned="x").tile_key(task, MACHINE),
        dataclasses.replace(found, costs={"m": {"a": 1.0}}).tile_key(task, MACHINE),
        dataclasses.replace(
            found, shots=(dataclasses.replace(shot, settings={**shot.settings, "seed": 9}),)
        ).tile_key(task, MACHINE),
        dataclasses.replace(
            found, shots=(dataclasses.replace(shot, aovs=(*shot.aovs, "uv")),)
        ).tile_key(task, MACHINE),
    ]
    assert len({key, *others}) == len(others) + 1
    threads = dataclasses.replace(shot, settings={**shot.settings, "threads": 7})
    more = dataclasses.replace(found, shots=(threads,), exposure=1.0, tries=9)
    assert more.tile_key(task, MACHINE) == key, "these change no pixel of a part"
    assert more.output_key(0) != found.output_key(0)


def test_a_stage_file_that_changes_changes_keys(stage: Path, tmp_path: Path) -> None:
    here = tmp_path / "cornell.usdc"
    shutil.copy(stage, here)
    folder = job(here, tmp_path)
    key = folder.job.tile_key(Task(0, 0), MACHINE)
    assert refresh(folder, with_files(folder.job)) == 0
    with here.open("ab") as file:
        file.write(b"\0")
    assert refresh(folder, with_files(folder.job)) == 1
    assert Folder(folder.path).job.tile_key(Task(0, 0), MACHINE) != key


# ---- parts ---------------------------------------------------------------------------------------


def test_a_tile_holds_its_own_pixels(stage: Path, tmp_path: Path) -> None:
    folder = job(stage, tmp_path, size=(400, 400), spp=1, tiles="4x4")
    task = Task(0, 5)
    Renderer(folder.job, threads=1).render(task, folder.part(task), MACHINE)
    part = read_tile(folder.part(task))
    assert part.layers["beauty"].shape == (100, 100, 3)
    assert part.layers["samples"].dtype == np.uint32
    whole = wavecomb.render(stage, size=(400, 400), spp=1).stats["memory_bytes"]["film"]
    assert part.stats["memory_bytes"]["film"] < whole / 12


def damages(good: bytes, other: bytes) -> dict[str, bytes | None]:
    """Returns damaged versions of a part's file."""
    middle = len(good) // 2
    return {
        "missing": None,
        "empty": b"",
        "cut short": good[:middle],
        "without its last byte": good[:-1],
        "zeroed": bytes(len(good)),
        "zeroed at its end": good[:middle] + bytes(len(good) - middle),
        "another tile": other,
        "no image": b"x" * len(good),
        "one bit": good[:-9] + bytes([good[-9] ^ 1]) + good[-8:],
    }


def test_a_part_counts_only_if_it_is_right(stage: Path, tmp_path: Path) -> None:
    folder = job(stage, tmp_path)
    render_all(folder)
    task, tile = Task(0, 2), folder.job.rectangles(0)[2]
    file, key = folder.part(task), folder.job.tile_key(task, MACHINE)
    assert load_tile(file, key, tile).tile == tile
    assert not has_tile(file, folder.job.tile_key(task, "another machine"), tile)
    assert not has_tile(file, key, tile, checks=3), "its border is too narrow"
    good = file.read_bytes()
    for what, data in damages(good, folder.part(Task(0, 1)).read_bytes()).items():
        file.unlink(missing_ok=True)
        if data is not None:
            file.write_bytes(data)
        assert not has_tile(file, key, tile), what
        with pytest.raises(InvalidTile):
            load_tile(file, key, tile)
        assert finish_image(folder, 0, MACHINE) == {"again": [2], "checks": 0}, what
        assert not (tmp_path / "a.exr").exists()
        assert status(folder).tasks_done == 5, what
    file.write_bytes(good)
    assert finish_image(folder, 0, MACHINE)["files"] and status(folder).state == "done"


def test_bits_of_a_part_that_flip_anywhere_are_found(stage: Path, tmp_path: Path) -> None:
    """A flipped bit is detected, unless it is in unused bytes, where it changes no pixel."""
    folder = job(stage, tmp_path, size=(8, 8), spp=1, tiles="1x1")
    render_all(folder)
    file = folder.part(Task(0, 0))
    good, first = file.read_bytes(), read_tile(file)
    found, steps = 0, range(0, len(good), max(1, len(good) // 200))
    for place in steps:
        file.write_bytes(good[:place] + bytes([good[place] ^ 0x10]) + good[place + 1 :])
        try:
            part = read_tile(file, (8, 8))
        except InvalidTile:
            found += 1
            continue
        if part.key != first.key:
            found += 1
            continue
        for name, layer in part.layers.items():
            assert layer.tobytes() == first.layers[name].tobytes(), (place, name)
    assert found > 0.8 * len(steps)


# ---- images --------------------------------------------------------------------------------------

ALL = [*(name for name in names() if name != "cost"), "light_groups"]
"""All AOVs except the measured cost."""
KINDS: dict[str, dict[str, Any]] = {
    "plain": {},
    "all layers": {"aovs": ALL, "spp": 16},
    "a region": {"region": (7, 3, 33, 20), "aovs": ALL},
    "a region in one tile": {"region": (7, 3, 33, 20), "tiles": "1x1"},
    "a crop": {"region": (7, 3, 33, 20), "crop": True, "aovs": ["crypto", "depth"]},
    "one tile": {"tiles": "1x1", "aovs": ALL},
    "errors": {"error": True, "spp": 32},
    "adaptive": {"adaptive": 0.03, "spp": 48, "size": (96, 64)},
    "learned": {"guiding": "on", "roulette": "efficient", "spp": 160},
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_tiles_are_the_image(stage: Path, tmp_path: Path, kind: str) -> None:
    """The assembled image equals the whole image in all bits and header entries."""
    options = {"size": (40, 24), "spp": 4, **KINDS[kind]}
    folder = job(stage, tmp_path, **options, file={"half": False, "compression": "zip"})
    work(folder)
    options.pop("tiles", None)
    whole = wavecomb.render(stage, **options)
    whole.save(tmp_path / "whole.exr")
    same(tmp_path / "a.exr", tmp_path / "whole.exr")
    assert not list((folder.path / "parts").iterdir()), "tiles go when their image is written"
    assert status(folder).state == "done" and not left_behind(tmp_path)
    if kind == "adaptive":
        assert len(np.unique(whole.samples)) > 2, "or nothing is tested"


@pytest.mark.slow
def test_a_border_that_was_too_narrow(stage: Path, tmp_path: Path) -> None:
    """A tile border that was too narrow is detected and widened."""
    options = {"size": (64, 48), "spp": 48, "adaptive": 0.03}
    folder = job(stage, tmp_path, **options)
    render_all(folder, checks=1)
    parts = (read_tile(folder.part(task)) for task in folder.job.tasks_of(0))
    with pytest.raises(NarrowBorder, match="is wide enough for 1 error checks"):
        join(folder.job, 0, parts)
    found = finish_image(folder, 0, MACHINE)
    assert found["again"] == list(range(6)) and found["checks"] > 5
    render_all(folder, checks=found["checks"])
    assert finish_image(folder, 0, MACHINE)["files"]
    wavecomb.render(stage, **options).save(tmp_path / "whole.exr")
    same(tmp_path / "a.exr", tmp_path / "whole.exr")


@needs("pyoidn")
def test_an_image_is_denoised_when_it_is_whole(stage: Path, tmp_path: Path) -> None:
    folder = job(stage, tmp_path, denoise=True, png=str(tmp_path / "a.png"))
    work(folder)
    whole = wavecomb.render(
        stage, size=(40, 24), spp=4, aovs=["albedo", "normal", "guide_albedo", "guide_normal"]
    ).with_denoised(threads=1)
    layers = read_layers(tmp_path / "a.exr")
    assert whole.denoised is not None and "guide_albedo" not in layers
    assert layers["denoised"].tobytes() == whole.denoised.tobytes()
    whole.save(tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_an_image_counts_only_with_the_bytes_that_were_written(stage: Path, tmp_path: Path) -> None:
    """A truncated, zeroed or replaced output file of any kind is detected."""
    files = {"png": str(tmp_path / "a.png"), "stats": str(tmp_path / "a.json")}
    folder = job(stage, tmp_path, file={"split": True}, aovs=["depth", "normal"], **files)
    work(folder)
    written = sorted(file for file in tmp_path.iterdir() if file.is_file())
    assert len(written) == 5, written
    other = tmp_path / "a.depth.exr"
    for file in written:
        good = file.read_bytes()
        for what, data in damages(good, other.read_bytes() + b"x").items():
            file.unlink(missing_ok=True)
            if data is not None:
                file.write_bytes(data)
            assert not is_finished(folder, 0), (file, what)
        file.write_bytes(good)
        assert is_finished(folder, 0)
    assert status(folder).state == "done"
    (folder.record(0)).write_text("[]")
    assert not is_finished(folder, 0)
