# SPDX-License-Identifier: Apache-2.0
"""``wavecomb doctor``."""

from __future__ import annotations

import json

import click

from wavecomb.cli.options import examples


@click.command("doctor", epilog=examples("wavecomb doctor", "wavecomb doctor --json | jq .fit"))
@click.option("--json", "as_json", is_flag=True, help="For programs.")
def doctor_command(as_json: bool) -> None:
    """Say what is installed and works, and what is missing.

    Beside what is missing stands the command that installs it. A small picture is rendered, too.

    Exit codes: 0 all that renders need is there and works, 2 something of it is not.
    """
    from wavecomb.doctor import as_plain, examine, is_fit, lines

    found = examine()
    click.echo(json.dumps(as_plain(found), indent=2) if as_json else "\n".join(lines(found)))
    if not is_fit(found):
        raise click.exceptions.Exit(2)
