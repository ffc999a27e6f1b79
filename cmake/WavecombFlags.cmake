# SPDX-License-Identifier: Apache-2.0 The target wavecomb_private holds the compile options of all
# C++ files of this repository (core, tests, benchmarks, bindings).
#
# All units use the same floating-point options, so that a formula gives the same bits wherever it
# is inlined.

include(CheckCXXSourceCompiles)

set(WAVECOMB_LANE_WIDTHS "" CACHE STRING
  "Lane widths to build, of 1;4;8;16 (default: 1 and the widest that the target has); all: every width it has")

# Compile options that are the same for all instruction sets.
add_library(wavecomb_common INTERFACE)
target_compile_features(wavecomb_common INTERFACE cxx_std_20)
target_compile_options(wavecomb_common INTERFACE
  -ffp-contract=off -fno-strict-aliasing -fno-math-errno -fno-trapping-math
  -Wall -Wextra -Wpedantic $<$<CXX_COMPILER_ID:GNU>:-Wshadow=local> -Wnon-virtual-dtor -Woverloaded-virtual -Wextra-semi -Wno-psabi
  # In code for one lane, masks have the type bool, and kernels combine masks with & and |.
  $<$<CXX_COMPILER_ID:Clang,AppleClang>:-Wno-bitwise-instead-of-logical>
  # GCC 12 gives false warnings about uninitialized and out-of-bounds vectors for inlined SIMD
  # intrinsics, and about overlapping strings.
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<VERSION_LESS:$<CXX_COMPILER_VERSION>,13>>:-Wno-maybe-uninitialized;-Wno-uninitialized;-Wno-array-bounds;-Wno-restrict;-Wno-stringop-overflow;-Wno-stringop-overread>
  # Without this parameter, GCC collects garbage so often that compiling takes 5 to 10 % longer. No
  # unit needs more than 1 GB of memory either way.
  $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=1000000>
  $<$<BOOL:${WAVECOMB_WERROR}>:-Werror>)
# Sanitizer checks of every reference and of every scope double the compile time of kernels and
# containers, and quadruple the compile time of SIMD code. Only WAVECOMB_SANITIZE=all, which `make
# test-long` sets, enables these checks.
if(WAVECOMB_SANITIZE)
  if(WAVECOMB_SANITIZE STREQUAL "thread")
    set(_sanitize -fsanitize=thread -fno-omit-frame-pointer)
  else()
    set(_sanitize -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer)
    if(NOT WAVECOMB_SANITIZE STREQUAL "all")
      list(APPEND _sanitize -fno-sanitize=null,alignment,object-size,vptr -fno-sanitize-address-use-after-scope)
    endif()
  endif()
  target_compile_options(wavecomb_common INTERFACE ${_sanitize})
  target_link_options(wavecomb_common INTERFACE ${_sanitize})
endif()

# _wavecomb_has(VAR ARCH EXPRESSION) sets VAR to true if the preprocessor expression EXPRESSION is
# true with the compiler option -march=ARCH.
function(_wavecomb_has var arch expression)
  set(CMAKE_REQUIRED_QUIET TRUE)
  if(arch)
    set(CMAKE_REQUIRED_FLAGS "-march=${arch}")
  endif()
  string(MAKE_C_IDENTIFIER "${var}_${arch}" key)
  check_cxx_source_compiles("#if !(${expression})\n#error no\n#endif\nint main() { return 0; }" ${key})
  set(${var} "${${key}}" PARENT_SCOPE)
endfunction()

# wavecomb_add_flags(NAME ARCH) adds an interface library NAME, whose users are compiled with
# -march=ARCH, or without -march if ARCH is empty. Its property WAVECOMB_WIDTHS lists the lane
# widths to build, and WAVECOMB_LABEL is the library's name in messages. A second interface library
# NAME_widths defines WAVECOMB_HAS_LANES_<width> for each of the lane widths.
function(wavecomb_add_flags name arch)
  _wavecomb_has(_isa_4 "${arch}" "defined(__SSE4_2__) || defined(__ARM_NEON)")
  _wavecomb_has(_isa_8 "${arch}" "defined(__AVX2__) && defined(__FMA__)")
  _wavecomb_has(_isa_16 "${arch}" "defined(__AVX512F__) && defined(__AVX512CD__) && defined(__AVX512DQ__) && defined(__AVX512BW__) && defined(__AVX512VL__)")
  set(supported 1)
  foreach(width 4 8 16)
    if(_isa_${width})
      list(APPEND supported ${width})
    endif()
  endforeach()
  if(WAVECOMB_LANE_WIDTHS STREQUAL "all")
    set(widths ${supported})
  elseif(WAVECOMB_LANE_WIDTHS)
    set(widths ${WAVECOMB_LANE_WIDTHS})
    foreach(width IN LISTS widths)
      if(NOT width IN_LIST supported)
        message(FATAL_ERROR "WAVECOMB_LANE_WIDTHS: ${width} lanes cannot be built for this target "
          "(-march=${arch}); it has ${supported}. See WAVECOMB_NATIVE, WAVECOMB_ARCH and WAVECOMB_ISAS.")
      endif()
    endforeach()
  else()
    list(GET supported -1 widest)
    set(widths 1 ${widest})
  endif()
  list(REMOVE_DUPLICATES widths)
  list(SORT widths COMPARE NATURAL)
  list(GET widths -1 most)
  message(STATUS "Lane widths: ${widths} (-march=${arch})")

  set(label "${arch}")
  if(NOT label)
    set(label default)
  endif()
  add_library(${name} INTERFACE)
  # Builds with sanitizers leave out kernels whose code other kernels also contain (see
  # wave/kernels/kernel_matrix.h).
  set(reduced 0)
  if(WAVECOMB_SANITIZE AND NOT WAVECOMB_SANITIZE STREQUAL "all")
    set(reduced 1)
  endif()
  set_target_properties(${name} PROPERTIES WAVECOMB_WIDTHS "${widths}" WAVECOMB_LABEL "${label}"
    WAVECOMB_REDUCED_KERNELS ${reduced})
  target_link_libraries(${name} INTERFACE wavecomb_common)
  target_include_directories(${name} SYSTEM INTERFACE "${WAVECOMB_DRJIT_INCLUDE_DIR}")
  if(arch)
    target_compile_options(${name} INTERFACE "-march=${arch}")
  endif()
  target_compile_definitions(${name} INTERFACE WAVECOMB_MAX_LANES=${most}
    WAVECOMB_REDUCED_KERNELS=${reduced})
  # Only source files that list the lane widths of the build use these definitions, so that changing
  # the set of widths does not recompile any other file.
  add_library(${name}_widths INTERFACE)
  foreach(width IN LISTS widths)
    target_compile_definitions(${name}_widths INTERFACE WAVECOMB_HAS_LANES_${width}=1)
  endforeach()
endfunction()

if(WAVECOMB_ARCH)
  wavecomb_add_flags(wavecomb_private "${WAVECOMB_ARCH}")
elseif(WAVECOMB_NATIVE)
  wavecomb_add_flags(wavecomb_private native)
else()
  wavecomb_add_flags(wavecomb_private "")
endif()
