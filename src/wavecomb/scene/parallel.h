// SPDX-License-Identifier: Apache-2.0
/// Loops over threads, for making scenes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

namespace wavecomb {

/// Runs `work` so that the loops in it have `threads` threads (0: all).
void with_threads(uint32_t threads, const std::function<void()>& work);

/// Runs body(0) to body(n - 1) in any order, on the threads of `with_threads`. An exception of one
/// ends the loop and comes out of it.
void parallel_for(size_t n, const std::function<void(size_t)>& body);

}  // namespace wavecomb
