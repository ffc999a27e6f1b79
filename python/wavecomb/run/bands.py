# SPDX-License-Identifier: Apache-2.0
"""Renders images that are too large for the memory in bands of rows, from top to bottom.

A pixel's value does not depend on which other pixels are rendered, so bands are bit-identical to
rows of the whole image. Denoising, adaptive sampling and checkpoints need all pixels at once, so
bands do not support them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wavecomb.errors import WavecombError
from wavecomb.run import aovs as aov_names
from wavecomb.run.isolation.memory import machine_limit
from wavecomb.run.settings import check_memory, has_error_layers, image_bytes, image_size

if TYPE_CHECKING:
    from wavecomb._core import Result, Settings
    from wavecomb.image.rendered import Picture
    from wavecomb.run.callbacks import Reporter, Status

STEP = 64
"""The height of a band is a multiple of this number of rows, or of the tile height."""
_ADDED = ("samples_done", "rays", "seconds")
"""Progress values that are added over all bands."""
_SECONDS = ("render", "build", "denoise")
"""Times in the statistics that are added over all bands."""


def band_rows(
    settings: Settings,
    aovs: Sequence[str],
    megabytes: float | None,
    *,
    whole: str = "",
    tile: int = 0,
    light_groups: int = 1,
) -> int | None:
    """Returns the number of rows of a band, or None if the whole image fits into memory.

    Args:
        settings: Settings of the render.
        aovs: Expanded AOVs.
        megabytes: Memory limit of film and layers in units of 10^6 bytes. None allows half of the
            machine's memory, or more if an option needs the whole image.
        whole: Name of an option that needs the whole image, or "".
        tile: Edge length of tiles in the file; 0 means scanlines.
        light_groups: Number of light groups in the scene.

    Raises:
        WavecombError: An option needs the whole image, which does not fit into memory.
    """
    machine = machine_limit()
    most = megabytes * 1e6 if megabytes is not None else machine and 0.5 * machine
    needed = image_bytes(settings, aovs, light_groups)
    if most is None or needed <= most:
        return None
    if not whole:
        whole = _needs_all(settings, aovs)
    if whole and megabytes is not None:
        raise WavecombError(
            f"--film-memory {megabytes:g}: the image takes {needed / 1e6:.0f} MB and {whole} "
            "needs all of it at once: leave that out, or give more memory"
        )
    if whole:
        check_memory(settings, aovs, light_groups)
        return None
    step = tile or STEP
    height = image_size(settings)[1]
    rows = max(step, int(most / (needed / height)) // step * step)
    return None if rows >= height else rows


def _needs_all(settings: Settings, aovs: Sequence[str]) -> str:
    """Returns the name of a setting that needs all pixels of the image at once, or ""."""
    if settings.time_limit:
        return "--time-limit"
    if settings.allocate != "even":
        return f"--allocate {settings.allocate}"
    if settings.firefly != "keep":
        return f"--firefly {settings.firefly}"
    if has_error_layers(settings):
        return "an image with errors (--adaptive, --noise, --aov error, --aov variance)"
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
    """Yields the image in bands of ``rows`` rows. A band is rendered when the iterator advances.

    Args:
        render: Function that renders with the given settings and reports progress to the given
            reporter.
        settings: Settings of the whole image.
        rows: Number of rows in each band.
        reporter: Object that receives the progress of the whole image.
    """
    from wavecomb import _core

    x0, y0, x1, y1 = settings.region or (0, 0, settings.width, settings.height)
    total = (x1 - x0) * (y1 - y0) * settings.spp
    shown = None if reporter is None else _BandReporter(reporter, total)
    for row in range(y0, y1, rows):
        region = (x0, row, x1, min(row + rows, y1))
        band = _core.Settings(**{**settings.to_dict(), "region": region, "crop": True})
        yield render(band, shown)
        if shown is not None:
            shown.next_band()


def without_samples(
    render: Callable[[Settings], Picture], settings: Settings, rows: int
) -> Picture:
    """Returns ``rows`` rows without samples. All layers have the values of pixels without samples.

    ``render`` is a function that renders with the given settings.
    """
    from wavecomb import _core

    of_one_pixel = {
        "width": image_size(settings)[0], "height": max(rows, 2), "region": (0, 0, 1, 1),
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


class _BandReporter:
    """Progress reporter that combines the progress of all bands."""

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
    """Combines the statistics of all bands.

    Counts and times are added. Means per queued hit (record) are weighted by the number of records.
    For memory, the maximum is used.
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
    """Returns weighted means of floats, including those in nested mappings.

    Values that are not floats come from the first band.
    """
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
