# SPDX-License-Identifier: Apache-2.0
"""Report of a result folder: a self-contained HTML page, and figure files."""

from __future__ import annotations

import math
import os
import shlex
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavecomb import options
from wavecomb.bench.analysis.data import SETTINGS, load
from wavecomb.bench.figures.style import style
from wavecomb.bench.reports import images
from wavecomb.bench.reports.experiment import experiment, suite
from wavecomb.bench.reports.parts import (
    Code,
    Facts,
    Figure,
    Lines,
    Part,
    Section,
    Table,
    Text,
    Writer,
    key_of,
    table,
)
from wavecomb.extras import needed
from wavecomb.image.files.output_file import replacing

if TYPE_CHECKING:
    import pandas as pd

    from wavecomb.bench.analysis.data import Results


LARGEST_SVG = 150_000
LARGEST_PNG = 120_000
"""Largest size in bytes of a PNG beside a Markdown page; larger figures are shrunk, because a
repository keeps every version of a file."""
_HERE = Path(__file__).parent


def build(folder: Path, markdown: Path | None = None) -> Path:
    """Writes DIR/report.html and DIR/figures, each figure as SVG and PNG.

    Args:
        folder: DIR.
        markdown: Also write this .md file, with a folder of figures beside it. The Markdown page
            has the same text, tables and figures as the HTML page, but no image viewers and no
            collapsed sections.

    Raises:
        WavecombError: The folder holds no results, a file in it is damaged, or a library of the pip
            extra "bench" is missing.
        OSError: The report cannot be written.
    """
    environment = _environment()
    results = load(folder)
    figures = folder / "figures"
    figures.mkdir(exist_ok=True)
    out = Writer(figures)
    with style():
        for name, runs in results.experiments():
            experiment(out, name, runs)
        suite(out, results)
        _pictures(out, results)
    _about(out, results)
    if out.findings:
        out.sections.insert(0, _findings(out))
    values: dict[str, Any] = {
        "title": f"Wavecomb benchmark: {results.runs['suite'].iloc[0] or results.folder.name}",
        "lead": _lead(results),
        "warnings": warnings_of(results),
        "sections": [section for section in out.sections if section.parts],
    }
    files = {name: (_HERE / f"report.{name}").read_text(encoding="utf-8") for name in ("css", "js")}
    text = environment.get_template("report.html.j2").render(
        values, style=files["css"], script=files["js"]
    )
    _write(folder / "report.html", text)
    if markdown is not None:
        target = markdown.with_suffix("")
        values |= {"folder": markdown.stem, "files": _copy_figures(out, target)}
        _write(markdown, environment.get_template("report.md.j2").render(values).strip() + "\n")
    return folder / "report.html"


def _environment() -> Any:
    """Returns a Jinja2 environment that escapes HTML and has the filters of the templates."""
    jinja2 = needed("jinja2", "the report")
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_HERE),
        autoescape=lambda name: ".html" in (name or ""),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    environment.filters |= {"prose": _prose, "md": _markdown, "key": key_of}
    return environment


def _prose(text: str) -> str:
    """Inserts no-break spaces between numbers and units."""
    return text.replace(" %", "\u00a0%").replace("n = ", "n\u00a0=\u00a0")


def _markdown(text: str) -> str:
    """Converts text to one line that can be put into a Markdown table."""
    return " ".join(text.split()).replace("<", "&lt;").replace("|", "\\|")


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def _copy_figures(out: Writer, folder: Path) -> dict[str, str]:
    """Copies all figures as SVG, or as PNG where the SVG is too large; returns the file names."""
    folder.mkdir(parents=True, exist_ok=True)
    files = {}
    for part in (part for section in out.sections for part in section.parts):
        if not isinstance(part, Figure):
            continue
        drawing = out.figures / f"{part.name}.svg"
        if drawing.stat().st_size <= LARGEST_SVG:
            shutil.copyfile(drawing, folder / drawing.name)
        else:
            drawing = drawing.with_suffix(".png")
            _small_png(drawing, folder / drawing.name)
        files[part.name] = drawing.name
    return files


def _small_png(source: Path, target: Path) -> None:
    """Writes the image with 256 colours, and scales it down until its file is small enough."""
    from PIL import Image

    with Image.open(source) as opened:
        image = opened.convert("RGB")
    scale = 1.0
    while True:
        size = (round(image.width * scale), round(image.height * scale))
        small = image.resize(size, Image.Resampling.LANCZOS).quantize(256)
        with replacing(target) as part:
            small.save(part, format="PNG", optimize=True)
        if os.path.getsize(target) <= LARGEST_PNG or min(size) < 200:
            return
        scale *= 0.85


# ---- sections ------------------------------------------------------------------------------------


def _lead(results: Results) -> list[str]:
    machine, runs = results.machine, results.runs
    about = [
        str(machine.get("cpu") or "unknown CPU"),
        f"{machine['cores']} cores" if machine.get("cores") else "",
        str(machine.get("isa") or ""),
        f"commit {str(machine['commit'])[:10]}" if machine.get("commit") else "",
    ]
    started = [text[:16].replace("T", " ") for text in runs["started"] if text]
    when = f", {min(started)} to {max(started)} UTC" if started else ""
    counts = (
        f"{len(runs)} runs of {runs['config'].nunique()} configurations on "
        f"{runs['stage'].nunique()} stages{when}"
    )
    return [" · ".join(part for part in about if part), counts]


def _findings(out: Writer) -> Section:
    note = Text(
        "Found by the rules of docs/bench-report.md. A difference is reported if its p-value, "
        "corrected for all comparisons of its table, is below 5 %.",
        "note",
    )
    return Section("Findings", [Lines(out.findings), note])


def _pictures(out: Writer, results: Results) -> None:
    groups, different = equality(results.runs)
    found = images.shots(results)
    if not groups and not found:
        return
    out.begin("Pictures")
    if groups:
        same = groups - len(different)
        text = (
            f"{same} of {groups} groups of runs that may differ in the order and spread of work "
            "only gave equal pictures, bit for bit"
        )
        out.add(Text(text + ("." if same == groups else "; these did not:")))
        out.add(*(Text(line, "worse") for line in different[:10]))
    for shot in found:
        out.add(images.viewer(shot))
        out.draw(images.differences(shot))


def _about(out: Writer, results: Results) -> None:
    out.begin("How to repeat the benchmark")
    commands = [
        sitting["command"]
        for sitting in results.machine.get("sittings", ())
        if isinstance(sitting, dict) and sitting.get("command")
    ]
    words = shlex.split(commands[-1]) if commands else []
    folder = words[words.index("-o") + 1] if "-o" in words[:-1] else results.folder.name
    commands.append(f"wavecomb bench report {shlex.quote(folder)}")
    out.add(Code("\n".join(dict.fromkeys(commands))))
    if results.suite_text:
        out.add(Code(results.suite_text, summary="The suite: suite.toml"))
    out.add(_settings(results))
    if len(results.failed):
        rows = results.failed[["run_id", "error"]].astype(str).to_numpy().tolist()
        out.add(table("Runs that failed", ["run", "why"], rows, summary="Runs that failed"))
    out.begin("Machine")
    out.add(*machine_parts(results.machine))
    out.begin("Words")
    out.add(Facts(WORDS))


def _settings(results: Results) -> Table:
    """Returns a collapsed table of the settings used by each configuration."""
    names = ["spp", "threads", "lanes", "wave_size", "max_depth"]
    by_config = results.runs.groupby("config", sort=False)
    used = by_config[["width", "height", *names]].first().assign(runs=by_config.size())
    rows = [
        [
            str(row.Index),
            f"{row.width:.0f} x {row.height:.0f}",
            *("–" if math.isnan(v := getattr(row, name)) else f"{v:.0f}" for name in names),
            str(row.runs),
        ]
        for row in used.itertuples()
    ]
    head = ["configuration", "pixels", "spp", "threads", "lanes", "wave", "max depth", "runs"]
    return table(
        "Settings as used", head, rows, summary=f"Settings of all {len(rows)} configurations"
    )


WORDS = {
    "record": "A hit that waits for shading.",
    "round": "One repetition of all configurations, in random order.",
    "order": "Keys, sort and moving of records: the cost of an order of shading.",
    "placebo": "random-runs: the runs of a material in random order.",
    "oracle": "cost-benefit with recorded true costs: a bound for the gain of a cost model.",
    "oracle-best, oracle-worst": (
        "the fastest and the slowest order of material runs, by recorded true costs."
    ),
    "run length": "Mean number of consecutive records of one material.",
    "relMSE": "Mean of (x − r)² / (r² + 0.01) to the golden image r.",
    "efficiency": "1 / (relMSE × render time).",
    "regret": "Time beyond the best fixed policy, as a fraction of its time.",
    "interval": "95 %; rounds are resampled whole. docs/bench-report.md has the formulas.",
}


# ---- Warnings of a report, and facts about its machine


FEW_ROUNDS = 5


def _equal_in() -> list[str]:
    """Returns columns of runs.csv; if runs agree in them, their images must be bit-identical."""
    rows = options.settings().values()
    same_bits = {row.name for row in rows if not row.changes_bits} - {"spp"}
    return [
        *(n for n in SETTINGS if n not in same_bits | {"experiment"} and n[:6] != "factor"),
        "seed",
    ]


def warnings_of(results: Results) -> list[str]:
    """Returns warnings about the results of the report, the most serious first."""
    lines: list[str] = []
    machine, runs, failed = results.machine, results.runs, results.failed
    _, different = equality(runs)
    if different:
        lines.append(
            f"Pictures that must be equal differ, in {len(different)} groups: their times are for "
            f"unequal work. {different[0]}."
        )
    noise = machine.get("noise")
    reasons = noise.get("lines", ()) if isinstance(noise, Mapping) else ()
    lines += [f"Noisy machine: {line}." for line in reasons]
    noisy = int((runs["noisy"] == True).sum())  # noqa: E712 (None is no noise)
    if noisy and not reasons:
        lines.append(f"{noisy} of {len(runs)} runs were disturbed by other work on the machine.")
    least = int(runs["config"].value_counts().min())
    if least < FEW_ROUNDS:
        some = "once" if least == 1 else f"{least} times"
        lines.append(
            f"Some configurations ran only {some}: their intervals are wide, or there is none."
        )
    if len(failed):
        first = failed.iloc[0]
        lines.append(f"{len(failed)} runs failed; the first: {first['run_id']}: {first['error']}")
    if machine.get("dirty"):
        lines.append("The source was changed after the commit shown here.")
    return lines


def equality(runs: pd.DataFrame) -> tuple[int, list[str]]:
    """Counts the groups of runs that must have equal images, and names groups whose images differ.

    The runs of a group agree in the sample count, the seed and all settings that change the bits of
    the image. Runs with a time limit are left out, since their sample counts differ.
    """
    ours = runs[(runs["renderer"] == "wavecomb") & (runs["picture_sha256"] != "")]
    ours = ours[ours["time_limit"].fillna(0) == 0]
    groups = ours.groupby(_equal_in(), dropna=False, sort=False)["picture_sha256"]
    found = groups.agg(["size", "nunique"]).reset_index()
    repeated = found[found["size"] > 1]
    different = [
        f"{row.stage}, roulette {row.roulette}, {row.spp:g} spp, seed {row.seed:g}: "
        f"{row.nunique} different pictures"
        for row in repeated[repeated["nunique"] > 1].itertuples()
    ]
    return len(repeated), different


def machine_parts(machine: Mapping[str, Any]) -> list[Part]:
    """Describes the machine, and gives the reasons for missing hardware counters."""
    counters = machine.get("counters")
    missing = (counters.get("missing") if isinstance(counters, Mapping) else None) or {}
    reasons: dict[str, list[str]] = {}
    for name, why in missing.items():
        reasons.setdefault(str(why), []).append(name.replace("_", " "))
    text = "; ".join(f"{', '.join(names)}: {why}" for why, names in reasons.items())
    known = {key: value for key, value in machine.items() if key not in ("schema", "noise")}
    parts: list[Part] = []
    if text:
        parts.append(Text(f"Hardware counters that are not available here: {text}."))
    return [*parts, Facts(known)]
