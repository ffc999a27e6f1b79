// SPDX-License-Identifier: Apache-2.0
/// A file that is read, whose stream throws where something is missing.
#pragma once

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

namespace vdb {

/// Opens it, and gives its size in bytes. What cannot be read of it later throws. Throws
/// std::system_error.
inline uintmax_t open_to_read(std::ifstream& stream, const std::string& path) {
  std::error_code code;
  const auto size = std::filesystem::file_size(path, code);
  if (code) throw std::system_error(code);
  stream.open(path, std::ios::binary);
  if (!stream) throw std::system_error(errno, std::generic_category());
  stream.exceptions(std::ios::failbit | std::ios::badbit | std::ios::eofbit);
  return size;
}

}  // namespace vdb
