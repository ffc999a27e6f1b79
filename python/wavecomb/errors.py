# SPDX-License-Identifier: Apache-2.0
"""Errors for users."""

from __future__ import annotations

from typing import Any


class Error(Exception):
    """Base class of all errors that Wavecomb and its native core raise on purpose.

    >>> try:  # doctest: +SKIP
    ...     wavecomb.render("shot.usd", spp=0)
    ... except wavecomb.Error as error:
    ...     print(error)
    """


class WavecombError(Error):
    """Invalid input; the one-line message names the prim, file or option and says what to do.

    The command line prints the message without a traceback and exits with ``EXIT_CODE``.
    """

    EXIT_CODE = 2

    def __init__(self, message: str) -> None:
        """Joins the lines of the message into one."""
        super().__init__(" ".join(str(message).split()))


class ArgumentError(WavecombError, TypeError):
    """An argument of a Python function has the wrong name or type; the message has an example."""


class SceneError(WavecombError, ValueError):
    """Error for a generated stage: an option or an imported file is invalid."""


def join_core(core: Any) -> None:
    """Makes the errors of a native module subclasses of ``Error``.

    Args:
        core: The module ``wavecomb._core``. The native class ``Error`` is a ValueError, which the
            core creates without knowing this package.
    """
    if not issubclass(core.Error, Error):
        core.Error.__bases__ = (ValueError, Error)
