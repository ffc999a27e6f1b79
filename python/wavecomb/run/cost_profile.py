# SPDX-License-Identifier: Apache-2.0
"""Cost profiles: the time to shade a hit with each material, as initial values of later renders."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError
from wavecomb.image.files.output_file import check_regular, reason, replacing

SCHEMA = "wavecomb-costs/1"

Profile = dict[str, dict[str, float]]


def load_costs(path: str | os.PathLike[str]) -> Profile:
    """Reads a cost profile of the form {"materials": {name: ns}, "textures": {name: ns}}.

    Raises:
        WavecombError: The file cannot be read, or is not a cost profile.
        OSError: The file is not a regular file.
    """
    name = os.fspath(path)
    check_regular(path)
    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise WavecombError(f"{name}: cannot be read: {reason(error)}") from error
    except (ValueError, RecursionError) as error:
        raise WavecombError(f"{name}: is not a cost profile: {error}") from error
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise WavecombError(f"{name}: is not a cost profile: no schema {SCHEMA}")
    return check_costs(document, name)


def check_costs(profile: Mapping[str, Any], name: str = "costs") -> Profile:
    """Returns a valid cost profile with all numbers converted to floats.

    Raises:
        WavecombError: The structure of the cost profile or one of its numbers is invalid.
    """
    checked: Profile = {}
    for kind in ("materials", "textures"):
        entries = profile.get(kind)
        if not isinstance(entries, Mapping):
            raise WavecombError(f"{name}: is not a cost profile: {kind} is not a table")
        checked[kind] = {}
        for key, value in entries.items():
            good = isinstance(value, (int, float)) and not isinstance(value, bool)
            if not (good and math.isfinite(value) and 0.0 <= value <= 1e12):
                raise WavecombError(
                    f"{name}: is not a cost profile: cost of {key!s:.80} is {value!r:.80}; "
                    "it must be nanoseconds, from 0 to 1e12"
                )
            checked[kind][str(key)] = float(value)
    return checked


def save_costs(path: str | os.PathLike[str], profile: Mapping[str, Mapping[str, float]]) -> None:
    """Writes a cost profile atomically.

    >>> save_costs("mixed-costs.json", picture.costs)  # doctest: +SKIP
    """
    document = {"schema": SCHEMA, **check_costs(profile, "costs")}
    with replacing(path) as part:
        part.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
