# SPDX-License-Identifier: Apache-2.0
"""What tests of the farm share: jobs, work in this process, comparisons of files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wavecomb.farm.folder import TODO, Folder
from wavecomb.farm.rendering import Renderer
from wavecomb.picture.image import read_layers, read_metadata

TIMES = ("wavecomb:render_seconds", "DateTime")
"""Of a header: what no two renders share."""


def work(folder: Folder, worker: str = "me") -> list[dict[str, Any]]:
    """Does all tasks of a job in this process; what came of them."""
    renderer, results = Renderer(folder, threads=1), []
    while entries := folder.entries(TODO):
        mine = folder.claim(entries[0], worker)
        assert mine is not None
        results.append(renderer.do(mine.task))
        assert folder.finish(mine, results[-1])
    renderer.close()
    return results


def same(one: Path, two: Path, but: tuple[str, ...] = TIMES) -> None:
    """Asserts that two EXR files hold the same bits, and headers that say the same."""
    first, second = read_layers(one), read_layers(two)
    assert list(first) == list(second)
    for name, layer in first.items():
        assert layer.shape == second[name].shape, name
        assert layer.tobytes() == second[name].tobytes(), name
    headers = [read_metadata(file) for file in (one, two)]
    for header in headers:
        for name in but:
            header.pop(name, None)
    texts = [{key: str(value) for key, value in header.items()} for header in headers]
    assert texts[0].keys() == texts[1].keys()
    for key, text in texts[0].items():
        assert text == texts[1][key], key
