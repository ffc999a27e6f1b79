# SPDX-License-Identifier: Apache-2.0
# wavecomb_private: what every translation unit of this tree is compiled with (core, tests, benchmarks,
# bindings), and WAVECOMB_WIDTHS, the lane widths that are built.
#
# Every unit gets the same floating-point flags: a formula gives the same bits wherever it is inlined.

include(CheckCXXSourceCompiles)

set(_arch_flags "")
if(WAVECOMB_ARCH)
  set(_arch_flags "-march=${WAVECOMB_ARCH}")
elseif(WAVECOMB_NATIVE)
  set(_arch_flags "-march=native")
endif()

# _wavecomb_isa(VAR EXPRESSION): VAR says whether the preprocessor expression holds under the flags.
function(_wavecomb_isa var expression)
  set(CMAKE_REQUIRED_FLAGS "${_arch_flags}")
  set(CMAKE_REQUIRED_QUIET TRUE)
  string(MAKE_C_IDENTIFIER "${var}_${_arch_flags}" key)
  check_cxx_source_compiles("#if !(${expression})\n#error no\n#endif\nint main() { return 0; }" ${key})
  set(${var} "${${key}}" PARENT_SCOPE)
endfunction()
_wavecomb_isa(_isa_4 "defined(__SSE4_2__) || defined(__ARM_NEON)")
_wavecomb_isa(_isa_8 "defined(__AVX2__) && defined(__FMA__)")
_wavecomb_isa(_isa_16 "defined(__AVX512F__) && defined(__AVX512CD__) && defined(__AVX512DQ__) && defined(__AVX512BW__) && defined(__AVX512VL__)")

set(_supported 1)
foreach(_width 4 8 16)
  if(_isa_${_width})
    list(APPEND _supported ${_width})
  endif()
endforeach()
list(GET _supported -1 WAVECOMB_WIDEST)

set(WAVECOMB_LANE_WIDTHS "" CACHE STRING
  "Lane widths to build, of 1;4;8;16 (default: all that the target has; 1 and the widest with sanitizers)")
if(WAVECOMB_LANE_WIDTHS)
  set(WAVECOMB_WIDTHS ${WAVECOMB_LANE_WIDTHS})
  foreach(_width IN LISTS WAVECOMB_WIDTHS)
    if(NOT _width IN_LIST _supported)
      message(FATAL_ERROR "WAVECOMB_LANE_WIDTHS: ${_width} lanes cannot be built for this target; "
        "it has ${_supported}. See WAVECOMB_NATIVE and WAVECOMB_ARCH.")
    endif()
  endforeach()
elseif(WAVECOMB_SANITIZE)
  set(WAVECOMB_WIDTHS 1 ${WAVECOMB_WIDEST})
else()
  set(WAVECOMB_WIDTHS ${_supported})
endif()
list(REMOVE_DUPLICATES WAVECOMB_WIDTHS)
list(SORT WAVECOMB_WIDTHS COMPARE NATURAL)
list(GET WAVECOMB_WIDTHS -1 WAVECOMB_MAX_LANES)
message(STATUS "Lane widths: ${WAVECOMB_WIDTHS} (flags: ${_arch_flags})")

add_library(wavecomb_private INTERFACE)
target_compile_features(wavecomb_private INTERFACE cxx_std_20)
target_include_directories(wavecomb_private SYSTEM INTERFACE "${WAVECOMB_DRJIT_INCLUDE_DIR}")
target_compile_options(wavecomb_private INTERFACE
  ${_arch_flags} -ffp-contract=off -fno-strict-aliasing -fno-math-errno -fno-trapping-math
  -Wall -Wextra -Wpedantic -Wshadow=local -Wnon-virtual-dtor -Woverloaded-virtual -Wextra-semi -Wno-psabi
  # GCC 12 sees uninitialized and out-of-bounds vectors inside its own intrinsics once they are inlined.
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<VERSION_LESS:$<CXX_COMPILER_VERSION>,13>>:-Wno-maybe-uninitialized;-Wno-uninitialized;-Wno-array-bounds;-Wno-stringop-overflow;-Wno-stringop-overread>
  $<$<BOOL:${WAVECOMB_WERROR}>:-Werror>)
foreach(_width IN LISTS WAVECOMB_WIDTHS)
  target_compile_definitions(wavecomb_private INTERFACE WAVECOMB_HAS_LANES_${_width}=1)
endforeach()
target_compile_definitions(wavecomb_private INTERFACE WAVECOMB_MAX_LANES=${WAVECOMB_MAX_LANES})

if(WAVECOMB_SANITIZE)
  set(_sanitize -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_compile_options(wavecomb_private INTERFACE ${_sanitize})
  target_link_options(wavecomb_private INTERFACE ${_sanitize})
endif()
