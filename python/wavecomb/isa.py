# SPDX-License-Identifier: Apache-2.0
"""Which native library is used: the only one, or in a portable build the best that this CPU runs.

A portable build (docs/building.md) brings ``wavecomb/lib/<isa>/_core`` for each instruction set,
and ``wavecomb/_cpu``, which says what this CPU runs. ``wavecomb._core`` is then the best of them,
chosen when it is first imported. The environment variable ``WAVECOMB_ISA`` names another.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib.machinery import (
    EXTENSION_SUFFIXES,
    ExtensionFileLoader,
    ModuleSpec,
)
from importlib.util import spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from wavecomb.errors import WavecombError

ISAS = ("x86-64-v4", "x86-64-v3", "x86-64-v2", "armv8-a")
"""Instruction sets that there may be a library for, best first."""

VARIABLE = "WAVECOMB_ISA"
CORE = "wavecomb._core"


def choose(built: Sequence[str], runnable: Sequence[str], forced: str | None = None) -> str:
    """The instruction set whose library is to be loaded.

    Args:
        built: Those that there is a library for; not empty.
        runnable: Those that this CPU runs.
        forced: The one that the user wants, if any.

    Raises:
        WavecombError: ``forced`` is unknown, not built or not for this CPU; or no library is.
    """
    there_are = ", ".join(isa for isa in ISAS if isa in built)
    if forced:
        if forced not in ISAS:
            raise WavecombError(f"{VARIABLE}: {forced} is unknown; there are {there_are}")
        if forced not in built:
            raise WavecombError(f"{VARIABLE}: {forced} was not built; there are {there_are}")
        if forced not in runnable:
            best = next((isa for isa in ISAS if isa in built and isa in runnable), None)
            do = f"{best} is the best that it runs" if best else "build Wavecomb on this machine"
            raise WavecombError(f"{VARIABLE}: this CPU does not run {forced}; {do}")
        return forced
    for isa in ISAS:
        if isa in built and isa in runnable:
            return isa
    raise WavecombError(
        f"this CPU runs none of the libraries of this build, {there_are}; build Wavecomb on this "
        "machine (`make build`)"
    )


def libraries(places: Sequence[str]) -> dict[str, Path]:
    """The library of each instruction set that was built, best first.

    Args:
        places: Directories of the package, as ``wavecomb.__path__``.
    """
    found: dict[str, Path] = {}
    for isa in ISAS:
        for place in places:
            for suffix in EXTENSION_SUFFIXES:
                path = Path(place, "lib", isa, f"_core{suffix}")
                if isa not in found and path.is_file():
                    found[isa] = path
    return found


def chosen_library(places: Sequence[str]) -> tuple[str, Path] | None:
    """Instruction set and file that ``wavecomb._core`` is, or None in a build of one library.

    Raises:
        WavecombError: As choose(); or ``WAVECOMB_ISA`` is set where there is nothing to choose.
    """
    built, forced = libraries(places), os.environ.get(VARIABLE)
    if not built:
        if forced:
            raise WavecombError(
                f"{VARIABLE}: {forced} was not built; this build has one library, for the machine "
                f"that it was built on (unset {VARIABLE}, or see docs/building.md for more)"
            )
        return None
    from wavecomb import _cpu

    isa = choose(list(built), _cpu.isas(), forced)
    return isa, built[isa]


def library_info() -> dict[str, Any]:
    """The library in use: ``library`` (its name), ``isa``, ``lanes``, and ``built``, all there are.

    Raises:
        ImportError: There is none, or it is broken.
        WavecombError: As chosen_library().
    """
    import wavecomb
    from wavecomb import _core

    info = _core.build_info()
    return {
        "library": info["library"],
        "isa": info["isa"],
        "lanes": list(_core.lane_widths()),
        "built": list(libraries(wavecomb.__path__)) or [info["library"]],
    }


def library_text() -> str:
    """The same for people, in one line."""
    info = library_info()
    lanes = ", ".join(str(width) for width in info["lanes"])
    of = f" of {', '.join(info['built'])}" if len(info["built"]) > 1 else ""
    return f"library {info['library']}{of}: {info['isa']}, lanes {lanes}"


class Finder:
    """Finds ``wavecomb._core`` among the libraries of a portable build, and nothing else."""

    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """What ``import`` asks."""
        if name != CORE or path is None:
            return None
        chosen = chosen_library(path)
        if chosen is None:
            return None
        file = str(chosen[1])
        # The name decides what the module calls itself and its classes; the folder does not show.
        return spec_from_file_location(name, file, loader=ExtensionFileLoader(name, file))


def install() -> None:
    """Makes ``import wavecomb._core`` ask the Finder first."""
    if Finder not in sys.meta_path:
        sys.meta_path.insert(0, Finder)
