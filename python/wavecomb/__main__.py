# SPDX-License-Identifier: Apache-2.0
"""``python -m wavecomb`` is the command ``wavecomb``."""

from wavecomb.cli import main

if __name__ == "__main__":
    main(prog_name="wavecomb")
