# SPDX-License-Identifier: Apache-2.0
# The Python module wavecomb._core, and the libraries that travel with it.
# Everything here is in the install component `python`, relative to site-packages.

execute_process(COMMAND "${Python_EXECUTABLE}" -m nanobind --cmake_dir
  OUTPUT_VARIABLE nanobind_ROOT OUTPUT_STRIP_TRAILING_WHITESPACE)
find_package(nanobind CONFIG REQUIRED)

file(GLOB binding_sources CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/bindings/*.cpp")
if(NOT binding_sources)
  message(FATAL_ERROR "bindings/ holds no *.cpp: there is no Python module to build.")
endif()
nanobind_add_module(wavecomb_python NB_STATIC NB_SUPPRESS_WARNINGS ${binding_sources})
target_compile_definitions(wavecomb_python PRIVATE WAVECOMB_VERSION="${PROJECT_VERSION}")
target_link_libraries(wavecomb_python PRIVATE wavecomb_core wavecomb_private TBB::tbb)

# In site-packages/wavecomb: `lib` holds what we bring; ../../.. is <venv>/lib, where the tbb wheel puts
# libtbb.so.12 (not looked for when oneTBB is the distribution's). In the build tree the linked
# directories are enough.
set(_rpath "$ORIGIN" "$ORIGIN/lib")
if(WAVECOMB_TBB_IS_WHEEL)
  list(APPEND _rpath "$ORIGIN/../../..")
endif()
# An Embree that is neither staged nor the system's (embree_ROOT) is looked for where it was found.
if(NOT WAVECOMB_EMBREE_IS_STAGED)
  get_target_property(_embree_library embree LOCATION)
  get_filename_component(_embree_folder "${_embree_library}" DIRECTORY)
  get_filename_component(_embree_folder "${_embree_folder}" REALPATH)
  if(_embree_library AND NOT _embree_folder IN_LIST CMAKE_CXX_IMPLICIT_LINK_DIRECTORIES)
    list(APPEND _rpath "${_embree_folder}")
  endif()
endif()
set_target_properties(wavecomb_python PROPERTIES
  OUTPUT_NAME _core
  INSTALL_RPATH "${_rpath}"
  INSTALL_RPATH_USE_LINK_PATH OFF)
install(TARGETS wavecomb_python LIBRARY DESTINATION wavecomb COMPONENT python)

# What the bindings really offer, to compare python/wavecomb/_core.pyi with: target wavecomb_stub.
nanobind_add_stub(wavecomb_stub EXCLUDE_FROM_ALL MODULE _core OUTPUT "${PROJECT_BINARY_DIR}/_core.pyi"
  PYTHON_PATH $<TARGET_FILE_DIR:wavecomb_python> DEPENDS wavecomb_python)

if(WAVECOMB_EMBREE_IS_STAGED)
  install(FILES "${WAVECOMB_STAGED_EMBREE}/lib/libembree4.so.4" DESTINATION wavecomb/lib
    PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE
    COMPONENT python)
endif()
if(BUILD_SHARED_LIBS)
  install(TARGETS wavecomb_core LIBRARY DESTINATION wavecomb/lib NAMELINK_SKIP COMPONENT python)
endif()
