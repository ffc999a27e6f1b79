# SPDX-License-Identifier: Apache-2.0
"""A job in its parts: tiles, states of tasks, leases, blocks of pixels, assembled pictures."""

from __future__ import annotations

import dataclasses
import json
import os
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from farm_jobs import cornell_in, same, work
from parts import needs

import wavecomb
from wavecomb.errors import WavecombError
from wavecomb.farm import Folder, repair, retry, status, submit
from wavecomb.farm.assemble import check_cover
from wavecomb.farm.folder import BUSY, DONE, FAILED, TODO, Entry
from wavecomb.farm.leases import Beat, take_back
from wavecomb.farm.part import DamagedPart, NarrowBorder, load_part
from wavecomb.farm.rendering import Renderer
from wavecomb.farm.spec import Spec, Task
from wavecomb.farm.tiling import border, choose_tiles, grown, looks, most_looks, tiles_of
from wavecomb.picture.image import read_layers
from wavecomb.run.aovs import names

pytestmark = needs("wavecomb._core")


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cornell_in(tmp_path_factory.mktemp("farm"))


def job(stage: Path, folder: Path, **options: Any) -> Folder:
    options = {"size": (40, 24), "spp": 4, "tiles": "3x2", "strict": False, **options}
    return submit(stage, folder / "a.exr", **options)


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
        ([(0, 0, 4, 4), (0, 0, 5, 4)], "leaves the picture"),
    ],
)
def test_a_cover_that_is_none(tiles: list[Any], said: str) -> None:
    with pytest.raises(WavecombError, match=said):
        check_cover((0, 0, 4, 4), tiles)


def test_tiles_that_are_chosen() -> None:
    full = [(0, 0, 1920, 1080)]
    assert choose_tiles(full, 48, 4, False) == (1, 1), "whole frames are shared out"
    columns, rows = choose_tiles(full, 1, 4, False)
    assert 12 <= columns * rows <= 24 and columns > rows
    assert choose_tiles(full, 1, 4, True) == (1, 1)
    assert choose_tiles([(0, 0, 100, 60)], 1, 64, False) == (1, 1), "not below 64 pixels"


def test_a_border_is_good_for_all_looks(stage: Path) -> None:
    """An adaptive render whose pixels never end looks as often as is expected."""
    settings = {"spp": 200, "min_spp": 16}
    picture = wavecomb.render(stage, size=(8, 8), adaptive=1e-6, **settings)
    assert looks(settings) < picture.stats["passes"] <= most_looks(settings)
    assert border({**settings, "adaptive": 0.1}, 3) == 14 and border(settings, 3) == 0
    assert grown((4, 0, 8, 4), 3, (0, 0, 9, 9)) == (1, 0, 9, 7)


# ---- states of tasks -----------------------------------------------------------------------------


def test_one_of_many_gets_a_task(stage: Path, tmp_path: Path) -> None:
    folder = job(stage, tmp_path)
    entry = folder.entries(TODO)[0]
    with ThreadPoolExecutor(8) as pool:
        got = list(pool.map(lambda i: folder.claim(entry, f"w{i}"), range(8)))
    assert sum(mine is not None for mine in got) == 1
    assert folder.counts() == {TODO: 6, BUSY: 1, DONE: 0, FAILED: 0}


def test_three_tries_and_the_rest_goes_on(stage: Path, tmp_path: Path) -> None:
    folder = job(stage, tmp_path)
    first = folder.entries(TODO)[0].task
    for attempt in (1, 2, 3):
        entry = next(e for e in folder.entries(TODO) if e.task == first)
        assert entry.attempt == attempt
        mine = folder.claim(entry, "w")
        assert mine is not None and folder.fail(mine, f"reason {attempt}")
    assert folder.ids(FAILED) == {first.id} and not folder.is_over()
    for entry in folder.entries(TODO):
        if not entry.task.is_join:
            mine = folder.claim(entry, "w")
            assert mine is not None and folder.finish(mine, {})
    assert folder.is_over(), "the assembly waits for a tile that failed"
    found = status(folder)
    assert found["state"] == "failed"
    assert (
        found["failed"][0]["error"] == "reason 3" and "tile 1 of 6" in found["failed"][0]["title"]
    )
    assert folder.logs(first.id).count("failed on w: reason") == 3
    assert retry(folder) == [first] and folder.entries(TODO)[0] == Entry(first, 1)


def test_a_lease_that_ran_out(stage: Path, tmp_path: Path) -> None:
    """Of a worker that hangs; what it says when it wakes up counts no more."""
    folder = job(stage, tmp_path)
    slow, quick = Beat(folder, {}, "slow"), Beat(folder, {}, "quick")
    mine = folder.claim(folder.entries(TODO)[0], slow.name)
    assert mine is not None and take_back(folder, quick.now()) == []
    file = folder.path / "workers" / "slow.json"
    past = time.time() - folder.spec.lease_s - 1
    os.utime(file, (past, past))
    assert take_back(folder, quick.now()) == [mine]
    assert not folder.finish(mine, {}) and not folder.fail(mine, "late")
    assert folder.entries(TODO)[0].attempt == 2


def test_a_worker_that_is_no_more(stage: Path, tmp_path: Path) -> None:
    """Its tasks need not wait for the lease: whoever is on its machine sees it."""
    folder = job(stage, tmp_path)
    beat = Beat(folder, {}, "gone")
    mine = folder.claim(folder.entries(TODO)[0], beat.name)
    assert take_back(folder) == []
    beat.note(pid=2**22 - 1)
    assert take_back(folder) == [mine]


def test_a_folder_is_whole_or_absent(stage: Path, tmp_path: Path) -> None:
    folder = job(stage, tmp_path)
    assert Folder(folder.path).spec == folder.spec
    assert [entry.task for entry in folder.entries(TODO)] == folder.spec.tasks()
    with pytest.raises(WavecombError, match="is there already"):
        job(stage, tmp_path)
    assert sorted(os.listdir(tmp_path)) == ["a.farm"]
    text = json.loads((folder.path / "job.json").read_text())
    (folder.path / "job.json").write_text(json.dumps({**text, "format": 99}))
    with pytest.raises(WavecombError, match="format 99"):
        Folder(folder.path)
    with pytest.raises(WavecombError, match="is no folder of a job"):
        Folder(tmp_path)


# ---- pictures ------------------------------------------------------------------------------------

ALL = [*(name for name in names() if name != "cost"), "light_groups"]
"""Costs are of the clock."""
KINDS: dict[str, dict[str, Any]] = {
    "plain": {},
    "all layers": {"aovs": ALL, "spp": 16},
    "a region": {"region": (7, 3, 33, 20), "aovs": ALL},
    "a crop": {"region": (7, 3, 33, 20), "crop": True, "aovs": ["crypto", "depth"]},
    "errors": {"error": True, "spp": 32},
    "adaptive": {"adaptive": 0.03, "spp": 48, "size": (96, 64)},
    "learned": {"guiding": "on", "roulette": "efficient", "spp": 160},
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_tiles_are_the_picture(stage: Path, tmp_path: Path, kind: str) -> None:
    """Bit for bit, with all that the header says."""
    options = {"size": (40, 24), "spp": 4, **KINDS[kind]}
    folder = job(stage, tmp_path, **options, file={"half": False, "compression": "zip"})
    work(folder)
    whole = wavecomb.render(stage, **options)
    whole.save(tmp_path / "whole.exr")
    same(tmp_path / "a.exr", tmp_path / "whole.exr")
    assert not list((folder.path / "parts").iterdir()), "tiles go when their picture is there"
    assert status(folder)["state"] == "done"
    if kind == "adaptive":
        assert len(np.unique(whole.samples)) > 2, "or nothing is tested"


@pytest.mark.slow
def test_a_border_that_was_too_narrow(
    stage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Is found out, and made wider."""
    options = {"size": (64, 48), "spp": 48, "adaptive": 0.03}
    folder = job(stage, tmp_path, **options)
    monkeypatch.setattr("wavecomb.farm.rendering.most_looks", lambda settings: 1)
    with pytest.raises(NarrowBorder, match="is good for 1 looks at errors"):
        work(folder)
    assert folder.give_back(folder.entries(BUSY)[0])
    assert len(repair(folder)) == 6
    work(folder)
    wavecomb.render(stage, **options).save(tmp_path / "whole.exr")
    same(tmp_path / "a.exr", tmp_path / "whole.exr")


@needs("pyoidn")
def test_denoised_once_when_it_is_whole(stage: Path, tmp_path: Path) -> None:
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


def test_a_tile_holds_its_own_pixels(stage: Path, tmp_path: Path) -> None:
    folder = job(stage, tmp_path, size=(400, 400), spp=1, tiles="4x4")
    renderer = Renderer(folder, threads=1)
    task = Task(0, "0005")
    renderer.do(task)
    part = load_part(folder.part(task), folder.spec.id, task)
    assert part.layers["beauty"].shape == (100, 100, 3)
    whole = wavecomb.render(stage, size=(400, 400), spp=1).stats["memory_bytes"]["film"]
    assert part.stats["memory_bytes"]["film"] < whole / 12


def test_tiles_that_are_damaged(stage: Path, tmp_path: Path) -> None:
    folder = job(stage, tmp_path)
    renderer = Renderer(folder, threads=1)
    for entry in folder.entries(TODO)[:6]:
        mine = folder.claim(entry, "w")
        assert mine is not None
        folder.finish(mine, renderer.do(mine.task))
    join = Task(0, "join")
    file = folder.part(Task(0, "0002"))
    good = file.read_bytes()
    file.write_bytes(good[: len(good) // 2])
    with pytest.raises(DamagedPart, match="rendered again"):
        renderer.do(join)
    assert repair(folder) == [Task(0, "0002")]
    file.unlink()
    with pytest.raises(DamagedPart, match="is not there"):
        renderer.do(join)
    file.write_bytes(folder.part(Task(0, "0001")).read_bytes())
    with pytest.raises(WavecombError, match=r"is task 000000\.0001 of job"):
        renderer.do(join)
    assert not (tmp_path / "a.exr").exists()


def test_resume_renders_what_is_missing(stage: Path, tmp_path: Path) -> None:
    folder = submit(
        stage, tmp_path / "a.#.exr", frames="1-3", size=(16, 16), spp=1, tiles="2x1", strict=False
    )
    work(folder)
    assert repair(folder) == []
    (tmp_path / "a.2.exr").unlink()
    again = repair(folder)
    assert [task.picture for task in again] == [1, 1, 1]
    work(folder)
    assert (tmp_path / "a.2.exr").exists()


def test_what_a_farm_refuses(stage: Path, tmp_path: Path) -> None:
    for options, said in (
        ({"time_limit": 5.0}, "--time-limit"),
        ({"noise": 0.1, "spp": 64}, "--noise 0.1: is of the whole picture"),
        ({"allocate": "error", "spp": 64}, "--allocate error"),
        ({"roulette": "cost-aware", "costs": "measured"}, "--costs measured"),
    ):
        with pytest.raises(WavecombError, match=said):
            job(stage, tmp_path, **options)
    assert job(stage, tmp_path, noise=0.1, spp=64, tiles="auto").spec.tiles == (1, 1)


def test_a_job_says_what_it_is(stage: Path, tmp_path: Path) -> None:
    folder = job(stage, tmp_path)
    spec = folder.spec
    assert Spec.of(json.loads(json.dumps(spec.as_json())), "x") == spec
    assert [spec.title(task) for task in spec.tasks()][::6] == ["tile 1 of 6", "assembly"]
    with pytest.raises(WavecombError, match="x: is damaged"):
        Spec.of({**spec.as_json(), "pictures": 3}, "x")
    assert dataclasses.replace(spec, tiles=(100, 1)).tile_count(0) == 40


def test_a_page_that_needs_nothing_else(stage: Path, tmp_path: Path) -> None:
    """Valid, names what failed in full, and loads itself anew while work goes on."""
    html5lib = pytest.importorskip("html5lib")
    from wavecomb.farm.page import page

    folder = job(stage, tmp_path)
    mine = folder.claim(folder.entries(TODO)[2], "w")
    assert mine is not None and folder.fail(mine, "a <b> & c", is_final=True)
    text = page(status(folder), 3)
    html5lib.HTMLParser(strict=True).parse(text)
    assert "a &lt;b&gt; &amp; c" in text and 'http-equiv="refresh"' in text
    assert text.count('class="todo"') == 5 and text.count('class="failed"') == 1
    assert "http://" not in text and "https://" not in text and "<script" not in text
