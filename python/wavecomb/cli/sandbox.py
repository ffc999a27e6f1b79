# SPDX-License-Identifier: Apache-2.0
"""Restarts a command in the sandbox, with access to the files that it will write."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence

from wavecomb.cli.render_options import WRITTEN, RenderOptions
from wavecomb.run.frame_names import fill, has_place, parse_frames

MOST_NAMES = 100_000
"""Largest number of files to which the sandbox gives access one by one. For longer sequences, it
gives access to their folder."""


def enter_to_render(
    options: RenderOptions, further: Sequence[str] = (), *, gpu: bool | None = None
) -> None:
    """Restarts ``wavecomb render`` in the sandbox.

    Args:
        options: Options of the command.
        further: Further files that the command will write; names may have a placeholder for the
            frame.
        gpu: Whether denoising may use GPU devices; None allows them if the options request
            denoising.
    """
    from wavecomb.run.isolation.outputs import Outputs
    from wavecomb.run.isolation.supervisor import enter

    names = (getattr(options, field) for field in WRITTEN)
    given = [name for name in (*names, *further) if name is not None]
    frame, output = options.source.values["frame"], options.image
    single = () if frame is None else (frame,)
    numbers = single if options.frames is None else parse_frames(options.frames)
    trees: list[tuple[str, str]] = []
    is_open = not numbers and any(map(has_place, given))
    if is_open or len(numbers) * len(given) > MOST_NAMES:
        trees = [(os.path.dirname(os.path.abspath(n)), os.path.splitext(n)[1]) for n in given]
        filled = []
    elif numbers:
        # The list contains the file name patterns as well as the names with frame numbers, since a
        # later check tests whether files can be created at the patterns' paths.
        filled = [*given, *(fill(name, frame) for name in given for frame in numbers)]
    else:
        filled = given
    layers = [output, *(fill(output, frame) for frame in numbers)] if output else []
    parts = dict.fromkeys(map(_layers_of, layers)) if options.split else ()
    if output is None:
        trees.append((os.path.abspath(options.output_dir or os.curdir), ".exr"))
    _make_folders(given)
    enter(
        Outputs(tuple(filled), tuple(parts), tuple(trees)),
        gpu=options.denoise if gpu is None else gpu,
    )


def _layers_of(image: str) -> tuple[str, str, str]:
    """Returns the folder, prefix and extension of the names of an image's per-layer files."""
    where, base = os.path.split(os.path.realpath(image))
    stem, ending = os.path.splitext(base)
    return where, f"{stem}.", ending


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
    """Restarts a command in the sandbox, with write access to all of its output files.

    Args:
        outputs: Files to write.
        split: Output file that may be split into a file for each layer.
    """
    from wavecomb.run.isolation.outputs import Outputs
    from wavecomb.run.isolation.supervisor import enter

    parts = () if split is None else (_layers_of(split),)
    enter(Outputs(tuple(name for name in outputs if name is not None), parts))
