# SPDX-License-Identifier: Apache-2.0
# Finds Embree 4, oneTBB, OpenSubdiv, Dr.Jit's headers, Python, and optionally OpenVDB.
#
# Embree comes from a package of the Linux distribution, or else from .deps/embree, where
# tools/setup_embree installs it. The distribution's Embree is used with the distribution's oneTBB,
# and the Embree in .deps/embree with the oneTBB of the Python wheels tbb and tbb-devel, so that a
# process has only one copy of oneTBB.

if(NOT DEFINED Python_EXECUTABLE AND EXISTS "${PROJECT_SOURCE_DIR}/.venv/bin/python")
  set(Python_EXECUTABLE "${PROJECT_SOURCE_DIR}/.venv/bin/python")
endif()
set(_python_components Interpreter)
if(WAVECOMB_PYTHON)
  list(APPEND _python_components Development.Module)
endif()
find_package(Python 3.10 REQUIRED COMPONENTS ${_python_components})

execute_process(
  COMMAND "${Python_EXECUTABLE}" "${PROJECT_SOURCE_DIR}/cmake/python_hints.py"
  OUTPUT_VARIABLE _hints
  OUTPUT_STRIP_TRAILING_WHITESPACE
  RESULT_VARIABLE _hints_result)
if(_hints_result EQUAL 0)
  list(GET _hints 0 _hint_drjit)
  list(GET _hints 1 _hint_tbb)
endif()

set(DRJIT_INCLUDE_DIR "" CACHE PATH "Directory that holds drjit/packet.h (default: the drjit wheel's)")
if(DRJIT_INCLUDE_DIR)
  set(WAVECOMB_DRJIT_INCLUDE_DIR "${DRJIT_INCLUDE_DIR}")
else()
  set(WAVECOMB_DRJIT_INCLUDE_DIR "${_hint_drjit}")
endif()
if(NOT EXISTS "${WAVECOMB_DRJIT_INCLUDE_DIR}/drjit/packet.h")
  message(FATAL_ERROR "Dr.Jit's headers were not found for ${Python_EXECUTABLE}: "
    "pip install 'drjit==1.5.*', or pass -DDRJIT_INCLUDE_DIR=<directory that holds drjit/packet.h>.")
endif()

set(WAVECOMB_STAGED_EMBREE "${PROJECT_SOURCE_DIR}/.deps/embree")
find_package(embree 4 CONFIG QUIET)
if(NOT embree_FOUND)
  list(APPEND CMAKE_PREFIX_PATH "${WAVECOMB_STAGED_EMBREE}")
  find_package(embree 4 CONFIG QUIET)
endif()
if(NOT embree_FOUND)
  message(FATAL_ERROR "Embree 4 was not found. Install your distribution's package (libembree-dev, "
    "embree-devel) where it is version 4, else run tools/setup_embree, or pass -Dembree_DIR=.")
endif()
string(FIND "${embree_DIR}" "${WAVECOMB_STAGED_EMBREE}/" _at)
if(_at EQUAL 0)
  set(WAVECOMB_EMBREE_IS_STAGED TRUE)
else()
  set(WAVECOMB_EMBREE_IS_STAGED FALSE)
endif()

# Debug builds also use oneTBB's release library, since Embree loads it, and a process needs a
# single copy of oneTBB.
set(TBB_FIND_RELEASE_ONLY ON)
if(WAVECOMB_EMBREE_IS_STAGED)
  find_package(TBB CONFIG QUIET COMPONENTS tbb PATHS "${_hint_tbb}" NO_DEFAULT_PATH)
else()
  # Ignore PATH, which may contain the bin directory of a Python environment with another oneTBB.
  find_package(TBB CONFIG QUIET COMPONENTS tbb NO_SYSTEM_ENVIRONMENT_PATH NO_CMAKE_ENVIRONMENT_PATH)
endif()
if(NOT TBB_FOUND)
  find_package(TBB CONFIG QUIET COMPONENTS tbb HINTS "${_hint_tbb}")
endif()
if(NOT TBB_FOUND)
  message(FATAL_ERROR "oneTBB was not found: pip install tbb-devel, or install your distribution's "
    "package (libtbb-dev, tbb-devel), or pass -DTBB_DIR=.")
endif()

if(_hint_tbb AND TBB_DIR STREQUAL _hint_tbb)
  set(WAVECOMB_TBB_IS_WHEEL TRUE)
else()
  set(WAVECOMB_TBB_IS_WHEEL FALSE)
endif()

# Wavecomb uses OpenSubdiv's libraries Far and Sdc, but not its evaluators or its OpenGL support.
list(APPEND CMAKE_MODULE_PATH "${PROJECT_SOURCE_DIR}/cmake")
find_package(OpenSubdiv 3.4 MODULE QUIET)
if(NOT OpenSubdiv_FOUND)
  message(FATAL_ERROR "OpenSubdiv 3.4 or newer was not found: run tools/setup, or install your distribution's "
    "package (libosd-dev, opensubdiv-devel, opensubdiv), or pass -DOpenSubdiv_ROOT=.")
endif()

# The plug-in that reads volumes (WavecombVdb.cmake) needs OpenVDB. OpenVDB must use the same copy
# of oneTBB as Embree, so both come from the Linux distribution, or both from .deps.
option(WAVECOMB_VDB "Python: build the plug-in that reads volumes, where OpenVDB is found" ON)
set(WAVECOMB_STAGED_OPENVDB "${PROJECT_SOURCE_DIR}/.deps/openvdb")
if(WAVECOMB_PYTHON AND WAVECOMB_VDB)
  if(WAVECOMB_EMBREE_IS_STAGED AND NOT OpenVDB_ROOT)
    set(OpenVDB_ROOT "${WAVECOMB_STAGED_OPENVDB}")
  endif()
  find_package(OpenVDB MODULE QUIET)
  if(NOT OpenVDB_FOUND)
    message(STATUS "No OpenVDB: volumes will not be read (tools/setup_openvdb stages it)")
  endif()
endif()

message(STATUS "Embree ${embree_VERSION} (${embree_DIR})")
message(STATUS "oneTBB ${TBB_VERSION} (${TBB_DIR})")
message(STATUS "OpenSubdiv ${OpenSubdiv_VERSION} (${OpenSubdiv_LIBRARY})")
message(STATUS "Dr.Jit (${WAVECOMB_DRJIT_INCLUDE_DIR})")
