# SPDX-License-Identifier: Apache-2.0
"""A picture in bands of rows from the top, where it is too large to be held whole.

A pixel does not depend on what else is rendered, so the bands are, bit for bit, the rows of the
whole picture. What needs all pixels at once (denoising, adaptive sampling, checkpoints) is not to
be had.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wavecomb.errors import WavecombError
from wavecomb.run import aovs as aov_names
from wavecomb.run.isolate.memory import machine_limit
from wavecomb.run.settings import check_memory, keeps_error, picture_bytes, picture_size

if TYPE_CHECKING:
    from wavecomb._core import Result, Settings
    from wavecomb.picture.rendered import Picture
    from wavecomb.run.watcher import Reporter, Status

STEP = 64
"""Bands have a multiple of so many rows, or of a tile."""
_ADDED = ("samples_done", "rays", "seconds")
"""Of a status: what bands before it count for."""
_SECONDS = ("render", "build", "denoise")
"""Of the statistics: what all bands took together."""


def band_rows(
    settings: Settings,
    aovs: Sequence[str],
    megabytes: float | None,
    *,
    whole: str = "",
    tile: int = 0,
    light_groups: int = 1,
) -> int | None:
    """Rows of a band; None where the whole picture is to be held.

    Args:
        settings: Of the render.
        aovs: As expanded.
        megabytes: That film and layers may take, 10^6 bytes; None: half of the machine's memory,
            and more where the whole is needed.
        whole: An option that needs the whole picture.
        tile: Edge of the tiles of the file, 0: it has none.
        light_groups: Of the scene.

    Raises:
        WavecombError: The whole is needed and does not fit.
    """
    machine = machine_limit()
    most = megabytes * 1e6 if megabytes is not None else machine and 0.5 * machine
    needed = picture_bytes(settings, aovs, light_groups)
    if most is None or needed <= most:
        return None
    if not whole:
        whole = _needs_all(settings, aovs)
    if whole and megabytes is not None:
        raise WavecombError(
            f"--film-memory {megabytes:g}: the picture takes {needed / 1e6:.0f} MB and {whole} "
            "needs all of it at once: leave that out, or give more memory"
        )
    if whole:
        check_memory(settings, aovs, light_groups)
        return None
    step = tile or STEP
    height = picture_size(settings)[1]
    rows = max(step, int(most / (needed / height)) // step * step)
    return None if rows >= height else rows


def _needs_all(settings: Settings, aovs: Sequence[str]) -> str:
    """What of the settings needs all pixels at once; empty: nothing."""
    if settings.time_limit:
        return "--time-limit"
    if settings.allocate != "even":
        return f"--allocate {settings.allocate}"
    if settings.firefly != "keep":
        return f"--firefly {settings.firefly}"
    if keeps_error(settings):
        return "a picture with errors (--adaptive, --noise, --aov error, --aov variance)"
    if any(name in aov_names.of_kind("coverage") for name in aovs):
        return "a Cryptomatte"
    if settings.region is not None and not settings.crop:
        return "--region without --crop"
    return ""


def render_bands(
    render: Callable[[Settings, Reporter | None], Result],
    settings: Settings,
    rows: int,
    reporter: Reporter | None = None,
) -> Iterator[Result]:
    """Renders bands of so many rows, each when it is asked for.

    Args:
        render: Renders with the settings that it is given, and shows progress there.
        settings: Of the whole picture.
        rows: Of a band.
        reporter: Shows the progress of the whole.
    """
    from wavecomb import _core

    x0, y0, x1, y1 = settings.region or (0, 0, settings.width, settings.height)
    total = (x1 - x0) * (y1 - y0) * settings.spp
    shown = None if reporter is None else _Whole(reporter, total)
    for row in range(y0, y1, rows):
        region = (x0, row, x1, min(row + rows, y1))
        band = _core.Settings(**{**settings.to_dict(), "region": region, "crop": True})
        yield render(band, shown)
        if shown is not None:
            shown.next_band()


def without_samples(
    render: Callable[[Settings], Picture], settings: Settings, rows: int
) -> Picture:
    """So many rows of the picture that have no samples, with all layers as the core gives them.

    ``render``: renders with the settings that it is given.
    """
    from wavecomb import _core

    of_one_pixel = {
        "width": picture_size(settings)[0], "height": max(rows, 2), "region": (0, 0, 1, 1),
        "overscan": 0, "crop": False, "spp": 1, "costs": "model", "light_weights": "power",
        "allocate": "even",
    }  # fmt: skip
    picture = render(_core.Settings(**{**settings.to_dict(), **of_one_pixel}))

    def empty(layer: Any) -> Any:
        if layer is None:
            return None
        copy = np.array(layer[:rows])
        copy[0, 0] = layer[-1, -1]
        return copy

    names = ("beauty", "albedo", "normal", "depth", "samples")
    aovs = {name: empty(layer) for name, layer in picture.aovs.items()}
    return replace(picture, aovs=aovs, **{name: empty(getattr(picture, name)) for name in names})


class _Whole:
    """Shows bands as parts of one render."""

    def __init__(self, reporter: Reporter, samples: int) -> None:
        self._reporter = reporter
        self._samples = samples
        self._before: dict[str, Any] = {}
        self._last: dict[str, Any] = {}

    def show(self, status: Status) -> None:
        self._last = {name: status[name] + self._before.get(name, 0) for name in _ADDED}
        self._reporter.show({**status, **self._last, "samples_total": self._samples})

    def wrote(self, path: str) -> None:
        self._reporter.wrote(path)

    def next_band(self) -> None:
        self._before = self._last


def sum_stats(bands: Sequence[Mapping[str, Any]], settings: Mapping[str, Any]) -> dict[str, Any]:
    """The statistics of bands as those of one render.

    Counts and times are added; means over records are weighed by them; of memory it is the most.
    """
    from wavecomb.run.stats import sort_overhead

    records = [band["counts"]["records"] for band in bands]
    out = dict(_mean(bands, records))
    for name in ("counts", "phases_s", "policy_uses"):
        out[name] = _sum([band[name] for band in bands])
    sharing = [band["sharing"] for band in bands]
    out["sharing"] = {
        "groups": sum(one["groups"] for one in sharing),
        "longest_s": max(one["longest_s"] for one in sharing),
        "passes_s": _sum([one["passes_s"] for one in sharing]),
    }
    out["depths"] = {
        name: _sum_lists([band["depths"][name] for band in bands]) for name in bands[0]["depths"]
    }
    out["seconds"] = {
        **bands[0]["seconds"],
        **{name: sum(band["seconds"][name] for band in bands) for name in _SECONDS},
    }
    out["programs"] = _programs(bands)
    out["materials"] = _materials(bands)
    for name in ("peak_rss_bytes", "passes"):
        out[name] = max(band[name] for band in bands)
    out["memory_bytes"] = {
        name: max(band["memory_bytes"][name] for band in bands) for name in bands[0]["memory_bytes"]
    }
    counts, seconds = out["counts"], out["seconds"]["render"]
    rays = counts["rays"] + counts["shadow_rays"]
    out["samples_per_s"] = counts["samples"] / seconds if seconds else 0.0
    out["rays_per_s"] = rays / seconds if seconds else 0.0
    out["mean_path_length"] = counts["rays"] / counts["samples"] if counts["samples"] else 0.0
    out["sort_overhead"] = sort_overhead(out["phases_s"])
    out["cancelled"] = any(band["cancelled"] for band in bands)
    out["settings"] = dict(settings)
    out["bands"] = len(bands)
    return out


def _mean(parts: Sequence[Any], weights: Sequence[float]) -> Any:
    """Floats weighed, mappings entry by entry; all else is the first's."""
    first = parts[0]
    if isinstance(first, Mapping):
        return {
            name: _mean([part[name] for part in parts], weights)
            for name in first
            if all(name in part for part in parts)
        }
    if isinstance(first, float) and all(isinstance(part, float) for part in parts):
        total = sum(weights)
        both = zip(parts, weights, strict=True)
        return sum(part * weight for part, weight in both) / total if total else first
    return first


def _sum(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    names = dict.fromkeys(name for part in parts for name in part)
    return {name: sum(part.get(name, 0) for part in parts) for name in names}


def _sum_lists(parts: Sequence[Sequence[int]]) -> list[int]:
    longest = max(map(len, parts))
    return [sum(part[i] for part in parts if i < len(part)) for i in range(longest)]


def _programs(bands: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    names = dict.fromkeys(name for band in bands for name in band["programs"])
    return {
        name: _weighed([band["programs"][name] for band in bands if name in band["programs"]])
        for name in names
    }


def _materials(bands: Sequence[Mapping[str, Any]]) -> list[Any]:
    materials = [band["materials"] for band in bands]
    return [_weighed(list(same)) for same in zip(*materials, strict=True)]


def _weighed(parts: list[Mapping[str, Any]]) -> dict[str, Any]:
    out = dict(_mean(parts, [part["records"] for part in parts]))
    for name in ("records", "timed_records"):
        if name in out:
            out[name] = sum(part[name] for part in parts)
    return out
