# SPDX-License-Identifier: Apache-2.0
"""Tests plans: results of pilot renders, made only once for all tiles of an image."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from farm_jobs import MACHINE

from wavecomb import _core
from wavecomb.farm import Folder, submit
from wavecomb.farm.job import Task
from wavecomb.farm.rendering import Renderer, load_plan, save_plan
from wavecomb.farm.tile_file import read_tile
from wavecomb.farm.tiling import has_pilots, is_better_whole
from wavecomb.run.sequence import Frames
from wavecomb.scenes import write_scene

TILE = Task(0, 77)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Folder:
    """Job of a caustic with just enough samples for pilot renders."""
    path = tmp_path_factory.mktemp("plans")
    write_scene("caustics", path / "caustics.usdc", plain=True)
    return submit(path / "caustics.usdc", path / "a.exr", size=(160, 160), spp=128, tiles="10x10")


@pytest.fixture
def handed_on(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Guiding data that renders receive."""
    found: list[Any] = []
    render = Frames.render

    def spy(self: Frames, *arguments: Any, **keywords: Any) -> Any:
        found.append(keywords["learned"])
        return render(self, *arguments, **keywords)

    monkeypatch.setattr(Frames, "render", spy)
    return found


def test_defaults_have_pilots_and_are_divided_into_tiles() -> None:
    settings = _core.Settings(width=200, height=100, spp=100).to_dict()
    assert has_pilots(settings)
    assert not has_pilots({**settings, "spp": 99})
    assert not has_pilots({**settings, "quality": "plain"})
    assert not has_pilots({**settings, "guiding": "off", "transport": "path"})
    assert has_pilots({**settings, "quality": "plain", "guiding": "on"})
    assert not is_better_whole(settings) and not is_better_whole({**settings, "guiding": "on"})
    assert is_better_whole({**settings, "transport": "light"})


@pytest.mark.slow
def test_a_tile_with_a_plan_equals_one_without(
    folder: Folder, tmp_path: Path, handed_on: list[Any]
) -> None:
    plan = folder.plan(0)
    Renderer(folder.job).plan(0, plan, MACHINE)
    learned = load_plan(plan, folder.job.image_key(0, MACHINE))
    assert learned
    Renderer(folder.job).plan(0, plan, MACHINE)
    assert handed_on == [None], "the plan exists, so nothing is rendered"
    Renderer(folder.job).render(TILE, tmp_path / "with.exr", MACHINE, plan=plan)
    Renderer(folder.job).render(TILE, tmp_path / "without.exr", MACHINE, plan=tmp_path / "none")
    assert handed_on == [None, learned, None]
    one, two = read_tile(tmp_path / "with.exr"), read_tile(tmp_path / "without.exr")
    assert one.key == two.key and list(one.layers) == list(two.layers)
    for name, layer in one.layers.items():
        assert layer.tobytes() == two.layers[name].tobytes(), name


def test_a_plan_counts_only_if_it_is_whole_and_of_the_image(tmp_path: Path) -> None:
    path = tmp_path / "parts" / "plan.learned"
    assert load_plan(path, "key") is None
    save_plan(path, "key", b"field")
    assert load_plan(path, "key") == b"field"
    assert load_plan(path, "another") is None
    data = path.read_bytes()
    for damaged in (b"", data[:-40], data[:60] + b"\xff" * 20 + data[80:], b"PK\x03\x04"):
        path.write_bytes(damaged)
        assert load_plan(path, "key") is None
    save_plan(path, "key", b"")
    assert load_plan(path, "key") == b"", "there were no pilot renders"
