# SPDX-License-Identifier: Apache-2.0
"""``wavecomb completion``: commands, options and their values on TAB."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

from wavecomb.cli.options import examples

SHELLS = ("bash", "zsh", "fish")
PROGRAM = "wavecomb"
VARIABLE = "_WAVECOMB_COMPLETE"
"""By which the shell asks the command for what may come next."""


@click.command(
    "completion",
    epilog=examples(
        "wavecomb completion bash > ~/.local/share/bash-completion/completions/wavecomb",
        "wavecomb completion zsh > ~/.zfunc/_wavecomb     # with fpath+=~/.zfunc in ~/.zshrc",
        "wavecomb completion fish > ~/.config/fish/completions/wavecomb.fish",
    ),
)
@click.argument("shell", type=click.Choice(SHELLS))
def completion_command(shell: str) -> None:
    """Print what makes SHELL complete commands, options and their values.

    The shell asks `wavecomb` itself, whose answers come from the tables that it reads options by:
    what is printed stays right when those change.
    """
    made = get_completion_class(shell)
    assert made is not None
    root = click.get_current_context().find_root().command
    # Of bash, click asks for the version first, by starting it: all that are in use do.
    template = made(root, {}, PROGRAM, VARIABLE)
    click.echo(template.source_template % template.source_vars())
