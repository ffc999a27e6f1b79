# SPDX-License-Identifier: Apache-2.0
"""The version that is installed."""

from __future__ import annotations


def version() -> str:
    """The version of the installed package, or "unknown" in a bare source tree."""
    from importlib.metadata import PackageNotFoundError
    from importlib.metadata import version as installed

    try:
        return installed("wavecomb")
    except PackageNotFoundError:
        return "unknown"
