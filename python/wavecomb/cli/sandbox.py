# SPDX-License-Identifier: Apache-2.0
"""Entering the sandbox of a command, with the files that the command will write."""

from __future__ import annotations

import os
from collections.abc import Iterable

from wavecomb.run.frame_names import fill, has_place, parse_frames

MOST_NAMES = 100_000
"""Largest number of file names given to the sandbox. Longer sequences allow their folder
instead."""


def enter_to_render(
    names: Iterable[str | None],
    output: str | None,
    folder: str | None,
    frames: str | None,
    frame: float | None = None,
    *,
    split: bool,
    gpu: bool,
) -> None:
    """Restarts ``wavecomb render`` in the sandbox.

    Args:
        names: Files to write, with placeholders for the frame.
        output: The image among them; None if the stage names it.
        folder: Folder of images that the stage names; None means the working folder.
        frames: Text of ``--frames``.
        frame: Frame of a single image; None if the stage decides.
        split: Whether each layer gets a separate file.
        gpu: Whether denoising may use GPU devices.
    """
    from wavecomb.run.isolation.outputs import Outputs
    from wavecomb.run.isolation.supervisor import enter

    given = [name for name in names if name is not None]
    single = () if frame is None else (frame,)
    numbers = single if frames is None else parse_frames(frames)
    trees: list[tuple[str, str]] = []
    is_open = not numbers and any(map(has_place, given))
    if is_open or len(numbers) * len(given) > MOST_NAMES:
        trees = [(os.path.dirname(os.path.abspath(n)), os.path.splitext(n)[1]) for n in given]
        filled = []
    elif numbers:
        # The unfilled names stay in the list: a later check tests whether they can be written.
        filled = [*given, *(fill(name, frame) for name in given for frame in numbers)]
    else:
        filled = given
    parts = []
    if output is not None and split:
        for name in (output, *(fill(output, frame) for frame in numbers)):
            where, base = os.path.split(os.path.realpath(name))
            stem, ending = os.path.splitext(base)
            parts.append((where, f"{stem}.", ending))
    if output is None:
        trees.append((os.path.abspath(folder or os.curdir), ".exr"))
    outputs = Outputs(tuple(filled), tuple(dict.fromkeys(parts)), tuple(trees))
    _make_folders(given)
    enter(outputs, gpu=gpu)


def _make_folders(names: Iterable[str]) -> None:
    """Creates the missing folders of files, which the sandboxed process cannot do."""
    for name in names:
        folder = os.path.dirname(os.path.realpath(name))
        if not has_place(folder) and not os.path.exists(folder):
            try:
                os.makedirs(folder, exist_ok=True)
            except OSError as error:
                why = error.strerror or str(error)
                raise OSError(f"{name}: cannot be written: {why}") from error


def enter_to_read(outputs: Iterable[str | None], *, split: str | None = None) -> None:
    """Restarts a command in the sandbox whose output files are all known.

    Args:
        outputs: Files to write.
        split: One of these that may become a file for each layer.
    """
    from wavecomb.run.isolation.outputs import Outputs
    from wavecomb.run.isolation.supervisor import enter

    parts: tuple[tuple[str, str, str], ...] = ()
    if split is not None:
        where, base = os.path.split(os.path.realpath(split))
        stem, ending = os.path.splitext(base)
        parts = ((where, f"{stem}.", ending),)
    enter(Outputs(tuple(name for name in outputs if name is not None), parts))
