// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

namespace wavecomb {

/// Scope guard that flushes denormal floats to zero on this thread. Denormals are slow and do not
/// matter in rendering, and all workers must treat denormals the same way so that they produce the
/// same image.
class DenormalsOff {
 public:
  DenormalsOff() : saved_(control()) { set_control(saved_ | kFlush); }
  ~DenormalsOff() { set_control(saved_); }
  DenormalsOff(const DenormalsOff&) = delete;
  DenormalsOff& operator=(const DenormalsOff&) = delete;

 private:
  // Floating-point control word of the thread, and the bits of it that flush results and operands.
#if defined(__SSE__)
  static constexpr uint64_t kFlush = 0x8040;
  static uint64_t control() { return _mm_getcsr(); }
  static void set_control(uint64_t word) { _mm_setcsr(static_cast<unsigned>(word)); }
#elif defined(__aarch64__)
  static constexpr uint64_t kFlush = uint64_t{1} << 24;  // FPCR.FZ flushes results and operands.
  static uint64_t control() {
    uint64_t word;
    asm volatile("mrs %0, fpcr" : "=r"(word));
    return word;
  }
  static void set_control(uint64_t word) { asm volatile("msr fpcr, %0" : : "r"(word) : "memory"); }
#else
#error "DenormalsOff: not implemented for this CPU."
#endif

  uint64_t saved_;
};

}  // namespace wavecomb
