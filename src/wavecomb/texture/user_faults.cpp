// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/texture/user_faults.h"

#include "wavecomb/core/error.h"

#if defined(__linux__)
#include <fcntl.h>
#include <linux/userfaultfd.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <utility>
#endif

namespace wavecomb {

#if defined(__linux__) && defined(UFFD_USER_MODE_ONLY)

namespace {

/// Opens a userfaultfd descriptor; returns -1 and sets errno on failure.
int open_faults() {
  // Handle only faults in user mode: unprivileged users may not handle faults that occur in the
  // kernel.
  const auto fd =
      static_cast<int>(::syscall(SYS_userfaultfd, O_CLOEXEC | O_NONBLOCK | UFFD_USER_MODE_ONLY));
  if (fd < 0) return -1;
  uffdio_api api{};
  api.api = UFFD_API;
  if (::ioctl(fd, UFFDIO_API, &api) == 0) return fd;
  const int reason = errno;
  ::close(fd);
  errno = reason;
  return -1;
}

uint64_t number(const std::byte* at) {
  return reinterpret_cast<uintptr_t>(at);
}

std::string reason_of(int error) {
  return std::string("the system allows no userfaultfd (") + std::strerror(error) + ")";
}

}  // namespace

std::string UserFaults::unsupported_reason() {
  const int fd = open_faults();
  if (fd < 0) return reason_of(errno);
  ::close(fd);
  return "";
}

UserFaults::UserFaults() : faults_(open_faults()) {
  if (faults_ < 0) throw Error(reason_of(errno));
  stop_ = ::eventfd(0, EFD_CLOEXEC);
  if (stop_ < 0) {
    const int reason = errno;
    ::close(faults_);
    throw Error(reason_of(reason));
  }
}

UserFaults::~UserFaults() {
  for (const auto& [at, bytes] : maps_) ::munmap(at, bytes);
  ::close(stop_);
  ::close(faults_);
}

const std::byte* UserFaults::map(size_t bytes) {
  void* at = ::mmap(nullptr, bytes, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (at == MAP_FAILED)
    throw Error(std::string("no address space for textures (") + std::strerror(errno) + ")");
  maps_.emplace_back(static_cast<std::byte*>(at), bytes);
  // Exclude the range from forks, since the child process would read zeros in unfilled pages.
  ::madvise(at, bytes, MADV_DONTFORK);
  ::madvise(at, bytes, MADV_NOHUGEPAGE);
  uffdio_register range{};
  range.range = {number(maps_.back().first), bytes};
  range.mode = UFFDIO_REGISTER_MODE_MISSING;
  if (::ioctl(faults_, UFFDIO_REGISTER, &range) != 0) throw Error(reason_of(errno));
  return maps_.back().first;
}

int UserFaults::fill(const std::byte* at, const std::byte* from, size_t bytes) noexcept {
  size_t done = 0;
  while (done < bytes) {
    uffdio_copy copy{};
    copy.dst = number(at) + done;
    copy.src = number(from) + done;
    copy.len = bytes - done;
    if (::ioctl(faults_, UFFDIO_COPY, &copy) == 0) return 0;
    if (errno != EAGAIN) return errno;
    // The kernel stopped early because mappings changed concurrently; continue after the copied
    // part.
    if (copy.copy > 0) done += static_cast<size_t>(copy.copy);
  }
  return 0;
}

void UserFaults::abandon(const std::byte* at, size_t bytes) noexcept {
  // After this call, the kernel fills the range with zero pages, as it does for ordinary memory.
  uffdio_range range{number(at), bytes};
  ::ioctl(faults_, UFFDIO_UNREGISTER, &range);
  wake(at, bytes);
}

void UserFaults::release(const std::byte* at, size_t bytes) noexcept {
  ::madvise(const_cast<std::byte*>(at), bytes, MADV_DONTNEED);
}

void UserFaults::wake(const std::byte* at, size_t bytes) noexcept {
  uffdio_range range{number(at), bytes};
  ::ioctl(faults_, UFFDIO_WAKE, &range);
}

size_t UserFaults::wait(const std::byte** addresses) noexcept {
  for (;;) {
    pollfd files[2] = {{faults_, POLLIN, 0}, {stop_, POLLIN, 0}};
    // Keep serving after any poll error, such as lack of memory, since readers are waiting.
    if (::poll(files, 2, -1) < 0) {
      if (errno != EINTR) ::usleep(1000);
      continue;
    }
    if (files[1].revents != 0) return 0;
    uffd_msg messages[kMaxAddresses];
    const ssize_t size = ::read(faults_, messages, sizeof(messages));
    size_t count = 0;
    for (size_t i = 0; size > 0 && i < static_cast<size_t>(size) / sizeof(uffd_msg); ++i)
      if (messages[i].event == UFFD_EVENT_PAGEFAULT)
        addresses[count++] =
            reinterpret_cast<const std::byte*>(uintptr_t{messages[i].arg.pagefault.address});
    if (count > 0) return count;  // If nothing was read, another thread has read the events.
  }
}

void UserFaults::stop() {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(stop_, &one, sizeof(one));
}

size_t page_bytes() {
  static const auto bytes = static_cast<size_t>(::sysconf(_SC_PAGESIZE));
  return bytes;
}

#else

std::string UserFaults::unsupported_reason() {
  return "the system has no userfaultfd; it needs Linux 5.11 or later";
}
UserFaults::UserFaults() {
  throw Error(unsupported_reason());
}
UserFaults::~UserFaults() = default;
const std::byte* UserFaults::map(size_t) {
  return nullptr;
}
int UserFaults::fill(const std::byte*, const std::byte*, size_t) noexcept {
  return 0;
}
void UserFaults::abandon(const std::byte*, size_t) noexcept {}
void UserFaults::release(const std::byte*, size_t) noexcept {}
void UserFaults::wake(const std::byte*, size_t) noexcept {}
size_t UserFaults::wait(const std::byte**) noexcept {
  return 0;
}
void UserFaults::stop() {}
size_t page_bytes() {
  return 4096;
}

#endif

}  // namespace wavecomb
