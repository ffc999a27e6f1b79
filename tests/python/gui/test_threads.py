# SPDX-License-Identifier: Apache-2.0
"""Tests that worker threads and Python's cyclic garbage hold no Qt objects."""

import gc
import os
import re
import subprocess
import sys
import threading
from functools import partial
from pathlib import Path

import pytest
import shiboken6
import window_story
from PySide6.QtCore import QObject, QPoint, QPointF, QRect, QRectF, QSize, Signal
from PySide6.QtGui import QColor
from scene_stage import write_stage

from wavecomb.gui import bridge
from wavecomb.gui.worker import Errands, Worker, refuse_qt

HARMLESS = (QColor, QPoint, QPointF, QRect, QRectF, QSize)
"""Qt value types without a lock or thread affinity."""


@pytest.fixture(scope="module")
def stage_path(tmp_path_factory):
    return write_stage(tmp_path_factory.mktemp("threads"))


def owned(things):
    """Returns the Qt objects that still exist."""
    return [
        one
        for one in things
        if isinstance(one, shiboken6.Object)
        and not isinstance(one, HARMLESS)
        and shiboken6.isValid(one)
    ]


class Saved:
    """Collects the objects that Python's garbage collector would have destroyed."""

    def __enter__(self):
        gc.collect()
        gc.disable()
        gc.set_debug(gc.DEBUG_SAVEALL)
        return self

    def __exit__(self, *fault):
        gc.set_debug(0)
        gc.garbage.clear()
        gc.enable()
        gc.collect()

    def look(self):
        gc.collect()
        return [f"{type(one).__name__} {one!r:.80}" for one in owned(gc.garbage)]


ALONE = []
"""Names of the tests that run in a separate process."""


@pytest.fixture(scope="module")
def lonely():
    """Runs the tests of ``ALONE`` in one separate process; returns their outcomes by name."""
    done = subprocess.run(
        [sys.executable, "-X", "faulthandler", "-m", "pytest", "-v", "-p", "no:xdist",
         "-p", "no:cacheprovider", *(f"{__file__}::{name}" for name in ALONE)],
        capture_output=True, text=True, check=False, env={**os.environ, "WAVECOMB_ALONE": "1"},
    )  # fmt: skip
    return done, dict(re.findall(r"::(\w+) (PASSED|FAILED|ERROR|SKIPPED)", done.stdout))


def alone(test):
    """Runs a test in a separate process, without garbage of tests other than those of ``ALONE``.

    Tests create Qt objects without a window, and PySide may crash when such objects are collected.
    """
    if os.environ.get("WAVECOMB_ALONE"):
        return test
    ALONE.append(test.__name__)

    def run(lonely):
        done, outcomes = lonely
        assert outcomes.get(test.__name__) == "PASSED", done.stdout + done.stderr

    run.__name__, run.__doc__ = test.__name__, test.__doc__
    return run


@pytest.mark.slow
@alone
def test_garbage_that_holds_qt_is_found(qapp):
    """``Saved`` finds a Qt object in garbage, as the other tests assume."""

    class Loop(QObject):
        def __init__(self):
            super().__init__()
            self.me = self

    with Saved() as saved:
        Loop()
        assert len(saved.look()) == 1


@pytest.mark.slow
@alone
def test_no_garbage_holds_anything_of_qt(qapp, stage_path, tmp_path):
    """A window that was opened, used and closed leaves no Qt objects for garbage collection."""
    warm = window_story.new_window(tmp_path, qapp)
    window_story.end(warm, qapp)
    del warm
    with Saved() as saved:
        window = window_story.new_window(tmp_path, qapp)
        window_story.use(window, stage_path, tmp_path)
        assert saved.look() == []
        window_story.end(window, qapp)
        del window
        assert saved.look() == []


@pytest.mark.slow
@alone
def test_a_session_alone_leaves_no_garbage(qapp, stage_path):
    """A session without a parent is destroyed with its last reference."""
    from wavecomb.gui.setup import Setup
    from wavecomb.gui.viewport.session import Session

    def live():
        session = Session(Setup(width=16, height=16, spp=1))
        session.open(stage_path)
        window_story.until(lambda: session.state == "finished", "the picture")
        twin = session.twin(session.setup.changed(seed=1))
        window_story.until(lambda: twin.state == "finished", "the other picture")
        session.run("nothing", int)
        session.drop_twin(twin)
        session.shutdown()

    with Saved() as saved:
        live()
        assert saved.look() == []


@pytest.mark.slow
@pytest.mark.parametrize("times", [1, pytest.param(10, marks=pytest.mark.long)])
def test_another_thread_may_collect(stage_path, tmp_path, times):
    """Another thread continually collects garbage while a window is used and closed.

    Nothing blocks.
    """
    script = str(Path(window_story.__file__))
    done = subprocess.run(
        [sys.executable, script, str(stage_path), str(tmp_path), str(times)],
        capture_output=True, text=True, timeout=2 * times * window_story.SECONDS, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-6000:]
    assert "on another thread" in done.stdout and int(done.stdout.split()[1]) > 20 * times


# ---- the worker ----------------------------------------------------------------------------------


class Told:
    """Records the signals of a worker and their threads."""

    def __init__(self, worker):
        self.done, self.failed, self.threads = [], [], set()
        worker.done.connect(self._take)
        worker.failed.connect(self._fail)

    def _take(self, key, result):
        self.done.append((key, result))
        self.threads.add(threading.get_ident())

    def _fail(self, key, line):
        self.failed.append((key, line))


class Gate:
    """Jobs of a worker that wait for the event ``open``."""

    def __init__(self):
        self.open = threading.Event()
        self.begun = []

    def job(self, name):
        return partial(self._run, name)

    def _run(self, name):
        self.begun.append(name)
        assert self.open.wait(10)
        return name, threading.get_ident()


@pytest.fixture
def worker(qapp):
    made = Worker("test")
    yield made
    made.close()


def test_the_newest_wins(worker, qtbot):
    told, gate = Told(worker), Gate()
    for number in range(5):
        worker.submit(gate.job(number), number)
    qtbot.waitUntil(lambda: gate.begun == [0])
    assert worker.busy and told.done == []
    gate.open.set()
    qtbot.waitUntil(lambda: not worker.busy)
    assert gate.begun == [0, 4], "what waited was replaced"
    assert [key for key, _ in told.done] == [0, 4]
    here = threading.get_ident()
    assert told.threads == {here} and all(ident != here for _, (_, ident) in told.done)


def test_a_job_that_runs_already_is_not_done_twice(worker, qtbot):
    told, gate = Told(worker), Gate()
    worker.submit(gate.job("a"), "a")
    worker.submit(gate.job("b"), "b")
    worker.submit(gate.job("a"), "a")
    gate.open.set()
    qtbot.waitUntil(lambda: not worker.busy)
    assert gate.begun == ["a"] and [key for key, _ in told.done] == ["a"]


def test_what_is_cancelled_is_not_told(worker, qtbot):
    told, gate = Told(worker), Gate()
    worker.submit(gate.job("a"), "a")
    worker.submit(gate.job("b"), "b")
    worker.cancel()
    gate.open.set()
    qtbot.waitUntil(lambda: not worker.busy)
    assert gate.begun == ["a"] and told.done == []
    worker.submit(gate.job("c"), "c")
    qtbot.waitUntil(lambda: not worker.busy)
    assert [key for key, _ in told.done] == ["c"]


def _fault():
    raise OSError(28, "No space left on device", "/a/b.exr")


def test_an_error_is_one_line(worker, qtbot):
    told = Told(worker)
    worker.submit(_fault, "a")
    qtbot.waitUntil(lambda: not worker.busy)
    assert told.failed == [("a", "/a/b.exr: No space left on device")] and told.done == []


def test_closing_waits_for_what_runs_and_tells_nothing(qapp, qtbot):
    worker, gate = Worker("test"), Gate()
    told = Told(worker)
    worker.submit(gate.job("a"))
    worker.submit(gate.job("b"))
    qtbot.waitUntil(lambda: gate.begun == ["a"])
    assert not worker.close(0.01), "it goes on by itself"
    gate.open.set()
    other = Worker("test")
    other.submit(gate.job("c"))
    assert other.close() and gate.begun[1:] == ["c"]
    worker.submit(gate.job("d"))
    qtbot.wait(20)
    assert told.done == [] and "b" not in gate.begun and "d" not in gate.begun


def test_a_worker_may_go_before_its_job(qapp, qtbot):
    worker, gate = Worker("test"), Gate()
    worker.submit(gate.job("a"))
    shiboken6.delete(worker)
    gate.open.set()
    qtbot.wait(50)


def test_jobs_hold_nothing_of_qt(qapp, worker):
    class Emitter(QObject):
        said = Signal(object)

    emitter = Emitter()

    def default(thing=emitter):
        return thing

    for job in (
        lambda: emitter,
        default,
        emitter.said.emit,
        emitter.deleteLater,
        partial(print, emitter),
        partial(print, end=emitter.said),
    ):
        with pytest.raises(TypeError, match="must not hold an object of Qt's"):
            worker.submit(job)
    gate = Gate()
    refuse_qt(gate.job("a"))
    assert not worker.busy


def test_errands_are_all_done_in_order(qapp, qtbot):
    errands, gate = Errands("test"), Gate()
    gate.open.set()
    results, lines = [], []
    for number in range(3):
        errands.submit(gate.job(number), lambda found: results.append(found[0]), lines.append)
    errands.submit(_fault, results.append, lines.append)
    errands.submit(gate.job(3), lambda found: results.append(found[0]), lines.append)
    qtbot.waitUntil(lambda: not errands.busy)
    assert gate.begun == results == [0, 1, 2, 3] and len(lines) == 1
    assert errands.close()


def test_letters_after_one_whose_receiver_fails_arrive(qapp, qtbot, monkeypatch):
    class Receiver(QObject):
        def __init__(self):
            super().__init__()
            self.got = []

        def take(self, letter):
            self.got.append(letter)
            if letter == "bad":
                raise ValueError("on purpose")

    receiver = Receiver()
    port = bridge.port(receiver.take)
    with qtbot.captureExceptions() as faults:
        for letter in ("bad", "good"):
            port.send(letter)
        qtbot.waitUntil(lambda: receiver.got == ["bad", "good"])
    assert len(faults) == 1
    shiboken6.delete(receiver)
    port.send("nobody")
    qtbot.wait(20)
    assert receiver.got == ["bad", "good"]
