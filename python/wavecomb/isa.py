# SPDX-License-Identifier: Apache-2.0
"""Selects the native library ``wavecomb._core`` that fits this CPU best.

A portable build (docs/building.md) has ``wavecomb/lib/<isa>/_core`` for each instruction set, and
``wavecomb/_cpu``, which detects the CPU's instruction sets. The first import of ``wavecomb._core``
loads the best library that this CPU supports. The environment variable ``WAVECOMB_ISA`` selects
another instruction set.
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

from wavecomb.errors import WavecombError, join_core

ISAS = ("x86-64-v4", "x86-64-v3", "x86-64-v2", "armv8-a")
"""Supported instruction sets, from best to worst."""

VARIABLE = "WAVECOMB_ISA"
CORE = "wavecomb._core"


def choose(built: Sequence[str], runnable: Sequence[str], forced: str | None = None) -> str:
    """Returns the instruction set whose library will be loaded.

    Args:
        built: Instruction sets for which there is a library; at least one.
        runnable: Instruction sets that this CPU supports.
        forced: Instruction set that the user requests, or None.

    Raises:
        WavecombError: ``forced`` is unknown, was not built or is not supported by this CPU, or this
            CPU supports none of the libraries.
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
    """Returns the library of each instruction set that was built, from best to worst.

    Args:
        places: Folders of the package ``wavecomb``, as in ``wavecomb.__path__``.
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
    """Returns the instruction set and file of ``wavecomb._core``.

    Returns None if the build has only one library.

    Raises:
        WavecombError: The library that ``WAVECOMB_ISA`` names is not available, or this CPU
            supports none of the libraries.
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
    """Returns a dictionary that describes the loaded library.

    ``library`` is the name of the library, ``isa`` its instruction set and ``lanes`` its SIMD
    widths. ``built`` lists all libraries of the build.

    Raises:
        ImportError: The library is missing or damaged.
        WavecombError: ``chosen_library`` fails.
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
    """Returns the entries of ``library_info`` as one line of text."""
    info = library_info()
    lanes = ", ".join(str(width) for width in info["lanes"])
    of = f" of {', '.join(info['built'])}" if len(info["built"]) > 1 else ""
    return f"library {info['library']}{of}: {info['isa']}, lanes {lanes}"


class CoreLoader(ExtensionFileLoader):
    """Loader of ``wavecomb._core`` that makes its errors subclasses of ``wavecomb.Error``."""

    def exec_module(self, module: ModuleType) -> None:
        """Initializes the module."""
        super().exec_module(module)
        join_core(module)


class Finder:
    """Import finder that handles only the module ``wavecomb._core``."""

    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Returns the spec of ``wavecomb._core``, or None.

        Part of the interface of ``sys.meta_path``.
        """
        if name != CORE or path is None:
            return None
        chosen = chosen_library(path)
        if chosen is not None:
            file: str | None = str(chosen[1])
        else:
            others = (one for one in sys.meta_path if one is not Finder)
            found = (one.find_spec(name, path, target) for one in others)
            file = next((spec.origin for spec in found if spec is not None), None)
            if file is not None and os.path.dirname(file) not in path:
                return None
        if file is None or not file.endswith(tuple(EXTENSION_SUFFIXES)):
            return None
        # Load the module under its usual name, so that the names of its classes do not contain the
        # instruction set.
        return spec_from_file_location(name, file, loader=CoreLoader(name, file))


def install() -> None:
    """Registers the finder, so that it handles ``import wavecomb._core``."""
    if Finder not in sys.meta_path:
        sys.meta_path.insert(0, Finder)
