# SPDX-License-Identifier: Apache-2.0
"""Command ``wavecomb doctor``."""

from __future__ import annotations

import json

import click

from wavecomb.cli.options import examples
from wavecomb.terminal import say


@click.command("doctor", epilog=examples("wavecomb doctor", "wavecomb doctor --json | jq .fit"))
@click.option("--json", "as_json", is_flag=True, help="Print JSON on standard output.")
def doctor_command(as_json: bool) -> None:
    """Report which parts are installed and work, and which are missing.

    Prints the command that installs each missing part, and renders a small test image.

    Exit codes: 0 if everything that rendering needs is installed and works, 2 otherwise.
    """
    from wavecomb.doctor import as_plain, examine, is_fit, lines

    found = examine()
    if as_json:
        click.echo(json.dumps(as_plain(found), indent=2))
    else:
        say(*lines(found))
    if not is_fit(found):
        raise click.exceptions.Exit(2)
