# SPDX-License-Identifier: Apache-2.0
# Adds the Python module wavecomb._vdb, which reads volumes with OpenVDB, in the install component
# `python`. The module does not depend on the core, so one module serves all instruction sets.
message(STATUS "OpenVDB ${OpenVDB_VERSION} (${OpenVDB_LIBRARY})")

file(GLOB _vdb_sources CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/bindings/vdb/*.cpp")
wavecomb_nanobind_module(wavecomb_vdb NOMINSIZE ${_vdb_sources})
target_link_libraries(wavecomb_vdb PRIVATE wavecomb_common OpenVDB::openvdb TBB::tbb)
set(_vdb_rpath "$ORIGIN" "$ORIGIN/lib")
if(WAVECOMB_TBB_IS_WHEEL)
  list(APPEND _vdb_rpath "$ORIGIN/../../..")
endif()
# Two unity batches: sources that include OpenVDB's headers, and all others.
foreach(_source IN LISTS _vdb_sources)
  set(_group plain)
  if(_source MATCHES "/(archive|chunks|open_tree|writing)\\.cpp$")
    set(_group openvdb)
  endif()
  set_source_files_properties("${_source}" PROPERTIES UNITY_GROUP ${_group})
endforeach()
set_target_properties(wavecomb_vdb PROPERTIES UNITY_BUILD ${WAVECOMB_BATCH} UNITY_BUILD_MODE GROUP
  OUTPUT_NAME _vdb
  LIBRARY_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}"
  INSTALL_RPATH "${_vdb_rpath}"
  INSTALL_RPATH_USE_LINK_PATH OFF)
if(CMAKE_SYSTEM_NAME STREQUAL "Linux")
  # Use DT_RPATH, since DT_RUNPATH does not apply to the libraries that OpenVDB depends on.
  target_link_options(wavecomb_vdb PRIVATE "-Wl,--version-script=${PROJECT_SOURCE_DIR}/cmake/vdb_exports.map"
    "-Wl,--disable-new-dtags")
  set_property(TARGET wavecomb_vdb APPEND PROPERTY LINK_DEPENDS "${PROJECT_SOURCE_DIR}/cmake/vdb_exports.map")
endif()
install(TARGETS wavecomb_vdb LIBRARY DESTINATION wavecomb COMPONENT python)
add_dependencies(wavecomb_python wavecomb_vdb)

# If OpenVDB comes from .deps/openvdb, install its libraries with the module.
string(FIND "${OpenVDB_LIBRARY}" "${WAVECOMB_STAGED_OPENVDB}/" _at)
if(_at EQUAL 0)
  install(DIRECTORY "${WAVECOMB_STAGED_OPENVDB}/lib/" DESTINATION wavecomb/lib COMPONENT python
    USE_SOURCE_PERMISSIONS
    PATTERN "libopenvdb.so" EXCLUDE PATTERN "libImath.so" EXCLUDE)
endif()
