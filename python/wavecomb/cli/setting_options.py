# SPDX-License-Identifier: Apache-2.0
"""Options of commands that are settings of a render: one for each row of the table."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import click

from wavecomb.cli.row_options import row_option
from wavecomb.options import Setting, default_text, settings

F = TypeVar("F", bound=Callable[..., Any])

ASKED_FOR_ELSEWHERE = (
    *("width", "height", "spp", "min_spp", "adaptive", "noise", "time_limit", "error"),
    *("progressive", "costs"),
)
"""Settings whose options say more than the setting: --size, --adaptive, --costs FILE ..."""

_METAVARS = {"integer": "N", "number": "X", "text": "TEXT"}


class SettingCommand(click.Command):
    """A command with ``setting_options``. The core is loaded when its options are needed."""

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Its parameters; the settings where ``setting_options`` stands."""
        params: list[click.Parameter] = []
        for one in super().get_params(ctx):
            params += one.options() if isinstance(one, _Settings) else [one]
        return params


class _Settings(click.Option):
    """Where the options of settings come."""

    def __init__(self, only: Iterable[str] | None) -> None:
        super().__init__(["--settings"], hidden=True)
        self._only = only
        self._options: list[click.Parameter] | None = None

    def options(self) -> list[click.Parameter]:
        """One for each setting."""
        if self._options is None:
            rows = settings()
            names = self._only
            if names is None:
                names = [name for name in rows if name not in ASKED_FOR_ELSEWHERE]
            self._options = [_option(rows[name]) for name in names]
        return self._options


def setting_options(only: Iterable[str] | None = None) -> Callable[[F], F]:
    """An option for each setting, by default of all that no other option stands for.

    For a ``SettingCommand``. Where an option is not given, its value is None.
    """

    def decorate(command: F) -> F:
        command.__dict__.setdefault("__click_params__", []).append(_Settings(only))
        return command

    return decorate


def _option(row: Setting) -> click.Option:
    """The option of a setting."""
    # The core says what is out of range; only signs are told here.
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
    """The steps of a setting that this build has."""
    from wavecomb import _core

    return _core.lane_widths() if row.name == "lanes" else row.steps


class _Steps(click.Choice):
    """The few numbers of a setting, of which help shows those in ``offered``; a word for 0."""

    def __init__(self, row: Setting, offered: Iterable[float]) -> None:
        super().__init__([row.zero, *(f"{step:g}" for step in row.steps)])
        self._zero = row.zero
        self._offered = [row.zero, *(f"{step:g}" for step in offered)]

    def get_metavar(self, *_: Any, **__: Any) -> str:
        """The choices that help shows: those that this build has."""
        return f"[{'|'.join(self._offered)}]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Text to the number."""
        if isinstance(value, int):
            return value
        text = super().convert(value, param, ctx)
        return 0 if text == self._zero else int(text)
