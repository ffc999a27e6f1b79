# SPDX-License-Identifier: Apache-2.0
# Toolchain: ARM64 on another Linux, by Debian's cross compiler, with what tools/setup_arm64 staged; what is built runs under
# qemu. `make test-arm64` uses it.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
get_filename_component(_root "${CMAKE_CURRENT_LIST_DIR}/../.deps/arm64" ABSOLUTE)
set(_libraries "${_root}/usr/lib/aarch64-linux-gnu")
file(GLOB embree_DIR "${_libraries}/cmake/embree-*")
set(TBB_DIR "${_libraries}/cmake/TBB")
# The staged libraries may ask for a newer glibc than the compiler's: the one beside them.
set(CMAKE_EXE_LINKER_FLAGS_INIT "-Wl,--allow-shlib-undefined,-rpath-link,${_libraries}")
set(CMAKE_CROSSCOMPILING_EMULATOR "qemu-aarch64;-L;${_root}")
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
