# SPDX-License-Identifier: Apache-2.0
"""What a render has learned of where light comes from, for a later render to start from.

A file holds the field that guides bounces, as checkpoints hold it. It fits scenes with as many
materials; of one that is moved or lit otherwise it is a worse guess, and no picture is biased.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from wavecomb.errors import WavecombError
from wavecomb.version import version

if TYPE_CHECKING:
    from wavecomb._core import Settings

BEFORE = "before"
"""In place of a file: each frame starts from what the frame before it has learned."""
ENDING = ".learned"
_KIND = "wavecomb-learned"
_FORMAT = 1


class _HasLearned(Protocol):
    @property
    def learned(self) -> bytes: ...


@dataclass
class Learning:
    """Where the pictures of a command start from.

    Attributes:
        given: What was learned before; None: nothing.
        follows: Each picture starts from what the one before it has learned.
        last: What the last picture has learned, or had been given.
    """

    given: bytes | None = None
    follows: bool = False
    last: bytes = b""

    def take(self, result: _HasLearned) -> None:
        """Notes what a render has learned."""
        self.last = result.learned or self.last
        if self.follows and result.learned:
            self.given = result.learned


def check_taught(settings: Settings, option: str) -> None:
    """Raises WavecombError where a render with such settings learns nothing."""
    chosen = settings.to_dict()
    if chosen["guiding"] == "off" and chosen["roulette"] != "efficient":
        raise WavecombError(f"{option}: nothing is learned here; give --guiding auto or on, too")


def save_learned(path: str | os.PathLike[str], learned: bytes) -> None:
    """Writes what a render has learned.

    Raises:
        OSError: It cannot be written.
        WavecombError: There is nothing: the render was not guided, or too short to learn.
    """
    if not learned:
        raise WavecombError(
            f"{os.fspath(path)}: nothing was learned; a render is guided with guiding auto or on, "
            "and learns from some 130,000 samples on"
        )
    import numpy as np

    from wavecomb.picture.archive import write_archive

    header = {"kind": _KIND, "format": _FORMAT, "version": version()}
    write_archive(path, header, {"field": np.frombuffer(learned, np.uint8)})


def load_learned(path: str | os.PathLike[str]) -> bytes:
    """Reads what ``save_learned`` wrote.

    Raises:
        OSError: It cannot be read.
        WavecombError: It is none, damaged, or of another format.
    """
    import numpy as np

    from wavecomb.picture.archive import ArchiveError, read_kind

    name = os.fspath(path)
    try:
        advice = "learn anew, by --learn-to"
        _, arrays = read_kind(name, _KIND, _FORMAT, "--learn-to", advice)
        field = arrays.get("field")
        if field is None or field.dtype != np.uint8 or field.ndim != 1:
            raise ArchiveError("it has no field")
    except ArchiveError as error:
        raise WavecombError(f"{name}: holds nothing learned, or is damaged: {error}") from error
    return field.tobytes()


def learned_of(source: str | os.PathLike[str] | bytes | _HasLearned | None) -> bytes | None:
    """What is in a file, or what a picture has learned; None of None."""
    if source is None or isinstance(source, bytes):
        return source
    return load_learned(source) if isinstance(source, (str, os.PathLike)) else source.learned
