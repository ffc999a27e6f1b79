# SPDX-License-Identifier: Apache-2.0
"""Render the UsdLux suite and compare each image with its reference.

    .venv/bin/python benchmarks/usdlux.py
    .venv/bin/python benchmarks/usdlux.py sphere rect:28 -o out/usdlux --size 256 --spp 64

The stages and images are in ../shared/assets (usd/usdlux, reference/usdlux; FRAMES.md there lists
what varies by frame). Direct light only. The page, index.html in the output folder, shows each pair
and its errors:

    mean        relative difference of mean brightness
    noise       standard error of the mean
    worst       largest difference of a block of 16 x 16 pixels, in standard errors
    absolute    mean absolute difference, including noise and edges of shapes

The means of two images must agree within 0.5 %, and each block within the noise of both images at a
significance level of 0.01 for all blocks of an image together (usdlux_judge.py). The exit code is 1
if an image fails and is not listed in NOT_REACHED, which states reasons.
"""

from __future__ import annotations

import argparse
import html
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pictures import read, shrunk, white_of, write_row
from usdlux_judge import Verdict, judge

import wavecomb
from wavecomb.image.files.output_file import replacing

ASSETS = Path(__file__).resolve().parents[2] / "shared" / "assets"
CAMERAS = {"iesTest": ("/cameras/iesTop", "/cameras/iesBottom")}
"""Stages whose reference has an image of each camera, one above the other."""
VISIBLE = ("visibleRect",)
"""Stages whose reference images show the lights."""
LAMBERT = """#usda 1.0
over "materials" {
    over "usdpreviewsurface1" {
        over "usdpreviewsurface1" {
            int inputs:useSpecularWorkflow = 0
        }
    }
}
"""
"""The references show Lambertian surfaces. The stages set a specularColor of 0 and an index of
refraction of 1. In UsdPreviewSurface's specular workflow such a surface still reflects at grazing
angles (F90 is 1); in the metallic workflow it is Lambertian.
"""
NOT_REACHED = {
    "dome": "the image is seen: OpenUSD's delegate looks up the nearest texel, we are bilinear",
    "visibleRect": "the image is seen, as in dome",
    **dict.fromkeys(
        ("distant 1", "distant 5", "distant 10"),
        "the delegate's 1 - cos(0.265 degrees) is 179 steps of a float for 179.45: 0.25 % too dark",
    ),
}
"""Reasons why images of some stages do not agree with their references. The means of these images
must still be within 0.5 %."""
NAME = re.compile(r"(?P<stage>\w+)-embree\.(?P<frame>\d+)\.exr")

PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>UsdLux suite</title>
<style>
body {{ font: 14px/1.4 sans-serif; margin: 2em; color: #222 }} img {{ height: 160px }}
td, th {{ padding: 2px 10px; text-align: right }} td:first-child {{ text-align: left }}
.off {{ color: #c33 }}
</style>
<h1>UsdLux suite: {agree} of {count} agree</h1>
<table><tr><th>picture<th>mean<th>mean difference, %<th>noise, %<th>worst block<th>may be
<th>blocks beyond<th>absolute, %<th>ours, reference</tr>
{rows}
</table></html>
"""


@dataclass
class Entry:
    """Result of comparing one image with its reference."""

    name: str
    mean: float
    verdict: Verdict
    absolute: float
    image: str

    @property
    def reason(self) -> str:
        """Known reason why blocks of this image differ by more than noise, or ""."""
        return NOT_REACHED.get(self.name) or NOT_REACHED.get(self.name.split()[0], "")

    @property
    def is_good(self) -> bool:
        """Whether the image passes the comparison with its reference."""
        v = self.verdict
        return v.agrees or (bool(self.reason) and v.mean_agrees)

    def row(self) -> str:
        """Return the HTML table row of this image."""
        v = self.verdict
        return (
            f"<tr{'' if v.agrees else ' class=off'}><td>{html.escape(self.name)}"
            f"<td>{self.mean:.5f}<td>{100 * v.difference:+.3f}<td>{100 * v.noise:.3f}"
            f"<td>{v.worst:.1f}<td>{v.limit:.1f}<td>{v.outside} of {v.blocks}"
            f"<td>{100 * self.absolute:.2f}"
            f'<td><img src="{html.escape(self.image)}" alt=""></tr>'
        )

    def line(self) -> str:
        """Return a line about this image for the terminal."""
        v = self.verdict
        what = "" if v.agrees else "   NOT REACHED" + (f": {self.reason}" if self.reason else "")
        if v.outside:
            what += (
                f" (block {v.place[0]}, {v.place[1]}: {100 * v.excess:+.2f} %, "
                f"{v.outside} of {v.blocks} beyond)"
            )
        return (
            f"{self.name:17s} mean {self.mean:9.5f}  difference {100 * v.difference:+7.3f} "
            f"+- {100 * v.noise:.3f} %  worst block {v.worst:5.1f} of {v.limit:.1f}{what}"
        )


def render(
    stage: Path, frame: int, camera: str | None, spp: int, options: argparse.Namespace
) -> NDArray[np.float64]:
    """Return independent renders of a frame as an array (batches, height, width, 3)."""
    lambert = options.out / "lambert.usda"
    lambert.write_text(LAMBERT, encoding="utf-8")
    lights = "visible" if stage.stem in VISIBLE else "hidden"
    scene = wavecomb.load(
        stage,
        frame=frame,
        camera=camera,
        lights=lights,
        session_layer=lambert,
        subdivision="off",  # OpenUSD's reference implementation renders unsubdivided meshes
    )
    return np.stack(
        [
            wavecomb.render(
                scene,
                size=(options.size, options.size),
                spp=max(1, spp // options.batches),
                seed=seed,
                max_depth=1,
                filter="box",
            ).beauty
            for seed in range(options.batches)
        ]
    ).astype(np.float64)


def compare(reference_file: Path, options: argparse.Namespace) -> Entry:
    """Render the frame of a reference and compare."""
    found = NAME.fullmatch(reference_file.name)
    assert found is not None
    stage, frame = found["stage"], int(found["frame"])
    reference = shrunk(read(reference_file), options.size)
    cameras = CAMERAS.get(stage, (None,))
    file = ASSETS / "usd" / "usdlux" / f"{stage}.usda"
    for spp in (options.spp, 4 * options.spp):
        batches = np.concatenate([render(file, frame, c, spp, options) for c in cameras], axis=1)
        verdict = judge(batches, reference.astype(np.float64))
        if not verdict.mean_is_open:
            break
    ours = np.asarray(batches.mean(0), np.float32)
    mean = max(float(reference.mean(dtype=np.float64)), 1e-12)
    absolute = float(abs(ours.astype(np.float64) - reference).mean()) / mean
    image = f"{stage}.{frame:04d}.png"
    write_row(options.out / image, [ours, reference], white_of(reference))
    return Entry(f"{stage} {frame}", mean, verdict, absolute, image)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the comparison."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("pictures", nargs="*", help="STAGE or STAGE:FRAME; default: all")
    parser.add_argument("-o", "--out", type=Path, default=Path("out/usdlux"))
    parser.add_argument("--size", type=int, default=512, help="image width, a divisor of 512")
    parser.add_argument(
        "--spp", type=int, default=256, help="samples per pixel of all batches together"
    )
    parser.add_argument(
        "--batches", type=int, default=8, help="number of independent renders, at least 2"
    )
    options = parser.parse_args(arguments)
    if options.size < 16 or 512 % options.size:
        parser.error("--size must divide 512 and be 16 or more")
    if not 2 <= options.batches <= options.spp:
        parser.error("--batches must be from 2 to --spp")
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
        print(entries[-1].line(), flush=True)
    if not entries:
        parser.error("no reference has that name")
    agree = sum(entry.verdict.agrees for entry in entries)
    page = PAGE.format(
        agree=agree, count=len(entries), rows="\n".join(entry.row() for entry in entries)
    )
    with replacing(options.out / "index.html") as part:
        Path(part).write_text(page, encoding="utf-8")
    print(f"{agree} of {len(entries)} agree; {options.out / 'index.html'}")
    return 0 if all(entry.is_good for entry in entries) else 1


if __name__ == "__main__":
    sys.exit(main())
