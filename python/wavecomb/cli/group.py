# SPDX-License-Identifier: Apache-2.0
"""Handles one-line errors, suggestions for misspelt options, exit codes and the version."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence
from difflib import get_close_matches
from importlib import import_module
from typing import Any, NoReturn

import click

from wavecomb import terminal
from wavecomb.arguments import SYNONYMS
from wavecomb.errors import WavecombError
from wavecomb.run.error_messages import describe
from wavecomb.run.isolation import supervisor
from wavecomb.run.progress import keep_interrupts, was_interrupted
from wavecomb.terminal import say

ERROR = 2
INTERRUPTED = 130

_GREETING = """renders OpenUSD stages on the CPU.

  wavecomb render shot.usd -o shot.exr --png shot.png   your stage
  wavecomb scene mixed -o mixed.usdc                    an example stage
  wavecomb view shot.usd                                look at it in a window
  wavecomb doctor                                       what is installed, and what is missing
  wavecomb --help                                       all commands; COMMAND --help: its options
"""

NAMES = (
    *("render", "view", "info", "scene", "compare", "sheet", "merge", "farm", "bench"),
    *("doctor", "completion"),
)
"""Commands in the order of the help. Module ``wavecomb.cli.NAME`` defines ``NAME_command``."""


class Commands(click.Group):
    """Command group that turns every exception into one line on stderr and an exit code.

    ``WAVECOMB_DEBUG=1`` shows tracebacks instead. Imports a command's module only when the command
    is used, so that ``wavecomb render`` does not load all other commands.
    """

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Returns the command names in the order of ``NAMES``."""
        return list(NAMES)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Returns the command with a given name, or None if there is no such command."""
        if cmd_name not in NAMES:
            return None
        command: click.Command = getattr(
            import_module(f"wavecomb.cli.{cmd_name}"), f"{cmd_name}_command"
        )
        return command

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Prints a short introduction if there are no arguments."""
        for word in args:
            try:
                word.encode()
            except UnicodeEncodeError:
                raise click.UsageError(f"{word}: is not UTF-8; rename the file or folder") from None
        if not args and not ctx.resilient_parsing:
            from wavecomb.version import version

            click.echo(f"Wavecomb {version()} {_GREETING}", err=True)
            ctx.exit(ERROR)
        return super().parse_args(ctx, args)

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        **extra: Any,
    ) -> Any:
        """Runs the command line and exits the process."""
        if not standalone_mode:
            return super().main(args, prog_name, complete_var, False, **extra)
        terminal.guard_streams()
        if not sys.warnoptions and not os.environ.get("WAVECOMB_DEBUG"):
            warnings.simplefilter("ignore")  # Python's warnings are for developers
        keep_interrupts()
        supervisor.choices.words = words = tuple(sys.argv[1:] if args is None else args)
        try:
            code = super().main(words, prog_name, complete_var, False, **extra)
        except click.exceptions.NoArgsIsHelpError as error:
            click.echo(error.format_message(), err=True)
            sys.exit(ERROR)
        except click.ClickException as error:
            _fail(message_of(error), _help_of(error))
        except (click.Abort, KeyboardInterrupt):
            say("stopped", err=True)
            sys.exit(INTERRUPTED)
        except Exception as error:
            if os.environ.get("WAVECOMB_DEBUG"):
                raise
            if was_interrupted() and not isinstance(error, WavecombError):
                # Some libraries catch a KeyboardInterrupt and raise another exception instead.
                say("stopped", err=True)
                sys.exit(INTERRUPTED)
            _fail(describe(error))
        lost = terminal.flush_streams()
        if lost is not None:
            line = f"standard output: {lost.strerror}"
            if _output_of(words) == "result":
                _fail(f"{line}; the output is incomplete")
            say(f"warning: {line}; messages were lost", err=True)
        sys.exit(code if isinstance(code, int) else 0)


def _output_of(words: Sequence[str]) -> str:
    """Returns which kind of text a command prints on standard output: "result" or "messages"."""
    names = [word for word in words if not word.startswith("-")]
    return "messages" if _WRITES_FILES & {tuple(names[:1]), tuple(names[:2])} else "result"


_WRITES_FILES = {
    *(("render",), ("view",), ("scene",), ("sheet",), ("merge",), ("bench", "run")),
    *(("bench", "report"), ("bench", "page"), ("farm", "submit"), ("farm", "worker")),
    *(("farm", "resume"), ("farm", "assemble"), ("farm", "cancel"), ("farm", "retry")),
    ("farm", "export"),
}
"""Commands that write files and print only messages on standard output."""


def print_version(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    """Prints the version and exits."""
    if value and not ctx.resilient_parsing:
        from wavecomb.isa import library_text
        from wavecomb.version import version

        try:
            text = library_text()
        except ImportError as error:
            text = describe(error)
        say(f"wavecomb {version()} ({text})")
        ctx.exit()


def _help_of(error: click.ClickException) -> str | None:
    context = getattr(error, "ctx", None)
    return f"{context.command_path} --help" if context is not None else None


def _fail(message: str, more: str | None = None) -> NoReturn:
    line = " ".join(message.split()).rstrip(".")
    if more:
        line += f" (`{more}` says more)"
    say(f"error: {line}", err=True)
    sys.exit(ERROR)


def message_of(error: click.ClickException) -> str:
    """Returns the message of a command-line error, with suggestions for a misspelt option."""
    if not isinstance(error, click.NoSuchOption) or error.ctx is None:
        return error.format_message()
    wanted = suggestions(error.option_name, options_of(error.ctx))
    if not wanted:
        return error.message
    return f"{error.message.rstrip('.')}; did you mean {' or '.join(wanted)}?"


def options_of(context: click.Context) -> list[str]:
    """Returns all visible options of a command."""
    shown = [one for one in context.command.get_params(context) if not getattr(one, "hidden", 0)]
    return [name for one in shown for name in (*one.opts, *one.secondary_opts)]


def suggestions(name: str, options: list[str]) -> list[str]:
    """Returns up to three options that are similar to a misspelt option, most likely first.

    >>> suggestions("--smaples", ["--spp", "--size", "--shutter"])
    ['--spp']
    >>> suggestions("--ouput", ["-o", "--output"])
    ['--output']
    """
    words = {option: option for option in options if option.startswith("--")}
    for word, one in SYNONYMS.items():
        other, option = (f"--{text.replace('_', '-')}" for text in (word, one))
        if option in words:
            words.setdefault(other, option)
    if name in words:
        return [words[name]]
    found = get_close_matches(name, words, n=6, cutoff=0.6)
    return list(dict.fromkeys(words[word] for word in found))[:3]
