// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace wavecomb {

/// The most memory this process has held, bytes.
uint64_t peak_rss_bytes();
/// Returns freed memory to the system where the C library keeps it (glibc): call after loading.
void give_back_memory();

}  // namespace wavecomb
