# SPDX-License-Identifier: Apache-2.0
"""Aborts USD's attempts to read FIFOs as layers, which would wait for data forever."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from pxr import Sdf

from wavecomb.errors import WavecombError
from wavecomb.image.files.output_file import kind_of
from wavecomb.run.isolation import progress_notes, time_limit

_TICK_S = 0.25


@contextmanager
def abort_on_fifo() -> Iterator[None]:
    """Aborts the ``with`` block, which opens layers, if USD waits for a FIFO.

    Another thread looks for FIFOs to which loaded layers refer, and opens each of them for writing.
    This fails at once unless USD is waiting for the FIFO. A child process with a supervising parent
    then ends with a one-line message. In other processes, the thread closes the FIFO, so that USD
    reads an empty layer; the block then raises WavecombError.

    Raises:
        WavecombError: A layer refers to a FIFO, and USD waited for data from the FIFO.
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
        line: Message that names the FIFO.
    """

    line: str | None = None


def _watch(done: threading.Event, found: _BlockingFifo) -> None:
    """Looks for FIFOs until ``done`` is set.

    The CPU load does not tell whether USD is waiting for a FIFO, since other threads of the process
    may be busy, and since USD's main thread spins while it waits for the thread that reads a layer.
    """
    searched: set[str] = set()
    fifos: dict[str, str] = {}
    before: set[str] = set()
    while not done.wait(_TICK_S):
        layers = _loaded_layers()
        # No layer was added for a while, so USD may be waiting for one.
        if layers.keys() == before:
            for name in layers.keys() - searched:
                named = _fifos(layers[name])
                # USD may still be reading a layer that is empty.
                if named is not None:
                    searched.add(name)
                    fifos |= named
            for path, line in fifos.items():
                if not done.is_set():
                    _release(path, line, found)
        before = set(layers)


def _loaded_layers() -> dict[str, Sdf.Layer]:
    layers: dict[str, Sdf.Layer] = {}
    for layer in Sdf.Layer.GetLoadedLayers():
        with suppress(Exception):  # The last user of the layer may have released it.
            layers[layer.identifier] = layer
    return layers


def _fifos(layer: Sdf.Layer) -> dict[str, str] | None:
    """Returns the FIFOs that a layer references as layers, with a message for each.

    Returns:
        None if the layer has no content, or if its last user has released it.
    """
    try:
        if layer.empty:
            return None
        named = [layer.ComputeAbsolutePath(n) for n in layer.GetCompositionAssetDependencies()]
        name = layer.realPath or layer.identifier
    except Exception:
        return None
    return {
        path: f"{name}: names the layer {path}, which is a FIFO, not a regular file; name a file"
        for path in named
        if path and kind_of(path) == "a FIFO"
    }


def _release(path: str, line: str, found: _BlockingFifo) -> None:
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
    except OSError:
        return
    if progress_notes.is_expendable():
        time_limit.end_process(line)
        return
    found.line = found.line or line
    os.close(descriptor)
