# SPDX-License-Identifier: Apache-2.0
"""Checkpoints, from which a stopped render can continue.

The result is identical to the result of an uninterrupted render.

A checkpoint is an uncompressed NumPy archive (.npz). It contains ``header``, which is JSON as
bytes, and the arrays of ``Snapshot.state()``. A checkpoint is first written under a temporary name,
and gets its final name when it is on disk. A complete file therefore exists at any time. Checksums
in the archive detect damage.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wavecomb.errors import WavecombError
from wavecomb.image.files.archive import ArchiveError, read_kind, write_archive
from wavecomb.options import settings as known_settings
from wavecomb.run import aovs as aov_names
from wavecomb.run.stats import plain
from wavecomb.version import version

if TYPE_CHECKING:
    from wavecomb._core import Scene, Settings

FORMAT = 1
_KIND = "wavecomb-checkpoint"

_OPTIONS = {"width": "size", "height": "size", "filter_width": "filter-width"}


@dataclass(frozen=True)
class Checkpoint:
    """Content of a checkpoint file."""

    path: str
    header: dict[str, Any]
    state: dict[str, Any]

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of the render that affect the image, as ``image_settings`` returns them."""
        return dict(self.header["settings"])

    @property
    def source(self) -> dict[str, Any]:
        """Load options of the stage, such as camera, frame, purposes and variants."""
        return dict(self.header["source"])

    @property
    def aovs(self) -> tuple[str, ...]:
        """AOVs of the image, as ``aovs.expand`` returns them."""
        return tuple(self.header["aovs"])

    @property
    def seconds(self) -> float:
        """Render time of all runs that contributed to the checkpoint, in seconds."""
        return float(self.header["seconds"])


def image_settings(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the settings that affect the image.

    The time limit is left out, since it affects only the number of samples.
    """
    rows = known_settings()
    chosen = {
        name: value
        for name, value in settings.items()
        if name not in rows or rows[name].changes_picture
    }
    del chosen["time_limit"]
    if chosen["roulette"] != "cost-aware" and chosen["allocate"] != "efficiency":
        del chosen["costs"]
    if chosen["allocate"] == "even":
        del chosen["allocate"]
    if not (chosen["adaptive"] or chosen["noise"]):
        del chosen["min_spp"]
    return chosen


def make_header(
    scene: Scene,
    settings: Settings,
    *,
    stage: str | None,
    source: Mapping[str, Any],
    aovs: Sequence[str],
) -> dict[str, Any]:
    """Returns the header entries that are equal in all checkpoints of a render."""
    from wavecomb import _core

    return {
        "kind": _KIND,
        "format": FORMAT,
        "version": version(),
        "library": _core.build_info()["library"],
        "stage": stage,
        "source": plain(source),
        "aovs": list(aovs),
        "settings": plain(image_settings(settings.to_dict())),
        "scene": _fingerprint(scene, settings),
    }


def _fingerprint(scene: Scene, settings: Settings) -> dict[str, str]:
    """Returns hashes of the scene's parts that affect the image. Names affect only Cryptomattes."""
    parts = dict(scene.fingerprint())
    if not any(name.startswith("crypto_") for name in settings.aovs):
        parts.pop("names", None)
    return parts


def save_checkpoint(
    path: str | os.PathLike[str], header: Mapping[str, Any], state: Mapping[str, Any]
) -> None:
    """Writes a checkpoint. The file gets its name only when it is complete and on disk."""
    write_archive(path, header, state, durable=True)


def load_checkpoint(path: str | os.PathLike[str]) -> Checkpoint:
    """Reads a file.

    Raises:
        OSError: The file cannot be read.
        WavecombError: The file is not a checkpoint, is damaged, or has another format.
    """
    name = os.fspath(path)
    try:
        advice = "resume with that version, or start anew"
        header, state = read_kind(name, _KIND, FORMAT, "--checkpoint", advice)
        _check_header(header)
        state["pass.target"] = _check_state(state)
    except ArchiveError as error:
        raise WavecombError(f"{name}: is not a checkpoint, or is damaged; start again") from error
    return Checkpoint(name, header, state)


_PARTS: dict[str, tuple[type, ...]] = {
    "version": (str,),
    "library": (str,),
    "stage": (str, type(None)),
    "source": (dict,),
    "aovs": (list,),
    "settings": (dict,),
    "scene": (dict,),
    "seconds": (int, float),
}


def _check_header(header: dict[str, Any]) -> None:
    """Raises ArchiveError if an entry of the header is missing or has a wrong type."""
    for key, types in _PARTS.items():
        if not isinstance(header.get(key, ()), types):
            raise ArchiveError(f"its {key} is invalid")
    texts = [*header["aovs"], *header["scene"].values()]
    if not all(isinstance(text, str) for text in texts):
        raise ArchiveError("its names are not text")
    if not 0 <= header["seconds"] < math.inf:
        raise ArchiveError("its seconds are invalid")
    from wavecomb import _core

    settings = header["settings"]
    known = image_settings(
        {
            **_core.Settings().to_dict(),
            "roulette": "cost-aware",
            "adaptive": 1.0,
            "allocate": "error",
        }
    )
    if not settings.keys() <= known.keys() or not {"width", "height", "spp"} <= settings.keys():
        raise ArchiveError("it has settings that are not known")
    try:
        aov_names.expand(header["aovs"])
        _core.Settings(**settings).check()
    except (TypeError, ValueError, OverflowError, RuntimeError, WavecombError) as error:
        raise ArchiveError(f"its settings are invalid: {error}") from error


def _check_state(state: dict[str, Any]) -> int:
    """Returns the sample count at which the current pass ends.

    Raises ArchiveError if an array has a wrong shape or type.
    """
    if not {"pass.target", "pass.active"} <= state.keys():
        raise ArchiveError("an entry is missing")
    target = state["pass.target"]
    if target.shape != () or target.dtype.kind not in "iu" or not 0 <= int(target) < 1 << 32:
        raise ArchiveError("its pass is not a number")
    for name, array in state.items():
        if name != "pass.target" and (array.dtype != np.uint8 or array.ndim != 1):
            raise ArchiveError(f"its {name} is not an array of bytes")
    return int(target)


def check_replaceable(path: str | os.PathLike[str]) -> None:
    """Raises WavecombError if writing a checkpoint would replace a file of another kind."""
    target = Path(path)
    if not target.is_file() or target.stat().st_size == 0:
        return
    try:
        load_checkpoint(target)
    except WavecombError:
        raise WavecombError(
            f"{os.fspath(path)}: exists and is not a checkpoint; give --checkpoint another name"
        ) from None


def check_fits(checkpoint: Checkpoint, header: Mapping[str, Any]) -> None:
    """Raises WavecombError if a render cannot continue from a checkpoint.

    The message names the difference.

    Args:
        checkpoint: The checkpoint.
        header: Header of the render that should continue from the checkpoint.
    """
    name, old = checkpoint.path, checkpoint.header
    parts = [part for part, key in header["scene"].items() if old["scene"].get(part) != key]
    if parts:
        what = ", ".join(parts[:-1]) + " and " * (len(parts) > 1) + parts[-1]
        raise WavecombError(
            f"{name}: was made of {old['stage'] or 'a scene'} in another state: "
            f"{what} differ{'s' * (len(parts) == 1)}; give the stage as it was, or start anew"
        )
    before, now = dict(old["settings"]), dict(header["settings"])
    _take_more_samples(checkpoint, before, now)
    for key in {**before, **now}:
        if before.get(key) == now.get(key):
            continue
        option = _OPTIONS.get(key, key).replace("_", "-")
        if option == "size":
            was, given = (f"{s['width']} x {s['height']}" for s in (before, now))
        else:
            was, given = (_shown(s.get(key)) for s in (before, now))
        raise WavecombError(
            f"{name}: was made with {option} {was}, and this render has {given}; "
            "give that, or start anew"
        )


def build_note(checkpoint: Checkpoint, header: Mapping[str, Any]) -> str | None:
    """Returns a warning if another build wrote the checkpoint, since the last bits may differ."""
    for key in ("version", "library"):
        if checkpoint.header[key] != header[key]:
            return (
                f"{checkpoint.path}: was made by another build ({key} "
                f"{checkpoint.header[key]}, now {header[key]}); the image may differ in last bits"
            )
    return None


def _take_more_samples(checkpoint: Checkpoint, before: dict[str, Any], now: dict[str, Any]) -> None:
    """Allows a render with the same sample count in all pixels to continue with a new ``spp``."""
    if any(before.get(name) for name in ("adaptive", "noise", "allocate")):
        return
    if now["spp"] >= checkpoint.state["pass.target"]:
        before["spp"] = now["spp"]


def _shown(value: Any) -> str:
    return "none" if value is None else str(value)
