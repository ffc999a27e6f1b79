# SPDX-License-Identifier: Apache-2.0
"""Whether a picture has the bits of the one before, though its scheduling is another; no Qt."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject

from wavecomb.gui.scheduling.run_log import describe, differences
from wavecomb.gui.viewport.session import Session
from wavecomb.options import settings

BITS = (*(name for name, row in settings().items() if row.changes_bits), "region")
"""Settings that decide over the bits, beside the samples of each pixel."""

MAX_PICTURES = 32


@dataclass(frozen=True)
class Verdict:
    """What the light shows.

    ``kind``: "same", "different", "first" (nothing to compare with yet), "none" (cannot be told).
    """

    kind: str
    text: str


def fingerprint(beauty: NDArray[np.float32]) -> str:
    """A hash of the bits of a picture."""
    return hashlib.blake2b(np.ascontiguousarray(beauty).data, digest_size=8).hexdigest()


def even_samples(samples: NDArray[Any] | None) -> int:
    """The samples that each pixel has; 0 where not all have the same number, or it is not known."""
    if samples is None or samples.size == 0:
        return 0
    first = int(samples.flat[0])
    return first if bool((samples == first).all()) else 0


def picture_key(setup: Mapping[str, Any], revision: Hashable) -> tuple[Hashable, ...] | None:
    """What decides over the bits at equal samples; None where the clock has a say.

    ``revision``: of scene and camera. With a limit of time, and with roulette by measured costs,
    a picture depends on how fast the machine was.
    """
    if setup.get("time_limit"):
        return None
    if setup.get("roulette") == "cost-aware":
        if setup.get("costs") == "measured":
            return None
        # Costs decide over the survival of paths.
        costs = (setup.get("costs"), repr(setup.get("profile")))
        return (revision, costs, *(_plain(setup.get(name)) for name in BITS))
    return (revision, *(_plain(setup.get(name)) for name in BITS))


class PictureBook:
    """Fingerprints of even pictures, and what they were rendered with."""

    def __init__(self) -> None:
        self._pictures: dict[Hashable, tuple[str, dict[str, Any]]] = {}
        self.checked = 0
        """Pictures compared with one of other settings since the last different one."""

    def add(
        self, key: Hashable | None, samples: Hashable, mark: str, settings: Mapping[str, Any]
    ) -> Verdict:
        """Compares a picture with the first of its key.

        Args:
            key: Of ``picture_key``.
            samples: Samples of each pixel, or what tells their map.
            mark: Of ``fingerprint``.
            settings: Of its scheduling, to say what is different.
        """
        if key is None:
            return Verdict("none", "Time decides over this picture: no two are alike")
        place = (key, samples)
        if place not in self._pictures:
            self._pictures[place] = (mark, dict(settings))
            if len(self._pictures) > MAX_PICTURES:
                self._pictures.pop(next(iter(self._pictures)))
            return Verdict("first", "First picture of this kind: change a setting to compare")
        other, before = self._pictures[place]
        changes = describe(differences(before, settings)) or "the same settings"
        if mark == other:
            self.checked += 1
            at = f"{samples} samples" if isinstance(samples, int) else samples
            return Verdict("same", f"Same picture, bit for bit ({at}), with {changes}")
        self.checked = 0
        return Verdict("different", f"DIFFERENT picture with {changes}: please report this")

    def clear(self) -> None:
        """Forgets all."""
        self._pictures.clear()
        self.checked = 0


def _plain(value: Any) -> Hashable:
    return tuple(value) if isinstance(value, list) else value


# ---- Tells whether what is looked at has changed: stage, camera, materials, lights ---------------


class PictureRevision(QObject):
    """A name for scene and camera: the same again when an edit is taken back."""

    def __init__(self, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._opened = 0
        session.opened.connect(self._count)

    def value(self) -> str:
        """The name of what is looked at now."""
        session = self._session
        camera = session.pose.options() if session.pose is not None else None
        edits = (
            sorted(session.material_edits.items()),
            sorted(session.light_edits.items()),
            camera,
        )
        return f"{self._opened}-{hashlib.blake2b(pickle.dumps(edits), digest_size=8).hexdigest()}"

    def _count(self, stage: object) -> None:
        self._opened += 1
