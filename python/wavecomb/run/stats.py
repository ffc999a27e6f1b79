# SPDX-License-Identifier: Apache-2.0
"""Statistics of a render; docs/statistics.md has the schema."""

from __future__ import annotations

import json
import math
import os
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavecomb.image.files.output_file import replacing
from wavecomb.image.working_space import header_of
from wavecomb.machine import memory_bytes, usable_cores
from wavecomb.version import version

if TYPE_CHECKING:
    from wavecomb._core import Result
    from wavecomb.usd.stage.load_result import LoadedStage

SCHEMA = "wavecomb-statistics/1"
PHASES = (
    "generate",
    "order_rays",
    "trace",
    "keys",
    "sort",
    "materialize",
    "shade",
    "shadow",
    "resolve",
    "metrics",
)
SORTING = ("keys", "sort", "materialize")
"""Render phases that only sort records (queued hits) before shading."""
COUNTS = ("samples", "rays", "shadow_rays", "records")
DEPTHS = ("rays", "shadow_rays", "records", "paths_ended")
MEMORY = ("accelerator", "meshes", "textures", "records", "waves", "film", "picture")
COHERENCE = ("run_length", "material_homogeneity", "texture_homogeneity")


def make_stats(
    result: Result,
    *,
    stage: str | None = None,
    loaded: LoadedStage | None = None,
    resumed_s: float = 0.0,
    is_built: bool = True,
) -> dict[str, Any]:
    """Returns the statistics of a result, including stage, load time and machine.

    ``resumed_s`` is the render time before this run continued from a checkpoint. If ``is_built`` is
    False, the acceleration structures existed before, and their build time is reported as 0.

    The result has every key of the schema; values that the core does not provide are 0. The result
    also has values of the core that are not in the schema.
    """
    core = dict(result.stats)
    seconds = dict(core.pop("seconds", {}))
    if not is_built:
        seconds["build"] = 0.0
    phases, counts = dict(core.pop("phases_s", {})), dict(core.pop("counts", {}))
    phases, counts = (
        {**dict.fromkeys(PHASES, 0.0), **phases},
        {**dict.fromkeys(COUNTS, 0), **counts},
    )
    report = loaded.report if loaded is not None else None
    return {
        "schema": SCHEMA,
        "version": _build_info()["version"],
        "stage": stage,
        "camera": loaded.camera_path if loaded is not None else None,
        "working_space": loaded.working_space if loaded is not None else "rec709",
        "origin": list(loaded.origin) if loaded is not None else [0.0, 0.0, 0.0],
        "cancelled": bool(result.cancelled),
        "settings": core.pop("settings", {}),
        "seconds": {
            "load": float(loaded.seconds) if loaded is not None else 0.0,
            "build": 0.0,
            "render": 0.0,
            "first_samples": 0.0,
            "resumed": float(resumed_s),
            "denoise": 0.0,
            "write": 0.0,
            **seconds,
        },
        "phases_s": phases,
        "sort_overhead": sort_overhead(phases),
        "counts": counts,
        "passes": core.pop("passes", 0),
        "resumed_samples": core.pop("resumed_samples", 0),
        "error": _finite(core.pop("error", None)),
        "mean_path_length": counts["rays"] / counts["samples"] if counts["samples"] else 0.0,
        "depths": {**{name: [] for name in DEPTHS}, **core.pop("depths", {})},
        "lane_utilisation": core.pop("lane_utilisation", 1.0),
        "coherence": {**dict.fromkeys(COHERENCE, 0.0), **core.pop("coherence", {})},
        "programs": core.pop("programs", {}),
        "materials": core.pop("materials", []),
        "cost_prediction": {
            "r2": 0.0,
            "mean_error": 0.0,
            "materials": 0,
            "calibration_s": 0.0,
            **core.pop("cost_prediction", {}),
        },
        "light_calibration": {
            "seconds": 0.0,
            "paths": 0,
            "kept": False,
            "tilted_nodes": 0,
            "shares": [],
            **core.pop("light_calibration", {}),
        },
        "policy_uses": core.pop("policy_uses", {}),
        "sharing": core.pop("sharing", {"groups": 0, "longest_s": 0.0, "passes_s": {}}),
        "samples_per_s": core.pop("samples_per_s", 0.0),
        "rays_per_s": core.pop("rays_per_s", 0.0),
        "memory_bytes": {**dict.fromkeys(MEMORY, 0), **core.pop("memory_bytes", {})},
        "peak_rss_bytes": core.pop("peak_rss_bytes", 0),
        "machine": machine(),
        "unsupported": [finding.line() for finding in report.unsupported] if report else [],
        "warnings": [
            *([finding.line() for finding in report.warnings] if report else []),
            *(loaded.scene.warnings if loaded is not None else []),
        ],
        **core,
    }


def rendered_pixels(settings: Mapping[str, Any]) -> int:
    """Returns the number of pixels that a render with these settings samples."""
    if settings.get("region") is None:
        return int(settings["width"] * settings["height"])
    x0, y0, x1, y1 = settings["region"]
    return int((x1 - x0) * (y1 - y0))


def sort_overhead(phases: Mapping[str, float]) -> float:
    """Returns the fraction of the time for sorting and shading that was spent on sorting.

    The fraction is (keys + sort + materialize) / (keys + sort + materialize + shade); 0 if nothing
    was shaded.

    >>> sort_overhead({"keys": 1.0, "sort": 2.0, "materialize": 0.0, "shade": 27.0})
    0.1
    """
    sorting = sum(phases.get(name, 0.0) for name in SORTING)
    total = sorting + phases.get("shade", 0.0)
    return sorting / total if total > 0.0 else 0.0


def machine() -> dict[str, Any]:
    """Returns a description of the machine without data that identifies the machine or its user."""
    return {
        "cpu": _cpu_name(),
        "cores": usable_cores(),
        "memory_bytes": memory_bytes(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "build": _build_info(),
    }


def write_stats(path: str | os.PathLike[str], stats: Mapping[str, Any]) -> None:
    """Writes statistics as JSON atomically; NaN and infinities become null."""
    text = json.dumps(plain(stats), indent=2, allow_nan=False) + "\n"
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def image_metadata(stats: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the statistics that are stored in the header of an image."""
    number = stats["version"] if "version" in stats else version()
    metadata: dict[str, Any] = {"Software": f"Wavecomb {number}"}
    if stats.get("stage"):
        metadata["wavecomb:stage"] = str(stats["stage"])
    if stats.get("camera"):
        metadata["wavecomb:camera"] = str(stats["camera"])
    metadata |= header_of(stats.get("working_space", "rec709"))
    if stats.get("settings"):
        metadata["wavecomb:settings"] = json.dumps(plain(stats["settings"]), sort_keys=True)
    if "seconds" in stats:
        # The render time is the sum over all runs of a resumed render.
        seconds = stats["seconds"]
        rendered = seconds.get("render", 0.0) + seconds.get("resumed", 0.0)
        metadata["wavecomb:render_seconds"] = float(rendered)
    return metadata


def plain(value: Any) -> Any:
    """Converts a value to types that JSON supports."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, (bool, int, str)) or value is None:
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if hasattr(value, "item"):
        return plain(value.item())
    return str(value)


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _cpu_name() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _build_info() -> dict[str, str]:
    from wavecomb import _core

    return dict(_core.build_info())
