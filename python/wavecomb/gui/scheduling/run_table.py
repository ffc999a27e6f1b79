# SPDX-License-Identifier: Apache-2.0
"""Table of runs as rows, as text and as CSV. Independent of Qt."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from wavecomb.gui.scheduling.run_log import FIELDS, RunLog, Series, labels, last_of
from wavecomb.gui.scheduling.run_rates import Ratio, compare, rate, rate_of
from wavecomb.run.progress import count_text

COLUMNS = (
    "settings",
    "samples/s",
    "spread",
    "speed",
    "95 %",
    "verdict",
    "ns/record",
    "lanes used",
    "run length",
    "rays/s",
    "runs",
    "changed",
)
_TIPS = {
    "settings": "Settings that differ between rows.",
    "changed": "Differences from the previous series.",
    "runs": "Renders with these settings. Columns without rates show the longest one.",
    "samples/s": "Over the whole time with these settings. In brackets if that was too short "
    "to have meaning.",
    "spread": "Standard deviation of samples/s: over runs, or over intervals of a single run.",
    "rays/s": "Camera, bounce and shadow rays.",
    "ns/record": "Thread time of keys, sort, materialize and shade, per record.",
    "lanes used": "Records / (packets x lanes).",
    "run length": "Records in an unbroken run of one material.",
    "speed": "Relative to the pinned row, or to the first of this picture, at equal samples.",
    "95 %": "Interval of the speed: over repeats, or over intervals of a single pair.",
    "verdict": "A difference holds if three repeats confirm it.",
}
TIPS = {name: _TIPS[name] for name in COLUMNS}
LEFT = tuple(COLUMNS.index(name) for name in ("settings", "verdict", "changed"))
"""Columns of the run table that contain text. All other columns contain numbers."""


@dataclass(frozen=True)
class Row:
    """A row of the table, which describes one series."""

    series: Series
    label: str
    texts: tuple[str, ...]
    """Texts of the row, one for each column in ``COLUMNS``."""
    ratio: Ratio | None
    is_base: bool


def rows(log: RunLog, count: int = 20) -> list[Row]:
    """Returns a row for each of the newest series, from old to new, compared with a base series."""
    base = log.base
    shown = [one for one in last_of(log.series, count, log.pinned) if one.runs]
    names = labels(shown)
    return [_row(one, name, base) for one, name in zip(shown, names, strict=True)]


def _row(series: Series, label: str, base: Series | None) -> Row:
    run = series.best
    samples, rays = rate_of(series, "samples"), rate_of(series, "rays")
    is_base = series is base
    ratio = None if base is None or is_base else compare(series, base)

    def known(text: str) -> str:
        return f"({text})" if samples.is_short else text

    waves = series.settings.get("integrator") != "reference"
    texts = (
        label,
        known(count_text(samples.value)),
        f"{100 * samples.spread:.0f} %" if samples.stretches >= 2 else "",
        *(("1", "", "base") if is_base else _ratio_texts(ratio)),
        f"{run.shading_ns():.0f}" if waves and run.last.records else "",
        f"{100 * run.lane_utilisation():.0f} %" if waves and run.last.packet_lanes else "",
        f"{run.run_length():.1f}" if waves and run.run_length() else "",
        known(count_text(rays.value)),
        str(len(series.runs)),
        series.changed,
    )
    return Row(series, label, texts, ratio, is_base)


def _ratio_texts(ratio: Ratio | None) -> tuple[str, str, str]:
    if ratio is None:
        return "", "", "other work"
    if not math.isfinite(ratio.value):
        return "", "", ratio.verdict()
    if ratio.short or not math.isfinite(ratio.high):
        return f"({ratio.value:.2f})", "", ratio.verdict()
    return f"{ratio.value:.2f}", f"{ratio.low:.2f} to {ratio.high:.2f}", ratio.verdict()


def as_text(table: Sequence[Row]) -> str:
    """Formats the table as aligned text that can be pasted into a mail or a notebook."""
    cells = [COLUMNS, *(row.texts for row in table)]
    widths = [max(len(line[i]) for line in cells) for i in range(len(COLUMNS))]
    return "\n".join(
        "  ".join(
            text.ljust(width) if i in LEFT else text.rjust(width)
            for i, (text, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in cells
    )


def as_csv(table: Sequence[Row]) -> str:
    """Formats the table as CSV.

    Each run is one line, with all settings as plain values and with times in seconds.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    phases = list(table[0].series.best.last.phases) if table else []
    writer.writerow(
        [
            "series", "run", "finished", *FIELDS, "seconds", "samples", "rays", "records",
            "samples_per_s", "spread", "stretches", "shading_ns_per_record", "lane_utilisation",
            "run_length", "material_homogeneity", "texture_homogeneity",
            *(f"{name}_s" for name in phases), "speed", "speed_low", "speed_high", "repeats",
        ]
    )  # fmt: skip
    for row in table:
        for number, run in enumerate(row.series.runs, 1):
            samples, last, ratio = rate(run, "samples"), run.last, row.ratio
            line: list[Any] = [row.series.number, number, int(run.finished)]
            line += [row.series.settings.get(name, "") for name in FIELDS]
            line += [last.seconds, last.samples, last.rays, last.records]
            line += [samples.value, samples.spread, samples.stretches]
            line += [run.shading_ns(), run.lane_utilisation()]
            line += [last.coherence.get(name, 0.0) for name in (
                "run_length", "material_homogeneity", "texture_homogeneity")]  # fmt: skip
            line += [last.phases.get(name, 0.0) for name in phases]
            line += [1, 1, 1, 0] if row.is_base else _numbers(ratio)
            writer.writerow(line)
    return out.getvalue()


def _numbers(ratio: Ratio | None) -> list[Any]:
    if ratio is None or not math.isfinite(ratio.value):
        return ["", "", "", ""]
    wide = not math.isfinite(ratio.high)
    ends = ["", ""] if wide else [ratio.low, ratio.high]
    return [ratio.value, *ends, ratio.repeats]
