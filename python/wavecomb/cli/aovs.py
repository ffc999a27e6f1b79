# SPDX-License-Identifier: Apache-2.0
"""Options that select AOVs and the EXR files they are written to."""

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
    """Option --aov. Builds its help text on demand, because listing the AOVs loads the core."""

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Returns the names of AOVs, groups and expressions that begin with ``incomplete``."""
        named = (f"{expressions.PREFIX}{name}" for name in expressions.NAMED)
        names = (*aov_names.names(), *aov_names.groups(), *named)
        return [CompletionItem(name) for name in names if name.startswith(incomplete)]

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """Returns the option and its help text, as ``click`` expects them."""
        self.help = (
            f"AOV to write as a layer; repeat for more: {', '.join(aov_names.names()[1:])}, "
            f"{aov_names.LIGHT}NAME, lpe:NAME=EXPRESSION, crypto, techniques, all; "
            "beauty is always written (docs/aovs.md).  "
            f"[default: {', '.join(aov_names.DEFAULT[1:])}]"
        )
        return super().get_help_record(ctx)


def aov_options(command: F) -> F:
    """Adds --aov and the options of ``file_options`` to a command."""
    command = click.option(
        "--aov",
        "aovs",
        multiple=True,
        metavar="NAME",
        cls=_AovOption,
    )(file_options(command))
    return command


def file_options(command: F) -> F:
    """Adds --half, --compression, --exr-tile and --split-aovs to a command."""
    for option in (
        click.option(
            "--split-aovs",
            "split",
            is_flag=True,
            help="Write each AOV to a separate file FILE.NAME.exr, and the beauty to FILE.exr.",
        ),
        click.option(
            "--exr-tile",
            "tile",
            type=click.IntRange(min=0),
            default=0,
            metavar="N",
            help="Write the EXR in tiles of N x N pixels, with N a multiple of 16.  [default: "
            "scanlines]",
        ),
        click.option(
            "--compression",
            type=click.Choice(_COMPRESSIONS),
            default="zip",
            show_default=True,
            help="Compression of the EXR file.",
        ),
        click.option("--half", is_flag=True, help="Store colours and normals as 16-bit floats."),
    ):
        command = option(command)
    return command


@dataclass(frozen=True)
class AovOptions:
    """Values of the options that ``aov_options`` or ``file_options`` added to a command."""

    aovs: tuple[str, ...]
    half: bool
    compression: str
    tile: int
    split: bool

    @classmethod
    def take(cls, options: dict[str, Any]) -> AovOptions:
        """Removes these options from a command's arguments. ``aovs`` may be missing."""
        options.setdefault("aovs", ())
        return cls(**{field.name: options.pop(field.name) for field in fields(cls)})

    @property
    def names(self) -> tuple[str, ...]:
        """Returns the AOV names with groups expanded. Raises WavecombError for an unknown name."""
        return aov_names.expand(self.aovs) if self.aovs else aov_names.DEFAULT

    def check(self, output: str, aovs: Sequence[str]) -> None:
        """Checks that files with these AOVs can be written; raises WavecombError if not.

        Light groups are known only after the stage is loaded, so the file names of ``light_groups``
        are not checked here.
        """
        from wavecomb.image import cryptomatte
        from wavecomb.image.files.exr import check_options
        from wavecomb.image.files.output_file import check_writable
        from wavecomb.image.files.render_output import split_names

        layers = [cryptomatte.LEVELS.get(name, name) for name in aovs]
        layers = [f"{name}00" if name in cryptomatte.LEVELS.values() else name for name in layers]
        check_options(output, () if self.split else layers, self.compression, self.tile)
        if self.split:
            known = [expressions.layer_of(name) for name in aovs if name != "light_groups"]
            for file in split_names(output, known).values():
                check_writable(file)

    def file_options(self) -> dict[str, Any]:
        """Returns keyword arguments for ``Picture.save``."""
        return {
            "half": self.half,
            "compression": self.compression,
            "tile": self.tile,
            "split": self.split,
        }
