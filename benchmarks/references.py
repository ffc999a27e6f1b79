# SPDX-License-Identifier: Apache-2.0
"""Render scenes of other renderers, and compare the images with the images of these renderers.

    .venv/bin/python benchmarks/references.py
    .venv/bin/python benchmarks/references.py arnold cbox -o out/references --spp 256

The scenes and images are in ../shared/assets/reference: tests of Autodesk's arnold-usd and of
Mitsuba 3. The reference is the stored image, or a new render by Mitsuba where a scene has none.
Mitsuba (make setup-test) also renders each of its scenes twice: unchanged, to check the stored
image, and with our approximations of its materials, to show their effect. The page, index.html in
the output folder, has the images of each scene, their difference and the reasons for the
difference. The page also lists the features that a stage cannot express, with reasons. All errors
are relative to the mean of the reference.

The exit code is 1 if a scene could not be rendered.
"""

from __future__ import annotations

import argparse
import html
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray
from pictures import Pixels, linear, read, white_of, write_row
from reference_scenes import arnold, mitsuba, mitsuba_files
from reference_scenes.mitsuba_scene import Scene, referee
from reference_scenes.stage import Inexpressible
from reference_scenes.why import LISTED, WHY

import wavecomb
from wavecomb.image.compare.comparison import compare
from wavecomb.image.files.output_file import replacing
from wavecomb.image.working_space import to_rec709

ASSETS = Path(__file__).resolve().parents[2] / "shared" / "assets"
EDGE = 128
"""Image edge for --spp; smaller images get more samples per pixel, larger images fewer."""
WIDTH = 128
"""Image width of references that Mitsuba renders because no image is stored."""
SHOWN = 240
"""Approximate height to which small images are enlarged on the page."""

PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>References</title>
<style>
body {{ font: 14px/1.4 sans-serif; margin: 2em; color: #222; max-width: 90em }}
td, th {{ padding: 4px 10px; text-align: right; vertical-align: top }}
td:first-child, td.text {{ text-align: left; max-width: 32em }} img {{ height: 150px }}
</style>
<h1>References: {count} compared, {listed} not expressed</h1>
<p>Ours, the reference, the absolute difference, all as bright as the reference is. Mean and
absolute difference in % of the reference's mean; the noise is one standard error of our mean;
relMSE as <code>wavecomb compare</code> has it, trimmed of its largest 0.1 %. "Mitsuba" is Mitsuba
now against the reference, "as ours" is our picture against Mitsuba with our approximations.</p>
<table><tr><th>scene<th>means, ours and reference<th>mean %<th>noise %<th>absolute %<th>relMSE
<th>Mitsuba %<th>as ours %<th>ours, reference, difference<th>why</tr>
{rows}
</table>
<h2>Not expressed</h2><ul>
{reasons}
</ul></html>
"""


@dataclass
class Entry:
    """Result of one scene; errors are relative to the reference's mean."""

    name: str
    ours: float
    reference: float
    noise: float
    absolute: float
    rel_mse: float
    image: str
    notes: list[str] = field(default_factory=list)
    referee: float | None = None
    as_ours: float | None = None

    @property
    def difference(self) -> float:
        """Difference of our image's mean to the reference's mean, relative to the reference."""
        return self.ours / self.reference - 1.0

    def row(self) -> str:
        """Return the HTML table row of this scene."""

        def share(value: float | None) -> str:
            return "" if value is None else f"{100 * value:+.2f}"

        why = html.escape(". ".join([*dict.fromkeys(self.notes), WHY.get(self.name, "")]))
        return (
            f"<tr><td>{html.escape(self.name)}<td>{self.ours:.5f}<br>{self.reference:.5f}"
            f"<td>{share(self.difference)}<td>{100 * self.noise:.2f}<td>{100 * self.absolute:.2f}"
            f"<td>{self.rel_mse:.2e}<td>{share(self.referee)}<td>{share(self.as_ours)}"
            f'<td><img src="{html.escape(self.image)}" alt=""><td class="text">{why}</tr>'
        )

    def line(self) -> str:
        """Return a line about this scene for the terminal."""
        more = "" if self.as_ours is None else f"   as ours {100 * self.as_ours:+6.2f} %"
        return (
            f"{self.name:58s} mean {self.reference:8.5f}   difference {100 * self.difference:+6.2f}"
            f" +- {100 * self.noise:.2f} %   absolute {100 * self.absolute:6.2f} %{more}"
        )


def render(stage: Path, spp: int, **settings: Any) -> tuple[Pixels, Pixels]:
    """Render a stage; return the image and the variance of its pixels."""
    scene = wavecomb.load(stage)
    picture = wavecomb.render(scene, spp=spp, error=True, **settings)
    assert picture.variance is not None
    return np.asarray(picture.beauty), np.asarray(picture.variance)


def entry_of(
    name: str, file: Path, ours: Pixels, variance: Pixels, reference: Pixels, kept: NDArray[Any]
) -> Entry:
    """Compare the pixels in the mask ``kept``; write the images with all other pixels darkened."""
    mean = max(float(reference[kept].mean(dtype=np.float64)), 1e-12)
    noise = float(np.sqrt(variance[kept].sum(dtype=np.float64))) / variance[kept].size
    found = compare(ours[kept][None], reference[kept][None])
    shown = [image * np.where(kept, 1, 0.15)[:, :, None] for image in (ours, reference)]
    shown.append(abs(ours - reference) * kept[:, :, None])
    enlarged = max(1, SHOWN // len(ours))
    write_row(file, [np.asarray(s, np.float32) for s in shown], white_of(reference), enlarged)
    return Entry(
        name,
        float(ours[kept].mean(dtype=np.float64)),
        mean,
        noise / mean,
        float(abs(ours - reference)[kept].mean(dtype=np.float64)) / mean,
        found.rel_mse_trimmed,
        file.name,
    )


def arnold_entry(folder: Path, options: argparse.Namespace) -> Entry:
    """Compare a test of arnold-usd; both images are clamped to [0, 1] like 8-bit files."""
    name = f"arnold {folder.name}"
    test = arnold.to_stage(folder, options.out / "stages" / f"{folder.name}.usda")
    ours, variance = render(
        test.stage,
        options.spp,
        size=arnold.SIZE,
        filter="gaussian",
        filter_width=arnold.GAUSSIAN_WIDTH,
    )
    ours = np.clip(to_rec709(ours, test.space), 0, 1).astype(np.float32)
    file = folder / "ref" / "reference.tif"
    kept = np.ones(ours.shape[:2], bool)
    if test.covered_only:
        kept = np.asarray(oiio.ImageBuf(str(file)).get_pixels(oiio.FLOAT))[:, :, 3] == 1.0
    image = options.out / f"{folder.name}.png"
    entry = entry_of(name, image, ours, variance, linear(read(file)), kept)
    entry.notes = test.notes
    return entry


def mitsuba_entry(mi: Any, file: Path, stored: Path, options: argparse.Namespace) -> Entry:
    """Compare a scene of Mitsuba.

    Raises:
        Inexpressible: A stage cannot express a feature of the scene.
    """
    width = 0 if stored.exists() else WIDTH
    name = name_of(file)
    stage = options.out / "stages" / f"{file.stem}.usda"
    film = mitsuba.to_stage(Scene(mi, file, width), stage)
    kept = ~film.left_out
    if kept.mean() < 0.5:
        raise Inexpressible(film.notes[0].split(":")[0])
    spp = max(options.spp * EDGE * EDGE // (film.size[0] * film.size[1]), 1)
    ours, variance = render(
        stage,
        spp,
        size=film.size,
        max_depth=film.max_depth,
        filter=film.filter,
        filter_width=film.filter_width,
    )

    def judged(as_ours: bool) -> Pixels:
        scene = referee(Scene(mi, file, width), as_ours)
        return np.asarray(mi.render(scene, spp=spp))[:, :, :3]

    now = judged(False)
    reference = read(stored) if stored.exists() else now
    entry = entry_of(name, options.out / f"{file.stem}.png", ours, variance, reference, kept)
    entry.notes = film.notes
    entry.referee = float(now[kept].mean()) / entry.reference - 1.0 if stored.exists() else None
    entry.as_ours = entry.ours / float(judged(True)[kept].mean()) - 1.0
    return entry


def name_of(file: Path) -> str:
    """Return the name of a Mitsuba scene on the page."""
    return f"mitsuba {file.parent.name}/{file.stem}"


def mitsuba_scenes(scenes: Path) -> list[tuple[Path, Path]]:
    """Return scene files, each with the path of its stored image, which may not exist."""
    found = []
    for file in sorted(scenes.rglob("*.xml")):
        if file.parent.name != "fragments":
            stem = file.stem.rsplit("_", 1)[0] if "tests" in file.parts else file.stem
            found.append((file, file.parent / "refs" / f"{stem}_ref_rgb.exr"))
    return found


def write_page(file: Path, entries: list[Entry], listed: dict[str, str]) -> None:
    """Write the page."""
    reasons = "\n".join(
        f"<li>{html.escape(name)}: {html.escape(reason)}" for name, reason in listed.items()
    )
    page = PAGE.format(
        count=len(entries),
        listed=len(listed),
        rows="\n".join(entry.row() for entry in entries),
        reasons=reasons,
    )
    with replacing(file) as part:
        Path(part).write_text(page, encoding="utf-8")


def main() -> int:
    """Run the comparison."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="*", help="parts of names; default: all")
    parser.add_argument("-o", "--out", type=Path, default=Path("out/references"))
    parser.add_argument("--spp", type=int, default=128)
    options = parser.parse_args()
    if not (ASSETS / "reference" / "arnold-usd").is_dir():
        parser.error(f"there are no references in {ASSETS}")
    options.out.mkdir(parents=True, exist_ok=True)
    entries: list[Entry] = []
    listed = {} if options.scenes else dict(LISTED)

    def wanted(name: str) -> bool:
        return not options.scenes or any(part in name for part in options.scenes)

    def take(name: str, made: Any) -> None:
        if wanted(name):
            try:
                entries.append(made())
                print(entries[-1].line(), flush=True)
            except Inexpressible as reason:
                listed[name] = str(reason)
                print(f"{name:58s} {reason}", flush=True)

    for folder in sorted((ASSETS / "reference" / "arnold-usd").iterdir()):
        take(f"arnold {folder.name}", lambda folder=folder: arnold_entry(folder, options))
    try:
        mi = mitsuba_files.load_mitsuba()
    except ImportError as error:
        print(f"Mitsuba is needed for its scenes (make setup-test): {error}", file=sys.stderr)
        return 1
    scenes = mitsuba_files.lay_out(ASSETS, options.out / "scenes")
    for file, stored in mitsuba_scenes(scenes):
        take(
            name_of(file),
            lambda file=file, stored=stored: mitsuba_entry(mi, file, stored, options),
        )
    if not entries and not listed:
        parser.error("no scene has that name")
    write_page(options.out / "index.html", entries, listed)
    print(f"{len(entries)} compared, {len(listed)} not expressed; {options.out / 'index.html'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
