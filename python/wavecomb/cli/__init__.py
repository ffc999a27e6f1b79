# SPDX-License-Identifier: Apache-2.0
"""Command-line program ``wavecomb``, with one module for each subcommand."""

from __future__ import annotations

import os
import signal
import threading
from typing import Any


def _stop(number: int, frame: Any) -> None:
    """Ends the process on Ctrl-C during imports, since there are no results to save yet."""
    os.write(2, b"stopped\n")
    os._exit(130)


# During imports, Ctrl-C ends the process without raising KeyboardInterrupt, which would print a
# traceback.
_handles = (
    threading.current_thread() is threading.main_thread()
    and signal.getsignal(signal.SIGINT) is signal.default_int_handler
)
if _handles:
    signal.signal(signal.SIGINT, _stop)

import click  # noqa: E402

from wavecomb.cli.group import Commands, print_version  # noqa: E402
from wavecomb.cli.options import examples  # noqa: E402

if _handles:
    signal.signal(signal.SIGINT, signal.default_int_handler)

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
    # Keep OpenBLAS, which NumPy uses, to one thread. Wavecomb multiplies only small matrices with
    # NumPy, and OpenBLAS's threads would compete with the render threads for cores.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
