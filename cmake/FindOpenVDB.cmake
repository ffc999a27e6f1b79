# SPDX-License-Identifier: Apache-2.0 Defines the target OpenVDB::openvdb. Searches for header and
# library files, because OpenVDB's own CMake module requires the packages of Boost and Imath, which
# Wavecomb does not need.
#
# OpenVDB_ROOT: if set, the only folder to search.
set(_vdb_where "")
if(OpenVDB_ROOT)
  set(_vdb_where PATHS "${OpenVDB_ROOT}" PATH_SUFFIXES include lib NO_DEFAULT_PATH)
endif()
find_path(OpenVDB_INCLUDE_DIR openvdb/openvdb.h ${_vdb_where})
find_library(OpenVDB_LIBRARY openvdb ${_vdb_where})
# OpenVDB's headers use a table of the Imath library to convert 16-bit floats.
find_library(OpenVDB_IMATH_LIBRARY Imath ${_vdb_where})
if(OpenVDB_INCLUDE_DIR)
  file(STRINGS "${OpenVDB_INCLUDE_DIR}/openvdb/version.h" OpenVDB_VERSION
    REGEX "define +OPENVDB_LIBRARY_VERSION_STRING ")
  string(REGEX MATCH "[0-9]+\\.[0-9]+\\.[0-9]+" OpenVDB_VERSION "${OpenVDB_VERSION}")
endif()
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenVDB REQUIRED_VARS OpenVDB_LIBRARY OpenVDB_INCLUDE_DIR
  VERSION_VAR OpenVDB_VERSION)
mark_as_advanced(OpenVDB_INCLUDE_DIR OpenVDB_LIBRARY OpenVDB_IMATH_LIBRARY)
if(OpenVDB_FOUND AND NOT TARGET OpenVDB::openvdb)
  add_library(OpenVDB::openvdb UNKNOWN IMPORTED)
  set_target_properties(OpenVDB::openvdb PROPERTIES
    IMPORTED_LOCATION "${OpenVDB_LIBRARY}"
    INTERFACE_INCLUDE_DIRECTORIES "${OpenVDB_INCLUDE_DIR}")
  if(OpenVDB_IMATH_LIBRARY)
    set_property(TARGET OpenVDB::openvdb PROPERTY INTERFACE_LINK_LIBRARIES "${OpenVDB_IMATH_LIBRARY}")
  endif()
endif()
