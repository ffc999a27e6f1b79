# SPDX-License-Identifier: Apache-2.0
"""``wavecomb info``."""

from __future__ import annotations

import json
from typing import Any

import click

from wavecomb.cli.options import (
    StageOptions,
    examples,
    isolation_options,
    stage_options,
    stage_warnings,
    warn,
)


@click.command(
    "info",
    epilog=examples(
        "wavecomb info shot.usd",
        "wavecomb info shot.usd --json | jq .triangles",
    ),
)
@stage_options
@isolation_options
@click.option("--json", "as_json", is_flag=True, help="For programs.")
def info_command(stage: str, as_json: bool, **options: Any) -> None:
    """Say what would be rendered of STAGE, and what would not."""
    from wavecomb.info import print_info, stage_info

    loaded = StageOptions.take(options).load(stage)
    info = stage_info(loaded, stage)
    if as_json:
        click.echo(json.dumps(info, indent=2))
        return
    from rich.console import Console

    warn(stage_warnings(loaded))
    print_info(info, loaded, Console(emoji=False))
