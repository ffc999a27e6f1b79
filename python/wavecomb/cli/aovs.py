# SPDX-License-Identifier: Apache-2.0
"""Options for the layers of a picture and the files that they go into."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem

from wavecomb.run import aovs as aov_names
from wavecomb.run import expressions

F = TypeVar("F", bound=Callable[..., Any])

_COMPRESSIONS = ("none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab")


class _AovOption(click.Option):
    """Its help names what the core keeps, which is loaded when it is read."""

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Names of AOVs."""
        named = (f"{expressions.PREFIX}{name}" for name in expressions.NAMED)
        names = (*aov_names.names(), *aov_names.groups(), *named)
        return [CompletionItem(name) for name in names if name.startswith(incomplete)]

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """The option, and its help."""
        self.help = (
            f"Layer to keep, may be given again: {', '.join(aov_names.names()[1:])}, "
            f"{aov_names.LIGHT}NAME, lpe:NAME=EXPRESSION, crypto, techniques, all; "
            "beauty is always there (docs/aovs.md).  "
            f"[default: {', '.join(aov_names.DEFAULT[1:])}]"
        )
        return super().get_help_record(ctx)


def aov_options(command: F) -> F:
    """--aov, and ``file_options``."""
    command = click.option(
        "--aov",
        "aovs",
        multiple=True,
        metavar="NAME",
        cls=_AovOption,
    )(file_options(command))
    return command


def file_options(command: F) -> F:
    """--half, --compression, --exr-tile and --split-aovs."""
    for option in (
        click.option(
            "--split-aovs",
            "split",
            is_flag=True,
            help="A file for each AOV, FILE.NAME.exr; the beauty is in FILE.exr.",
        ),
        click.option(
            "--exr-tile",
            "tile",
            type=click.IntRange(min=0),
            default=0,
            metavar="N",
            help="EXR in tiles of N x N pixels, a multiple of 16.  [default: scanlines]",
        ),
        click.option(
            "--compression",
            type=click.Choice(_COMPRESSIONS),
            default="zip",
            show_default=True,
            help="Of the EXR.",
        ),
        click.option("--half", is_flag=True, help="16 bit colours and normals in the EXR."),
    ):
        command = option(command)
    return command


@dataclass(frozen=True)
class AovOptions:
    """What ``aov_options`` gave."""

    aovs: tuple[str, ...]
    half: bool
    compression: str
    tile: int
    split: bool

    @classmethod
    def take(cls, options: dict[str, Any]) -> AovOptions:
        """Moves them out of a command's arguments; those of AOVs may not be there."""
        options.setdefault("aovs", ())
        return cls(**{field.name: options.pop(field.name) for field in fields(cls)})

    @property
    def names(self) -> tuple[str, ...]:
        """The AOVs, expanded; raises WavecombError for one that is not known."""
        return aov_names.expand(self.aovs) if self.aovs else aov_names.DEFAULT

    def check(self, output: str, aovs: Sequence[str]) -> None:
        """Raises, in one line, what would else come up when files of these AOVs are written.

        The names of light groups are known once a stage is loaded: those of all are not checked.
        """
        from wavecomb.picture import cryptomatte
        from wavecomb.picture.exr import check_options
        from wavecomb.picture.files import check_writable
        from wavecomb.picture.output import split_names

        layers = [cryptomatte.LEVELS.get(name, name) for name in aovs]
        layers = [f"{name}00" if name in cryptomatte.LEVELS.values() else name for name in layers]
        check_options(output, () if self.split else layers, self.compression, self.tile)
        if self.split:
            known = [expressions.layer_of(name) for name in aovs if name != "light_groups"]
            for file in split_names(output, known).values():
                check_writable(file)

    def file_options(self) -> dict[str, Any]:
        """Keyword arguments of ``Picture.save``."""
        return {
            "half": self.half,
            "compression": self.compression,
            "tile": self.tile,
            "split": self.split,
        }
