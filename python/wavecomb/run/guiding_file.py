# SPDX-License-Identifier: Apache-2.0
"""Guiding field of a render, saved as the starting point of later renders.

A file holds the guiding field in the form of checkpoints. A saved guiding field fits scenes with
the same number of materials. After changes of geometry or lighting a guiding field is less
accurate, but never biases the image.
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
"""Option value in place of a file name: each frame starts from the previous frame's guiding
field."""
ENDING = ".learned"
_KIND = "wavecomb-learned"
_FORMAT = 1


class _HasLearned(Protocol):
    @property
    def learned(self) -> bytes: ...


@dataclass
class Learning:
    """The initial guiding field of the renders of a command.

    Attributes:
        given: The initial guiding field; None starts without one.
        follows: Whether each render starts from the result of the previous render.
        last: Guiding field of the last render, or its initial field.
    """

    given: bytes | None = None
    follows: bool = False
    last: bytes = b""

    def take(self, result: _HasLearned) -> None:
        """Stores the guiding field of a render."""
        self.last = result.learned or self.last
        if self.follows and result.learned:
            self.given = result.learned


def check_trains_field(settings: Settings, option: str) -> None:
    """Raises WavecombError if a render with these settings trains no guiding field."""
    chosen = settings.to_dict()
    may_guide = chosen["guiding"] == "on" or (
        chosen["guiding"] == "auto" and chosen["quality"] == "auto"
    )
    if not may_guide and chosen["roulette"] != "efficient":
        raise WavecombError(
            f"{option}: this render trains no guiding field; give --guiding on, or auto with "
            "--quality auto"
        )


def save_learned(path: str | os.PathLike[str], learned: bytes) -> None:
    """Writes the guiding field of a render.

    Raises:
        OSError: The file cannot be written.
        WavecombError: There is no field: the render was not guided, or too short for training.
    """
    if not learned:
        raise WavecombError(
            f"{os.fspath(path)}: nothing was learned; a render learns from some 130,000 samples on "
            "with guiding on, and from two million on with guiding auto"
        )
    import numpy as np

    from wavecomb.image.files.archive import write_archive

    header = {"kind": _KIND, "format": _FORMAT, "version": version()}
    write_archive(path, header, {"field": np.frombuffer(learned, np.uint8)})


def load_learned(path: str | os.PathLike[str]) -> bytes:
    """Reads a file of ``save_learned``.

    Raises:
        OSError: The file cannot be read.
        WavecombError: The file has another kind or format, or is damaged.
    """
    import numpy as np

    from wavecomb.image.files.archive import ArchiveError, read_kind

    name = os.fspath(path)
    try:
        advice = "create it again with --learn-to"
        _, arrays = read_kind(name, _KIND, _FORMAT, "--learn-to", advice)
        field = arrays.get("field")
        if field is None or field.dtype != np.uint8 or field.ndim != 1:
            raise ArchiveError("it has no field")
    except ArchiveError as error:
        raise WavecombError(f"{name}: holds no guiding field, or is damaged: {error}") from error
    return field.tobytes()


def learned_of(source: str | os.PathLike[str] | bytes | _HasLearned | None) -> bytes | None:
    """Returns the guiding field of a file or picture; None for None."""
    if source is None or isinstance(source, bytes):
        return source
    return load_learned(source) if isinstance(source, (str, os.PathLike)) else source.learned
