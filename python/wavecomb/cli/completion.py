# SPDX-License-Identifier: Apache-2.0
"""Command ``wavecomb completion``, which prints shell completion scripts."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

from wavecomb.cli.options import examples

SHELLS = ("bash", "zsh", "fish")
PROGRAM = "wavecomb"
VARIABLE = "_WAVECOMB_COMPLETE"
"""Environment variable by which the shell asks ``wavecomb`` for completions."""


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
    """Print the script that makes SHELL complete commands, options and their values on TAB.

    The script asks `wavecomb` itself for completions, so it stays valid when options change.
    """
    made = get_completion_class(shell)
    assert made is not None
    root = click.get_current_context().find_root().command
    # click's method ``source`` starts bash to check its version. This function fills in click's
    # template itself to avoid that start, since all bash versions in use are new enough.
    template = made(root, {}, PROGRAM, VARIABLE)
    click.echo(template.source_template % template.source_vars())
