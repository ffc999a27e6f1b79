# SPDX-License-Identifier: Apache-2.0
"""Summary that ``wavecomb render`` prints at the end."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

    from wavecomb.usd import LoadReport

MOST_MATERIALS = 6
"""Number of rows of the table of materials. The statistics file has all materials."""

MOST_DEPTHS = 8
MOST_LIGHTS = 5


SECONDS = {
    "load": "load", "build": "build", "render": "render", "denoise": "denoising",
    "write": "writing",
}  # fmt: skip
"""Timings in the statistics that add up to the time of an image, and their names in the summary.
"""


def times_text(seconds: Mapping[str, float]) -> str:
    """Returns the time of an image, and the times of its steps, without steps of zero time.

    >>> times_text({"load": 0.5, "build": 0.1, "render": 61.0, "denoise": 0.0, "write": 0.2})
    '1 min 02 s: load 0.500 s, build 0.100 s, render 1 min 01 s, writing 0.200 s'
    """
    from wavecomb.run.progress import time_text

    parts = {said: seconds.get(name, 0.0) for name, said in SECONDS.items()}
    shown = (f"{said} {time_text(value)}" for said, value in parts.items() if value > 0.0)
    return f"{time_text(sum(parts.values()))}: {', '.join(shown)}"


def print_summary(
    stats: Mapping[str, Any], report: LoadReport, files: Sequence[str], *, verbose: bool = False
) -> None:
    """Prints time, samples, memory, warnings and files of a render.

    Args:
        stats: Statistics of the render.
        report: Report of the loaded stage.
        files: Files that were written.
        verbose: Whether to print phases, programs, materials and predictions as well.
    """
    from rich.markup import escape

    from wavecomb import terminal

    console = terminal.console(highlight=False, soft_wrap=True)
    console.print(f"time     {times_text(stats['seconds'])}")
    console.print(f"samples  {_samples_text(stats)}")
    more = _memory(stats["memory_bytes"]) if verbose else ""
    console.print(f"memory   {stats['peak_rss_bytes'] / 1e6:,.0f} MB{more}")
    if verbose:
        _details(console, stats)
    if report.warnings:
        console.print(f"warnings {len(report.warnings)}, listed above")
    if report.unsupported:
        console.print("not supported, left out:")
        for finding in report.unsupported:
            console.print(f"  {escape(finding.line())}")
    for finding in report.notes:
        console.print(f"note: {escape(finding.line())}")
    console.print("wrote " + escape(", ".join(files)))


def _samples_text(stats: Mapping[str, Any]) -> str:
    """Returns a line with the number and rate of samples, the passes and the error."""
    from wavecomb.run.progress import count_text, time_text
    from wavecomb.run.stats import rendered_pixels

    settings, count, before = (
        stats["settings"],
        stats["counts"]["samples"],
        stats["resumed_samples"],
    )
    mean = (before + count) / rendered_pixels(settings)
    text = f"{mean:.3g} per pixel, {count_text(count)}, {count_text(stats['samples_per_s'])}/s"
    if before:
        took = time_text(stats["seconds"]["resumed"])
        text += f"; resumed after {took} and {count_text(before)}"
    if stats["error"] is not None:
        text += f"; mean relative error {_percent(stats['error'])}"
    return text


def _details(console: Console, stats: Mapping[str, Any]) -> None:
    """Prints rays, predictions, scheduling, phases, programs and materials."""
    from rich.markup import escape

    from wavecomb.run.progress import count_text

    rays = stats["counts"]["rays"] + stats["counts"]["shadow_rays"]
    console.print(f"{count_text(rays)} rays, {count_text(stats['rays_per_s'])}/s")
    for line in _sampling_lines(stats):
        console.print(escape(line))
    if lights := light_line(stats["light_calibration"]):
        console.print(escape(lights))
    for line in _scheduling_lines(stats):
        console.print(escape(line))
    _phases(console, stats)
    _programs_and_materials(console, stats)


def _memory(parts: Mapping[str, int]) -> str:
    """Returns the sizes of the render's arrays and of Embree's BVH, in MB, or ""."""
    arrays = sum(parts.values()) - parts["accelerator"]
    if not arrays:
        return ""
    return f" (arrays {arrays / 1e6:,.0f}, BVH {parts['accelerator'] / 1e6:,.0f})"


def _sampling_lines(stats: Mapping[str, Any]) -> list[str]:
    """Returns lines about adaptive sampling, time limits, resuming and guiding."""
    from wavecomb.run.progress import count_text, time_text
    from wavecomb.run.stats import rendered_pixels

    lines: list[str] = []
    settings, before = stats["settings"], stats["resumed_samples"]
    if allotted := stats.get("allotment"):
        line = (
            f"samples by {settings['allocate']}: {allotted['least']} to {allotted['most']} per "
            f"pixel after {allotted['pilot']} in each"
        )
        if allotted["gain"] is not None:
            line += f"; expected efficiency {allotted['gain']:.2f} times the even one"
        lines.append(line)
    if learned := stats.get("guiding"):
        took = "before" if learned["kept"] else f"in {time_text(learned['seconds'])}"
        line = f"learned from {count_text(learned['paths'])} paths {took}"
        if learned["gain"]:
            line += f", expected efficiency {learned['gain']:.2f} times the unguided one"
        if not learned["used"]:
            line += "; not used"
        elif learned["guided_share"] > 0:
            line += f"; {_percent(learned['guided_share'])} of bounced light is guided"
        if learned["used"] and settings["roulette"] in ("auto", "efficient"):
            line += f"; {_percent(learned['survival'])} of paths continue after a bounce"
        lines.append(line)
    elif settings.get("guiding") == "auto" and settings.get("quality", "auto") == "auto":
        lines.append(f"not guided: {_why_not_guided(stats)}")
    if transport := stats.get("transport"):
        lines.append(_transport_line(transport))
    if aiming := stats.get("light_aiming"):
        lines.append(_aiming_line(aiming))
    lines += [
        f"light {name} is sampled by camera paths only"
        for name in stats.get("lights_without_paths", ())
    ]
    if any(settings.get(name) for name in ("adaptive", "noise", "time_limit")):
        mean = (before + stats["counts"]["samples"]) / rendered_pixels(settings)
        lines.append(f"{stats['passes']} passes, {mean:.3g} samples per pixel")
    return lines


def _why_not_guided(stats: Mapping[str, Any]) -> str:
    """Returns the reason why ``--guiding auto`` has not predicted a gain."""
    transport = stats.get("transport") or {}
    given = stats["settings"].get("transport")
    if transport.get("chosen") == "light" or given in ("light", "bdpt"):
        return "guiding cannot be combined with light paths"
    return "too few samples to predict the gain"


def _transport_line(chosen: Mapping[str, Any]) -> str:
    """Returns a line with the choice of ``--transport auto`` and its reason."""
    line = f"transport {chosen['chosen']}"
    if chosen["chosen"] == "light":
        line += f", {chosen['light_paths']:g} light paths for each camera path"
        line += ", merged within a pixel" if chosen["merges"] else ""
    line += f": {chosen['why']}"
    if chosen["gain"] is not None:
        line += f" in {chosen['seconds']:.2f} s, light paths are predicted to have "
        line += f"{chosen['gain']:.2f} times the efficiency"
    return line


def _aiming_line(aiming: Mapping[str, Any]) -> str:
    """Returns a line about the targets at which light paths are aimed."""
    from wavecomb.run.progress import count_text, time_text

    found = (
        f"{aiming['targets']} places" if aiming["targets"] else "nothing, since none contributed"
    )
    return (
        f"light paths aim at {found}: learned from {count_text(aiming['paths'])} paths "
        f"in {time_text(aiming['seconds'])}"
    )


def light_line(calibration: Mapping[str, Any]) -> str | None:
    """Returns a line with the most frequently sampled lights, from ``light_calibration``."""
    from wavecomb.run.progress import count_text

    if not calibration["paths"]:
        return None
    parts = sorted(calibration["shares"], key=lambda part: -part["share"])
    most = [(part["name"].rsplit("/", 1)[-1], part["share"]) for part in parts[:MOST_LIGHTS]]
    said = ", ".join(f"{name} {_percent(share)}" for name, share in most)
    return (
        f"lights: {said}{' ...' if len(parts) > MOST_LIGHTS else ''}, by "
        f"{count_text(calibration['paths'])} paths in {calibration['seconds']:.2f} s"
    )


def _scheduling_lines(stats: Mapping[str, Any]) -> list[str]:
    lines: list[str] = []
    counts, coherence, costs = stats["counts"], stats["coherence"], stats["cost_prediction"]
    if counts.get("packet_lanes"):
        policy = stats["settings"].get("policy", "")
        lines.append(
            f"policy {policy}: sorting takes {_percent(stats['sort_overhead'])} of the time of "
            f"sorting and shading; {_percent(stats['lane_utilisation'])} of lanes are used"
        )
        if counts.get("volume_lanes"):
            ways = counts["rays"] + counts["shadow_rays"]
            steps = counts["volume_steps"]
            lines.append(
                f"volumes: {steps / ways:.3g} steps per ray, "
                f"{_percent(counts['volume_collisions'] / steps)} of them collisions; "
                f"{_percent(steps / counts['volume_lanes'])} of lanes are used"
            )
        if counts.get("walks"):
            steps = counts["walk_steps"]
            lines.append(
                f"subsurface: {steps / counts['walks']:.3g} collisions per random walk; "
                f"{_percent(steps / counts['walk_lanes'])} of lanes are used"
            )
        lines.append(
            f"records: {coherence['run_length']:.3g} in a row have the same material; "
            f"{_percent(coherence['material_homogeneity'])} of adjacent records have the same "
            f"material, {_percent(coherence['texture_homogeneity'])} the same texture position"
        )
    uses = stats["policy_uses"]
    if total := sum(uses.values()):
        chosen = sorted((item for item in uses.items() if item[1]), key=lambda item: -item[1])
        lines.append(
            "queues by policy: "
            + ", ".join(f"{name} {_percent(count / total)}" for name, count in chosen)
        )
    if costs["materials"]:
        lines.append(
            f"predicted costs of {costs['materials']} materials: R2 {costs['r2']:.2f}, mean error "
            f"{_percent(costs['mean_error'])}"
        )
    if by_depth := stats["depths"].get("rays"):
        shares = [f"{rays / max(1, by_depth[0]):.2g}" for rays in by_depth[:MOST_DEPTHS]]
        more = " ..." if len(by_depth) > MOST_DEPTHS else ""
        lines.append(
            f"rays per path: {stats['mean_path_length']:.3g}; at each depth: "
            f"{' '.join(shares)}{more}"
        )
    return lines


def _phases(console: Console, stats: Mapping[str, Any]) -> None:
    phases = {name: value for name, value in stats["phases_s"].items() if value > 0.0}
    total = sum(phases.values())
    _table(
        console,
        ("phase", "thread s", "%"),
        ((name, f"{value:.3f}", f"{100.0 * value / total:.1f}") for name, value in phases.items()),
    )


def _programs_and_materials(console: Console, stats: Mapping[str, Any]) -> None:
    from wavecomb.run.progress import count_text

    total = max(1, stats["counts"]["records"])
    programs = sorted(stats["programs"].items(), key=lambda item: -item[1]["records"])
    _table(
        console,
        ("program", "records", "%", "ns each"),
        (
            (
                name,
                count_text(entry["records"]),
                f"{100.0 * entry['records'] / total:.1f}",
                _ns(entry["ns_per_record"]),
            )
            for name, entry in programs
        ),
    )
    seen = [entry for entry in stats["materials"] if entry["records"]]
    seen.sort(key=lambda entry: -entry["records"])
    _table(
        console,
        ("material", "records", "%", "ns each", "predicted"),
        (
            (
                entry["name"] or "(no name)",
                count_text(entry["records"]),
                f"{100.0 * entry['records'] / total:.1f}",
                _ns(entry["ns_per_record"]),
                _ns(entry["predicted_ns"]),
            )
            for entry in seen[:MOST_MATERIALS]
        ),
    )
    if len(seen) > MOST_MATERIALS:
        console.print(f"and {len(seen) - MOST_MATERIALS} more materials (--stats has all)")


def _table(console: Console, head: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Prints a plain table with right-aligned numbers, or nothing if there are no rows."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for i, title in enumerate(head):
        table.add_column(title, justify="right" if i else "left", no_wrap=True)
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    if table.row_count:
        console.print(table)


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"


def _ns(value: float) -> str:
    return f"{value:.0f}" if value else "-"
