// SPDX-License-Identifier: Apache-2.0
/// Something done by every thread of the process: what Linux takes from one thread only.
#include <nanobind/nanobind.h>

#include "bind.h"
#include "wavecomb/core/error.h"

#if defined(__linux__)
#include <signal.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <set>
#include <string>
#include <thread>
#endif

namespace nb = nanobind;

namespace {

#if defined(__linux__)

constexpr long kRestrictSelf = 446;  ///< landlock_restrict_self, on all machines alike

std::atomic<int> ruleset{-1};
std::atomic<unsigned> done{0};
std::atomic<int> failure{0};

/// Runs on the thread that is to be restricted; calls nothing but the system.
void restrict_self(int) {
  const int before = errno;
  if (::syscall(kRestrictSelf, ruleset.load(), 0) != 0) failure = errno;
  ++done;
  errno = before;
}

/// Whether a thread did it: false where it has ended meanwhile.
bool restrict_other(pid_t process, pid_t thread, int number) {
  const unsigned before = done.load();
  if (::syscall(SYS_tgkill, process, thread, number) != 0) return false;
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (done.load() == before) {
    if (::syscall(SYS_tgkill, process, thread, 0) != 0) return false;
    if (std::chrono::steady_clock::now() > until)
      throw wavecomb::Error("a thread of this process cannot be put into the sandbox");
    std::this_thread::sleep_for(std::chrono::microseconds(50));
  }
  return true;
}

/// See _core.pyi.
size_t restrict_threads(int descriptor) {
  const auto process = ::getpid();
  const auto self = static_cast<pid_t>(::syscall(SYS_gettid));
  const int number = SIGRTMAX - 2;
  ruleset = descriptor;
  failure = 0;
  // Threads that start from now on are as who starts them.
  restrict_self(0);
  struct sigaction action{}, before{};
  action.sa_handler = restrict_self;
  action.sa_flags = SA_RESTART;
  if (::sigaction(number, &action, &before) != 0)
    throw wavecomb::Error("no signal for the threads of this process");
  std::set<pid_t> known{self};
  // Until none is new: one that is not restricted yet may have started another.
  for (bool is_more = true; is_more;) {
    is_more = false;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task")) {
      const pid_t thread = std::stoi(entry.path().filename().string());
      if (!known.insert(thread).second) continue;
      is_more = true;
      restrict_other(process, thread, number);
    }
  }
  ::sigaction(number, &before, nullptr);
  if (failure != 0) throw wavecomb::Error("the sandbox refuses a thread of this process");
  return known.size();
}

#else

size_t restrict_threads(int) {
  throw wavecomb::Error("the sandbox is Linux's");
}

#endif

}  // namespace

void bind_threads(nb::module_& m) {
  m.def("restrict_threads", &restrict_threads, nb::arg("ruleset"));
}
