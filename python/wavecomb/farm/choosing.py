# SPDX-License-Identifier: Apache-2.0
"""Which task a worker takes next.

A worker stays with its chunk of pictures, in their order, so that a stage is read once and what
does not change from frame to frame is kept. When its chunk is done it begins the one that the
fewest others work on.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict

from wavecomb.farm.folder import BUSY, DONE, TODO, Entry, Folder

_FRESH_S = 1.0
"""So long a list of names is good; what is no longer there cannot be taken, so it does no harm."""


class Chooser:
    """Takes tasks for one worker."""

    def __init__(self, folder: Folder, worker: str) -> None:
        self._folder = folder
        self._worker = worker
        self._chunk: int | None = None
        self._waiting: dict[int, list[Entry]] = {}
        self._joins: list[Entry] = []
        self._until = 0.0

    def next(self) -> Entry | None:
        """A task, taken; None: there is none to take now."""
        if time.monotonic() >= self._until or not (self._waiting or self._joins):
            self._look()
        return self._take_join() or self._take_part()

    def _look(self) -> None:
        """Lists what is to be done."""
        self._waiting, self._joins = defaultdict(list), []
        for entry in self._folder.entries(TODO):
            if entry.task.is_join:
                self._joins.append(entry)
            else:
                self._waiting[self._chunk_of(entry)].append(entry)
        if self._joins:
            done = self._folder.ids(DONE)
            self._joins = [entry for entry in self._joins if self._is_ready(entry, done)]
        self._until = time.monotonic() + _FRESH_S

    def _chunk_of(self, entry: Entry) -> int:
        return entry.task.picture // self._folder.spec.chunk

    def _is_ready(self, entry: Entry, done: set[str]) -> bool:
        return all(tile.id in done for tile in self._folder.spec.parts_of(entry.task.picture))

    def _take_join(self) -> Entry | None:
        while self._joins:
            mine = self._folder.claim(self._joins.pop(0), self._worker)
            if mine is not None:
                return mine
        return None

    def _take_part(self) -> Entry | None:
        while self._waiting:
            if self._chunk not in self._waiting:
                self._chunk = self._least_busy()
            left = self._waiting[self._chunk]
            mine = self._folder.claim(left.pop(0), self._worker)
            if not left:
                del self._waiting[self._chunk]
            if mine is not None:
                return mine
        return None

    def _least_busy(self) -> int:
        others = Counter(self._chunk_of(entry) for entry in self._folder.entries(BUSY))
        return min(self._waiting, key=lambda chunk: (others[chunk], chunk))
