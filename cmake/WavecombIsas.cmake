# SPDX-License-Identifier: Apache-2.0
# Adds one Python module for each instruction set in WAVECOMB_ISAS, and the module wavecomb._cpu
# that reports which of them a CPU supports. docs/decisions/isa.md gives the reasons.

if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64)$")
  set(_known x86-64-v2 x86-64-v3 x86-64-v4)
elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "^(aarch64|arm64)$")
  set(_known armv8-a)
else()
  message(FATAL_ERROR "WAVECOMB_ISAS: no list of instruction sets for ${CMAKE_SYSTEM_PROCESSOR}; leave it empty "
    "and give WAVECOMB_ARCH.")
endif()
set(_isas ${WAVECOMB_ISAS})
if(_isas STREQUAL "portable")
  set(_isas ${_known})
endif()
foreach(_isa IN LISTS _isas)
  if(NOT _isa IN_LIST _known)
    message(FATAL_ERROR "WAVECOMB_ISAS: ${_isa} is not one of portable, ${_known}.")
  endif()
endforeach()

check_cxx_source_compiles("int main() {
#if defined(__x86_64__)
  return __builtin_cpu_supports(\"x86-64-v4\") && __builtin_cpu_supports(\"x86-64-v2\");
#endif
}" WAVECOMB_HAS_CPU_LEVELS)
if(NOT WAVECOMB_HAS_CPU_LEVELS)
  message(FATAL_ERROR "WAVECOMB_ISAS: ${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION} cannot ask a CPU for "
    "x86-64-v2 to x86-64-v4 (__builtin_cpu_supports); take GCC 12 or newer.")
endif()

# wavecomb._cpu runs on every CPU, since it is compiled for the compiler's baseline instruction set
# and uses only Python's C API and libc.
Python_add_library(wavecomb_cpu MODULE "${PROJECT_SOURCE_DIR}/bindings/cpu/cpu.cpp")
target_compile_definitions(wavecomb_cpu PRIVATE Py_LIMITED_API=0x030A0000)
target_link_libraries(wavecomb_cpu PRIVATE wavecomb_common)
if(CMAKE_SYSTEM_NAME STREQUAL "Linux")
  # Link wavecomb._cpu with libc although it calls no libc function, since auditwheel determines the
  # wheel's libc from this dependency.
  target_link_libraries(wavecomb_cpu PRIVATE "-Wl,--push-state,--no-as-needed" -l:libc.so.6 "-Wl,--pop-state")
endif()
set_target_properties(wavecomb_cpu PROPERTIES OUTPUT_NAME _cpu CXX_VISIBILITY_PRESET hidden
  PREFIX "" SUFFIX ".abi3${CMAKE_SHARED_MODULE_SUFFIX}")
install(TARGETS wavecomb_cpu LIBRARY DESTINATION wavecomb COMPONENT python)

add_custom_target(wavecomb_python DEPENDS wavecomb_cpu)
foreach(_isa IN LISTS _isas)
  string(MAKE_C_IDENTIFIER "${_isa}" _id)
  wavecomb_add_flags(wavecomb_private_${_id} ${_isa})
  wavecomb_add_core(wavecomb_core_${_id} wavecomb_private_${_id} STATIC)
  wavecomb_add_module(wavecomb_python_${_id} wavecomb_core_${_id} wavecomb_private_${_id} lib/${_isa})
  add_dependencies(wavecomb_python wavecomb_python_${_id})
endforeach()
