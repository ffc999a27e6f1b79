# SPDX-License-Identifier: Apache-2.0 Adds the Python module wavecomb._core and the libraries that
# are installed with it. All install rules belong to the component `python`, and their destinations
# are relative to site-packages.
#
# Without WAVECOMB_ISAS, there is one module, wavecomb/_core. With WAVECOMB_ISAS, each instruction
# set has a module wavecomb/lib/<isa>/_core. The module wavecomb/_cpu reports the instruction sets
# that the CPU supports, and python/wavecomb/isa.py chooses the module to load.

execute_process(COMMAND "${Python_EXECUTABLE}" -m nanobind --cmake_dir
  OUTPUT_VARIABLE nanobind_ROOT OUTPUT_STRIP_TRAILING_WHITESPACE)
find_package(nanobind CONFIG REQUIRED)

# The module uses Python's stable ABI, so that it works with all Python versions from 3.10. It loads
# nanobind from the wheel nanobind-backend. With libc++ a stable-ABI module works on macOS only (see
# nb_defs.h). With libc++ on other systems, nanobind is linked statically, and the module works only
# with the Python version that it was built for.
check_cxx_source_compiles("#include <version>
#ifndef _LIBCPP_VERSION
#error no
#endif
int main() { return 0; }" WAVECOMB_HAS_LIBCXX)
set(WAVECOMB_PYTHON_ABI 3.10)
if(WAVECOMB_HAS_LIBCXX AND NOT APPLE)
  set(WAVECOMB_PYTHON_ABI "")
endif()

# wavecomb_nanobind_module(NAME ARGUMENTS...) calls nanobind_add_module, with the stable ABI unless
# WAVECOMB_PYTHON_ABI is empty.
function(wavecomb_nanobind_module name)
  if(WAVECOMB_PYTHON_ABI)
    nanobind_add_module(${name} BACKEND_MODULE nanobind_backend STABLE_ABI_VERSION ${WAVECOMB_PYTHON_ABI}
      NB_SUPPRESS_WARNINGS ${ARGN})
    set_target_properties(${name} PROPERTIES SUFFIX ".abi3${CMAKE_SHARED_MODULE_SUFFIX}")
  else()
    nanobind_add_module(${name} NB_STATIC NB_SUPPRESS_WARNINGS ${ARGN})
  endif()
endfunction()

file(GLOB binding_sources CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/bindings/*.cpp")
if(NOT binding_sources)
  message(FATAL_ERROR "bindings/ holds no *.cpp: there is no Python module to build.")
endif()
# Unity batches (WAVECOMB_BATCH). render.cpp reuses local names of other sources.
foreach(_group IN ITEMS "camera;geometry;lights;materials;meshes" "graphs;scene;scene_values;settings;volumes"
    "module;recording;renderer;statistics;watching")
  list(GET _group 0 _name)
  list(TRANSFORM _group REPLACE "(.+)" "${PROJECT_SOURCE_DIR}/bindings/\\1.cpp")
  set_source_files_properties(${_group} PROPERTIES UNITY_GROUP ${_name})
endforeach()

# If Embree is neither in .deps/embree nor in a system folder (embree_ROOT names its folder), the
# module needs an rpath to find it.
set(_embree_rpath "")
if(NOT WAVECOMB_EMBREE_IS_STAGED)
  get_target_property(_embree_library embree LOCATION)
  get_filename_component(_embree_folder "${_embree_library}" DIRECTORY)
  get_filename_component(_embree_folder "${_embree_folder}" REALPATH)
  if(_embree_library AND NOT _embree_folder IN_LIST CMAKE_CXX_IMPLICIT_LINK_DIRECTORIES)
    set(_embree_rpath "${_embree_folder}")
  endif()
endif()

# Install the OpenSubdiv library with the module, since no wheel provides it. The OpenMP runtime is
# also installed if OpenSubdiv is linked with it.
get_filename_component(_osd_library "${OpenSubdiv_LIBRARY}" REALPATH)
set(_osd_link "")
if(OpenSubdiv_NEEDS_OPENMP AND CMAKE_SYSTEM_NAME STREQUAL "Linux")
  execute_process(COMMAND "${CMAKE_CXX_COMPILER}" -print-file-name=libgomp.so.1
    OUTPUT_VARIABLE _gomp_library OUTPUT_STRIP_TRAILING_WHITESPACE)
  # Link the module with the OpenMP runtime, so that the module's rpath finds the runtime before
  # OpenSubdiv is loaded, which needs it.
  set(_osd_link "-Wl,--push-state,--no-as-needed" gomp "-Wl,--pop-state")
endif()

# wavecomb_add_module(NAME CORE FLAGS FOLDER) adds the Python module wavecomb/FOLDER/_core, which
# uses the core library CORE.
function(wavecomb_add_module name core flags folder)
  wavecomb_nanobind_module(${name} ${binding_sources})
  target_compile_definitions(${name} PRIVATE WAVECOMB_VERSION="${PROJECT_VERSION}")
  target_link_libraries(${name} PRIVATE ${core} ${flags} TBB::tbb ${_osd_link})
  target_precompile_headers(${name} PRIVATE ${wavecomb_pch} <nanobind/nanobind.h> <nanobind/ndarray.h>)
  # Export only the entry point of the module, so that other libraries never call functions that
  # were compiled for this instruction set.
  if(CMAKE_SYSTEM_NAME STREQUAL "Linux")
    target_link_options(${name} PRIVATE "-Wl,--version-script=${PROJECT_SOURCE_DIR}/cmake/python_exports.map")
    set_property(TARGET ${name} APPEND PROPERTY LINK_DEPENDS "${PROJECT_SOURCE_DIR}/cmake/python_exports.map")
  endif()
  # The rpath of the installed module contains site-packages/wavecomb/lib, which holds the installed
  # libraries, and <venv>/lib, where the tbb wheel installs libtbb.so.12 (left out if the
  # distribution's oneTBB is used). In the build directory, the rpath lists the folders of the
  # linked libraries.
  string(REGEX REPLACE "[^/]+" ".." up "${folder}")
  if(up)
    string(APPEND up "/")
  endif()
  set(rpath "$ORIGIN" "$ORIGIN/${up}lib")
  if(WAVECOMB_TBB_IS_WHEEL)
    list(APPEND rpath "$ORIGIN/${up}../../..")
  endif()
  list(APPEND rpath ${_embree_rpath})
  set_target_properties(${name} PROPERTIES UNITY_BUILD ${WAVECOMB_BATCH} UNITY_BUILD_MODE GROUP
    OUTPUT_NAME _core
    LIBRARY_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/${folder}"
    INSTALL_RPATH "${rpath}"
    INSTALL_RPATH_USE_LINK_PATH OFF)
  install(TARGETS ${name} LIBRARY DESTINATION "wavecomb/${folder}" COMPONENT python)
endfunction()

if(WAVECOMB_ISAS)
  include(cmake/WavecombIsas.cmake)
else()
  wavecomb_add_module(wavecomb_python wavecomb_core wavecomb_private "")
  # The target wavecomb_stub generates a stub file from the module, for comparison with
  # python/wavecomb/_core.pyi.
  nanobind_add_stub(wavecomb_stub EXCLUDE_FROM_ALL MODULE _core OUTPUT "${PROJECT_BINARY_DIR}/_core.pyi"
    PYTHON_PATH $<TARGET_FILE_DIR:wavecomb_python> DEPENDS wavecomb_python)
  if(BUILD_SHARED_LIBS)
    install(TARGETS wavecomb_core LIBRARY DESTINATION wavecomb/lib NAMELINK_SKIP COMPONENT python)
  endif()
endif()

if(NOT OpenSubdiv_SOURCE)
  install(PROGRAMS "${_osd_library}" DESTINATION wavecomb/lib COMPONENT python)
endif()
if(IS_ABSOLUTE "${_gomp_library}")
  get_filename_component(_gomp_library "${_gomp_library}" REALPATH)
  install(PROGRAMS "${_gomp_library}" DESTINATION wavecomb/lib RENAME libgomp.so.1 COMPONENT python)
endif()
if(WAVECOMB_EMBREE_IS_STAGED)
  install(FILES "${WAVECOMB_STAGED_EMBREE}/lib/libembree4.so.4" DESTINATION wavecomb/lib
    PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE
    COMPONENT python)
endif()

if(OpenVDB_FOUND)
  include(cmake/WavecombVdb.cmake)
endif()
