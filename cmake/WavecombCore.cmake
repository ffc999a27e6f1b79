# SPDX-License-Identifier: Apache-2.0
# wavecomb_add_core: the core as a library. Called once for this tree, and once more for each instruction
# set of WAVECOMB_ISAS.

file(GLOB_RECURSE core_sources CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/src/wavecomb/*.cpp")
set(lane_sources ${core_sources})
list(FILTER lane_sources INCLUDE REGEX "\\.lanes\\.cpp$")
list(FILTER core_sources EXCLUDE REGEX "\\.lanes\\.cpp$")
file(GLOB_RECURSE core_headers CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/src/wavecomb/*.h")
# Only the core. Not all of -Wconversion: int to float is everyday in kernels that serve float and packets.
set(core_warnings -Wfloat-conversion)

# wavecomb_add_core(NAME FLAGS [STATIC]): the library NAME, compiled with FLAGS of wavecomb_add_flags. Each
# *.lanes.cpp is compiled once per width, with -DWAVECOMB_LANES=<width>.
function(wavecomb_add_core name flags)
  add_library(${name} ${ARGN} ${core_sources} ${core_headers})
  target_compile_features(${name} PUBLIC cxx_std_20)
  target_include_directories(${name} PUBLIC
    "$<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>" "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>")
  get_target_property(label ${flags} WAVECOMB_LABEL)
  target_compile_definitions(${name} PRIVATE WAVECOMB_LIBRARY="${label}")
  target_compile_options(${name} PRIVATE ${core_warnings})
  target_link_libraries(${name} PRIVATE $<BUILD_INTERFACE:${flags}> embree TBB::tbb
    OpenSubdiv::osdCPU)
  get_target_property(widths ${flags} WAVECOMB_WIDTHS)
  foreach(width IN LISTS widths)
    set(lanes ${name}_lanes_${width})
    add_library(${lanes} OBJECT ${lane_sources})
    target_compile_definitions(${lanes} PRIVATE WAVECOMB_LANES=${width})
    target_include_directories(${lanes} PRIVATE "${PROJECT_SOURCE_DIR}/src")
    target_compile_options(${lanes} PRIVATE ${core_warnings})
    target_link_libraries(${lanes} PRIVATE ${flags} embree TBB::tbb)
    target_sources(${name} PRIVATE $<TARGET_OBJECTS:${lanes}>)
  endforeach()
endfunction()
