# SPDX-License-Identifier: Apache-2.0
"""Time limit for USD's composition of a stage.

References that double at each level, or that are indirectly cyclic, can make composition take
years, and USD cannot interrupt composition. Therefore a thread of the child process watches
composition and ends the process if it takes too long.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from wavecomb.run.isolation import progress_notes

BASE_S = 6.0
"""Time limit in seconds for an empty stage; suffices for stages of some hundred thousand prims."""

BYTES_PER_S = 1_000_000
"""Layer bytes that extend the time limit by one second; valid layers load much faster."""

limit_s: float | None = None
"""Time limit in seconds set by the user (0 disables it); None derives the limit from the layer
size."""

_TICK_S = 0.25


def allowed_s(layer_bytes: int) -> float:
    """Returns the time limit in seconds for a stage whose layers have ``layer_bytes`` bytes."""
    return BASE_S + layer_bytes / BYTES_PER_S if limit_s is None else limit_s


def _end_with_message(message: str) -> None:
    if sys.stderr is not None:
        sys.stderr.write(f"error: {' '.join(message.split())}\n")
        sys.stderr.flush()
    os._exit(2)


end_process: Callable[[str], None] = _end_with_message
"""Function that ends this process with an error message."""


@contextmanager
def limit_composition(file: Path) -> Iterator[None]:
    """Ends the process if composing a stage inside the ``with`` block takes too long.

    The limit counts only CPU time of this process, not waiting for a slow disk or a busy machine.

    Args:
        file: File of the stage.
    """
    if not progress_notes.is_expendable() or limit_s == 0:
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
        # Query the sizes of the loaded layers only after the minimum time limit has passed.
        if busy < (BASE_S if limit_s is None else limit_s):
            continue
        layers, size = loaded_layers()
        allowed = allowed_s(size)
        if busy >= allowed and not done.is_set():
            more = 10 * max(1, round(allowed))
            end_process(
                f"{file}: USD has composed for {busy:.0f} s, and the size of its layers ({layers}, "
                f"{size / 1e6:.3g} MB) does not explain it: prims refer to each other without end, "
                f"or multiply; fix that, or allow more by --load-limit {more}"
            )
            return


def loaded_layers() -> tuple[int, int]:
    """Returns the number and total size of the layers that USD has loaded so far."""
    from pxr import Sdf

    number = size = 0
    for layer in Sdf.Layer.GetLoadedLayers():
        path = layer.realPath
        if path and os.path.isfile(path):
            number += 1
            size += os.path.getsize(path)
    return number, size
