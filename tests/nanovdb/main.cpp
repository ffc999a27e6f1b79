// SPDX-License-Identifier: Apache-2.0
/// Writes an .nvdb file from the first grids of .vdb files, with NanoVDB's own code.
///
///   wavecomb_nvdb_writer OUT.nvdb PACKED (BITS IN.vdb)...
///
/// PACKED is none, zip or blosc. BITS is 32; for a float grid it can also be 4, 8, 16 or n, to
/// which leaves are quantised. Equal grids give equal bytes.
#include <openvdb/openvdb.h>

#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#if __has_include(<nanovdb/util/OpenToNanoVDB.h>)
#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <new>
#include <stdexcept>

// Declare these functions here because they belong to OpenVDB's libraries, whose headers may not be
// installed.
extern "C" {
int blosc_compress_ctx(int level, int shuffle, size_t type_size, size_t bytes, const void* from,
                       void* to, size_t most, const char* name, size_t block, int threads);
int compress(unsigned char* to, unsigned long* size, const unsigned char* from,
             unsigned long from_size);
unsigned long compressBound(unsigned long size);
}

namespace {

/// Memory of a grid. Bytes that are never written are 0, so that equal grids give equal bytes.
class ZeroedBuffer {
 public:
  ZeroedBuffer() = default;
  explicit ZeroedBuffer(uint64_t size) : size_(size) {
    const size_t whole = (size + 63) / 64 * 64;
    data_ = static_cast<uint8_t*>(std::aligned_alloc(64, whole));
    if (data_ == nullptr) throw std::bad_alloc();
    std::memset(data_, 0, whole);
  }
  ZeroedBuffer(ZeroedBuffer&& other) noexcept { *this = std::move(other); }
  ZeroedBuffer& operator=(ZeroedBuffer&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    return *this;
  }
  ~ZeroedBuffer() { clear(); }

  static ZeroedBuffer create(uint64_t size, const ZeroedBuffer* = nullptr) {
    return ZeroedBuffer(size);
  }
  uint8_t* data() { return data_; }
  const uint8_t* data() const { return data_; }
  uint64_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  void clear() {
    std::free(data_);
    data_ = nullptr;
    size_ = 0;
  }

 private:
  uint8_t* data_ = nullptr;
  uint64_t size_ = 0;
};

using Handle = nanovdb::GridHandle<ZeroedBuffer>;

template <typename Open, typename Nano>
Handle convert(const openvdb::GridBase& grid) {
  using Grid = openvdb::Grid<typename openvdb::tree::Tree4<Open, 5, 4, 3>::Type>;
  return nanovdb::OpenToNanoVDB<Open, Nano, nanovdb::AbsDiff, ZeroedBuffer>()(
      static_cast<const Grid&>(grid));
}

Handle convert(const openvdb::GridBase& grid, const std::string& bits) {
  if (grid.isType<openvdb::Vec3SGrid>()) return convert<openvdb::Vec3f, nanovdb::Vec3f>(grid);
  if (bits == "4") return convert<float, nanovdb::Fp4>(grid);
  if (bits == "8") return convert<float, nanovdb::Fp8>(grid);
  if (bits == "16") return convert<float, nanovdb::Fp16>(grid);
  if (bits == "n") return convert<float, nanovdb::FpN>(grid);
  if (bits != "32") throw std::invalid_argument("bits must be 4, 8, 16, 32 or n");
  return convert<float, float>(grid);
}

/// Returns the bytes that nanovdb::io::writeGrid writes for a grid.
std::string packed_bytes(const Handle& handle, nanovdb::io::Codec codec) {
  std::string out;
  const auto add = [&](const void* from, uint64_t size) {
    out.append(reinterpret_cast<const char*>(&size), sizeof(size));
    out.append(static_cast<const char*>(from), size);
  };
  if (codec == nanovdb::io::Codec::NONE) {
    out.assign(reinterpret_cast<const char*>(handle.data()), handle.size());
  } else if (codec == nanovdb::io::Codec::ZIP) {
    unsigned long size = compressBound(handle.size());
    std::vector<unsigned char> packed(size);
    if (compress(packed.data(), &size, handle.data(), handle.size()) != 0) throw std::bad_alloc();
    add(packed.data(), size);
  } else {
    constexpr uint64_t kChunk = uint64_t{1} << 30;
    for (uint64_t done = 0; done < handle.size(); done += kChunk) {
      const uint64_t bytes = std::min(kChunk, handle.size() - done);
      std::vector<unsigned char> packed(bytes + 64);
      const int size = blosc_compress_ctx(9, 1, sizeof(float), bytes, handle.data() + done,
                                          packed.data(), packed.size(), "lz4", 1 << 18, 1);
      if (size <= 0) throw std::bad_alloc();
      add(packed.data(), static_cast<uint64_t>(size));
    }
  }
  return out;
}

void write(const std::string& path, const std::string& packed,
           const std::vector<std::pair<std::string, std::string>>& inputs) {
  using nanovdb::io::Codec;
  if (packed != "none" && packed != "zip" && packed != "blosc")
    throw std::invalid_argument("PACKED must be none, zip or blosc");
  const Codec codec = packed == "zip" ? Codec::ZIP : packed == "blosc" ? Codec::BLOSC : Codec::NONE;
  nanovdb::io::Segment segment(codec);
  std::vector<std::string> all;
  for (const auto& [bits, input] : inputs) {
    openvdb::io::File file(input);
    file.open(false);
    const Handle handle = convert(*file.readGrid(file.beginName().gridName()), bits);
    segment.add(handle);
    all.push_back(packed_bytes(handle, codec));
    segment.meta.back().fileSize = all.back().size();
  }
  std::ofstream file(path, std::ios::binary);
  if (file && !inputs.empty()) segment.write(file);
  for (const std::string& bytes : all)
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) throw std::runtime_error(path + " cannot be written");
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() < 4 || words.size() % 2 != 0) return 2;
  std::vector<std::pair<std::string, std::string>> inputs;
  for (size_t i = 2; i < words.size(); i += 2) inputs.emplace_back(words[i], words[i + 1]);
  try {
    openvdb::initialize();
    write(words[0], words[1], inputs);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "wavecomb_nvdb_writer: %s\n", error.what());
    return 1;
  }
  return 0;
}

#else

int main() {
  std::fprintf(stderr, "wavecomb_nvdb_writer: NanoVDB's headers were not there\n");
  return 1;
}

#endif
