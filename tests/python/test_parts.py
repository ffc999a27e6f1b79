# SPDX-License-Identifier: Apache-2.0
"""Tests that missing dependencies skip a test, or fail it in CI, and that long tests are
separate."""

from __future__ import annotations

from pathlib import Path

import parts
import pytest

pytest_plugins = ["pytester"]

HERE = Path(__file__).resolve().parents[1]
TESTS = """
import pytest
from parts import asset, needs, needs_asset, not_here, only_where

@needs("json")
@needs("bin:sh")
def test_there(): pass

@needs("json", "engine_that_nobody_has")
def test_part(): assert False

@needs("bin:program-that-nobody-has")
def test_program(): assert False

@needs_asset("usd/nothing.usda")
def test_file(): assert False

@needs_asset("usd")
def test_folder(): assert False

def test_inside(): asset("usd/nothing.usda"); assert False

def test_plain(): pytest.skip("somehow")

@pytest.fixture
def engine(): pytest.skip("no engine in the fixture")

def test_fixture(engine): assert False

@only_where(False, "needs a bigger machine")
def test_machine(): assert False

def test_within(): not_here("no counters")

@pytest.mark.long
def test_minutes(): pass

@pytest.mark.xfail(reason="known")
def test_known(): assert False
"""
LACKING = ["part", "program", "file", "folder", "inside", "plain", "fixture"]
MODULE = "import pytest\npytest.importorskip('engine_that_nobody_has')\ndef test_it(): pass\n"


@pytest.fixture
def inner(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """A folder of tests with this repository's conftest, outside of CI."""
    for name in ("CI", "WAVECOMB_STRICT", "WAVECOMB_LONG"):
        monkeypatch.delenv(name, raising=False)
    pytester.makeconftest((HERE / "conftest.py").read_text())
    for name in ("cpu_times", "crashes", "parts", "tiers"):
        pytester.makepyfile(**{name: (HERE / f"{name}.py").read_text()})
    (pytester.path / "long_tests.txt").write_text("")
    pytester.makeini("[pytest]\nmarkers = long: minutes")
    return pytester


def run(inner: pytest.Pytester, *options: str) -> pytest.RunResult:
    return inner.runpytest_subprocess("-ra", "-p", "no:cacheprovider", *options)


@pytest.mark.slow
def test_a_user_sees_skips(inner: pytest.Pytester) -> None:
    inner.makepyfile(test_some=TESTS, test_module=MODULE)
    result = run(inner)
    # Skipped are seven tests that lack a dependency, two tests for other machines, a long test, and
    # a file that cannot be imported.
    result.assert_outcomes(passed=1, skipped=len(LACKING) + 4, xfailed=1)
    result.stdout.fnmatch_lines(["*engine_that_nobody_has cannot be imported*"])


@pytest.mark.parametrize("variable", ["CI", "WAVECOMB_STRICT"])
@pytest.mark.parametrize("workers", [[], ["-n", "1"]], ids=["alone", "worker"])
@pytest.mark.slow
def test_ci_sees_failures(
    inner: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, variable: str, workers: list[str]
) -> None:
    inner.makepyfile(test_some=TESTS)
    monkeypatch.setenv(variable, "true")
    result = run(inner, *workers)
    # A skip in a fixture becomes a failure in the set-up, which pytest reports as an error.
    found = result.parseoutcomes()
    assert (found["passed"], found["skipped"], found["xfailed"]) == (1, 3, 1)
    assert found.get("failed", 0) + found.get("errors", 0) == len(LACKING)
    for name in LACKING:
        result.stdout.re_match_lines([rf"(FAILED|ERROR) test_some.py::test_{name}\b.*"])
    result.stdout.fnmatch_lines(["*needs engine_that_nobody_has: *cannot be imported*"])


@pytest.mark.slow
def test_ci_sees_files_that_are_not_collected(
    inner: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    inner.makepyfile(test_module=MODULE)
    monkeypatch.setenv("CI", "true")
    result = run(inner)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*every part has to be*engine_that_nobody_has*"])
    monkeypatch.setenv("WAVECOMB_STRICT", "0")
    run(inner).assert_outcomes(skipped=1)


def test_long_tests_run_when_asked(inner: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    inner.makepyfile(test_some=TESTS)
    monkeypatch.setenv("WAVECOMB_LONG", "1")
    run(inner, "-m", "long").assert_outcomes(passed=1, deselected=len(TESTS.split("def test_")) - 2)


def test_flags_of_the_environment() -> None:
    assert parts.is_strict({"CI": "true"}) and parts.is_strict({"WAVECOMB_STRICT": "1"})
    assert not parts.is_strict({}) and not parts.is_strict({"CI": "false"})
    assert not parts.is_strict({"CI": "true", "WAVECOMB_STRICT": "0"})
    assert parts.is_long({"WAVECOMB_LONG": "1"}) and not parts.is_long({"WAVECOMB_LONG": "0"})
