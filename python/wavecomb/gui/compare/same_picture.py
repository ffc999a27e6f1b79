# SPDX-License-Identifier: Apache-2.0
"""Verifies that scheduling settings do not change the bits of an image. Independent of Qt."""

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
"""Settings that determine the bits of an image, in addition to the sample counts."""

MAX_PICTURES = 32


@dataclass(frozen=True)
class Verdict:
    """Result of a bitwise comparison of two images.

    ``kind`` is "same", "different", "first" (there is no earlier image to compare with) or "none"
    (the image cannot be compared).
    """

    kind: str
    text: str


def fingerprint(beauty: NDArray[np.float32]) -> str:
    """Returns a hash of the bits of an image."""
    return hashlib.blake2b(np.ascontiguousarray(beauty).data, digest_size=8).hexdigest()


def even_samples(samples: NDArray[Any] | None) -> int:
    """Returns the sample count that all pixels share, or 0 if they differ or are unknown."""
    if samples is None or samples.size == 0:
        return 0
    first = int(samples.flat[0])
    return first if bool((samples == first).all()) else 0


def picture_key(setup: Mapping[str, Any], revision: Hashable) -> tuple[Hashable, ...] | None:
    """Returns a key of all inputs that determine an image's bits at equal sample counts.

    ``revision`` identifies the scene and camera. Returns None if the image depends on the speed of
    the machine, as it does with a time limit or with roulette by measured costs.
    """
    if setup.get("time_limit"):
        return None
    if setup.get("roulette") == "cost-aware":
        if setup.get("costs") == "measured":
            return None
        # With cost-aware roulette, the image depends on the costs of materials, because the costs
        # decide which paths are terminated.
        costs = (setup.get("costs"), repr(setup.get("profile")))
        return (revision, costs, *(_plain(setup.get(name)) for name in BITS))
    return (revision, *(_plain(setup.get(name)) for name in BITS))


class PictureBook:
    """Store of image fingerprints with the settings of the images, by key and sample counts."""

    def __init__(self) -> None:
        self._pictures: dict[Hashable, tuple[str, dict[str, Any]]] = {}
        self.checked = 0
        """Number of equal results since the last comparison in which bits differed."""

    def add(
        self, key: Hashable | None, samples: Hashable, mark: str, settings: Mapping[str, Any]
    ) -> Verdict:
        """Compares the bits of an image with those of the first image that had the same key.

        Args:
            key: Key from ``picture_key``.
            samples: Sample count of every pixel, or an identifier of the sample count map.
            mark: Hash from ``fingerprint``.
            settings: Scheduling settings of the image, which the verdict names if bits differ.
        """
        if key is None:
            return Verdict("none", "This picture depends on time, so no two are equal")
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
        """Removes all stored images and their fingerprints."""
        self._pictures.clear()
        self.checked = 0


def _plain(value: Any) -> Hashable:
    return tuple(value) if isinstance(value, list) else value


# ---- Detection of changes in stage, camera, materials and lights
# -----------------------------------


class PictureRevision(QObject):
    """Identifier of the scene and camera. Undoing an edit restores the earlier identifier."""

    def __init__(self, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._opened = 0
        session.opened.connect(self._count)

    def value(self) -> str:
        """Returns the identifier of the current scene and camera."""
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
