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

/// Runs body(first, last) for the bands that [0, n) falls into, `band` each, in any order, as
/// parallel_for does. Within a task of another loop, a thread that waits for a band begins no other
/// task of that loop meanwhile: what a task holds in memory is held by no more tasks than threads.
void parallel_bands(size_t n, size_t band, const std::function<void(size_t, size_t)>& body);

/// How many threads a loop has here.
uint32_t loop_threads();

}  // namespace wavecomb
