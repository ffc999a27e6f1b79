# SPDX-License-Identifier: Apache-2.0
"""Requirements of tests, and skips that CI accepts.

A test whose requirement is missing is skipped on a user's machine. A missing requirement fails the
test where everything must be installed: in CI (`CI=true`), or with `WAVECOMB_STRICT=1`.
`conftest.py` applies this to every skip, including `pytest.skip` and `pytest.importorskip`. Two
kinds of skips are always accepted: tests that only `make test-long` runs, and those that
`only_where` or `not_here` skips because of the machine or the build.

    pytestmark = needs("wavecomb._core")

    @needs("mitsuba")
    @needs_asset("usd/Teapot/Teapot.usd")
    def test_teapot() -> None: ...
"""

from __future__ import annotations

import importlib
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import NoReturn

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "python" / "wavecomb"
ASSETS = Path(__file__).resolve().parents[2] / "shared" / "assets"
"""Third-party stages, images and meshes; not available on a user's machine."""

NOT_HERE = "not here: "
LONG = "long: "
_OFF = ("", "0", "false", "no", "off")


def is_on(name: str, environment: Mapping[str, str] = os.environ) -> bool:
    """Whether an environment variable is set to a true value."""
    return environment.get(name, "").strip().lower() not in _OFF


def is_strict(environment: Mapping[str, str] = os.environ) -> bool:
    """Whether a missing requirement is a failure, as `WAVECOMB_STRICT` says or, if unset, in CI."""
    return is_on("WAVECOMB_STRICT" if "WAVECOMB_STRICT" in environment else "CI", environment)


def is_long(environment: Mapping[str, str] = os.environ) -> bool:
    """Whether long tests run, which requires `WAVECOMB_LONG=1` (set by `make test-long`)."""
    return is_on("WAVECOMB_LONG", environment)


def missing(part: str) -> str:
    """Reason why a module, a program (`bin:objdump`) or `userfaultfd` is missing, or else ''."""
    if part.startswith("bin:"):
        return "" if shutil.which(part[4:]) else f"the program {part[4:]} is not installed"
    if part == "userfaultfd":
        if reason := missing("wavecomb._core"):
            return reason
        return str(importlib.import_module("wavecomb._core").TextureStore.obstacle())
    try:
        importlib.import_module(part)
    except ImportError as error:
        return f"{part} cannot be imported: {error}"
    return ""


def needs(*parts: str) -> pytest.MarkDecorator:
    """Mark tests that need the given requirements; `missing` documents their names."""
    reasons = [f"{part}: {reason}" for part in parts if (reason := missing(part))]
    return pytest.mark.skipif(bool(reasons), reason="needs " + "; ".join(reasons))


def needs_asset(*files: str) -> pytest.MarkDecorator:
    """Mark tests that need the given files below `ASSETS`; folders are not accepted."""
    absent = [file for file in files if not (ASSETS / file).is_file()]
    return pytest.mark.skipif(bool(absent), reason=f"needs {', '.join(absent)} in {ASSETS}")


def asset(file: str) -> Path:
    """Return a file below `ASSETS` to a test, which is skipped if the file is missing."""
    path = ASSETS / file
    if not path.is_file():
        pytest.skip(f"needs {file} in {ASSETS}")
    return path


def written_scenes() -> list[str]:
    """Names of the scenes that this machine can write and read; scenes with grids need OpenVDB."""
    from wavecomb import vdb
    from wavecomb.scenes import SCENES

    grids = () if vdb.is_there() else ("smoke", "clouds")
    return sorted(set(SCENES) - set(grids))


def only_where(condition: object, reason: str) -> pytest.MarkDecorator:
    """Mark tests for certain machines or builds only. CI accepts the skip."""
    return pytest.mark.skipif(not condition, reason=NOT_HERE + reason)


def not_here(reason: str) -> NoReturn:
    """Skip a test that this machine or this build cannot run. CI accepts the skip."""
    pytest.skip(NOT_HERE + reason)
