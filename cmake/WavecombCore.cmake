# SPDX-License-Identifier: Apache-2.0 The function wavecomb_add_core adds Wavecomb's C++ core as a
# library target. The build calls the function once, and once more for each instruction set in
# WAVECOMB_ISAS.

file(GLOB_RECURSE core_sources CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/src/wavecomb/*.cpp")
# wavecomb_read_rows(VAR FILE PATTERN) sets VAR to the list of matches of the regular expression
# PATTERN in FILE, a header of src/wavecomb.
function(wavecomb_read_rows var file pattern)
  set(file "${PROJECT_SOURCE_DIR}/src/wavecomb/${file}")
  file(READ "${file}" text)
  string(REGEX MATCHALL "${pattern}" rows "${text}")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${file}")
  set(${var} ${rows} PARENT_SCOPE)
endfunction()

# Read the shading programs from the rows "X(name, Class, ...)" and "P(name, Class, ...)" of the
# macro WAVECOMB_PROGRAMS. The code of each program is in a header with the program's name.
wavecomb_read_rows(programs material/description/programs.h "\n  [XP]\\([a-z_0-9]+, ")
list(TRANSFORM programs REPLACE "^.*\\(([a-z_0-9]+), $" "\\1")
file(GLOB program_headers CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/src/wavecomb/material/programs/*.h")
list(TRANSFORM program_headers REPLACE "^.*/([^/]+)\\.h$" "\\1")
foreach(program IN LISTS programs)
  if(NOT program IN_LIST program_headers)
    message(FATAL_ERROR "WAVECOMB_PROGRAMS (src/wavecomb/material/description/programs.h) has a program \"${program}\", and "
      "there is no src/wavecomb/material/programs/${program}.h")
  endif()
endforeach()
foreach(program IN LISTS program_headers)
  if(NOT program IN_LIST programs)
    message(FATAL_ERROR "src/wavecomb/material/programs/${program}.h is there, and WAVECOMB_PROGRAMS "
      "(src/wavecomb/material/description/programs.h) has no row for it")
  endif()
endforeach()
# Read the medium programs from the rows "M(name, Class, ...)" of the macro
# WAVECOMB_MEDIUM_PROGRAMS.
wavecomb_read_rows(media material/description/programs.h " M\\([a-z_0-9]+, ")
list(TRANSFORM media REPLACE "^.*\\(([a-z_0-9]+), $" "\\1")
# List of program variants in the form "name:program". The list begins with the unreduced programs.
# The reduced variants follow, which are read from the rows "X(name, program, parts)" of the macro
# WAVECOMB_VARIANTS.
wavecomb_read_rows(reduced material/description/variants.h "\n  X\\([a-z_0-9]+, [a-z_0-9]+, ")
list(TRANSFORM reduced REPLACE "^.*\\(([a-z_0-9]+), ([a-z_0-9]+), $" "\\1:\\2")
set(variants ${programs} ${media})
list(TRANSFORM variants REPLACE "^(.+)$" "\\1:\\1")
list(APPEND variants ${reduced})
set(lane_sources ${core_sources})
list(FILTER lane_sources INCLUDE REGEX "\\.lanes\\.cpp$")
list(FILTER core_sources EXCLUDE REGEX "\\.lanes\\.cpp$|/render/lane_kernels\\.cpp$")
# The sources of light kinds and light filters, bare_traversal.cpp and ears.cpp are excluded from
# unity batches (WAVECOMB_BATCH), because their local names collide with names in other sources, and
# openpbr_wall.cpp, so that no batch depends on a program.
file(GLOB alone "${PROJECT_SOURCE_DIR}/src/wavecomb/light/kinds/*.cpp" "${PROJECT_SOURCE_DIR}/src/wavecomb/light/filters/*.cpp")
list(APPEND alone "${PROJECT_SOURCE_DIR}/src/wavecomb/material/programs/openpbr_wall.cpp"
  "${PROJECT_SOURCE_DIR}/src/wavecomb/accel/bare_traversal.cpp" "${PROJECT_SOURCE_DIR}/src/wavecomb/geometry/tessellation/ears.cpp")
set(refiner "${PROJECT_SOURCE_DIR}/src/wavecomb/geometry/tessellation/subdivision.cpp")
set_source_files_properties(${alone} ${refiner} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
if(WAVECOMB_SANITIZE)
  # With sanitizers, compiling OpenSubdiv's templates with optimisation takes three times as long.
  set_source_files_properties(${refiner} PROPERTIES COMPILE_OPTIONS -O0 SKIP_PRECOMPILE_HEADERS ON)
endif()
# Sources whose functions take a negligible part of the render time, such as scene descriptions and
# checks of parameters, are compiled with -Og, which takes half of the compile time of -O3.
# Sources with loops over vertices, texels, pixels or training samples keep full optimisation.
set(cold ${core_sources})
list(FILTER cold INCLUDE REGEX
  "/src/wavecomb/(core|scene|render|(light|material|medium)/description|light/(tree|calibration)|geometry/mesh|graph/parameters|light_paths/render)/([a-z_]+/)?[a-z_]+\\.cpp$")
foreach(name IN ITEMS geometry/mesh/attributes geometry/mesh/tangents light/calibration/partition
    light/description/image_distribution light/description/motion light/description/triangle_means light/tree/light_cluster
    light/tree/light_tree medium/description/subsurface medium/description/volume_grid medium/description/volume_motion
    render/passes/adaptive render/passes/allotment render/passes/pixel_order render/pilots/guiding_training
    scene/fingerprint scene/object_bounds scene/parallel scene/scene_records)
  set(source "${PROJECT_SOURCE_DIR}/src/wavecomb/${name}.cpp")
  if(NOT source IN_LIST cold)
    message(FATAL_ERROR "cmake/WavecombCore.cmake lists ${source}, which is not there")
  endif()
  list(REMOVE_ITEM cold "${source}")
endforeach()
list(APPEND cold ${refiner} "${PROJECT_SOURCE_DIR}/src/wavecomb/light_paths/setup.cpp")
list(REMOVE_ITEM core_sources ${cold})
file(GLOB_RECURSE core_headers CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/src/wavecomb/*.h"
  "${PROJECT_SOURCE_DIR}/src/wavecomb/*.inl")
# Warnings for the core only. -Wconversion would also warn about conversions from int to float,
# which are common in kernels.
set(core_warnings -Wfloat-conversion)

# Third-party headers that nearly every source file includes. Parsing these headers takes half of
# the compile time of a small source file.
set(wavecomb_pch <algorithm> <array> <chrono> <cmath> <cstring> <functional> <limits> <memory> <numeric>
  <optional> <span> <string> <utility> <vector> <drjit/packet.h>)

# Read the rows of the macro WAVECOMB_KERNELS as a list in the form "kind:set:widths:reduced".
wavecomb_read_rows(kernels wave/kernels/kernel_matrix.h "\n  X\\([a-z]+, [a-z]+, [a-z]+, [a-z]+, ")
list(TRANSFORM kernels REPLACE "^.*\\(([a-z]+), ([a-z]+), ([a-z]+), ([a-z]+), $" "\\1:\\2:\\3:\\4")

# wavecomb_kernel_units(VAR KIND SET WIDTH) generates the source files of a row of WAVECOMB_KERNELS
# for WIDTH lanes in the build directory. SET is `programs`, `variants` or `first` (the first
# program).
function(wavecomb_kernel_units var kind set width)
  file(GLOB_RECURSE template "${PROJECT_SOURCE_DIR}/src/wavecomb/${kind}.lanes.cpp.in")
  if(NOT template)
    message(FATAL_ERROR "WAVECOMB_KERNELS (src/wavecomb/wave/kernels/kernel_matrix.h) has the kind \"${kind}\", and "
      "there is no ${kind}.lanes.cpp.in in src/wavecomb")
  endif()
  set(units "")
  set(index 0)
  foreach(row IN LISTS variants)
    string(REGEX MATCH "^(.*):(.*)$" row "${row}")
    set(member "${CMAKE_MATCH_1}")
    set(program "${CMAKE_MATCH_2}")
    if(NOT program IN_LIST media AND (set STREQUAL "variants" OR member STREQUAL program)
        AND (NOT set STREQUAL "first" OR index EQUAL 0))
      set(unit "${PROJECT_BINARY_DIR}/lanes/${kind}_${member}_${width}.cpp")
      configure_file("${template}" "${unit}" @ONLY)
      # With WAVECOMB_BATCH, all kernels of a program and lane width are compiled as one unit.
      set_source_files_properties("${unit}" PROPERTIES UNITY_GROUP "${program}_${width}")
      list(APPEND units "${unit}")
    endif()
    math(EXPR index "${index} + 1")
  endforeach()
  set(${var} ${units} PARENT_SCOPE)
endfunction()

# wavecomb_lane_units(VAR WIDTH WIDEST REDUCED) generates the source files for WIDTH lanes in a
# build whose largest lane width is WIDEST. These are the files for all rows of WAVECOMB_KERNELS (as
# their column `reduced` states if REDUCED is true), and one file for each *.lanes.cpp. The value of
# WAVECOMB_LANES distinguishes files of different widths.
function(wavecomb_lane_units var width widest reduced)
  set(all "")
  foreach(row IN LISTS kernels)
    string(REPLACE ":" ";" row "${row}")
    list(GET row 0 kind)
    list(GET row 1 set)
    list(GET row 2 widths)
    if(reduced)
      list(GET row 3 widths)
    endif()
    if(widths STREQUAL "first")
      set(widths every)
      if(width GREATER 1)
        set(set first)
      endif()
    endif()
    if(widths STREQUAL "every"
        OR (widths MATCHES "^(scalar|ends)$" AND width EQUAL 1)
        OR (widths MATCHES "^(widest|ends)$" AND width EQUAL widest AND width GREATER 1))
      wavecomb_kernel_units(units ${kind} ${set} ${width})
      list(APPEND all ${units})
    endif()
  endforeach()
  foreach(source IN LISTS lane_sources)
    get_filename_component(name "${source}" NAME_WE)
    # kHasVolumePackets
    if(reduced AND width GREATER 1 AND name MATCHES "^volume")
      continue()
    endif()
    file(RELATIVE_PATH source "${PROJECT_SOURCE_DIR}/src" "${source}")
    set(unit "${PROJECT_BINARY_DIR}/lanes/all_${name}_${width}.cpp")
    file(CONFIGURE OUTPUT "${unit}" CONTENT "#define WAVECOMB_LANES ${width}\n#include \"${source}\"\n")
    list(APPEND all "${unit}")
  endforeach()
  set(${var} ${all} PARENT_SCOPE)
endfunction()

# wavecomb_add_core(NAME FLAGS [STATIC]) adds the library NAME. FLAGS is a target of
# wavecomb_add_flags that contains the compile options. The library always contains the kernels for
# one lane, since the reference integrator uses them.
function(wavecomb_add_core name flags)
  add_library(${name} ${ARGN} ${core_sources} ${core_headers})
  target_compile_features(${name} PUBLIC cxx_std_20)
  target_include_directories(${name} PUBLIC
    "$<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>" "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>")
  get_target_property(label ${flags} WAVECOMB_LABEL)
  target_compile_options(${name} PRIVATE ${core_warnings})
  target_link_libraries(${name} PRIVATE $<BUILD_INTERFACE:${flags}> embree TBB::tbb
    OpenSubdiv::osdCPU)
  get_target_property(widths ${flags} WAVECOMB_WIDTHS)
  set_target_properties(${name} PROPERTIES UNITY_BUILD ${WAVECOMB_BATCH} UNITY_BUILD_BATCH_SIZE 10
    # with the default define symbol, precompiled headers of other targets would not match
    DEFINE_SYMBOL "")
  set(cold_target ${name}_cold)
  add_library(${cold_target} OBJECT ${cold})
  target_include_directories(${cold_target} PRIVATE "${PROJECT_SOURCE_DIR}/src")
  target_compile_options(${cold_target} PRIVATE ${core_warnings})
  target_link_libraries(${cold_target} PRIVATE ${flags} embree TBB::tbb)
  if(NOT WAVECOMB_SANITIZE)
    target_compile_options(${cold_target} PRIVATE -Og)
  endif()
  target_precompile_headers(${cold_target} PRIVATE ${wavecomb_pch})
  if(WAVECOMB_SANITIZE)
    target_precompile_headers(${name} REUSE_FROM ${cold_target})
  else()
    # GCC 12 fails if a header that was precompiled with -Og is used with -O3.
    target_precompile_headers(${name} PRIVATE ${wavecomb_pch})
  endif()
  set_target_properties(${cold_target} PROPERTIES UNITY_BUILD ${WAVECOMB_BATCH} UNITY_BUILD_BATCH_SIZE 10)
  target_sources(${name} PRIVATE $<TARGET_OBJECTS:${cold_target}>)
  list(GET widths -1 widest)
  list(REMOVE_ITEM widths 1)
  set(packets "")
  get_target_property(reduced ${flags} WAVECOMB_REDUCED_KERNELS)
  foreach(width IN LISTS widths)
    wavecomb_lane_units(units ${width} ${widest} ${reduced})
    list(APPEND packets ${units})
  endforeach()
  wavecomb_lane_units(scalar 1 ${widest} ${reduced})
  # Compile lane_kernels.cpp, which lists the lane widths of this library.
  set(table ${name}_lane_kernels)
  add_library(${table} OBJECT "${PROJECT_SOURCE_DIR}/src/wavecomb/render/lane_kernels.cpp")
  target_include_directories(${table} PRIVATE "${PROJECT_SOURCE_DIR}/src")
  target_compile_definitions(${table} PRIVATE WAVECOMB_LIBRARY="${label}")
  target_compile_options(${table} PRIVATE ${core_warnings})
  target_link_libraries(${table} PRIVATE ${flags} ${flags}_widths embree TBB::tbb)
  target_sources(${name} PRIVATE $<TARGET_OBJECTS:${table}>)
  foreach(kind IN ITEMS packets scalar)
    set(lanes ${name}_${kind})
    if(NOT ${kind})
      continue()
    endif()
    add_library(${lanes} OBJECT ${${kind}})
    target_include_directories(${lanes} PRIVATE "${PROJECT_SOURCE_DIR}/src")
    target_compile_options(${lanes} PRIVATE ${core_warnings})
    target_link_libraries(${lanes} PRIVATE ${flags} embree TBB::tbb)
    target_sources(${name} PRIVATE $<TARGET_OBJECTS:${lanes}>)
    # All kernels of a shading program are compiled as one unit, since they instantiate the same
    # templates.
    set_target_properties(${lanes} PROPERTIES UNITY_BUILD ${WAVECOMB_BATCH} UNITY_BUILD_MODE GROUP)
  endforeach()
  # Headers that all source files of kernels include. Headers of shading programs and of single
  # kernels are left out.
  set(kernel_pch ${wavecomb_pch} <wavecomb/wave/kernels/shared_kernels.h> <wavecomb/wave/wave.h>
    <wavecomb/wave/stages/order_rays.h>)
  foreach(step IN ITEMS interact emit sample_light scatter survive)
    list(APPEND kernel_pch <wavecomb/path/steps/${step}.h>)
  endforeach()
  target_precompile_headers(${name}_scalar PRIVATE ${kernel_pch})
  if(packets)
    target_precompile_headers(${name}_packets REUSE_FROM ${name}_scalar)
  endif()
endfunction()
