# SPDX-License-Identifier: Apache-2.0
"""Render products of ``wavecomb render``, from the stage's render settings and the options."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from wavecomb.cli.aovs import AovOptions
from wavecomb.cli.job import Names
from wavecomb.cli.options import StageOptions
from wavecomb.cli.purpose import PurposeOptions
from wavecomb.cli.shots import FrameShot
from wavecomb.cli.size import Percent
from wavecomb.errors import WavecombError
from wavecomb.run import aovs as aov_names
from wavecomb.run.expressions import layer_of

if TYPE_CHECKING:
    from wavecomb.run.sequence import Frames
    from wavecomb.usd.render_settings.reader import ProductSettings


@dataclass(frozen=True)
class Plan:
    """One render product, with the choices of the stage and its output files."""

    choice: ProductSettings
    names: Names
    folder: str | None = None
    """Folder that the image must stay in if the stage chose its name; None if the user did."""

    def check_place(self, names: Names) -> None:
        """Raises WavecombError if the image would leave ``folder``, also through symbolic links.

        Args:
            names: File names of the plan, at a frame.
        """
        if self.folder is None:
            return
        within = os.path.realpath(self.folder)
        target = os.path.realpath(names.image)
        if os.path.commonpath([within, target]) != within or within == target:
            name = self.choice.output or names.image
            raise WavecombError(
                f"{self.choice.product}: productName {name} leaves the folder {within}: give "
                "-o FILE.exr, or --output-dir with the folder for images"
            )

    def check_split(self, aovs: Sequence[str], frames: Sequence[float] | None) -> None:
        """Does ``check_place`` for the files of --split-aovs, one for each layer and frame."""
        from wavecomb.image.files.render_output import split_names

        if self.names.output is None:
            return
        for names in [self.names] if frames is None else map(self.names.at, frames):
            for file in split_names(names.image, [layer_of(name) for name in aovs]).values():
                self.check_place(replace(names, output=str(file)))

    def aovs(self, layers: AovOptions, before: Sequence[str] | None) -> tuple[str, ...]:
        """Returns the AOVs to render.

        They come from the options, else from the resumed render, else from the render product.
        """
        if layers.aovs:
            return layers.names
        if before is not None:
            return tuple(before)
        return layers.names if self.choice.aovs is None else aov_names.expand(self.choice.aovs)

    def settings(
        self, chosen: Mapping[str, Any], aovs: Sequence[str], resumed: bool, fits: Any = None
    ) -> Any:
        """Builds checked render settings.

        Args:
            chosen: Settings from the options and from the resumed render; "size" is that of
                --size.
            aovs: AOVs to keep.
            resumed: Whether a render is resumed, which fixes size and region.
            fits: As in ``make_settings``.
        """
        from wavecomb.run.settings import DEFAULT_SIZE, make_settings

        chosen = dict(chosen)
        width, height = self.choice.resolution or DEFAULT_SIZE
        size = chosen.pop("width", width), chosen.pop("height", height)
        asked = chosen.pop("size", size)
        size = asked.of((width, height)) if isinstance(asked, Percent) else asked
        if "region" not in chosen and not resumed and (region := self.choice.region(*size)):
            chosen["region"] = region
            chosen["crop"] = True  # the data window of the files is the one that the stage defines
        try:
            return make_settings(size, chosen.pop("spp"), aovs=aovs, fits=fits, **chosen)
        except WavecombError as error:
            if size != self.choice.resolution:
                raise
            prim = self.choice.product or self.choice.settings
            raise WavecombError(f"{prim}: {error}; --size overrides it") from None

    def source(self, source: StageOptions) -> StageOptions:
        """Returns the options that load the stage for this product."""
        return source.changed(product=self.choice.product or source["product"])

    def shot(self, frames: Frames, frame: float | None, settings: Any) -> FrameShot:
        """Returns this product at a frame of an open stage."""
        size = settings.width, settings.height
        return FrameShot(frames, frame, product=self.choice.product, size=size)


def plan_products(
    choices: Sequence[ProductSettings],
    output: str | None,
    beside: Names,
    purpose: PurposeOptions,
    folder: str | None = None,
    *,
    png_alone: bool = False,
) -> list[Plan]:
    """Plans the images to render: the first render product with ``-o``, else all.

    Args:
        choices: Choices of the stage, one for each render product.
        output: File of -o, or None.
        beside: Other output files, from the options.
        purpose: Options of ``purpose_options``.
        folder: Folder for images that the stage names, which they must not leave; None means the
            working folder.
        png_alone: Whether -o names a PNG, the only image.

    Raises:
        WavecombError: An image has no file name, or an option applies to one image only.
    """
    if output is not None or png_alone:
        if folder is not None:
            raise WavecombError("--output-dir is for pictures that the stage names; -o names one")
        return [Plan(choices[0], replace(beside, output=output))]
    plans = []
    for choice in choices:
        if choice.output is None:
            if beside.png is not None and len(choices) == 1:
                plans.append(Plan(choice, beside))
                continue
            prim = choice.product
            where = f"{prim} has no productName" if prim else "the stage has no render product"
            raise WavecombError(f"-o is missing, and {where}: give -o FILE.exr or -o FILE.png")
        if not choice.output.lower().endswith(".exr"):
            raise WavecombError(
                f"{choice.product}: productName {choice.output} must end in .exr; give -o FILE.exr"
            )
        if "\0" in choice.output:
            raise WavecombError(f"{choice.product}: productName is no file name; give -o FILE.exr")
        name = choice.output if folder is None else os.path.join(folder, choice.output)
        plans.append(Plan(choice, replace(beside, output=name), folder or os.curdir))
    if len(plans) > 1:
        single = {
            "--png": beside.png, "--deep": beside.deep, "--stats": beside.stats,
            "--checkpoint": purpose.checkpoint, "--resume": purpose.resume,
            "--preview": purpose.preview,
        }  # fmt: skip
        for option, given in single.items():
            if given is not None:
                raise WavecombError(
                    f"{option} {given}: is of one picture and the stage has {len(plans)} render "
                    "products; choose one by --product"
                )
        seen: set[str] = set()
        for plan in plans:
            target = os.path.realpath(plan.names.image)
            if target in seen:
                raise WavecombError(
                    f"productName {plan.choice.output} is used by several render products; "
                    "choose one by --product"
                )
            seen.add(target)
    return plans
