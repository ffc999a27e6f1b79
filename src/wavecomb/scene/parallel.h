// SPDX-License-Identifier: Apache-2.0
/// Parallel loops for building scenes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

namespace wavecomb {

/// Calls `work`, with `threads` threads for the parallel loops inside it; 0 means all threads.
void with_threads(uint32_t threads, const std::function<void()>& work);

/// Calls body(0) to body(n - 1) in any order on several threads. `with_threads` sets the number of
/// threads. If a call of `body` throws, the loop stops and rethrows the exception.
void parallel_for(size_t n, const std::function<void(size_t)>& body);

/// Splits [0, n) into bands of `band` indices and calls body(first, last) for each band, in any
/// order and on several threads. If the call is nested in another parallel loop, a thread that
/// waits for bands does not start a new iteration of the outer loop. This limits the number of
/// outer iterations that hold memory at the same time to the number of threads.
void parallel_bands(size_t n, size_t band, const std::function<void(size_t, size_t)>& body);

/// Returns the number of threads that a parallel loop uses in the current context.
uint32_t loop_threads();

}  // namespace wavecomb
