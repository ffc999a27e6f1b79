# SPDX-License-Identifier: Apache-2.0
"""Fixtures of several test files, rules for skipped tests, and selection of long tests."""

from __future__ import annotations

import compileall
import functools
import os
import signal
import subprocess
import sys
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import cpu_times
import crashes
import parts
import pytest
import tiers

# Turn the sandbox off. A sandboxed command starts a new Python process, which would delay hundreds
# of tests. Tests of the sandbox pass --sandbox on.
os.environ.setdefault("WAVECOMB_SANDBOX", "off")

# Tests start hundreds of processes, which should not compile the package each time. A process in
# the sandbox cannot write the compiled bytecode.
if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):
    sys.dont_write_bytecode = False


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Compile the package once, before workers start, and let SIGINT stop child processes.

    A shell that runs the tests in the background ignores SIGINT, and child processes inherit that.
    """
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if hasattr(config, "workerinput"):
        crashes.write_stacks(config)
    else:
        compileall.compile_dir(parts.PACKAGE, quiet=2)


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Tell a worker where to write the stacks of its threads if it crashes."""
    crashes.give_folder(node.workerinput)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Keep the tests of a file in one worker, with its fixtures, until another worker is idle."""
    if config.getvalue("dist") != "load":
        return None
    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log)


@pytest.fixture(scope="session")
def caustics(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Generate the scene caustics with a coarse teapot."""
    from wavecomb.scenes import write_scene

    path = tmp_path_factory.mktemp("caustics") / "caustics.usdc"
    write_scene("caustics", path, teapot_level=6)
    return path


@pytest.fixture(scope="session")
def plain_room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Generate the plain form of the scene room with fewer triangles and texels."""
    from wavecomb.scenes import write_scene

    path = tmp_path_factory.mktemp("plain_room") / "room.usdc"
    write_scene("room", path, plain=True, triangles=12_000, teapot_level=4, texture_size=64)
    return path


@pytest.fixture(scope="session", autouse=True)
def shared_dragons() -> Iterator[None]:
    """Compute small dragons of generated scenes once, which takes a second of CPU time for each.

    The arrays of a shared mesh are read-only. ``options.dragon.cache_clear()`` forgets the meshes.
    """
    try:
        from wavecomb.scenes import options
        from wavecomb.scenes.models.mesh import Mesh
    except ImportError:
        yield
        return
    make = options.dragon

    @functools.lru_cache(maxsize=4)
    def shared(triangles: int) -> Mesh:
        mesh = make(triangles)
        for array in vars(mesh).values():
            array.flags.writeable = False
        return mesh

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(options, "dragon", shared)
        yield


@pytest.fixture
def forked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Start the package's processes, such as stage readers, with the tests' fork server."""
    import forks

    monkeypatch.setattr(subprocess, "Popen", forks.Popen)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip the long tests unless `make test-long` runs."""
    rows = tiers.read(tiers.FILE.read_text(encoding="utf-8"))
    by_file: dict[str, list[str]] = {}
    for row in rows:
        by_file.setdefault(row.long.partition("::")[0], []).append(row.long)
    for item in items:
        patterns = by_file.get(item.nodeid.partition("::")[0], ())
        if any(tiers.matches(pattern, item.nodeid) for pattern in patterns):
            item.add_marker(pytest.mark.long)
    if parts.is_long():
        return
    mark = pytest.mark.skip(reason=parts.LONG + "make test-long runs it")
    for item in items:
        if item.get_closest_marker("long"):
            item.add_marker(mark, append=False)


def refuse_skip(report: pytest.TestReport | pytest.CollectReport) -> None:
    """Turn a skip because of a missing requirement into a failure."""
    if not report.skipped or hasattr(report, "wasxfail"):
        return
    where = report.longrepr
    reason = str(where[2] if isinstance(where, tuple) else where).removeprefix("Skipped: ")
    if not reason.startswith((parts.NOT_HERE, parts.LONG)):
        report.outcome = "failed"
        report.longrepr = f"skipped where every part has to be (CI or WAVECOMB_STRICT): {reason}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Record CPU time. In strict mode, reject skips because of missing requirements."""
    report = yield
    report.user_properties.append((cpu_times.PROPERTY, cpu_times.since_last()))
    if parts.is_strict():
        refuse_skip(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """In strict mode, reject test files that are skipped because of missing requirements."""
    report = yield
    if parts.is_strict():
        refuse_skip(report)
    return report


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Sum the CPU time of tests; with xdist, in the process that collects the reports."""
    cpu_times.add(report.nodeid, dict(report.user_properties).get(cpu_times.PROPERTY, 0.0))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the files and tests that took the most CPU time, and the stacks of lost workers."""
    cpu_times.save()
    for title, lines in (("CPU time", cpu_times.table()), ("lost workers", crashes.report())):
        if lines:
            terminalreporter.section(title)
            for line in lines:
                terminalreporter.line(line)
