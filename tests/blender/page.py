# SPDX-License-Identifier: Apache-2.0
"""Writes docs/blender-parity.md: ``python page.py FOLDER``, a folder of ``run.py``'s output.

Needs Pillow.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "blender-parity.md"
HEAD = """# Blender: comparison with Cycles

Scenes made by script, rendered by Cycles and by the [Blender extension](blender.md) with the same
number of bounces, a box filter and no clamping. Blender {version}.

    make setup-blender     # install Blender's wheels, 400 MB each
    make test-blender      # render and check all scenes; JSON and images go to out/blender

- *mean*: mean of the image by Wavecomb over that by Cycles.
- *blocks*: fraction of blocks of 12 x 12 pixels that differ by more than 2 % and four standard
  errors.
- *difference*: reason and bound where the models differ. Without one, the means must agree within
  1 %.

Each pair of images shows Cycles to the left and Wavecomb to the right.
"""


def main(folder: Path) -> None:
    """Writes the page and one sheet of images per group."""
    rows = {f.stem: json.loads(f.read_text()) for f in sorted(folder.glob("*.json"))}
    rows = {name: row for name, row in rows.items() if "ratio" in row and "group" in row}
    for name, row in rows.items():
        expected, noise = row["expected"], 3.0 * row["noise"]
        is_near = expected["low"] - noise <= row["ratio"] <= expected["high"] + noise
        if not is_near or row["outside"] > expected["outside"]:
            print(f"outside of its bounds: {name} {row['ratio']:.4f} {row['outside']:.3f}")
    groups = list(dict.fromkeys(row["group"] for row in rows.values()))
    version = next(iter(rows.values()))["blender"]
    text = [HEAD.format(version=version)]
    for group in sorted(groups):
        chosen = {name: row for name, row in rows.items() if row["group"] == group}
        text.append(f"## {group}\n")
        image = f"images/blender-{group.lower()}.jpg"
        _sheet(folder, list(chosen), PAGE.parent / image)
        text.append(f"![{group}, in the order of the table]({image})\n")
        text.append(
            "| scene | content | mean | blocks | difference |\n| --- | --- | --- | --- | --- |"
        )
        text += [_line(name, row) for name, row in chosen.items()]
        text.append("")
    PAGE.write_text("\n".join(text))


def _line(name: str, row: dict[str, Any]) -> str:
    expected = row["expected"]
    why = expected["why"]
    if why:
        why += f" ({expected['low']:.2f} to {expected['high']:.2f})"
    about = row["about"].rstrip(".")
    return f"| `{name}` | {about} | {row['ratio']:.4f} | {100 * row['outside']:.0f} % | {why} |"


def _sheet(folder: Path, names: list[str], file: Path) -> None:
    tiles = [Image.open(folder / f"{name}.png").convert("RGB") for name in names]
    width, height = 192 + 6, 72 + 6
    columns = 4
    count = -(-len(tiles) // columns)
    sheet = Image.new("RGB", (columns * width, count * height), (255, 255, 255))
    for i, tile in enumerate(tiles):
        tile = tile.resize((192, round(192 * tile.height / tile.width)))
        sheet.paste(tile, ((i % columns) * width, (i // columns) * height))
    sheet.save(file, quality=88)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
