# SPDX-License-Identifier: Apache-2.0
"""Selects the native library: in a portable build, the best one for this CPU.

A portable build (docs/building.md) has ``wavecomb/lib/<isa>/_core`` for each instruction set, and
``wavecomb/_cpu``, which detects the CPU's instruction sets. The first import of ``wavecomb._core``
loads the best library. The environment variable ``WAVECOMB_ISA`` selects another library.
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
"""Supported instruction sets, best first."""

VARIABLE = "WAVECOMB_ISA"
CORE = "wavecomb._core"


def choose(built: Sequence[str], runnable: Sequence[str], forced: str | None = None) -> str:
    """Returns the instruction set whose library is to be loaded.

    Args:
        built: Instruction sets with a library; not empty.
        runnable: Instruction sets of this CPU.
        forced: Instruction set that the user requests, if any.

    Raises:
        WavecombError: ``forced`` is unknown, not built or not supported by this CPU, or this CPU
            supports no library.
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
    """Returns the library of each instruction set that was built, best first.

    Args:
        places: Folders of the package, as in ``wavecomb.__path__``.
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
    """Returns instruction set and file of ``wavecomb._core``; None in a build with one library.

    Raises:
        WavecombError: ``choose`` fails, or ``WAVECOMB_ISA`` is set in a build with one library.
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
    """Returns ``library`` (its name), ``isa``, ``lanes`` and ``built`` (all libraries).

    Raises:
        ImportError: There is no library, or it is broken.
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
    """Returns ``library_info`` as one line of text."""
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
    """Import finder for ``wavecomb._core``, and for nothing else."""

    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Finds a module; part of the interface of ``sys.meta_path``."""
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
