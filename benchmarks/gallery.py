# SPDX-License-Identifier: Apache-2.0
"""Render every stage below a folder and show the images on one page.

    .venv/bin/python benchmarks/gallery.py
    .venv/bin/python benchmarks/gallery.py my/stages -o out/mine --size 320 --spp 64 --limit 120

Each stage is rendered by ``wavecomb render`` in a separate process, which is stopped at the time
limit. The page, index.html in the output folder, shows the image, seconds, memory, unsupported
features and warnings of each stage. The exit code is 1 if a stage failed or was stopped.
"""

from __future__ import annotations

import argparse
import html
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from wavecomb.image.files.output_file import replacing
from wavecomb.version import version

ASSETS = Path(__file__).resolve().parents[2] / "shared" / "assets" / "usd"
ENDINGS = (".usd", ".usda", ".usdc", ".usdz")

PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>Gallery of {folder}</title>
<style>
body {{ font: 14px/1.4 sans-serif; margin: 2em; background: #f4f4f4; color: #222 }}
main {{ display: grid; grid-template-columns: repeat(auto-fill, minmax({size}px, 1fr)); gap: 1em }}
article {{ background: #fff; padding: 8px; border-radius: 4px; overflow-wrap: anywhere }}
article.failed {{ outline: 2px solid #c33 }}
h2 {{ font-size: 14px; margin: 4px 0 }} ul {{ margin: 4px 0; padding-left: 1.2em }}
img {{ width: 100%; background: #888 }} .no {{ color: #a40 }} .bad {{ color: #c33 }}
</style>
<h1>{count} stages of {folder}</h1>
<p>{summary}</p>
<main>
{cards}
</main></html>
"""


@dataclass
class Entry:
    """Result of one stage; ``reference`` is an image to show beside the render."""

    name: str
    about: str = ""
    reference: str | None = None
    picture: str | None = None
    seconds: float = 0.0
    load: float = 0.0
    memory_mb: float = 0.0
    unsupported: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    failure: str = ""

    def card(self) -> str:
        """Return the HTML that shows this stage on the page."""
        lines = [f'<article class="{"failed" if self.failure else "done"}">']
        for picture in (self.picture, self.reference):
            if picture is not None:
                lines.append(f'<img src="{html.escape(picture)}" alt="">')
        lines.append(f"<h2>{html.escape(self.name)}</h2>")
        if self.about:
            lines.append(f"<p>{html.escape(self.about)}</p>")
        if self.failure:
            lines.append(f'<p class="bad">{html.escape(self.failure)}</p>')
        else:
            lines.append(
                f"<p>{self.seconds:.1f} s, of that {self.load:.1f} s to load; "
                f"{self.memory_mb:.0f} MB</p>"
            )
        for kind, texts in (("no", self.unsupported), ("warning", self.warnings)):
            if texts:
                title = "not supported" if kind == "no" else "warnings"
                items = "".join(f"<li>{html.escape(text)}</li>" for text in texts)
                lines.append(f'<div class="{kind}">{title}:<ul>{items}</ul></div>')
        return "\n".join([*lines, "</article>"])


def render(
    stage: Path, name: str, stem: Path, options: argparse.Namespace, extra: Sequence[str] = ()
) -> Entry:
    """Render a stage in a separate process; ``extra`` are options of ``wavecomb render``."""
    entry = Entry(name)
    files = {kind: stem.with_name(f"{stem.name}.{kind}") for kind in ("exr", "png", "json")}
    command = [sys.executable, "-m", "wavecomb", "render", str(stage), "--quiet"]
    command += ["-o", str(files["exr"]), "--png", str(files["png"]), "--stats", str(files["json"])]
    command += ["--size", str(options.size), str(options.size), "--spp", str(options.spp)]
    command += extra
    begin = time.monotonic()
    child = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        _, said = child.communicate(timeout=options.limit)
    except subprocess.TimeoutExpired:
        os.killpg(child.pid, signal.SIGKILL)
        child.communicate()
        entry.failure = f"ended after {options.limit:g} s"
        return entry
    entry.seconds = time.monotonic() - begin
    if child.returncode != 0:
        last = said.strip().splitlines()[-1:] or ["no message"]
        entry.failure = f"exit code {child.returncode}: {last[0]}"
        return entry
    stats = json.loads(files["json"].read_text(encoding="utf-8"))
    entry.picture = files["png"].name
    entry.load = stats["seconds"]["load"]
    entry.memory_mb = stats["peak_rss_bytes"] / 1e6
    entry.unsupported, entry.warnings = stats["unsupported"], stats["warnings"]
    for kind in ("exr", "json"):
        files[kind].unlink()
    return entry


def write_page(folder: str, entries: Sequence[Entry], options: argparse.Namespace) -> int:
    """Write the page; return the exit code."""
    failed = [entry for entry in entries if entry.failure]
    summary = (
        f"{len(failed)} failed; Wavecomb {version()}, {options.size} x {options.size} pixels, "
        f"{options.spp} samples each, at most {options.limit:g} s."
    )
    page = options.output / "index.html"
    with replacing(page) as part:
        part.write_text(
            PAGE.format(
                folder=html.escape(folder),
                count=len(entries),
                size=options.size,
                summary=html.escape(summary),
                cards="\n".join(entry.card() for entry in entries),
            ),
            encoding="utf-8",
        )
    print(f"{summary} Wrote {page}")
    return 1 if failed else 0


def main() -> int:
    """Render all stages and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=ASSETS, help="folder of the stages")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/gallery"))
    parser.add_argument("--size", type=int, default=256, help="image edge in pixels")
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--limit", type=float, default=60.0, help="time limit per stage in seconds")
    options = parser.parse_args()
    stages = sorted(p for p in options.folder.rglob("*") if p.suffix.lower() in ENDINGS)
    if not stages:
        print(f"{options.folder}: no stages below it", file=sys.stderr)
        return 2
    options.output.mkdir(parents=True, exist_ok=True)
    entries = []
    for number, stage in enumerate(stages, 1):
        name = str(stage.relative_to(options.folder))
        stem = options.output / name.replace(os.sep, "__")
        entry = render(stage, name, stem, options)
        entries.append(entry)
        result = entry.failure or f"{entry.seconds:.1f} s, {entry.memory_mb:.0f} MB"
        print(f"{number} of {len(stages)}  {name}: {result}", flush=True)
    return write_page(options.folder.name, entries, options)


if __name__ == "__main__":
    sys.exit(main())
