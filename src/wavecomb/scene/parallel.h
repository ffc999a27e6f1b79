// SPDX-License-Identifier: Apache-2.0
/// Parallel loops for building scenes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

namespace wavecomb {

/// Calls `work`, in which parallel loops use `threads` threads (0: all).
void with_threads(uint32_t threads, const std::function<void()>& work);

/// Calls body(0) to body(n - 1) in any order on the threads of `with_threads`. If a call of `body`
/// throws, the loop stops and rethrows the exception.
void parallel_for(size_t n, const std::function<void(size_t)>& body);

/// Splits [0, n) into bands of `band` and calls body(first, last) for each, in any order, as
/// parallel_for does. In a task of an outer parallel loop, a thread that waits for a band does not
/// start another task of the outer loop; so at most as many outer tasks as threads hold memory at
/// the same time.
void parallel_bands(size_t n, size_t band, const std::function<void(size_t, size_t)>& body);

/// Returns the number of threads that a parallel loop uses in the current context.
uint32_t loop_threads();

}  // namespace wavecomb
