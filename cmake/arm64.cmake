# SPDX-License-Identifier: Apache-2.0 Toolchain file for ARM64 Linux, which uses Debian's cross
# compiler and the libraries that tools/setup_arm64 installs in .deps/arm64. Programs run under
# qemu. Used by `make test-arm64`.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
get_filename_component(_root "${CMAKE_CURRENT_LIST_DIR}/../.deps/arm64" ABSOLUTE)
set(_libraries "${_root}/usr/lib/aarch64-linux-gnu")
file(GLOB embree_DIR "${_libraries}/cmake/embree-*")
set(TBB_DIR "${_libraries}/cmake/TBB")
# The libraries in .deps/arm64 may need a newer glibc than the cross compiler has, so programs are
# linked with the glibc of .deps/arm64.
set(CMAKE_EXE_LINKER_FLAGS_INIT "-Wl,--allow-shlib-undefined,-rpath-link,${_libraries}")
set(CMAKE_CROSSCOMPILING_EMULATOR "qemu-aarch64;-L;${_root}")
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
