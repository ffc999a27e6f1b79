# SPDX-License-Identifier: Apache-2.0
"""The files of a picture that is done."""

from __future__ import annotations

import os
from dataclasses import replace

from wavecomb.farm.spec import Spec
from wavecomb.picture.rendered import Picture
from wavecomb.run.stats import write_stats


def write_picture(spec: Spec, picture: int, rendered: Picture, threads: int) -> list[str]:
    """Writes PNG, statistics and at last the EXR, each whole or not at all.

    Args:
        spec: The job.
        picture: Which one.
        rendered: It.
        threads: For denoising.

    Returns:
        The files.
    """
    if spec.denoise:
        rendered = rendered.with_denoised(threads=threads)
    shot = spec.shots[spec.pictures[picture][0]]
    # What is said of it is what one machine would have been told.
    rendered = replace(rendered, stats={**rendered.stats, "settings": dict(shot.settings)})
    names = {kind: spec.place(name) for kind, name in spec.names(picture).items()}
    os.makedirs(os.path.dirname(names["output"]) or os.curdir, exist_ok=True)
    written = []
    if "png" in names:
        rendered.save(names["png"], exposure=spec.exposure, tone_map=spec.tone_map)  # type: ignore[arg-type]
        written.append(names["png"])
    if "stats" in names:
        write_stats(names["stats"], rendered.stats)
        written.append(names["stats"])
    return [str(name) for name in rendered.save(names["output"], **spec.file)] + written
