# SPDX-License-Identifier: Apache-2.0
"""Declares options of commands, among them one for each render setting."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

import click

from wavecomb.options import Setting, default_text, settings

F = TypeVar("F", bound=Callable[..., Any])

ASKED_FOR_ELSEWHERE = (
    *("width", "height", "spp", "min_spp", "adaptive", "noise", "time_limit", "error"),
    *("progressive", "costs"),
)
"""Settings that have a separately declared option with more features, such as --size."""

_EDGES = re.compile(r"(-?\d+)[xX](-?\d+)")
_METAVARS = {"integer": "N", "number": "X", "text": "TEXT"}


class SettingPlaceholder(click.Option):
    """Placeholder in a command's list of parameters, for the options of settings."""

    def __init__(self, only: Iterable[str] | None) -> None:
        super().__init__(["--settings"], hidden=True)
        self._only = only
        self._options: list[click.Parameter] | None = None

    def options(self) -> list[click.Parameter]:
        """Returns one option for each setting."""
        if self._options is None:
            rows = settings()
            names = self._only
            if names is None:
                names = [name for name in rows if name not in ASKED_FOR_ELSEWHERE]
            self._options = [_option(rows[name]) for name in names]
        return self._options


def setting_options(only: Iterable[str] | None = None) -> Callable[[F], F]:
    """Adds an option for each setting in ``only``, or for all without a separate option.

    The decorated command must be a ``SettingCommand`` (cli/command.py). An option that is not given
    has the value None.
    """

    def decorate(command: F) -> F:
        command.__dict__.setdefault("__click_params__", []).append(SettingPlaceholder(only))
        return command

    return decorate


def _option(row: Setting) -> click.Option:
    """Returns the option of a setting."""
    # The core checks that values are in range. The command line itself rejects only negative
    # numbers, and the value 0 for settings that must be positive.
    return row_option(
        [row.option, row.name],
        _Steps(row, _offered(row)) if row.steps else row.kind,
        row.help + (f" 0: {row.zero}." if row.zero and not row.steps else ""),
        default="" if row.kind == "flag" else default_text(row),
        choices=tuple(row.choices),
        least=0,
        above=(row.least or 0.0) > 0 and not row.zero,
        metavar=None if row.steps else _METAVARS.get(row.kind),
    )


def _offered(row: Setting) -> Iterable[float]:
    """Returns the allowed numbers of a setting that this build supports."""
    from wavecomb import _core

    return _core.lane_widths() if row.name == "lanes" else row.steps


class _Steps(click.Choice):
    """Type of options that accept a few numbers or a word for 0; the help shows ``offered``."""

    def __init__(self, row: Setting, offered: Iterable[float]) -> None:
        super().__init__([row.zero, *(f"{step:g}" for step in row.steps)])
        self._zero = row.zero
        self._offered = [row.zero, *(f"{step:g}" for step in offered)]

    def get_metavar(self, *_: Any, **__: Any) -> str:
        """Returns the choices for the help, which are the numbers that this build supports."""
        return f"[{'|'.join(self._offered)}]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Converts text to a number."""
        if isinstance(value, int):
            return value
        text = super().convert(value, param, ctx)
        return 0 if text == self._zero else int(text)


class Real(click.ParamType):
    """A finite number, optionally with a lower bound."""

    name = "number"

    def __init__(self, minimum: float = -math.inf, *, above: bool = False) -> None:
        self._minimum = minimum
        self._above = above

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Converts text to a float. The message of an invalid value states the bound."""
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


@dataclass(frozen=True)
class Percent:
    """Image size relative to another size, such as 50%."""

    value: float

    def of(self, size: tuple[int, int]) -> tuple[int, int]:
        """Returns the size in pixels; each edge is at least one.

        >>> Percent(50.0).of((1920, 1081))
        (960, 540)
        """
        width, height = (max(1, round(edge * self.value / 100.0)) for edge in size)
        return width, height

    def __str__(self) -> str:
        return f"{self.value!r}%"


ImageSize = tuple[int, int] | Percent


class SizeType(click.ParamType):
    """Type of --size. ``SettingCommand`` joins the two words of a size to one word."""

    name = "size"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> ImageSize:
        """Converts a word to a size."""
        if not isinstance(value, str):
            return value
        if found := _EDGES.fullmatch(value):
            return int(found[1]), int(found[2])
        if value.endswith("%"):
            try:
                percent = float(value[:-1])
            except ValueError:
                percent = math.nan
            if 0.0 < percent <= 10000.0:
                return Percent(percent)
        self.fail(
            f"{value!r} is no size: give width and height, such as 640x360, or a percentage, such "
            "as 50%",
            param,
            ctx,
        )


def _first_integer(least: float, above: bool) -> int | None:
    """Returns the smallest integer that a setting accepts, or None without a limit."""
    bound = _bound(least)
    return bound + 1 if above and bound is not None else bound


def _bound(number: float) -> int | None:
    return int(number) if math.isfinite(number) else None


def row_option(
    names: Sequence[str],
    kind: str | click.ParamType,
    text: str,
    *,
    default: str = "",
    choices: Sequence[str] = (),
    least: float = -math.inf,
    most: float = math.inf,
    above: bool = False,
    metavar: str | None = None,
    many: bool = False,
) -> click.Option:
    """Returns the option of a table row.

    An option that is not given has the value None, or () with ``many``.

    Args:
        names: "--option", and the name of the argument.
        kind: "flag", "text", "file", "number", "integer", "pair" (of numbers), "choice" or "switch"
            (on or off); or a type of click.
        text: Help text.
        default: Description of the default, for help.
        choices: Values of a "choice".
        least: Smallest number.
        most: Largest integer.
        above: Whether ``least`` itself is excluded.
        metavar: Placeholder of the value in help.
        many: Whether the option may be repeated.
    """
    if default:
        text = f"{text}  [default: {default}]"
    if kind == "flag":
        return click.Option(names, is_flag=True, default=None, help=text)
    types: dict[str, Any] = {
        "text": str,
        "file": click.Path(),
        "number": Real(least, above=above),
        "integer": click.IntRange(_first_integer(least, above), _bound(most)),
        "pair": Real(least, above=above),
        "choice": click.Choice(choices),
        "switch": click.Choice(["on", "off"]),
    }
    return click.Option(
        names,
        type=types[kind] if isinstance(kind, str) else kind,
        metavar=metavar,
        multiple=many,
        nargs=2 if kind == "pair" else 1,
        help=text,
    )


_TYPES: dict[str, Any] = {
    "count": click.IntRange(min=1),
    "flag": None,
    "path": click.Path(),
    "positive": Real(0, above=True),
    "number": Real(),
    "text": None,
}


def option(usage: str, kind: str | click.ParamType, text: str, **more: Any) -> Callable[[F], F]:
    """Returns a decorator that adds an option to a command.

    Args:
        usage: Names and metavar as help shows them, such as "-o --output FILE.exr".
        kind: A type of click, or one of "count" (a positive integer), "flag", "path", "positive" (a
            positive number), "number", "text".
        text: Help text.
        more: Further arguments of ``click.option``; ``name`` is the name of the argument.
    """
    words = usage.split()
    names = [word for word in words if word.startswith("-")]
    metavar = " ".join(words[len(names) :]) or None
    if "name" in more:
        names.append(more.pop("name"))
    given = _TYPES[kind] if isinstance(kind, str) else kind
    # do not pass is_flag=False for other kinds, since click would then reject the value "-1"
    if kind == "flag":
        more["is_flag"] = True
    return click.option(*names, type=given, metavar=metavar, help=text, **more)


def declared(usage: str, kind: str | click.ParamType, text: str, **more: Any) -> Any:
    """Returns a field of a dataclass of options; the arguments are those of ``option``.

    The field and the argument of the command have the same name.
    """
    return field(metadata={"option": (usage, kind, text, more)})


def options_of(values: type) -> Callable[[F], F]:
    """Returns a decorator that adds the options of a dataclass, in the order of its fields."""
    rows = ((one.name, one.metadata.get("option")) for one in fields(values))
    return add_options(*(option(*row[:3], name=name, **row[3]) for name, row in rows if row))


def add_options(*options: Callable[[F], F]) -> Callable[[F], F]:
    """Returns a decorator that adds options to a command, in the order of the help."""

    def add(command: F) -> F:
        for one in reversed(options):
            command = one(command)
        return command

    return add
