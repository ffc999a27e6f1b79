# SPDX-License-Identifier: Apache-2.0
"""The stage files of a sitting: generated once, or where the suite says they are."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from wavecomb.bench.plan import Config, digest
from wavecomb.bench.suite_model import StageSource
from wavecomb.errors import WavecombError


def stage_file(source: StageSource, name: str, folder: Path) -> Path:
    """Where the stage is, or will be once it is generated."""
    if source.file is not None:
        return source.file
    return folder / f"{name}-{digest([source.scene, source.options])}.usdc"


def check_files(configs: Iterable[Config]) -> None:
    """Raises WavecombError unless every stage that is a file is there."""
    for config in configs:
        file = config.source.file
        if file is not None and not file.is_file():
            raise WavecombError(f"{file}: no such file (stage {config.stage} of the suite)")


def generate(source: StageSource, path: Path) -> None:
    """Writes a generated stage, unless it is there."""
    if source.file is not None or path.exists():
        return
    from wavecomb.scenes import write_scene

    try:
        write_scene(source.scene, path, **source.options)
    except (ValueError, TypeError) as error:
        raise WavecombError(f"stage {path.stem}: {error}") from error
