# SPDX-License-Identifier: Apache-2.0
"""Tests that options of ``wavecomb render`` pass through few modules on the way to the core."""

from __future__ import annotations

import dataclasses
import inspect
import os
import sys
from itertools import groupby
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest
from click.testing import CliRunner

pytest.importorskip("wavecomb._core")
import wavecomb
from wavecomb import _core
from wavecomb.cli import main
from wavecomb.cli import render_options as declarations
from wavecomb.cli.options import StageOptions

ROOT = os.path.dirname(wavecomb.__file__) + os.sep
STAGE = """#usda 1.0
def Sphere "Ball" {}
def Camera "View" {
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
MOST_FILES = 15
MOST_RETURNS = 9


class Follower:
    """Records the modules that are called with the value of an option.

    Attributes:
        given: Values of options: texts and numbers that occur nowhere else.
        visits: Modules in the order of the calls that enter them from another module.
    """

    def __init__(self, given: tuple[Any, ...]) -> None:
        self.given = given
        self.visits: list[str] = []

    def holds(self, value: Any, depth: int = 3) -> bool:
        """Returns whether a value is, or contains, the value of an option."""
        if isinstance(value, (str, int, float, tuple)) and value in self.given:
            return True
        if isinstance(value, _core.Settings):
            return True
        if depth == 0 or value is None or isinstance(value, (str, int, float)):
            return False
        parts: list[Any] = []
        if isinstance(value, dict):
            parts = list(value.values())
        elif isinstance(value, (list, tuple, set)):
            parts = list(value)
        elif type(value).__module__.startswith("wavecomb"):
            parts = list(getattr(value, "__dict__", {}).values())
        elif inspect.isfunction(value):
            parts = [cell.cell_contents for cell in value.__closure__ or ()]
        return any(self.holds(part, depth - 1) for part in parts)

    def __call__(self, frame: FrameType, event: str, argument: Any) -> None:
        code, module = frame.f_code, module_of(frame.f_code)
        if event != "call" or not module or code.co_name == "<module>":
            return
        caller = frame.f_back
        while caller is not None and not module_of(caller.f_code):
            caller = caller.f_back
        if caller is not None and module_of(caller.f_code) == module:
            return
        sys.setprofile(None)
        count = code.co_argcount + code.co_kwonlyargcount
        count += bool(code.co_flags & inspect.CO_VARARGS)
        count += bool(code.co_flags & inspect.CO_VARKEYWORDS)
        names = (*code.co_varnames[:count], *code.co_freevars)
        if any(self.holds(frame.f_locals.get(name)) for name in names):
            self.visits.append(module)
        sys.setprofile(self)


def module_of(code: CodeType) -> str:
    """Returns the file of code, relative to the package, or "" for code outside the package."""
    return code.co_filename.removeprefix(ROOT) if code.co_filename.startswith(ROOT) else ""


def test_options_visit_few_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Options pass through few files from command to core, not counting ``wavecomb.usd``.

    ``load_stage`` takes all load options as one object, ``LoadOptions``.
    """
    stage = tmp_path / "a.usda"
    stage.write_text(STAGE)
    monkeypatch.chdir(tmp_path)
    follower = Follower(("shot-b.exr", str(tmp_path / "shot-b.exr"), "/View", 1237, 5.25, (37, 23)))
    rendered: list[Any] = []

    def render(scene: Any, settings: Any, *arguments: Any, **named: Any) -> Any:
        sys.setprofile(None)
        rendered.append(settings)
        raise RuntimeError("enough")

    parse = declarations.RenderOptions.parse.__func__  # type: ignore[attr-defined]

    def parsed(cls: Any, options: Any) -> Any:
        sys.setprofile(follower)
        return parse(cls, options)

    monkeypatch.setattr(_core, "render", render)
    monkeypatch.setattr(declarations.RenderOptions, "parse", classmethod(parsed))
    words = (
        "render", "a.usda", "-o", "shot-b.exr", "--spp", "1237", "--size", "37x23", "--camera",
        "/View", "--time-limit", "5.25",
    )  # fmt: skip
    try:
        CliRunner().invoke(main, words)
    finally:
        sys.setprofile(None)
    (settings,) = rendered
    assert (settings.spp, settings.width, settings.time_limit) == (1237, 37, 5.25)
    line = [module for module in follower.visits if not module.startswith("usd" + os.sep)]
    visits = ["cli/render.py", *(module for module, _ in groupby(line))]
    files = set(visits)
    assert len(files) <= MOST_FILES, visits
    assert len(visits) - len(files) <= MOST_RETURNS, visits


def test_each_option_is_declared_once() -> None:
    """Each field of the dataclass declares its option, except derived fields."""
    fields = dataclasses.fields(declarations.RenderOptions)
    derived = [one.name for one in fields if "option" not in one.metadata]
    assert derived == ["stage", "image", "source", "settings", "whole"]
    others = [
        name
        for name, kind in inspect.getmembers(sys.modules["wavecomb.cli.render_options"])
        if dataclasses.is_dataclass(kind)
    ]
    assert sorted(others) == ["FileOptions", "RenderOptions", StageOptions.__name__]
