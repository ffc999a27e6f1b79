# SPDX-License-Identifier: Apache-2.0
"""Optional libraries that only some commands need."""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import re
import sys
from dataclasses import dataclass
from typing import Any

from wavecomb.errors import WavecombError


@dataclass(frozen=True)
class Extra:
    """A group of optional packages: an extra of pyproject.toml.

    Attributes:
        brings: Features that the extra enables, as shown to users.
        modules: Import names of the modules that the extra installs.
    """

    brings: str
    modules: tuple[str, ...]


EXTRAS = {
    "gui": Extra("the window", ("PySide6.QtWidgets", "pyqtgraph")),
    "denoise": Extra("denoising", ("pyoidn",)),
    "farm": Extra(
        "farms on Dask, Open Job Description",
        ("bokeh", "cryptography", "distributed", "openjd.model"),
    ),
    "bench": Extra(
        "SSIM, FLIP, z-tests, reports",
        ("flip_evaluator", "jinja2", "matplotlib", "pandas", "scipy"),
    ),
}
"""Extras for users by name; extras for developers are not included."""


def install_command(extra: str) -> str:
    """Returns the command that installs the packages of an extra.

    The command names the packages instead of ``wavecomb[extra]``, since Wavecomb is not in a
    package index and anybody could register its name.

    >>> install_command("denoise")
    "pip install 'pyoidn>=2.5'"
    """
    return f"pip install {' '.join(repr(one) for one in requirements(extra))}"


def requirements(extra: str) -> list[str]:
    """Returns the packages of an extra and their version bounds, from the installed metadata."""
    try:
        lines = importlib.metadata.requires("wavecomb") or []
    except importlib.metadata.PackageNotFoundError:
        lines = []
    found = []
    for line in lines:
        package, _, marker = line.partition(";")
        if re.search(rf"""extra == ['"]{extra}['"]""", marker) and _is_for_this_python(marker):
            found.append(package.strip())
    return found or [module.partition(".")[0] for module in EXTRAS[extra].modules]


def _is_for_this_python(marker: str) -> bool:
    """Returns whether this Python version is within the python_version bounds of a marker."""
    bounds = re.findall(r"""python_version (<|>=) ['"](\d+)\.(\d+)['"]""", marker)
    now = sys.version_info[:2]
    return all((now < (int(a), int(b))) == (sign == "<") for sign, a, b in bounds)


def needed(module: str, what: str, extra: str = "bench") -> Any:
    """Imports a library of an extra.

    Args:
        module: Import name.
        what: Feature that needs the library, as the subject of the message, such as "SSIM".
        extra: Extra of pyproject.toml that contains the library.

    Raises:
        WavecombError: The library is missing; the message explains how to install it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0].replace("_", "-")
        raise WavecombError(
            f"{what} needs {package} ({error}): {install_command(extra)}"
        ) from error


def missing_modules(extra: str) -> list[str]:
    """Returns the modules of an extra that are not installed, without importing any."""
    missing = []
    for module in EXTRAS[extra].modules:
        package = module.partition(".")[0]
        if importlib.util.find_spec(package) is None:
            missing.append(package.replace("_", "-"))
    return missing


def check_installed(extra: str, what: str) -> None:
    """Raises WavecombError with installation advice unless an extra is installed.

    Args:
        extra: Extra of pyproject.toml.
        what: Feature that needs the extra, as the subject of the message.
    """
    missing = missing_modules(extra)
    if missing:
        raise WavecombError(f"{what} needs {' and '.join(missing)}: {install_command(extra)}")
