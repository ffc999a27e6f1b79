# SPDX-License-Identifier: Apache-2.0
# Defines the target OpenSubdiv::osdCPU, OpenSubdiv's CPU library. Searches for files, because the
# CMake package of Debian 12 and Ubuntu refers to static libraries that it does not install.
#
# OpenSubdiv_ROOT: an additional folder to search. OpenSubdiv_NEEDS_OPENMP: whether the library is
# linked with libgomp. OpenSubdiv_SOURCE: folder of OpenSubdiv's source code. If set, the required
# parts of OpenSubdiv are compiled with Wavecomb's flags. Builds for another CPU or standard library
# than the Linux distribution's need this.

# _osd_version(FOLDER): sets OpenSubdiv_VERSION from the headers in FOLDER.
function(_osd_version folder)
  file(STRINGS "${folder}/opensubdiv/version.h" version REGEX "define +OPENSUBDIV_VERSION +v[0-9_]+")
  string(REGEX MATCH "[0-9]+_[0-9]+_[0-9]+" version "${version}")
  string(REPLACE "_" "." version "${version}")
  set(OpenSubdiv_VERSION "${version}" PARENT_SCOPE)
endfunction()

if(OpenSubdiv_SOURCE)
  file(GLOB _osd_sources "${OpenSubdiv_SOURCE}/opensubdiv/far/*.cpp" "${OpenSubdiv_SOURCE}/opensubdiv/sdc/*.cpp"
    "${OpenSubdiv_SOURCE}/opensubdiv/vtr/*.cpp")
  add_library(wavecomb_opensubdiv STATIC EXCLUDE_FROM_ALL ${_osd_sources})
  target_include_directories(wavecomb_opensubdiv SYSTEM PUBLIC "${OpenSubdiv_SOURCE}")
  target_compile_features(wavecomb_opensubdiv PUBLIC cxx_std_14)
  target_compile_options(wavecomb_opensubdiv PRIVATE -w)
  # Create an imported target, so that the installed CMake package of Wavecomb refers to OpenSubdiv
  # by the same name.
  add_library(OpenSubdiv::osdCPU INTERFACE IMPORTED)
  set_target_properties(OpenSubdiv::osdCPU PROPERTIES INTERFACE_LINK_LIBRARIES wavecomb_opensubdiv)
  set(OpenSubdiv_LIBRARY wavecomb_opensubdiv)
  _osd_version("${OpenSubdiv_SOURCE}")
  set(OpenSubdiv_NEEDS_OPENMP FALSE)
  set(OpenSubdiv_FOUND TRUE)
  return()
endif()

find_path(OpenSubdiv_INCLUDE_DIR opensubdiv/far/primvarRefiner.h)
find_library(OpenSubdiv_LIBRARY osdCPU)
if(OpenSubdiv_INCLUDE_DIR)
  _osd_version("${OpenSubdiv_INCLUDE_DIR}")
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
