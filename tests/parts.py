# SPDX-License-Identifier: Apache-2.0
"""What a test needs, in words that CI understands.

A test without a part that it needs is skipped on a user's machine, and fails where all parts have
to be: in CI (`CI=true`), or with `WAVECOMB_STRICT=1`. `conftest.py` sees to that for every skip,
also for `pytest.skip` and `pytest.importorskip`. Only two kinds of skips are left alone: what
`make test-long` runs, and where `only_where` or `not_here` says that this machine or this build is
the wrong one.

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
"""Stages, pictures and meshes of others; not on a user's machine."""

NOT_HERE = "not here: "
LONG = "long: "
_OFF = ("", "0", "false", "no", "off")


def is_on(name: str, environment: Mapping[str, str] = os.environ) -> bool:
    """Whether an environment variable says yes."""
    return environment.get(name, "").strip().lower() not in _OFF


def is_strict(environment: Mapping[str, str] = os.environ) -> bool:
    """Whether a missing part is a failure: as `WAVECOMB_STRICT` says, or else in CI."""
    return is_on("WAVECOMB_STRICT" if "WAVECOMB_STRICT" in environment else "CI", environment)


def is_long(environment: Mapping[str, str] = os.environ) -> bool:
    """Whether tests take as long as they need: `WAVECOMB_LONG=1`, as `make test-long` sets it."""
    return is_on("WAVECOMB_LONG", environment)


def missing(part: str) -> str:
    """Why a part is not to be had: a module, a program (`bin:objdump`) or `userfaultfd`; or ''."""
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
    """Marks tests that need these parts; see `missing` for their names."""
    reasons = [f"{part}: {reason}" for part in parts if (reason := missing(part))]
    return pytest.mark.skipif(bool(reasons), reason="needs " + "; ".join(reasons))


def needs_asset(*files: str) -> pytest.MarkDecorator:
    """Marks tests that need these files below `ASSETS`; a folder does not do."""
    absent = [file for file in files if not (ASSETS / file).is_file()]
    return pytest.mark.skipif(bool(absent), reason=f"needs {', '.join(absent)} in {ASSETS}")


def asset(file: str) -> Path:
    """The file below `ASSETS`, from within a test; without it the test is skipped."""
    path = ASSETS / file
    if not path.is_file():
        pytest.skip(f"needs {file} in {ASSETS}")
    return path


def written_scenes() -> list[str]:
    """Names of the scenes that can be written and read here: reading grids needs OpenVDB."""
    from wavecomb import vdb
    from wavecomb.scenes import SCENES

    grids = () if vdb.is_there() else ("smoke", "clouds")
    return sorted(set(SCENES) - set(grids))


def only_where(condition: object, reason: str) -> pytest.MarkDecorator:
    """Marks tests of other machines or builds: no part is missing, so CI may skip them, too."""
    return pytest.mark.skipif(not condition, reason=NOT_HERE + reason)


def not_here(reason: str) -> NoReturn:
    """Ends a test that this machine or this build cannot run; CI may skip it, too."""
    pytest.skip(NOT_HERE + reason)
