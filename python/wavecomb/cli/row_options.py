# SPDX-License-Identifier: Apache-2.0
"""Options of commands: from rows of tables, and from one line each."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import click

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
    """The option of a row; its value is None where it is not given, or () of ``many``.

    Args:
        names: "--option", and the name of the argument.
        kind: "flag", "text", "file", "number", "integer", "pair" (of numbers), "choice" or "switch"
            (on or off); or a type.
        text: What it is.
        default: What holds where it is not given, for people.
        choices: Of a choice.
        least: Smallest number.
        most: Largest integer.
        above: Whether ``least`` itself is too little.
        metavar: Of its value.
        many: May be given again.
    """
    if default:
        text = f"{text}  [default: {default}]"
    if kind == "flag":
        return click.Option(names, is_flag=True, default=None, help=text)
    types: dict[str, Any] = {
        "text": str,
        "file": click.Path(),
        "number": Real(least, above=above),
        "integer": click.IntRange(_bound(least), _bound(most)),
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
    """Makes an option of a command.

    Args:
        usage: Names and metavar as help shows them: "-o --output FILE.exr".
        kind: A type, or one of "count" (a positive integer), "flag", "path", "positive" (a
            positive number), "number", "text".
        text: Help.
        more: Further arguments of ``click.option``; ``name`` is that of the argument.
    """
    words = usage.split()
    names = [word for word in words if word.startswith("-")]
    metavar = " ".join(words[len(names) :]) or None
    if "name" in more:
        names.append(more.pop("name"))
    given = _TYPES[kind] if isinstance(kind, str) else kind
    if kind == "flag":  # with is_flag=False an option would not take "-1" as its value
        more["is_flag"] = True
    return click.option(*names, type=given, metavar=metavar, help=text, **more)


def add_options(*options: Callable[[F], F]) -> Callable[[F], F]:
    """Makes a decorator that adds options to a command, in the order of help."""

    def add(command: F) -> F:
        for one in reversed(options):
            command = one(command)
        return command

    return add
