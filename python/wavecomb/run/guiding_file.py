# SPDX-License-Identifier: Apache-2.0
"""Files with the guiding field of a render, from which later renders can start.

A file contains a guiding field in the form in which checkpoints store it. A guiding field can be
used for scenes with the same number of materials. If geometry or lighting has changed, guiding is
less effective, but the image is still unbiased.
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
"""Option value that is used in place of a file name. Each frame then starts from the guiding field
of the previous frame."""
ENDING = ".learned"
_KIND = "wavecomb-learned"
_FORMAT = 1


class _HasLearned(Protocol):
    @property
    def learned(self) -> bytes: ...


@dataclass
class Learning:
    """Initial guiding field for the renders of a command.

    Attributes:
        given: Initial guiding field; None means that renders start without one.
        follows: Whether each render starts from the guiding field of the previous render.
        last: Guiding field after the last render, or the initial field before any render.
    """

    given: bytes | None = None
    follows: bool = False
    last: bytes = b""

    def take(self, result: _HasLearned) -> None:
        """Stores the guiding field of a finished render."""
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
    """Writes the guiding field of a render to a file.

    Raises:
        OSError: The file cannot be written.
        WavecombError: The render has no guiding field, because guiding was off or the render was
            too short.
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
        WavecombError: The file is damaged, or has another kind or format.
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
    """Returns the guiding field of a file or a picture. Returns None if ``source`` is None."""
    if source is None or isinstance(source, bytes):
        return source
    return load_learned(source) if isinstance(source, (str, os.PathLike)) else source.learned
