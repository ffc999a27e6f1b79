// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/texture/tile_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "wavecomb/core/error.h"

namespace wavecomb {
namespace {

int open_unnamed(const std::string& folder) {
#if defined(O_TMPFILE)
  const int file = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (file >= 0) return file;
#endif
  // Fallback for file systems without O_TMPFILE: create a named file and unlink it.
  std::string path = folder + "/wavecomb-textures-XXXXXX";
  const int named = ::mkstemp(path.data());
  if (named < 0) return -1;
  ::unlink(path.c_str());
  ::fcntl(named, F_SETFD, FD_CLOEXEC);
  return named;
}

[[noreturn]] void fail(const std::string& what, const std::string& folder, int reason) {
  throw Error("texture limit: " + what + " " + folder + " (" + std::strerror(reason) +
              "); set TMPDIR to a folder with room, or give a larger limit");
}

}  // namespace

TileFile::TileFile(std::string folder) : folder_(std::move(folder)), file_(open_unnamed(folder_)) {
  if (file_ < 0) fail("no file for textures can be made in", folder_, errno);
}

TileFile::~TileFile() {
  ::close(file_);
}

void TileFile::write(const std::byte* from, size_t bytes, uint64_t offset) {
  while (bytes > 0) {
    const ssize_t n = ::pwrite(file_, from, bytes, static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      const uint64_t megabytes = (offset + bytes) / 1'000'000 + 1;
      fail(std::to_string(megabytes) + " MB of textures do not fit into", folder_,
           n < 0 ? errno : ENOSPC);
    }
    from += n;
    bytes -= static_cast<size_t>(n);
    offset += static_cast<uint64_t>(n);
    uint64_t before = bytes_;
    while (before < offset && !bytes_.compare_exchange_weak(before, offset)) {
    }
  }
}

bool TileFile::read(std::byte* to, size_t bytes, uint64_t offset) const {
  while (bytes > 0) {
    const ssize_t n = ::pread(file_, to, bytes, static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    to += n;
    bytes -= static_cast<size_t>(n);
    offset += static_cast<uint64_t>(n);
  }
  return true;
}

void TileFile::discard(uint64_t offset, uint64_t bytes) {
#if defined(FALLOC_FL_PUNCH_HOLE)
  // The call only frees disk space. On file systems that do not support hole punching, the next
  // texture stored in the range reuses the space.
  [[maybe_unused]] const int done =
      ::fallocate(file_, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, static_cast<off_t>(offset),
                  static_cast<off_t>(bytes));
#else
  (void)offset, (void)bytes;
#endif
}

}  // namespace wavecomb
