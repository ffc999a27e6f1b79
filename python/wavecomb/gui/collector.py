# SPDX-License-Identifier: Apache-2.0
"""Python's cyclic garbage, collected on the window's thread alone.

Whatever thread allocates may be the one to collect. Where that is a worker, and the garbage holds
objects of Qt's, these are destroyed there: that takes a lock of Qt's and then waits for Python's,
while the window's thread, which has Python's, waits for Qt's. Nothing moves again.
"""

from __future__ import annotations

import gc

from PySide6.QtCore import QObject, QTimer

INTERVAL_MS = 200
"""Between looks at how much there is."""


class Collector(QObject):
    """Collects by Python's own thresholds, but from a timer; automatic collection is off."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        gc.disable()
        timer = QTimer(self)
        timer.timeout.connect(collect)
        timer.start(INTERVAL_MS)


def collect() -> int | None:
    """Collects what is due; returns the oldest generation that was, None where none is due."""
    due = [
        generation
        for generation, (count, threshold) in enumerate(
            zip(gc.get_count(), gc.get_threshold(), strict=True)
        )
        if threshold and count > threshold
    ]
    if not due:
        return None
    # Counts of older generations grow by one a collection of the younger, as Python's own do.
    gc.collect(due[-1])
    return due[-1]


def install(application: QObject) -> None:
    """Once for an application; the collector lives as long as it."""
    if application.findChild(Collector) is None:
        Collector(application)
