# SPDX-License-Identifier: Apache-2.0
"""Detects layers that are FIFOs, which would block USD forever."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from pxr import Sdf

from wavecomb.errors import WavecombError
from wavecomb.image.files.output_file import kind_of
from wavecomb.run.isolation import progress_notes, time_limit

_TICK_S = 0.25
_IDLE = 0.1
"""CPU time as a fraction of wall time below which the process may be waiting for a FIFO."""


@contextmanager
def abort_on_fifo() -> Iterator[None]:
    """Aborts a block that opens layers if USD waits for a FIFO.

    While the process is idle, a thread checks the files that loaded layers name. An expendable
    process ends with one message. In other processes the thread opens the FIFO for writing and
    closes it, so that USD reads an empty layer; the block then raises.

    Raises:
        WavecombError: A layer names a FIFO that USD waited for.
    """
    done, found = threading.Event(), _BlockingFifo()
    thread = threading.Thread(target=_watch, args=(done, found), daemon=True)
    thread.start()
    try:
        yield
    except Exception:
        if found.line is not None:
            raise WavecombError(found.line) from None
        raise
    finally:
        done.set()
        thread.join()
    if found.line is not None:
        raise WavecombError(found.line)


class _BlockingFifo:
    """The first FIFO that USD waited for.

    Attributes:
        line: Message that names it.
    """

    line: str | None = None


def _watch(done: threading.Event, found: _BlockingFifo) -> None:
    clock, computed = time.monotonic(), time.process_time()
    while not done.wait(_TICK_S):
        now, so_far = time.monotonic(), time.process_time()
        is_idle = so_far - computed < _IDLE * (now - clock)
        clock, computed = now, so_far
        if is_idle:
            for path, layer in _fifos():
                if not done.is_set():
                    _release(path, layer, found)


def _fifos() -> Iterator[tuple[str, str]]:
    """Yields FIFOs that loaded layers name as layers, with the layer that names each."""
    for layer in Sdf.Layer.GetLoadedLayers():
        try:
            named = [layer.ComputeAbsolutePath(n) for n in layer.GetCompositionAssetDependencies()]
            name = layer.realPath or layer.identifier
        # The composing thread has released the layer.
        except Exception:
            continue
        for path in named:
            if path and kind_of(path) == "a FIFO":
                yield path, name


def _release(path: str, layer: str, found: _BlockingFifo) -> None:
    line = f"{layer}: names the layer {path}, which is a FIFO, not a regular file; name a file"
    if progress_notes.is_expendable():
        time_limit.end_process(line)
        return
    # Opening fails if there is no reader, which means that USD is not waiting for this FIFO.
    with contextlib.suppress(OSError):
        os.close(os.open(path, os.O_WRONLY | os.O_NONBLOCK))
        found.line = found.line or line
