# SPDX-License-Identifier: Apache-2.0
"""Writes docs/blender-parity.md: ``python page.py FOLDER [--update]``.

FOLDER is the output of ``run.py``. With ``--update``, scenes that FOLDER lacks keep their rows and
images. Set the environment variable PARITY_SPP as for ``run.py``. Needs Pillow.
"""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "blender-parity.md"
HEAD = """# Blender: comparison with Cycles

A script makes scenes and renders them with Cycles and with the [Blender extension](blender.md),
with the same number of bounces, a box filter and no clamping. The images of this page were rendered
by Blender {version}{samples}.

    make setup-blender     # install Blender's wheels, 400 MB each
    make test-blender      # render and check all scenes; JSON and images go to out/blender

- *mean*: mean of Wavecomb's image divided by the mean of Cycles' image.
- *blocks*: fraction of blocks of 12 x 12 pixels that differ by more than 2 % and four standard
  errors.
- *difference*: reason and bound of a difference between the models of the two renderers. Where the
  column is empty, the means of the images must agree within 1 %.

Each pair of images shows Cycles to the left and Wavecomb to the right.
"""

FOOT = """## Limits

Most scenes test one feature in a small image. Production files of Blender were not compared.
"""


TILE = (192, 72)
COLUMNS = 4
Kept = dict[str, dict[str, str]]


def kept_rows() -> Kept:
    """Returns the rows of the page: lines of the table by group and scene."""
    found: Kept = {}
    group = ""
    for line in PAGE.read_text().splitlines():
        if line.startswith("## "):
            group = line[3:]
        elif match := re.match(r"\| `(\w+)` \|", line):
            found.setdefault(group, {})[match[1]] = line
    return found


def main(folder: Path, kept: Kept) -> None:
    """Writes the page and one sheet of images per group.

    Args:
        folder: Output of ``run.py``.
        kept: Rows of scenes that ``folder`` may lack.
    """
    rows = {f.stem: json.loads(f.read_text()) for f in sorted(folder.glob("*.json"))}
    rows = {name: row for name, row in rows.items() if "ratio" in row and "group" in row}
    for name, row in rows.items():
        expected, noise = row["expected"], 3.0 * row["noise"]
        is_near = expected["low"] - noise <= row["ratio"] <= expected["high"] + noise
        if not is_near or row["outside"] > expected["outside"]:
            print(f"outside of its bounds: {name} {row['ratio']:.4f} {row['outside']:.3f}")
    version = next(iter(rows.values()))["blender"]
    is_half = os.environ.get("PARITY_SPP") == "0.5"
    samples = " with half of the samples that the tests use" if is_half else ""
    text = [HEAD.format(version=version, samples=samples)]
    for group in sorted({row["group"] for row in rows.values()} | set(kept)):
        before = kept.get(group, {})
        lines = {name: _line(name, row) for name, row in rows.items() if row["group"] == group}
        lines = dict(sorted({**before, **lines}.items()))
        text.append(f"## {group}\n")
        image = f"images/blender-{group.lower()}.jpg"
        _sheet(folder, list(lines), list(before), PAGE.parent / image)
        text.append(f"![{group}, in the order of the table]({image})\n")
        text.append(
            "| scene | content | mean | blocks | difference |\n| --- | --- | --- | --- | --- |"
        )
        text += lines.values()
        text.append("")
    PAGE.write_text("\n".join([*text, FOOT]))


def _line(name: str, row: dict[str, Any]) -> str:
    expected = row["expected"]
    why = expected["why"]
    if why:
        why += f" ({expected['low']:.2f} to {expected['high']:.2f})"
    about = row["about"].rstrip(".")
    return f"| `{name}` | {about} | {row['ratio']:.4f} | {100 * row['outside']:.0f} % | {why} |"


def _sheet(folder: Path, names: list[str], before: list[str], file: Path) -> None:
    """Writes a sheet; copies tiles of scenes without an image from the existing sheet."""
    old = Image.open(file).convert("RGB") if file.exists() else None
    boxes = {name: _corner(i) for i, name in enumerate(before)}
    count = -(-len(names) // COLUMNS)
    size = (COLUMNS * (TILE[0] + 6), count * (TILE[1] + 6))
    sheet = Image.new("RGB", size, (255, 255, 255))
    for i, name in enumerate(names):
        if (folder / f"{name}.png").exists():
            tile = Image.open(folder / f"{name}.png").convert("RGB")
            tile = tile.resize((TILE[0], round(TILE[0] * tile.height / tile.width)))
        else:
            assert old is not None, name
            x, y = boxes[name]
            tile = old.crop((x, y, x + TILE[0], y + TILE[1]))
        sheet.paste(tile, _corner(i))
    sheet.save(file, quality=88)


def _corner(index: int) -> tuple[int, int]:
    return (index % COLUMNS * (TILE[0] + 6), index // COLUMNS * (TILE[1] + 6))


if __name__ == "__main__":
    main(Path(sys.argv[1]), kept_rows() if "--update" in sys.argv else {})
