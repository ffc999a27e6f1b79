// SPDX-License-Identifier: Apache-2.0
#pragma once

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

namespace wavecomb {

/// Flushes denormal floats to zero on this thread for as long as it lives: they are slow and mean
/// nothing here, and every worker must treat them alike for pictures to be equal.
class DenormalsOff {
 public:
#if defined(__SSE__)
  DenormalsOff() : saved_(_mm_getcsr()) { _mm_setcsr(saved_ | 0x8040u); }
  ~DenormalsOff() { _mm_setcsr(saved_); }
#else
  DenormalsOff() = default;
  ~DenormalsOff() = default;
#endif
  DenormalsOff(const DenormalsOff&) = delete;
  DenormalsOff& operator=(const DenormalsOff&) = delete;

#if defined(__SSE__)
 private:
  unsigned saved_;
#endif
};

}  // namespace wavecomb
