# SPDX-License-Identifier: Apache-2.0
"""A limit to the time that USD takes to compose a stage.

References that double at each level, or that run through each other in circles which are no plain
cycle, make composition take years; USD cannot be stopped. So a thread looks on, where the process
is expendable, and ends it.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from wavecomb.run.isolate import trail

BASE_S = 6.0
"""What any stage may take: some hundred thousand prims, whatever multiplies them."""

BYTES_PER_S = 1_000_000
"""Each of them is a second more: sound layers are read many times faster."""

limit_s: float | None = None
"""Seconds that the user allows, 0: no limit; None: by the size of the layers."""

_TICK_S = 0.25


def allowed_s(layer_bytes: int) -> float:
    """Seconds for layers of this size."""
    return BASE_S + layer_bytes / BYTES_PER_S if limit_s is None else limit_s


def _say_and_end(message: str) -> None:
    if sys.stderr is not None:
        sys.stderr.write(f"error: {' '.join(message.split())}\n")
        sys.stderr.flush()
    os._exit(2)


on_end: Callable[[str], None] = _say_and_end
"""Ends this process, which is expendable, with a line."""


@contextmanager
def watched(file: Path) -> Iterator[None]:
    """Ends the process where the block, which composes a stage, takes too long.

    Only time in which this process computes counts, not that of a slow disk or a busy machine.

    Args:
        file: The stage's.
    """
    if not trail.is_expendable() or limit_s == 0:
        yield
        return
    done = threading.Event()
    watcher = threading.Thread(target=_watch, args=(file, done), daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()


def _watch(file: Path, done: threading.Event) -> None:
    busy, clock, computed = 0.0, time.monotonic(), time.process_time()
    while not done.wait(_TICK_S):
        now, so_far = time.monotonic(), time.process_time()
        busy += min(now - clock, so_far - computed)
        clock, computed = now, so_far
        # Sizes are looked up only where it matters.
        if busy < (BASE_S if limit_s is None else limit_s):
            continue
        layers, size = loaded_layers()
        allowed = allowed_s(size)
        if busy >= allowed and not done.is_set():
            on_end(
                f"{file}: USD has composed for {busy:.0f} s, and its layers ({layers}, "
                f"{size / 1e6:.3g} MB) give no reason: prims refer to each other without end, or "
                f"multiply; mend that, or allow more by --load-limit {10 * max(1, round(allowed))}"
            )
            return


def loaded_layers() -> tuple[int, int]:
    """Number and bytes of the layers that USD holds by now."""
    from pxr import Sdf

    number = size = 0
    for layer in Sdf.Layer.GetLoadedLayers():
        path = layer.realPath
        if path and os.path.isfile(path):
            number += 1
            size += os.path.getsize(path)
    return number, size
