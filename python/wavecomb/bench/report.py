# SPDX-License-Identifier: Apache-2.0
"""The report of a result folder: one HTML page that needs nothing else, and figure files."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavecomb.bench import report_pictures
from wavecomb.bench.analysis_data import load
from wavecomb.bench.figures_style import style
from wavecomb.bench.report_experiment import experiment
from wavecomb.bench.report_facts import equality, machine_parts, warnings_of
from wavecomb.bench.report_html import (
    escape,
    folded,
    nested,
    page,
    paragraph,
    prose,
    table,
)
from wavecomb.bench.report_markdown import copy_figures, write_page
from wavecomb.bench.report_parts import Markup, Report, Section, Viewer
from wavecomb.bench.report_suite import suite
from wavecomb.bench.report_writer import Writer
from wavecomb.picture.files import replacing

if TYPE_CHECKING:
    from wavecomb.bench.analysis_data import Results


def build(folder: Path, markdown: Path | None = None) -> Path:
    """Writes DIR/report.html, its parts as DIR/report.json, and DIR/figures, SVG and PNG.

    Args:
        folder: DIR.
        markdown: A .md file that is written, too, with a folder of figures beside it.

    Raises:
        WavecombError: The folder holds no results, or a file in it is damaged; or a library of the
            extra "bench" is missing.
        OSError: It cannot be written.
    """
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
        lines = "".join(f"<li>{prose(line)}</li>" for line in out.findings)
        out.sections.insert(0, _findings(f'<ul class="findings">{lines}</ul>'))
    target = folder / "report.html"
    warnings = warnings_of(results.machine, results.rows)
    report = Report(_title(results), _lead(results), warnings, out.sections)
    with replacing(target) as part:
        part.write_text(page(report), encoding="utf-8")
    report.write(folder)
    if markdown is not None:
        write_page(markdown, report)
        copy_figures(figures, markdown)
    return target


def _title(results: Results) -> str:
    return f"Wavecomb benchmark: {results.runs['suite'].iloc[0] or results.folder.name}"


def _lead(results: Results) -> str:
    machine, runs = results.machine, results.runs
    about = [
        str(machine.get("cpu") or "unknown CPU"),
        f"{machine['cores']} cores" if machine.get("cores") else "",
        str(machine.get("isa") or ""),
        f"commit {str(machine['commit'])[:10]}" if machine.get("commit") else "",
    ]
    started = [text for text in runs["started"] if text]
    when = f", {min(started)[:16].replace('T', ' ')} to {max(started)[:16].replace('T', ' ')} UTC"
    counts = (
        f"{len(runs)} runs of {runs['config'].nunique()} configurations on "
        f"{runs['stage'].nunique()} stages{when if started else ''}"
    )
    lines = [" · ".join(part for part in about if part), counts]
    return "".join(f'<p class="facts">{escape(line)}</p>' for line in lines)


def _findings(inside: str) -> Section:
    note = paragraph(
        "Found by the rules of docs/bench-report.md, not chosen by hand. A difference is spoken of "
        "where its p-value, corrected for all comparisons of its table, is below 5 %.",
        "note",
    )
    return Section("findings", "What the figures say", [Markup(inside), Markup(note)])


def _pictures(out: Writer, results: Results) -> None:
    groups, different = equality(results.rows)
    found = report_pictures.shots(results)
    if not groups and not found:
        return
    out.begin("Pictures")
    if groups:
        same = groups - len(different)
        text = (
            f"{same} of {groups} groups of runs that may differ in the order and spread of work "
            "only gave equal pictures, bit for bit"
        )
        out.add(paragraph(text + ("." if same == groups else "; these did not:")))
        out.add("".join(paragraph(line, "worse") for line in different[:10]))
    for shot in found:
        if shown := report_pictures.viewer(shot):
            out.add(Viewer(shown))
        out.draw(report_pictures.differences(shot))


def _about(out: Writer, results: Results) -> None:
    out.begin("How to repeat it")
    commands = [
        sitting["command"]
        for sitting in results.machine.get("sittings", ())
        if isinstance(sitting, dict) and sitting.get("command")
    ]
    words = shlex.split(commands[-1]) if commands else []
    folder = words[words.index("-o") + 1] if "-o" in words[:-1] else results.folder.name
    commands.append(f"wavecomb bench report {shlex.quote(folder)}")
    out.add(f"<pre><code>{escape(chr(10).join(dict.fromkeys(commands)))}</code></pre>")
    if results.suite_text:
        suite_text = f"<pre><code>{escape(results.suite_text)}</code></pre>"
        out.add(folded("The suite: suite.toml", suite_text))
    settings = [
        [str(row.config), f"{row.width:.0f} x {row.height:.0f}", *_numbers(row), str(row.runs)]
        for row in _configurations(results)
    ]
    head = ["configuration", "pixels", "spp", "threads", "lanes", "wave", "max depth", "runs"]
    text = table("Settings as used", head, settings)
    out.add(folded(f"Settings of all {len(settings)} configurations", text))
    if len(results.failed):
        rows = [[str(row.run_id), str(row.error)] for row in results.failed.itertuples()]
        out.add(folded("Runs that failed", table("Runs that failed", ["run", "why"], rows)))
    out.begin("Machine")
    out.add(*machine_parts(results.machine))
    out.begin("Words")
    out.add(nested(WORDS))


def _configurations(results: Results) -> list[Any]:
    numbers = ("width", "height", "spp", "threads", "lanes", "wave_size", "max_depth")
    first = results.runs.groupby("config", sort=False)[list(numbers)].first()
    sizes = results.runs.groupby("config").size()
    return list(first.assign(runs=sizes).reset_index().itertuples())


def _numbers(row: Any) -> list[str]:
    values = (row.spp, row.threads, row.lanes, row.wave_size, row.max_depth)
    return ["–" if value != value else f"{value:.0f}" for value in values]


WORDS = {
    "record": "A hit that waits for shading.",
    "round": "One repetition of all configurations, in random order.",
    "order": "Keys, sort and moving of records: what an order of shading costs.",
    "placebo": "random-runs: the runs of a material in an order that means nothing.",
    "oracle": "cost-benefit with true costs, recorded before: what a cost model could win.",
    "oracle-best, oracle-worst": (
        "the order of the runs of materials that a trace with true costs says is quickest, slowest."
    ),
    "run length": "Mean number of consecutive records of one material.",
    "relMSE": "Mean of (x − r)² / (r² + 0.01) to the golden picture r.",
    "efficiency": "1 / (relMSE × render time).",
    "regret": "Time above that of the best fixed policy, as a share of it.",
    "interval": "95 %; rounds are resampled whole. docs/bench-report.md has the formulas.",
}
