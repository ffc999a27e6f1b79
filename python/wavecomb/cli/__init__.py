# SPDX-License-Identifier: Apache-2.0
"""The command ``wavecomb``: one module for each subcommand."""

from __future__ import annotations

import os

import click

from wavecomb.cli.group import Commands, print_version
from wavecomb.cli.options import examples

__all__ = ["main"]


@click.group(
    cls=Commands,
    epilog=examples(
        "wavecomb scene mixed -o mixed.usdc",
        "wavecomb info mixed.usdc",
        "wavecomb view mixed.usdc",
        "wavecomb render mixed.usdc -o mixed.exr --png mixed.png",
        "wavecomb compare mixed.exr other.exr --heatmap difference.png",
    ),
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=print_version,
    help="Show the version and exit.",
)
def main() -> None:
    """Wavecomb: a CPU path tracer for OpenUSD stages.

    Exit codes: 0 done, 1 pictures differ (compare), 2 an error, 130 stopped by Ctrl-C.
    `wavecomb COMMAND --help` says more.
    """
    # NumPy's matrix products here are three wide: more threads would only spin beside ours.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
