// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace wavecomb {

/// Returns the peak resident memory of this process in bytes.
uint64_t peak_rss_bytes();
/// Returns freed memory to the system. Call this function after loading. It has an effect only with
/// glibc, which otherwise retains freed memory.
void release_memory();

}  // namespace wavecomb
