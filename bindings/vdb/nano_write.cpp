// SPDX-License-Identifier: Apache-2.0
#include "nano_write.h"

#include <stdexcept>

#if __has_include(<nanovdb/util/OpenToNanoVDB.h>)
#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <new>
#include <system_error>

// By their prototypes, as those that unpack (packed.h).
extern "C" {
int blosc_compress_ctx(int level, int shuffle, size_t type_size, size_t bytes, const void* from,
                       void* to, size_t most, const char* name, size_t block, int threads);
int compress(unsigned char* to, unsigned long* size, const unsigned char* from,
             unsigned long from_size);
unsigned long compressBound(unsigned long size);
}
#endif

namespace vdb {

#if __has_include(<nanovdb/util/OpenToNanoVDB.h>)

namespace {

/// Memory of a grid, 0 where nothing is written, so that files repeat.
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

Handle convert(const NanoDesc& desc) {
  const openvdb::GridBase& grid = *desc.grid;
  if (grid.isType<openvdb::Vec3SGrid>()) return convert<openvdb::Vec3f, nanovdb::Vec3f>(grid);
  if (desc.bits == "4") return convert<float, nanovdb::Fp4>(grid);
  if (desc.bits == "8") return convert<float, nanovdb::Fp8>(grid);
  if (desc.bits == "16") return convert<float, nanovdb::Fp16>(grid);
  if (desc.bits == "n") return convert<float, nanovdb::FpN>(grid);
  if (desc.bits != "32") throw std::invalid_argument("bits must be 4, 8, 16, 32 or n");
  return convert<float, float>(grid);
}

/// What nanovdb::io::writeGrid writes of a grid.
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

}  // namespace

bool can_write_nano() {
  return true;
}

void write_nano(const std::string& path, const std::vector<NanoDesc>& grids,
                const std::string& packed) {
  using nanovdb::io::Codec;
  if (packed != "" && packed != "zip" && packed != "blosc")
    throw std::invalid_argument("packed must be zip, blosc or nothing");
  const Codec codec = packed == "zip" ? Codec::ZIP : packed == "blosc" ? Codec::BLOSC : Codec::NONE;
  nanovdb::io::Segment segment(codec);
  std::vector<std::string> all;
  for (const NanoDesc& desc : grids) {
    const Handle handle = convert(desc);
    segment.add(handle);
    all.push_back(packed_bytes(handle, codec));
    segment.meta.back().fileSize = all.back().size();
  }
  std::ofstream file(path, std::ios::binary);
  if (file && !grids.empty()) segment.write(file);
  for (const std::string& bytes : all)
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) throw std::system_error(errno != 0 ? errno : EIO, std::generic_category());
}

#else

bool can_write_nano() {
  return false;
}

void write_nano(const std::string&, const std::vector<NanoDesc>&, const std::string&) {
  throw std::invalid_argument("this build is without NanoVDB");
}

#endif

}  // namespace vdb
