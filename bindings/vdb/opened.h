// SPDX-License-Identifier: Apache-2.0
/// Function that opens an input file with a stream that throws at the end of the file.
#pragma once

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

namespace vdb {

/// Opens a file and returns its size in bytes. Throws std::system_error if the file cannot be
/// opened. The stream throws an exception when code reads past the end of the file.
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
