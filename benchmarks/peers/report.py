# SPDX-License-Identifier: Apache-2.0
"""Report the results of a comparison: ratios with intervals, tables, and the machine."""

from __future__ import annotations

import os
import platform
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
from renderers import ROOT

_DRAWS = 4000


def summary(
    turns: dict[str, list[dict[str, Any]]], noise: dict[str, dict[str, Any]], size: int
) -> dict[str, Any]:
    """Return medians of each renderer, and ratios of Wavecomb to the other renderers."""
    renderers: dict[str, Any] = {}
    for name in dict.fromkeys([*turns, *noise]):
        facts: dict[str, Any] = {}
        if name in turns:
            facts = {
                key: float(np.median([t[key] for t in turns[name]]))
                for key in turns[name][0]
                if isinstance(turns[name][0][key], float)
            }
            facts["turns"] = turns[name]
        if name in noise:
            facts["noise"] = noise[name]
        if name in turns and name in noise:
            seconds = noise[name]["spp"] * size**2 / facts["marginal_rate"]
            facts["efficiency"] = 1.0 / (noise[name]["relmse"] * seconds)
        renderers[name] = facts
    ratios = {
        name: _ratios(renderers["wavecomb"], theirs)
        for name, theirs in renderers.items()
        if name != "wavecomb" and "wavecomb" in renderers
    }
    return {"renderers": renderers, "ratios": ratios}


def _ratios(ours: dict[str, Any], theirs: dict[str, Any]) -> dict[str, Any]:
    """Ratio of medians over rounds and of means over seeds, with 95 % bootstrap intervals."""
    rng = np.random.default_rng(1)
    out: dict[str, Any] = {}

    def put(key: str, value: float, draws: Any) -> None:
        low, high = np.percentile(draws, [2.5, 97.5])
        out[key] = {"ratio": value, "low": float(low), "high": float(high)}

    rate = lower = None
    if "turns" in ours and "turns" in theirs:
        for key in ("rate", "marginal_rate", "start_to_first_picture_s", "peak_mb"):
            a, b = (np.array([t[key] for t in r["turns"]]) for r in (ours, theirs))
            again = rng.integers(0, len(a), (_DRAWS, len(a)))
            draws = np.median((a / b)[again], axis=1)
            value = float(np.median(a / b))
            put(key, value, draws)
            if key == "marginal_rate":
                rate = (value, draws)
    if "noise" in ours and "noise" in theirs:
        for key in ("relmse", "trimmed"):
            both = (r["noise"] for r in (ours, theirs))
            a, b = (np.array(n[f"{key}_of_seeds"]) * n["spp"] for n in both)
            means = [x[rng.integers(0, len(x), (_DRAWS, len(x)))].mean(axis=1) for x in (a, b)]
            value, draws = float(b.mean() / a.mean()), means[1] / means[0]
            put(f"{key}_of_theirs_to_ours", value, draws)
            if key == "relmse":
                lower = (value, draws)
    if rate and lower:
        put("efficiency", rate[0] * lower[0], rate[1] * lower[1])
    return out


def tables(scenes: dict[str, Any]) -> str:
    """Return Markdown tables: results, then ratios."""
    head = ["stage", "renderer", "M samples/s", "marginal", "M rays/s", "spp", "relMSE", "trimmed"]
    head += ["efficiency", "peak MB", "start to first picture, s"]
    lines = _row(head) + _row(["---"] * len(head))
    for scene, found in scenes.items():
        for name, r in found["renderers"].items():
            noise = r.get("noise", {})
            cells = [
                scene,
                name,
                _number(r.get("rate"), 1e-6),
                _number(r.get("marginal_rate"), 1e-6),
            ]
            cells += [_number(r.get("rays_per_s"), 1e-6), str(noise.get("spp", ""))]
            cells += [_number(noise.get(key), digits=5) for key in ("relmse", "trimmed")]
            cells.append(_number(r.get("efficiency")))
            cells += [_number(r.get("peak_mb"), 1.0, 0), _number(r.get("start_to_first_picture_s"))]
            lines += _row(cells)
    keys = {
        "rate": "samples/s",
        "marginal_rate": "marginal",
        "relmse_of_theirs_to_ours": "their relMSE to ours",
        "trimmed_of_theirs_to_ours": "trimmed",
        "efficiency": "efficiency",
        "peak_mb": "peak memory",
        "start_to_first_picture_s": "start to first picture",
        "picture": "mean colour",
    }
    lines += "\n" + _row(["stage", "Wavecomb to", *keys.values()])
    lines += _row(["---"] * (len(keys) + 2))
    for scene, found in scenes.items():
        for name, ratios in found["ratios"].items():
            cells = [scene, name]
            for key in keys:
                q = ratios.get(key)
                if key == "picture" and q:
                    cells.append(" ".join(f"{v:.3f}" for v in q["mean_ratio"]))
                else:
                    cells.append(f"{q['ratio']:.2f} [{q['low']:.2f}, {q['high']:.2f}]" if q else "")
            lines += _row(cells)
    return "".join(lines)


def _row(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |\n"


def _number(value: float | None, scale: float = 1.0, digits: int = 2) -> str:
    return "" if value is None else f"{value * scale:.{digits}f}"


def machine() -> dict[str, Any]:
    """Return the machine's CPU, cores, instruction set and load."""
    cpu = platform.processor() or platform.machine()
    isa: list[str] = []
    if Path("/proc/cpuinfo").exists():
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                cpu = line.split(":", 1)[1].strip()
            if line.startswith("flags"):
                flags = line.split(":", 1)[1].split()
                isa = [f for f in ("sse4_2", "avx2", "avx512f", "avx512vl") if f in flags]
                break
    return {
        "cpu": cpu,
        "cores": len(os.sched_getaffinity(0)),
        "isa": isa,
        "load_before": list(os.getloadavg()),
        "system": platform.platform(terse=True),
        "python": platform.python_version(),
    }


def commit() -> dict[str, Any]:
    """Return the git commit and the source files that differ from it."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True)
        return done.stdout.strip()

    changed = git("status", "--porcelain", "--", "src", "python", "bindings", "CMakeLists.txt")
    return {"commit": git("rev-parse", "HEAD"), "changed": changed.splitlines()}
