# SPDX-License-Identifier: Apache-2.0
"""Errors for users."""

from __future__ import annotations


class WavecombError(Exception):
    """Invalid input; the one-line message names the prim, file or option and says what to do.

    The command line prints it without a traceback and exits with ``EXIT_CODE``.
    """

    EXIT_CODE = 2

    def __init__(self, message: str) -> None:
        """Folds the message to one line."""
        super().__init__(" ".join(str(message).split()))
