# SPDX-License-Identifier: Apache-2.0
"""Settings that a farm refuses when a job is submitted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wavecomb.errors import WavecombError


def check_reproducible(settings: Mapping[str, Any]) -> None:
    """Raises WavecombError for settings whose pictures are never the same twice."""
    if settings.get("time_limit"):
        raise WavecombError(
            "--time-limit: how many samples fit depends on the machine, so a farm's pictures would "
            "differ from one machine's: give --spp, --adaptive or --noise"
        )
    if settings.get("costs") == "measured" and _costs_matter(settings):
        raise WavecombError(
            "--costs measured: times of one machine decide over the picture here, and a farm has "
            "several: give --costs model"
        )


def _costs_matter(settings: Mapping[str, Any]) -> bool:
    return settings.get("roulette") == "cost-aware" or settings.get("allocate") == "efficiency"


def needs_whole(settings: Mapping[str, Any]) -> str:
    """Why pictures cannot be cut into tiles; empty: they can."""
    if settings.get("noise"):
        return f"--noise {settings['noise']:g}: is of the whole picture"
    if settings.get("allocate", "even") != "even":
        return f"--allocate {settings['allocate']}: shares samples out over the whole picture"
    if settings.get("firefly", "keep") != "keep":
        return f"--firefly {settings['firefly']}: looks at the pixels around each"
    return ""


def is_better_whole(settings: Mapping[str, Any], is_taught: bool = False) -> bool:
    """Whether each tile costs much beside its own pixels: a border, a field, all light paths.

    ``is_taught``: the field is given.
    """
    learns = settings.get("guiding", "off") != "off" or settings.get("roulette") == "efficient"
    return (
        bool(settings.get("adaptive"))
        or settings.get("transport") in ("light", "bdpt", "auto")
        or (learns and not is_taught)
    )


def check_tiles(settings: Mapping[str, Any], tiles: tuple[int, int]) -> None:
    """Raises WavecombError where pictures cannot be cut so."""
    why = needs_whole(settings)
    if why and tiles != (1, 1):
        raise WavecombError(f"{why}, which tiles do not see: give --tiles 1x1")
