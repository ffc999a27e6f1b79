// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/statistics/process_memory.h"

#include <sys/resource.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <fstream>
#include <string>

namespace wavecomb {

void give_back_memory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

uint64_t peak_rss_bytes() {
#ifdef __linux__
  // ru_maxrss would include the memory of the parent process before exec.
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (word == "VmHWM:") {
      uint64_t kilobytes = 0;
      status >> kilobytes;
      return kilobytes * 1024;
    }
#endif
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
#ifdef __APPLE__
  return static_cast<uint64_t>(usage.ru_maxrss);
#else
  return static_cast<uint64_t>(usage.ru_maxrss) * 1024;
#endif
}

}  // namespace wavecomb
