# SPDX-License-Identifier: Apache-2.0
# OpenSubdiv's CPU library as the target OpenSubdiv::osdCPU. By its files: the CMake package of Debian 12 and
# Ubuntu names static libraries that are not installed.
#
# OpenSubdiv_ROOT leads to it where it is elsewhere. OpenSubdiv_NEEDS_OPENMP: it is linked with libgomp.
find_path(OpenSubdiv_INCLUDE_DIR opensubdiv/far/primvarRefiner.h)
find_library(OpenSubdiv_LIBRARY osdCPU)
if(OpenSubdiv_INCLUDE_DIR)
  file(STRINGS "${OpenSubdiv_INCLUDE_DIR}/opensubdiv/version.h" OpenSubdiv_VERSION
    REGEX "define +OPENSUBDIV_VERSION +v[0-9_]+")
  string(REGEX MATCH "[0-9]+_[0-9]+_[0-9]+" OpenSubdiv_VERSION "${OpenSubdiv_VERSION}")
  string(REPLACE "_" "." OpenSubdiv_VERSION "${OpenSubdiv_VERSION}")
endif()
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenSubdiv REQUIRED_VARS OpenSubdiv_LIBRARY OpenSubdiv_INCLUDE_DIR
  VERSION_VAR OpenSubdiv_VERSION)
mark_as_advanced(OpenSubdiv_INCLUDE_DIR OpenSubdiv_LIBRARY)
if(OpenSubdiv_FOUND)
  file(STRINGS "${OpenSubdiv_LIBRARY}" _osd_openmp REGEX "libgomp\\.so\\.1")
  set(OpenSubdiv_NEEDS_OPENMP FALSE)
  if(_osd_openmp)
    set(OpenSubdiv_NEEDS_OPENMP TRUE)
  endif()
  if(NOT TARGET OpenSubdiv::osdCPU)
    add_library(OpenSubdiv::osdCPU UNKNOWN IMPORTED)
    set_target_properties(OpenSubdiv::osdCPU PROPERTIES
      IMPORTED_LOCATION "${OpenSubdiv_LIBRARY}"
      INTERFACE_INCLUDE_DIRECTORIES "${OpenSubdiv_INCLUDE_DIR}")
  endif()
endif()
