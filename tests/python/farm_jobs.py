# SPDX-License-Identifier: Apache-2.0
"""Helpers for tests of the farm: jobs, rendering in this process, file comparison."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from wavecomb.farm import Folder
from wavecomb.farm.assembly import finish_image
from wavecomb.farm.rendering import Renderer
from wavecomb.image.files.image import read_layers, read_metadata

TIMES = ("wavecomb:render_seconds", "DateTime")
"""Header entries that differ between any two renders."""


def cornell_in(folder: Path) -> Path:
    """Writes the Cornell box to a folder and returns its path."""
    from wavecomb.scenes import write_scene

    path = folder / "cornell.usdc"
    write_scene("cornell", path)
    return path


MACHINE = "wavecomb-test"
"""Name of the machine class for tests that render in this process."""


def render_all(folder: Folder, image: int = 0, checks: int = 0) -> None:
    """Renders all tiles of an image in this process."""
    renderer = Renderer(folder.job, threads=1, learned=folder.learned())
    for task in folder.job.tasks_of(image):
        renderer.render(task, folder.part(task), MACHINE, checks)


def work(folder: Folder) -> None:
    """Renders and writes all images of a job in this process."""
    for image in range(len(folder.job.images)):
        render_all(folder, image)
        assert finish_image(folder, image, MACHINE)["files"]


def same(one: Path, two: Path, but: tuple[str, ...] = TIMES) -> None:
    """Asserts that two EXR files have the same pixels bit for bit, and the same headers."""
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


def processes_of(folder: Path, what: str = "") -> list[int]:
    """Returns the ids of processes whose command line contains the folder and ``what``."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_bytes()
        except OSError:
            continue
        if (
            os.fsencode(folder) in words
            and what.encode() in words
            and int(entry.name) != os.getpid()
        ):
            found.append(int(entry.name))
    return found


def wait_for(what: Callable[[], Any], seconds: float = 60.0) -> Any:
    """Calls a function until its result is true, and returns the result."""
    until = time.monotonic() + seconds
    while not (found := what()):
        assert time.monotonic() < until, "it never happened"
        time.sleep(0.02)
    return found


def left_behind(folder: Path) -> list[Path]:
    """Returns temporary files below a folder."""
    return [file for file in folder.rglob(".*") if ".part" in file.name]
