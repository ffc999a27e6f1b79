# SPDX-License-Identifier: Apache-2.0
"""Options that more than one command has, and types of option values."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from wavecomb.usd import LoadedStage

F = TypeVar("F", bound=Callable[..., Any])


class Real(click.ParamType):
    """A finite number, perhaps with a lower bound."""

    name = "number"

    def __init__(self, minimum: float = -math.inf, *, above: bool = False) -> None:
        self._minimum = minimum
        self._above = above

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Text to a float; fails with what it must be."""
        try:
            number = float(value)
        except ValueError:
            self.fail(f"{value!r} is not a number", param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        if number < self._minimum or (self._above and number == self._minimum):
            bound = "above" if self._above else "at least"
            self.fail(f"{value} must be {bound} {self._minimum:g}", param, ctx)
        return number


def examples(*lines: str) -> str:
    """The end of a help text."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


def stage_options(command: F) -> F:
    """STAGE, --camera, --frame, --variant, --purpose, --subdivision and those of motion blur."""
    for option in (
        click.option(
            "--subdivision",
            metavar="off|LEVEL|auto",
            help="Subdivision surfaces: as polygons, refined LEVEL times (0 to 10), or by their "
            "size in the picture.  [default: auto]",
        ),
        click.option(
            "--motion-steps",
            type=click.IntRange(2, 64),
            metavar="N",
            help="Steps of every motion over the shutter.  [default: as many as it needs, 2 to 8]",
        ),
        click.option(
            "--no-motion-blur", is_flag=True, help="What moves is drawn as it is at the frame."
        ),
        click.option(
            "--shutter",
            type=Real(),
            nargs=2,
            metavar="OPEN CLOSE",
            help="When the shutter opens and closes, time codes from the frame.  "
            "[default: the camera's]",
        ),
        click.option(
            "--variant",
            "variants",
            multiple=True,
            metavar="PRIM{SET}=NAME",
            help="Variant to select, may be given again; SET=NAME is of the default prim.",
        ),
        click.option(
            "--purpose",
            "purposes",
            multiple=True,
            type=click.Choice(["default", "render", "proxy", "guide"]),
            help="Geometry to take, may be given again.  [default: default and render]",
        ),
        click.option(
            "--frame",
            type=Real(),
            metavar="T",
            help="Time code.  [default: the stage's start]",
        ),
        click.option(
            "--camera",
            metavar="PATH",
            help="Camera prim.  [default: of the render settings, else the first]",
        ),
        click.argument("stage", type=click.Path()),
    ):
        command = option(command)
    return command


@dataclass(frozen=True)
class StageOptions:
    """What ``stage_options`` gave."""

    camera: str | None
    frame: float | None
    purposes: tuple[str, ...]
    variants: tuple[str, ...]
    subdivision: str | None = None
    shutter: tuple[float, float] | None = None
    no_motion_blur: bool = False
    motion_steps: int | None = None

    @classmethod
    def take(cls, options: dict[str, Any]) -> StageOptions:
        """Moves them out of a command's arguments."""
        return cls(**{field.name: options.pop(field.name) for field in fields(cls)})

    def as_dict(self) -> dict[str, Any]:
        """For a file: what ``completed`` takes."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def completed(self, before: dict[str, Any]) -> StageOptions:
        """With what was chosen before in place of what is not chosen here."""
        mine = self.as_dict()
        values: dict[str, Any] = {name: mine[name] or before.get(name) for name in mine}
        if self.frame is not None:
            values["frame"] = self.frame
        for name in ("purposes", "variants"):
            values[name] = tuple(values[name])
        values["shutter"] = tuple(values["shutter"]) if values["shutter"] else None
        values["no_motion_blur"] = bool(values["no_motion_blur"])
        return StageOptions(**values)

    def load(
        self, stage: str, threads: int = 0, size: tuple[int, int] | None = None
    ) -> LoadedStage:
        """Loads a stage as the options say, on ``threads`` threads (0: all), for a picture."""
        from wavecomb.api import load
        from wavecomb.errors import WavecombError

        if self.camera == "":
            raise WavecombError("--camera is empty: give the path of a camera prim")
        return load(
            stage,
            camera=self.camera,
            frame=self.frame,
            purposes=self.all_purposes(),
            variants=self.selections() or None,
            threads=threads,
            subdivision="auto" if self.subdivision is None else self.subdivision,
            **({} if size is None else {"size": size}),
            shutter=self.shutter,
            motion_blur=not self.no_motion_blur,
            motion_steps=self.motion_steps,
        )

    def selections(self) -> dict[str, str]:
        """Variants as ``wavecomb.load`` takes them."""
        from wavecomb.errors import WavecombError

        variants: dict[str, str] = {}
        for text in self.variants:
            key, equals, value = text.rpartition("=")
            if not (key and equals and value):
                raise WavecombError(f"--variant {text}: must be PRIM{{SET}}=NAME or SET=NAME")
            variants[key] = value
        return variants

    def all_purposes(self) -> tuple[str, ...] | None:
        """Purposes with "default"; None where none was chosen."""
        return tuple(dict.fromkeys(("default", *self.purposes))) if self.purposes else None


def warn(lines: list[str]) -> None:
    """Prints warnings on stderr, each once."""
    for line in dict.fromkeys(lines):
        click.echo(f"warning: {' '.join(line.split())}", err=True)


def stage_warnings(loaded: LoadedStage) -> list[str]:
    """Warnings of a loaded stage as lines."""
    return [*(finding.line() for finding in loaded.report.warnings), *loaded.scene.warnings]
