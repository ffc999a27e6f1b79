# SPDX-License-Identifier: Apache-2.0
"""Command ``wavecomb info``."""

from __future__ import annotations

import json
from typing import Any

import click

from wavecomb import terminal
from wavecomb.cli.options import (
    StageOptions,
    examples,
    isolation_options,
    optional_stage,
    stage_warnings,
    warn,
)


@click.command(
    "info",
    epilog=examples(
        "wavecomb info shot.usd",
        "wavecomb info shot.usd --json | jq .triangles",
        "wavecomb info --machine",
    ),
)
@optional_stage
@isolation_options
@click.option("--machine", is_flag=True, help="Report what this machine supports; takes no STAGE.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON on standard output.")
def info_command(stage: str | None, machine: bool, as_json: bool, **options: Any) -> None:
    """Report what would be rendered of STAGE, and which parts are not supported."""
    if machine:
        if stage is not None:
            raise click.UsageError("--machine takes no STAGE")
        _say_machine(as_json)
        return
    if stage is None:
        raise click.UsageError("Missing argument 'STAGE'.")
    from wavecomb.info import print_info, stage_info
    from wavecomb.load_options import given
    from wavecomb.run.isolation.outputs import Outputs
    from wavecomb.run.isolation.supervisor import enter

    loading = given(StageOptions.take(options).values)
    enter(Outputs())
    from wavecomb.api import load

    loaded = load(stage, **loading)
    info = stage_info(loaded, stage)
    if as_json:
        click.echo(json.dumps(info, indent=2))
        return
    warn(stage_warnings(loaded))
    print_info(info, loaded, terminal.console())


def _say_machine(as_json: bool) -> None:
    from wavecomb.info import machine_info, machine_lines

    info = machine_info()
    if as_json:
        click.echo(json.dumps(info, indent=2))
    else:
        terminal.say(*machine_lines(info))
