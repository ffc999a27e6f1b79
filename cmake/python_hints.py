# SPDX-License-Identifier: Apache-2.0
"""Prints the locations of build inputs that come from wheels.

Output is one line: Dr.Jit's include directory and the directory of oneTBB's CMake config,
separated by ';'. An empty string stands for a directory that was not found. The script imports no
packages, so it is fast and also works in isolated builds.
"""

import importlib.metadata
import importlib.util
import pathlib


def drjit_include() -> str:
    """Returns the include directory of the drjit wheel, or ''."""
    spec = importlib.util.find_spec("drjit")
    for place in (spec.submodule_search_locations or []) if spec else []:
        include = pathlib.Path(place) / "include"
        if (include / "drjit" / "packet.h").is_file():
            return include.as_posix()
    return ""


def tbb_cmake() -> str:
    """Returns the directory of TBBConfig.cmake of the tbb-devel wheel, or ''."""
    try:
        files = importlib.metadata.distribution("tbb-devel").files or []
    except importlib.metadata.PackageNotFoundError:
        return ""
    for file in files:
        if file.name == "TBBConfig.cmake":
            return pathlib.Path(file.locate()).resolve().parent.as_posix()
    return ""


print(drjit_include(), tbb_cmake(), sep=";")
