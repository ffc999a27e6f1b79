# SPDX-License-Identifier: Apache-2.0
"""Renders the UsdLux suite and compares each picture with its reference.

    .venv/bin/python benchmarks/usdlux.py
    .venv/bin/python benchmarks/usdlux.py sphere rect:28 -o out/usdlux --size 512 --spp 64

The stages and pictures lie in ../shared/assets (usd/usdlux, reference/usdlux; FRAMES.md there says
what varies at each frame). Direct light only. The page, index.html in the output folder, shows each
pair and its errors, all relative to the mean of the reference:

    mean        of the difference: what the two disagree about in brightness
    absolute    of the absolute difference, which noise and the edges of shapes are part of

Exit code 1 where less than 90 % of the pictures are within 1 % by their mean.
"""

from __future__ import annotations

import argparse
import html
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pictures import Pixels, read, shrunk, white_of, write_row

import wavecomb
from wavecomb.files import replacing

ASSETS = Path(__file__).resolve().parents[2] / "shared" / "assets"
CAMERAS = {"iesTest": ("/cameras/iesTop", "/cameras/iesBottom")}
"""Of stages whose reference has a picture of each, one above the other."""
VISIBLE = ("visibleRect",)
"""Stages whose lights are seen."""
LAMBERT = """#usda 1.0
over "materials" {
    over "usdpreviewsurface1" {
        over "usdpreviewsurface1" {
            int inputs:useSpecularWorkflow = 0
        }
    }
}
"""
"""The references are of Lambert's surfaces. The stages ask for a specularColor of 0 at the index 1.
By UsdPreviewSurface's specular workflow that still reflects at grazing angles (F90 is 1); by its
metallic workflow it is Lambert's."""
NAME = re.compile(r"(?P<stage>\w+)-embree\.(?P<frame>\d+)\.exr")

PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>UsdLux suite</title>
<style>
body {{ font: 14px/1.4 sans-serif; margin: 2em; color: #222 }} img {{ height: 160px }}
td, th {{ padding: 2px 10px; text-align: right }} td:first-child {{ text-align: left }}
.off {{ color: #c33 }}
</style>
<h1>UsdLux suite: {within} of {count} within 1 %</h1>
<table><tr><th>picture<th>mean<th>mean difference, %<th>absolute, %<th>ours, reference</tr>
{rows}
</table></html>
"""


@dataclass
class Entry:
    """What came of one picture."""

    name: str
    mean: float
    difference: float
    absolute: float
    image: str

    @property
    def is_within(self) -> bool:
        """Whether the means differ by 1 % or less."""
        return abs(self.difference) <= 0.01

    def row(self) -> str:
        """Its part of the page."""
        return (
            f"<tr{'' if self.is_within else ' class=off'}><td>{html.escape(self.name)}"
            f"<td>{self.mean:.5f}<td>{100 * self.difference:+.3f}<td>{100 * self.absolute:.2f}"
            f'<td><img src="{html.escape(self.image)}" alt=""></tr>'
        )


def render(stage: Path, frame: int, camera: str | None, options: argparse.Namespace) -> Pixels:
    """Our picture of a frame."""
    lambert = options.out / "lambert.usda"
    lambert.write_text(LAMBERT, encoding="utf-8")
    lights = "visible" if stage.stem in VISIBLE else "hidden"
    scene = wavecomb.load(stage, frame=frame, camera=camera, lights=lights, session_layer=lambert)
    picture = wavecomb.render(
        scene,
        size=(options.size, options.size),
        spp=options.spp,
        max_depth=1,
        filter="box",
        filter_width=1.0,
    )
    return np.asarray(picture.beauty, np.float32)


def compare(reference_file: Path, options: argparse.Namespace) -> Entry:
    """Renders what a reference shows and compares."""
    found = NAME.fullmatch(reference_file.name)
    assert found is not None
    stage, frame = found["stage"], int(found["frame"])
    reference = shrunk(read(reference_file), options.size)
    cameras = CAMERAS.get(stage, (None,))
    file = ASSETS / "usd" / "usdlux" / f"{stage}.usda"
    ours = np.concatenate([render(file, frame, camera, options) for camera in cameras], axis=0)
    name = f"{stage} {frame}"
    mean = max(float(reference.mean(dtype=np.float64)), 1e-12)
    difference = np.asarray(ours, np.float64) - reference
    image = f"{stage}.{frame:04d}.png"
    write_row(options.out / image, [ours, reference], white_of(reference))
    return Entry(
        name, mean, float(difference.mean()) / mean, float(abs(difference).mean()) / mean, image
    )


def main() -> int:
    """Runs the comparison."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("pictures", nargs="*", help="STAGE or STAGE:FRAME; default: all")
    parser.add_argument("-o", "--out", type=Path, default=Path("out/usdlux"))
    parser.add_argument("--size", type=int, default=512, help="width; divides 512")
    parser.add_argument("--spp", type=int, default=64)
    options = parser.parse_args()
    if options.size < 1 or 512 % options.size:
        parser.error("--size must divide 512")
    references = sorted((ASSETS / "reference" / "usdlux").glob("*-embree.*.exr"))
    if not references:
        parser.error(f"there are no references in {ASSETS}")
    wanted = set(options.pictures)
    options.out.mkdir(parents=True, exist_ok=True)
    entries = []
    for file in references:
        found = NAME.fullmatch(file.name)
        if found is None:
            continue
        stage, frame = found["stage"], int(found["frame"])
        if wanted and not wanted & {stage, f"{stage}:{frame}"}:
            continue
        entries.append(compare(file, options))
        last = entries[-1]
        print(
            f"{last.name:20s} mean {last.mean:9.5f}   difference {100 * last.difference:+8.3f} %   "
            f"absolute {100 * last.absolute:7.2f} %",
            flush=True,
        )
    if not entries:
        parser.error("no reference has that name")
    within = sum(entry.is_within for entry in entries)
    page = PAGE.format(
        within=within, count=len(entries), rows="\n".join(entry.row() for entry in entries)
    )
    with replacing(options.out / "index.html") as part:
        Path(part).write_text(page, encoding="utf-8")
    print(f"{within} of {len(entries)} within 1 %; {options.out / 'index.html'}")
    return 0 if within >= 0.9 * len(entries) else 1


if __name__ == "__main__":
    sys.exit(main())
