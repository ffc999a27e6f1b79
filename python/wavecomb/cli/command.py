# SPDX-License-Identifier: Apache-2.0
"""Command class that groups options in the help and accepts sizes as one word or two."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Sequence
from typing import Any

import click
import cloup

from wavecomb.cli.setting_options import SettingPlaceholder
from wavecomb.load_options import rows
from wavecomb.options import settings

WIDEST = 100
"""Maximum width of a help text in columns."""

MOST_EXAMPLES = 3
"""Number of examples in the short help."""

GROUPS: dict[str, tuple[str, str]] = {
    "Most used": (
        "output png size spp noise time_limit denoise camera frame frames",
        "",
    ),
    "Output": (
        "preview checkpoint resume ocio_view exposure stats_file",
        "verbose output_dir tone_map ocio_display preview_every every progress quiet skip_existing "
        "film_memory part as_json",
    ),
    "Quality": (
        "max_depth firefly",
        "filter adaptive min_spp max_spp sampler seed filter_width clamp_indirect fresnel "
        "texture_filter cosine_sampling allocate",
    ),
    "Camera": (
        "region no_motion_blur",
        "depth_of_field shutter motion_steps camera_projection camera_exposure lens_settings "
        "st_map overscan crop",
    ),
    "Stage": (
        "variants subdivision",
        "purposes",
    ),
    "Layers": (
        "aovs half alpha",
        "deep compression tile split deep_samples deep_tolerance",
    ),
    "Light transport": (
        "quality guiding transport",
        "learn_from learn_to",
    ),
    "Performance": (
        "threads memory_limit",
        "isolate sandbox sandbox_read load_limit costs",
    ),
}
"""For each group title, the options in the short help and those only in the full help.

Unlisted load options belong to the group "Stage", unlisted settings to their group of
``SETTING_GROUPS``, and all other unlisted options to the group "This command".
"""

SETTING_GROUPS = {"picture": "Quality", "work": "Light transport", "order": "Performance"}

OTHERS = "This command"

_FULL = "wavecomb.cli.command.full"
_DEFAULT = re.compile(r"\s*\[default: .*$")
_ENDS = (". ", "; ", ": ", ", ", " (")
"""Strings at which a help text may be cut, in order of preference."""


def grouped(
    options: Sequence[click.Option], *, full: bool = False
) -> list[tuple[str, list[click.Option]]]:
    """Returns titles of groups with their options, in the order of the help.

    Args:
        options: Options of a command.
        full: Whether to include rarely used options.
    """
    by_name = {str(one.name): one for one in options if not one.hidden}
    of_stage = {row.key for row in rows().values()}
    placed = {name for common, rare in GROUPS.values() for name in f"{common} {rare}".split()}
    rest: dict[str, list[str]] = {}
    for name in by_name:
        if name not in placed:
            title = OTHERS
            if name in of_stage:
                title = "Stage"
            elif name in settings():
                title = SETTING_GROUPS[settings()[name].group]
            rest.setdefault(title, []).append(name)
    found = [(OTHERS, rest.get(OTHERS, []))]
    for title, (common, rare) in GROUPS.items():
        names = common.split()
        if full:
            names += [*rare.split(), *rest.get(title, [])]
        found.append((title, names))
    chosen = [(title, [by_name[n] for n in names if n in by_name]) for title, names in found]
    return [(title, some) for title, some in chosen if some]


def shortened(text: str, width: int) -> str:
    """Shortens a help text to one line, if possible, by dropping its default and then later parts.

    >>> shortened("Samples per pixel; the most with --noise.  [default: 64]", 45)
    'Samples per pixel; the most with --noise.'
    """
    if len(text) <= width:
        return text
    plain = _DEFAULT.sub("", text)
    if len(plain) <= width:
        return plain
    for end in _ENDS:
        plain = plain.partition(end)[0].rstrip(".") + "."
        if len(plain) <= width:
            break
    return plain


def _described(option: click.Option, context: click.Context, *, full: bool) -> Any:
    record = option.get_help_record(context)
    assert record is not None
    names, text = record
    if full:
        return names, text
    described: Callable[[int], str] = lambda width: shortened(text, width)  # noqa: E731
    return names, described


def _show_all(context: click.Context, parameter: click.Parameter, value: bool) -> None:
    if value and not context.resilient_parsing:
        context.meta[_FULL] = True
        click.echo(context.get_help(), color=context.color)
        context.exit()


SIZE = re.compile(r"-?\d+")


def joined_sizes(words: Sequence[str]) -> list[str]:
    """Joins the two words of a size such as "640 480" in a command line into one word.

    >>> joined_sizes(["--size", "640", "360", "a.usd"])
    ['--size', '640x360', 'a.usd']
    """
    out: list[str] = []
    left = list(words)
    while left:
        word = left.pop(0)
        if word == "--":
            return [*out, word, *left]
        start = word.removeprefix("--size=")
        if word == "--size" and left and SIZE.fullmatch(left[0]):
            out.append(word)
            start = word = left.pop(0)
        elif start == word:
            out.append(word)
            continue
        if SIZE.fullmatch(start) and left and SIZE.fullmatch(left[0]):
            word = f"{word}x{left.pop(0)}"
        out.append(word)
    return out


class SettingCommand(cloup.Command):
    """Command with ``setting_options``. Loads the core only when the options are needed."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """Adds --help-all to the options."""
        context = dict(kwargs.pop("context_settings", None) or {})
        context.setdefault("max_content_width", WIDEST)
        columns = cloup.HelpFormatter.settings(col2_min_width=20)
        context.setdefault("formatter_settings", columns)
        super().__init__(*args, context_settings=context, **kwargs)
        self.params.append(
            click.Option(
                ["--help-all"], is_flag=True, is_eager=True, expose_value=False,
                callback=_show_all, hidden=True,
                help="Show all options of the command and all examples.",
            )
        )  # fmt: skip

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Returns the parameters of the command, with one option for each render setting."""
        params: list[click.Parameter] = []
        for one in super().get_params(ctx):
            params += one.options() if isinstance(one, SettingPlaceholder) else [one]
        return params

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parses the command line."""
        return super().parse_args(ctx, joined_sizes(args))

    def format_params(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Writes the options in groups: the common options, or all options after --help-all."""
        full = ctx.meta.get(_FULL, False)
        options = [one for one in self.get_params(ctx) if isinstance(one, click.Option)]
        options = [one for one in options if "--help" not in one.opts]
        sections = [
            cloup.HelpSection(title, [_described(one, ctx, full=full) for one in some])
            for title, some in grouped(options, full=full)
        ]
        assert isinstance(formatter, cloup.HelpFormatter)
        formatter.write("\n")
        # Without empty lines between the groups, a short help fits a screen.
        rows = [row for section in sections for row in section.definitions]
        width = formatter.compute_col1_width(
            rows, min(formatter.col1_max_width, formatter.width // 3)
        )
        for section in sections:
            formatter.write_heading(section.heading)
            with formatter.indentation():
                formatter.write_dl(section.definitions, col1_width=width)

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Writes the first paragraph of the description, or all paragraphs after --help-all."""
        text = inspect.cleandoc(self.help or "")
        if not ctx.meta.get(_FULL, False):
            text = text.partition("\n\n")[0]
        formatter.write("\n")
        formatter.write_text(text)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Writes the examples, and how to see all options."""
        full = ctx.meta.get(_FULL, False)
        lines = (self.epilog or "").removeprefix("\b\n").splitlines()
        shown = lines if full else lines[: 1 + MOST_EXAMPLES]
        formatter.write("\n" + "".join(f"{line}\n" for line in shown))
        if not full:
            formatter.write(f"\n`{ctx.command_path} --help-all` shows all options.\n")
