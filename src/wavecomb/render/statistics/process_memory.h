// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace wavecomb {

/// Returns the peak resident memory of this process in bytes.
uint64_t peak_rss_bytes();
/// Returns freed memory to the system. Call after loading; only glibc keeps such memory.
void give_back_memory();

}  // namespace wavecomb
