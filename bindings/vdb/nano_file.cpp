// SPDX-License-Identifier: Apache-2.0
#include "nano_file.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <new>
#include <vector>

#include "nano_tree.h"
#include "opened.h"
#include "packed.h"

namespace vdb {

namespace {

/// Header of a segment (nanovdb::io::Header).
struct SegmentHead {
  std::array<char, 8> magic;
  uint32_t version;
  uint16_t count;
  uint16_t codec;
};
static_assert(sizeof(SegmentHead) == 16);

/// Header of a grid in a segment, before its name (nanovdb::io::MetaData).
struct GridHead {
  uint64_t size, file_size, name_key, voxels;
  uint32_t type, kind;
  std::array<double, 6> world_box;
  std::array<int32_t, 6> index_box;
  std::array<double, 3> voxel_size;
  uint32_t name_size;
  std::array<uint32_t, 4> nodes;
  std::array<uint32_t, 3> tiles;
  uint16_t codec, padding;
  uint32_t version;
};
static_assert(sizeof(GridHead) == 176);

constexpr char kMagic[] = "NanoVDB";
constexpr char kMagicOfOthers[] = "BDVonaN";
/// Maximum unpacked size of a chunk of Blosc data. NanoVDB compresses a grid as a sequence of such
/// chunks.
constexpr uint64_t kNanoChunk = uint64_t{1} << 30;
/// Upper bound of the compression ratios of zlib and Blosc.
constexpr uint64_t kMaxPacked = 1100;
constexpr uint32_t kLongestName = 1 << 16;

std::string version_text(uint32_t version) {
  return std::to_string(version >> 21) + "." + std::to_string((version >> 10) & 2047);
}

/// Throws BrokenFile if a segment is not supported.
void check_head(const SegmentHead& head) {
  if (std::memcmp(head.magic.data() + 1, kMagicOfOthers, 7) == 0)
    throw BrokenFile("it was written on a machine of the other byte order");
  if (std::memcmp(head.magic.data(), kMagic, 7) != 0)
    throw BrokenFile("a segment has no valid header");
  if (head.magic[7] == '1')
    throw BrokenFile("it is a grid without a header: write it with nanovdb::io::writeGrid");
  const uint32_t major = head.version >> 21, known = nano_major_version();
  if (known == 0) throw BrokenFile("this build is without NanoVDB (libnanovdb-dev)");
  if (major != known)
    throw BrokenFile("format " + version_text(head.version) + " of NanoVDB is " +
                     (major < known ? "older" : "newer") + " than " + std::to_string(known) +
                     ", which is read: convert it, or give the .vdb file that it was made from");
  if (head.magic[7] != '0' && head.magic[7] != '2')
    throw BrokenFile("it is an unknown kind of NanoVDB file");
  if (head.codec > 2) throw BrokenFile("its compression is not known");
}

/// Location of a grid in a file.
struct NanoEntry {
  std::string name;
  /// Position of the grid among the grids of the same name.
  uint32_t index = 0;
  /// Type of the grid, a nanovdb::GridType.
  uint32_t type = 0;
  /// Compression of the grid: 0 means none, 1 zlib, and 2 Blosc.
  uint16_t codec = 0;
  /// Unpacked size of the grid in bytes, its size in the file, and its offset in the file.
  uint64_t size = 0, file_size = 0, offset = 0;
};

constexpr std::align_val_t kAligned{64};
struct FreeAligned {
  void operator()(char* p) const { ::operator delete[](p, kAligned); }
};
using AlignedBytes = std::unique_ptr<char[], FreeAligned>;

class NanoFile final : public GridFile {
 public:
  explicit NanoFile(const std::string& path);

  size_t size() const override { return entries_.size(); }
  Head head(size_t number) const override {
    const NanoEntry& entry = entries_.at(number);
    return {entry.name, entry.index, type_name(entry), false};
  }
  bool describe(size_t number, GridFacts& facts) override {
    const NanoEntry& entry = entries_.at(number);
    if (!is_nano_type_read(entry.type)) return false;
    const AlignedBytes bytes = load(entry, std::numeric_limits<uint64_t>::max());
    facts = nano_facts(bytes_of(bytes), entry.size, entry.type);
    facts.metadata.emplace_back("name", entry.name);
    return true;
  }
  Bricks read(size_t number, const BrickOptions& options, GridFacts& facts) override {
    const NanoEntry& entry = entries_.at(number);
    if (!is_nano_type_read(entry.type))
      throw BrokenFile("it is of type " + type_name(entry) + ", which is not read");
    const AlignedBytes bytes = load(entry, options.max_bytes);
    facts = nano_facts(bytes_of(bytes), entry.size, entry.type);
    return nano_bricks(bytes_of(bytes), entry.size, entry.type, options);
  }

 private:
  /// Returns OpenVDB's name of a grid type. For quantised grids, the name contains the number of
  /// bits, such as "Tree_fp8_5_4_3".
  static std::string type_name(const NanoEntry& entry) {
    return std::string("Tree_") + nano_type_word(entry.type) + "_5_4_3";
  }
  static const unsigned char* bytes_of(const AlignedBytes& bytes) {
    return reinterpret_cast<const unsigned char*>(bytes.get());
  }
  template <typename T>
  T take();
  void find_grids(uint64_t file_bytes);
  AlignedBytes load(const NanoEntry& entry, uint64_t max_bytes);
  void unpack(const NanoEntry& entry, char* to);

  std::ifstream stream_;
  std::vector<NanoEntry> entries_;
};

NanoFile::NanoFile(const std::string& path) {
  const uintmax_t size = open_to_read(stream_, path);
  try {
    find_grids(size);
  } catch (const std::ios_base::failure&) {
    throw BrokenFile("the file ends too early");
  }
}

template <typename T>
T NanoFile::take() {
  T value;
  stream_.read(reinterpret_cast<char*>(&value), sizeof(value));
  return value;
}

void NanoFile::find_grids(uint64_t file_bytes) {
  std::map<std::string, uint32_t> known;
  for (uint64_t at = 0; at < file_bytes;) {
    stream_.seekg(static_cast<std::streamoff>(at));
    const auto head = take<SegmentHead>();
    check_head(head);
    const size_t first = entries_.size();
    for (uint32_t i = 0; i < head.count; ++i) {
      const auto grid = take<GridHead>();
      if (grid.name_size > kLongestName) throw BrokenFile("the name of a grid is too long");
      std::string name(grid.name_size, '\0');
      stream_.read(name.data(), grid.name_size);
      NanoEntry& entry = entries_.emplace_back();
      entry.name = name.c_str();
      entry.index = known[entry.name]++;
      entry.type = grid.type;
      entry.codec = head.codec;
      entry.size = grid.size;
      entry.file_size = grid.file_size;
    }
    at = static_cast<uint64_t>(stream_.tellg());
    for (size_t i = first; i < entries_.size(); ++i) {
      NanoEntry& entry = entries_[i];
      entry.offset = at;
      if (entry.file_size > file_bytes - at) throw BrokenFile("the file ends too early");
      at += entry.file_size;
    }
  }
}

void NanoFile::unpack(const NanoEntry& entry, char* to) {
  stream_.seekg(static_cast<std::streamoff>(entry.offset));
  if (entry.codec == 0) {
    stream_.read(to, static_cast<std::streamsize>(entry.size));
    return;
  }
  const uint64_t end = entry.offset + entry.file_size;
  for (uint64_t done = 0; done < entry.size;) {
    const uint64_t bytes = entry.codec == 2 ? std::min(kNanoChunk, entry.size - done) : entry.size;
    const auto length = take<uint64_t>();
    if (length > end - static_cast<uint64_t>(stream_.tellg()))
      throw BrokenFile("a chunk is longer than its grid");
    const auto packed = std::make_unique_for_overwrite<unsigned char[]>(length);
    stream_.read(reinterpret_cast<char*>(packed.get()), static_cast<std::streamsize>(length));
    const bool ok = entry.codec == 2 ? unpack_blosc(packed.get(), length, to + done, bytes)
                                     : unpack_zip(packed.get(), length, to + done, bytes);
    if (!ok) throw BrokenFile("a chunk cannot be unpacked");
    done += bytes;
  }
}

AlignedBytes NanoFile::load(const NanoEntry& entry, uint64_t max_bytes) {
  if (entry.codec == 0 ? entry.size != entry.file_size : entry.size / kMaxPacked > entry.file_size)
    throw BrokenFile("the sizes of a grid are inconsistent");
  if (entry.size > max_bytes) throw TooLarge(limit_message("the grid", entry.size, max_bytes));
  AlignedBytes bytes(static_cast<char*>(::operator new[](entry.size, kAligned)));
  try {
    unpack(entry, bytes.get());
  } catch (const std::ios_base::failure&) {
    throw BrokenFile("the file ends too early");
  }
  return bytes;
}

}  // namespace

bool is_nano_file(const std::string& path) {
  std::array<char, 8> start{};
  std::ifstream(path, std::ios::binary).read(start.data(), start.size());
  return std::memcmp(start.data(), kMagic, 7) == 0 ||
         std::memcmp(start.data() + 1, kMagicOfOthers, 7) == 0;
}

std::unique_ptr<GridFile> open_nano_file(const std::string& path) {
  return std::make_unique<NanoFile>(path);
}

std::unique_ptr<GridFile> open_file(const std::string& path) {
  return is_nano_file(path) ? open_nano_file(path) : open_archive(path);
}

}  // namespace vdb
