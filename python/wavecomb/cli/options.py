# SPDX-License-Identifier: Apache-2.0
"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import click

from wavecomb.cli.setting_options import Real, row_option
from wavecomb.load_options import Row, rows
from wavecomb.terminal import say

if TYPE_CHECKING:
    from wavecomb.usd import LoadedStage

F = TypeVar("F", bound=Callable[..., Any])


def examples(*lines: str) -> str:
    """Returns example command lines, formatted for the end of a help text."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


def _isolate(context: click.Context, parameter: click.Parameter, value: str) -> None:
    from wavecomb.run.isolation import supervisor

    supervisor.choices.isolate = value


def _set_load_limit(
    context: click.Context, parameter: click.Parameter, value: float | None
) -> None:
    from wavecomb.run.isolation import time_limit

    time_limit.limit_s = value


def _limit_memory(context: click.Context, parameter: click.Parameter, value: float | None) -> None:
    from wavecomb.run.isolation import memory

    if not context.resilient_parsing:
        memory.request_limit(value)


def _ask_sandbox(context: click.Context, parameter: click.Parameter, value: str) -> None:
    from wavecomb.run.isolation import supervisor

    supervisor.choices.sandbox = value


def _ask_reads(context: click.Context, parameter: click.Parameter, value: tuple[str, ...]) -> None:
    from wavecomb.run.isolation import supervisor

    supervisor.choices.reads = value


def isolate_option(command: F) -> F:
    """Adds --isolate, --sandbox, --sandbox-read and --memory-limit to a command."""
    command = click.option(
        "--sandbox-read",
        type=click.Path(exists=True, file_okay=False),
        multiple=True,
        metavar="DIR",
        expose_value=False,
        callback=_ask_reads,
        help="Folder that the command may read besides its inputs and libraries (repeatable).  "
        "[default: all readable folders]",
    )(command)
    command = click.option(
        "--sandbox",
        type=click.Choice(["auto", "on", "off"]),
        default="auto",
        envvar="WAVECOMB_SANDBOX",
        expose_value=False,
        callback=_ask_sandbox,
        help="Run the child process in a bubblewrap sandbox without network, where it can write "
        "only its outputs.  [default: auto, on if possible]",
    )(command)
    command = click.option(
        "--memory-limit",
        type=Real(0, above=True),
        metavar="MB",
        expose_value=False,
        callback=_limit_memory,
        help="Memory limit of the child process that does the work, in MB.  "
        "[default: the memory of the machine]",
    )(command)
    return click.option(
        "--isolate",
        type=click.Choice(["auto", "on", "off"]),
        default="auto",
        expose_value=False,
        callback=_isolate,
        help="Run the command in a child process, so that a crash ends in a one-line error.  "
        "[default: auto, on unless called from Python]",
    )(command)


def isolation_options(command: F) -> F:
    """Adds the options of ``isolate_option`` and --load-limit, for commands that load a stage."""
    return click.option(
        "--load-limit",
        type=Real(0),
        metavar="S",
        expose_value=False,
        callback=_set_load_limit,
        help="Time limit for USD to compose the stage, in seconds; 0 means no limit.  "
        "[default: 6, plus 1 for each MB of layers]",
    )(isolate_option(command))


def stage_options(command: F) -> F:
    """Adds the argument STAGE and an option for each row of ``LoadOptions``."""
    parameters = command.__dict__.setdefault("__click_params__", [])
    parameters += [_load_option(row) for row in reversed(rows().values())]
    return click.argument("stage", type=click.Path())(command)


def _load_option(row: Row) -> click.Option:
    return row_option(
        [row.option, row.key],
        "flag" if row.kind == "not" else row.kind,
        row.help,
        default=row.unset,
        choices=row.choices,
        least=row.least,
        most=row.most,
        above=row.above,
        metavar=row.metavar,
        many=row.many,
    )


def optional_stage(command: Any) -> Any:
    """Adds the same options as ``stage_options``, but with an optional argument STAGE."""
    command = stage_options(command)
    for parameter in command.__click_params__:
        if parameter.name == "stage":
            parameter.required = False
    return command


@dataclass(frozen=True)
class StageOptions:
    """Values of the options from ``stage_options``, by the keys of the rows in the option table."""

    values: Mapping[str, Any]

    @classmethod
    def take(cls, options: dict[str, Any]) -> StageOptions:
        """Removes the options of ``stage_options`` from a command's arguments."""
        return cls({row.key: options.pop(row.key) for row in rows().values()})

    def __getitem__(self, key: str) -> Any:
        return self.values[key]

    def as_dict(self) -> dict[str, Any]:
        """Returns the values of the options as a dictionary, to be stored in a checkpoint."""
        return dict(self.values)

    def completed(self, before: dict[str, Any]) -> StageOptions:
        """Returns a copy in which omitted options have their values from an earlier render."""
        values: dict[str, Any] = {}
        for row in rows().values():
            key, mine, other = row.key, self.values[row.key], before.get(row.key)
            _check_kept(row, other)
            values[key] = mine if mine is not None and mine not in ((), False) else other
            if row.many:
                values[key] = tuple(values[key] or ())
            elif row.kind == "pair" and values[key]:
                values[key] = tuple(values[key])
            elif row.kind == "not":
                values[key] = bool(values[key])
        return StageOptions(values)


def _check_kept(row: Row, value: Any) -> None:
    """Raises WavecombError if an option in a checkpoint has the wrong type."""
    from wavecomb.errors import WavecombError

    if value is None or value is False:
        return
    wanted: tuple[type, ...] = (str,)
    if row.kind in ("number", "integer", "pair"):
        wanted = (int, float)
    elif row.kind == "not":
        wanted = (bool,)
    good = isinstance(value, list) == (row.many or row.kind == "pair")
    for item in value if isinstance(value, list) else [value]:
        good = good and isinstance(item, wanted) and item == item
    if row.kind == "pair":
        good = good and len(value) == 2
    if not good:
        raise WavecombError(f"the checkpoint's {row.key} is invalid: the file is damaged")


def warn(lines: list[str]) -> None:
    """Prints warnings on stderr, each distinct line once."""
    for line in dict.fromkeys(lines):
        say(f"warning: {' '.join(line.split())}", err=True)


def stage_warnings(loaded: LoadedStage) -> list[str]:
    """Returns the warnings of a loaded stage as lines."""
    return [*(finding.line() for finding in loaded.report.warnings), *loaded.scene.warnings]
