# SPDX-License-Identifier: Apache-2.0
"""Runs the command ``wavecomb`` for ``python -m wavecomb``."""

from wavecomb.cli import main

if __name__ == "__main__":
    main(prog_name="wavecomb")
