# SPDX-License-Identifier: Apache-2.0
"""What a command is going to write, said before anything is read."""

from __future__ import annotations

import os
from collections.abc import Iterable

from wavecomb.run.frame_names import fill, has_place, parse_frames

MOST_NAMES = 100_000
"""Beyond that the folder of a sequence is allowed, not each name."""


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
    """Puts ``wavecomb render`` into the sandbox.

    Args:
        names: Files that are written, with places for the frame.
        output: The picture among them; None: the stage says.
        folder: Where pictures go that the stage names; None: the working folder.
        frames: As ``--frames`` takes them.
        frame: The frame of a single image; None: the stage says.
        split: Whether there is a picture for each layer.
        gpu: Whether denoising may use devices.
    """
    from wavecomb.run.isolate.outputs import Outputs
    from wavecomb.run.isolate.supervisor import enter

    given = [name for name in names if name is not None]
    single = () if frame is None else (frame,)
    numbers = single if frames is None else parse_frames(frames)
    trees: list[tuple[str, str]] = []
    is_open = not numbers and any(map(has_place, given))
    if is_open or len(numbers) * len(given) > MOST_NAMES:
        trees = [(os.path.dirname(os.path.abspath(n)), os.path.splitext(n)[1]) for n in given]
        filled = []
    elif numbers:
        # That a name with a place for the frame could be written is checked as it is.
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
    enter(Outputs(tuple(filled), tuple(dict.fromkeys(parts)), tuple(trees)), gpu=gpu)


def enter_to_read(outputs: Iterable[str | None], *, split: str | None = None) -> None:
    """Puts a command into the sandbox whose files are all known.

    Args:
        outputs: That it writes.
        split: One of these, of which there may be one for each layer.
    """
    from wavecomb.run.isolate.outputs import Outputs
    from wavecomb.run.isolate.supervisor import enter

    parts: tuple[tuple[str, str, str], ...] = ()
    if split is not None:
        where, base = os.path.split(os.path.realpath(split))
        stem, ending = os.path.splitext(base)
        parts = ((where, f"{stem}.", ending),)
    enter(Outputs(tuple(name for name in outputs if name is not None), parts))
