# SPDX-License-Identifier: Apache-2.0
"""Garbage is collected on the window's thread."""

import gc
import threading
import weakref

from wavecomb.gui import collector


class Loop:
    """Is garbage as soon as nobody else has it."""

    def __init__(self) -> None:
        self.me = self


def test_no_other_thread_collects(qapp, qtbot) -> None:
    assert not gc.isenabled()
    threads = []

    def look(phase: str, info: object) -> None:
        if phase == "start":
            threads.append(threading.get_ident())

    loop = weakref.ref(Loop())
    gc.callbacks.append(look)
    try:
        kept: list[object] = []
        worker = threading.Thread(target=lambda: kept.extend([] for _ in range(100_000)))
        worker.start()
        worker.join()
        assert threads == [] and loop() is not None
        qtbot.waitUntil(lambda: loop() is None, timeout=5000)
    finally:
        gc.callbacks.remove(look)
    assert set(threads) == {threading.get_ident()}


def test_what_is_due_by_the_thresholds() -> None:
    gc.collect()
    assert collector.collect() is None
    kept = [[] for _ in range(2 * gc.get_threshold()[0])]
    assert collector.collect() == 0
    assert len(kept) > 0 and collector.collect() is None


def test_installed_once(qapp) -> None:
    collector.install(qapp)
    assert len(qapp.findChildren(collector.Collector)) == 1
