# SPDX-License-Identifier: Apache-2.0
"""Render material test stages, and make a page of the images and the stages' documentation.

    .venv/bin/python benchmarks/materials_page.py
    .venv/bin/python benchmarks/materials_page.py cornell-box MaterialXTest -o out/looks --spp 256

The stages are in ../shared/assets/usd. A name selects the stages whose path contains it. The page,
index.html in the output folder, shows our image beside the one in the stage's repository, if there
is one, and below it the stage's documentation, unsupported features and warnings. The exit code is
1 if a stage failed.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import gallery

ROOT = gallery.ASSETS
PICTURE = re.compile(r"!\[[^\]]*\]\(([^)]+)\)|<img[^>]* src=\"([^\"]+)\"")
BALL = "/standard_shader_ball_scene"


@dataclass(frozen=True)
class Exhibit:
    """An image to render.

    Attributes:
        stage: Path below ``ROOT``.
        about: Content of the stage, as its documentation describes it.
        options: Options of ``wavecomb render``.
    """

    stage: str
    about: str
    options: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Title of the image: the path of the stage and the selected variants."""
        chosen = [
            word.rpartition("{")[2].replace("}", "")
            for word in self.options
            if not word.startswith("--")
        ]
        return " ".join([self.stage, *chosen])


def _variants(stage: str, about: str, *choices: tuple[str, ...]) -> tuple[Exhibit, ...]:
    """Return an image to render for each list of USD variants."""
    return tuple(
        Exhibit(stage, about, tuple(word for one in choice for word in ("--variant", one)))
        for choice in choices
    )


EXHIBITS = (
    *_variants(
        "StandardShaderBall/standard_shader_ball_scene.usda",
        "A modified sphere and a rim of the material over neutral 18 % grey, in a box of neutral "
        "textures. Examples come as MaterialX files of two models, and as UsdPreviewSurface. (With "
        "OpenPBR the file gives the neutral part no colour, so that it is OpenPBR's 80 % grey.)",
        *(
            (
                f"{BALL}{{example_material}}=mtlx_{name}",
                f"{BALL}/materials{{material_model}}={model}",
                f"{BALL}/materials/examples{{material_model}}={model}",
            )
            for name in ("plastic", "gold", "glass", "bubblegum")
            for model in ("OpenPBRSurface", "standard_surface")
        ),
        *((f"{BALL}{{example_material}}={name}",) for name in (
            "usdpreview_plastic", "usdpreview_copper", "usdpreview_glass", "uvgrid", "none",
        )),
    ),
    *(
        Exhibit(
            f"cornell-box/{folder}/cornell-box.usda",
            f"{what}. The box of Cornell's data: a light of 17, 12, 4 over walls of white, red and "
            "green. (The display colours have red and green the other way round.)",
        )
        for folder, what in (
            ("mtlx-ref", "MaterialX as a file"),
            ("mtlx-usdshade", "MaterialX in the stage"),
            ("usdpreviewsurface", "UsdPreviewSurface"),
            ("display-color", "Display colours; no light is in the file"),
        )
    ),
    *_variants(
        "Teapot/Teapot.usd",
        "The Utah teapot and a fancy one, each with shading variants of UsdPreviewSurface.",
        *(
            ("/Teapot{modelVariant}=Utah", f"/Teapot{{shadingVariant}}=Ceramic{colour}")
            for colour in ("Black", "Blue", "LimeGreen", "Orange", "Red", "White")
        ),
        ("/Teapot{modelVariant}=Fancy",),
    ),
    Exhibit(
        "Teapot/DrawModes.usd",
        "Each teapot in the draw modes cards, cross, bounds, origin and default.",
    ),
    *_variants(
        "Vehicles/USD_Mini_Car_Kit/assets/vehicles/vehicleVariants.usda",
        "Vehicles as variants, put together of bodies and of wheels that can be exchanged.",
        *(
            (f"/vehicleVariant{{wheels}}={name}",)
            for name in ("4wd", "ambulance", "formula", "sedan", "tractor", "truckFlat", "van")
        ),
    ),
    *_variants(
        "wg_test_assets/MaterialXTest/basicTextured.usda",
        "A teapot that refers to two MaterialX files: coated brass with textures, or plastic.",
        ("/Teapot{materialvariants}=BrassTiled",),
        ("/Teapot{materialvariants}=Plastic",),
    ),
    Exhibit(
        "wg_test_assets/MaterialXTest/basic.usda",
        "A sphere that refers to a MaterialX file with UsdPreviewSurface: blue plastic.",
    ),
    *(
        Exhibit(
            f"wg_test_assets/MaterialXTest/{name}_flatten.usda",
            f"{name}.usda as OpenUSD itself reads it, flattened: the same picture.",
        )
        for name in ("basic", "basicTextured")
    ),
)  # fmt: skip


def exhibits() -> Iterator[Exhibit]:
    """Yield ``EXHIBITS``, and all other stages of the USD working group's test assets."""
    yield from EXHIBITS
    shown = {exhibit.stage for exhibit in EXHIBITS}
    for file in sorted((ROOT / "wg_test_assets").rglob("*")):
        name = file.relative_to(ROOT).as_posix()
        if file.suffix in gallery.ENDINGS and not file.name.startswith("_") and name not in shown:
            yield Exhibit(name, said_of(file))


def document_of(stage: Path) -> Path | None:
    """Return the nearest README in the folder of a stage or above."""
    for folder in stage.parents:
        if folder == ROOT.parent:
            break
        found = sorted(f for f in folder.glob("*.md") if f.stem.lower() == "readme")
        if found:
            return found[0]
    return None


def said_of(stage: Path) -> str:
    """Return the sentence after a stage's name in a README, or else the README's first sentence."""
    document = document_of(stage)
    if document is None:
        return ""
    text = document.read_text(encoding="utf-8", errors="replace")
    after = text.find(stage.name)
    for part in (text[after:], text) if after >= 0 else (text,):
        for paragraph in re.split(r"\n\s*\n", part):
            line = " ".join(paragraph.split())
            is_prose = re.match(r"[A-Z]", line) and ". " in f"{line} "
            if is_prose and not re.search(r"\bTM\b|©|rights reserved", line):
                return re.split(r"(?<=\.) ", line)[0]
    return ""


def picture_of(exhibit: Exhibit) -> Path | None:
    """Return the image of a stage in the stage's documentation, if there is one."""
    stage = ROOT / exhibit.stage
    document = document_of(stage)
    if document is None:
        return None
    there = []
    for match in PICTURE.finditer(document.read_text(encoding="utf-8", errors="replace")):
        file = document.parent / (match[1] or match[2])
        if file.is_file() and "texture" not in file.as_posix().lower():
            there.append(file)
    # Prefer an image named after the stage or a variant; otherwise take the document's first image.
    words = [stage.stem, *(option.rpartition("=")[2] for option in exhibit.options)]
    named = (f for f in there if any(word.lower() in f.stem.lower() for word in words if word))
    return next(named, there[0] if there else None)


def main() -> int:
    """Render all exhibits and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="parts of paths; default: all")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/materials"))
    parser.add_argument("--size", type=int, default=256, help="image edge in pixels")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument(
        "--limit", type=float, default=300.0, help="time limit per stage in seconds"
    )
    options = parser.parse_args()
    wanted = [
        exhibit
        for exhibit in exhibits()
        if not options.names or any(name in exhibit.name for name in options.names)
    ]
    if not wanted:
        parser.error(f"no stage below {ROOT} has such a name")
    options.output.mkdir(parents=True, exist_ok=True)
    entries = []
    for number, exhibit in enumerate(wanted, 1):
        stem = options.output / re.sub(r"[^\w.-]+", "__", exhibit.name)
        entry = gallery.render(ROOT / exhibit.stage, exhibit.name, stem, options, exhibit.options)
        entry.about = exhibit.about
        reference = picture_of(exhibit)
        if reference is not None:
            entry.reference = f"{stem.name}.reference{reference.suffix}"
            shutil.copyfile(reference, options.output / entry.reference)
        entries.append(entry)
        result = entry.failure or f"{entry.seconds:.1f} s"
        print(f"{number} of {len(wanted)}  {exhibit.name}: {result}", flush=True)
    return gallery.write_page("materials", entries, options)


if __name__ == "__main__":
    sys.exit(main())
