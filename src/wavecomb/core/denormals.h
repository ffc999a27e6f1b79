// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

namespace wavecomb {

/// Scope guard that flushes denormal floats to zero on this thread. Arithmetic with denormals is
/// slow, and denormals do not matter in rendering. All threads must treat denormals in the same
/// way, so that the image does not depend on the distribution of work.
class DenormalsOff {
 public:
  DenormalsOff() : saved_(control()) { set_control(saved_ | kFlush); }
  ~DenormalsOff() { set_control(saved_); }
  DenormalsOff(const DenormalsOff&) = delete;
  DenormalsOff& operator=(const DenormalsOff&) = delete;

 private:
  // Access to the floating-point control word of the thread. `kFlush` contains the bits that flush
  // denormal results and operands to zero.
#if defined(__SSE__)
  static constexpr uint64_t kFlush = 0x8040;
  static uint64_t control() { return _mm_getcsr(); }
  static void set_control(uint64_t word) { _mm_setcsr(static_cast<unsigned>(word)); }
#elif defined(__aarch64__)
  static constexpr uint64_t kFlush = uint64_t{1} << 24;  // bit FZ of the register FPCR
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
