// SPDX-License-Identifier: Apache-2.0
/// Reader of .vdb files. The reader uses OpenVDB with a stream that throws at the end of the file,
/// because openvdb::io::File continues past the end and reads zeros.
#include <openvdb/io/Archive.h>
#include <openvdb/io/Compression.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/io.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <map>
#include <vector>

#include "files.h"
#include "open_tree.h"
#include "opened.h"

namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {
// openvdb::initialize is declared here, because openvdb/openvdb.h also includes grids of points.
void initialize();
}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb

namespace vdb {

namespace {

namespace vio = openvdb::io;

/// Location of a grid in a file.
struct Entry {
  vio::GridDescriptor descriptor;
  /// Position of the grid among the grids of the same name.
  uint32_t index = 0;

  /// Name of the grid without the suffix that makes it unique.
  const std::string& name() const { return descriptor.gridName(); }
};

/// Part of a grid to read: the tree without voxel values (`kTopology`) or the whole grid
/// (`kWhole`).
enum class Part { kTopology, kWhole };

class Archive final : public GridFile, private vio::Archive {
 public:
  explicit Archive(const std::string& path);

  size_t size() const override { return entries_.size(); }
  Head head(size_t number) const override {
    const Entry& entry = entries_.at(number);
    return {entry.name(), entry.index, entry.descriptor.gridType(),
            entry.descriptor.saveFloatAsHalf()};
  }
  bool describe(size_t number, GridFacts& facts) override {
    const uint64_t unlimited = std::numeric_limits<uint64_t>::max();
    const auto grid = read_part(entries_.at(number), Part::kTopology, unlimited);
    if (grid == nullptr) return false;
    facts = facts_of(*grid);
    return true;
  }
  Bricks read(size_t number, const BrickOptions& options, GridFacts& facts) override {
    const Entry& entry = entries_.at(number);
    const auto grid = read_part(entry, Part::kWhole, options.max_bytes);
    if (grid == nullptr)
      throw BrokenFile("it is of type " + entry.descriptor.gridType() + ", which is not known");
    facts = facts_of(*grid);
    return bricks_of(*grid, options);
  }

 private:
  /// Calls `read` and returns its result. Throws `BrokenFile` if OpenVDB throws an exception.
  template <typename Read>
  static auto guarded(Read&& read) {
    try {
      return read();
    } catch (const openvdb::Exception& error) {
      throw BrokenFile(one_line(error.what()));
    } catch (const std::ios_base::failure&) {
      throw BrokenFile("the file ends too early");
    }
  }

  static std::string one_line(const char* text);
  void read_entries(int64_t size);
  /// Attaches the file's version and compression to the stream, where OpenVDB reads them, and
  /// removes the properties of the previous grid.
  void tag_stream();
  /// Creates a grid and reads its metadata and transform. Leaves the stream at the start of the
  /// grid's tree. Returns null if OpenVDB does not know the grid's type.
  openvdb::GridBase::Ptr begin(const Entry& entry);
  const Entry& instance_parent(const Entry& entry) const;
  /// Reads a grid; returns null if OpenVDB does not know the grid's type. Throws TooLarge after
  /// reading the grid's topology, before memory for its values is allocated.
  openvdb::GridBase::Ptr read_part(const Entry& entry, Part part, uint64_t max_bytes);

  std::ifstream stream_;
  /// The stream holds a pointer to this metadata object.
  vio::StreamMetadata::Ptr metadata_;
  std::vector<Entry> entries_;
};

Archive::Archive(const std::string& path) {
  // Reading past the end of the stream must throw, since OpenVDB does not check the state of the
  // stream.
  const uintmax_t size = open_to_read(stream_, path);
  guarded([&] {
    readHeader(stream_);
    if (fileVersion() > openvdb::OPENVDB_FILE_VERSION)
      throw BrokenFile("format " + std::to_string(fileVersion()) + " is newer than OpenVDB " +
                       std::string(OPENVDB_LIBRARY_VERSION_STRING) + " reads (" +
                       std::to_string(openvdb::OPENVDB_FILE_VERSION) + ")");
    if (!inputHasGridOffsets())
      throw BrokenFile("it was written as a stream, without a table of its grids: save it again");
    if (fileVersion() < openvdb::OPENVDB_FILE_VERSION_NEW_TRANSFORM)
      throw BrokenFile("format " + std::to_string(fileVersion()) +
                       " is older than OpenVDB 2: save it again");
    tag_stream();
    openvdb::MetaMap().readMeta(stream_);
    read_entries(static_cast<int64_t>(size));
    return 0;
  });
}

void Archive::read_entries(int64_t size) {
  const int32_t count = readGridCount(stream_);
  if (count < 0) throw BrokenFile("the number of grids is negative");
  std::map<std::string, uint32_t> known;
  for (int32_t i = 0; i < count; ++i) {
    Entry entry;
    entry.descriptor.read(stream_);
    const auto& d = entry.descriptor;
    const int64_t here = stream_.tellg();
    // Grids of a truncated file end beyond the file's size. Offsets must increase, so that no
    // sequence of grid offsets forms a cycle.
    if (d.getEndPos() > size) throw BrokenFile("the file ends too early");
    if (d.getGridPos() < here || d.getBlockPos() < d.getGridPos() ||
        d.getEndPos() < d.getBlockPos())
      throw BrokenFile("grid offsets are out of order");
    entry.index = known[entry.name()]++;
    entries_.push_back(entry);
    d.seekToEnd(stream_);
  }
}

const Entry& Archive::instance_parent(const Entry& entry) const {
  for (const Entry& other : entries_)
    if (other.descriptor.uniqueName() == entry.descriptor.instanceParentName() &&
        !other.descriptor.isInstance())
      return other;
  throw BrokenFile("a grid shares the voxels of a missing grid");
}

void Archive::tag_stream() {
  metadata_ = std::make_shared<vio::StreamMetadata>();
  vio::setStreamMetadataPtr(stream_, metadata_, false);
  vio::setVersion(stream_, libraryVersion(), fileVersion());
  setDataCompression(stream_);
}

openvdb::GridBase::Ptr Archive::begin(const Entry& entry) {
  const auto& d = entry.descriptor;
  if (!openvdb::GridBase::isRegistered(d.gridType())) return nullptr;
  tag_stream();
  d.seekToGrid(stream_);
  readGridCompression(stream_);
  openvdb::GridBase::Ptr grid = openvdb::GridBase::createGrid(d.gridType());
  grid->setSaveFloatAsHalf(d.saveFloatAsHalf());
  metadata_->setHalfFloat(d.saveFloatAsHalf());
  grid->readMeta(stream_);
  metadata_->gridMetadata() = static_cast<openvdb::MetaMap&>(*grid);
  vio::setGridClass(stream_, grid->getGridClass());
  grid->readTransform(stream_);
  return grid;
}

openvdb::GridBase::Ptr Archive::read_part(const Entry& entry, Part part, uint64_t max_bytes) {
  return guarded([&] {
    openvdb::GridBase::Ptr grid = begin(entry);
    if (grid == nullptr) return grid;
    if (part == Part::kWhole) check_type_of(*grid);
    if (entry.descriptor.isInstance()) {
      const openvdb::GridBase::Ptr parent = read_part(instance_parent(entry), part, max_bytes);
      if (parent == nullptr || parent->type() != grid->type())
        throw BrokenFile("a grid shares the voxels of a grid of another type");
      grid->setTree(parent->baseTreePtr());
      return grid;
    }
    grid->readTopology(stream_);
    if (part == Part::kTopology) return grid;
    check_size_of(*grid, max_bytes);
    grid->readBuffers(stream_);
    return grid;
  });
}

std::string Archive::one_line(const char* text) {
  std::string line(text);
  // Exceptions of OpenVDB begin with their type name.
  const size_t colon = line.find("Error: ");
  if (colon != std::string::npos && line.find(' ') == colon + 6) line.erase(0, colon + 7);
  std::replace_if(
      line.begin(), line.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, ' ');
  return line.empty() ? "it is damaged" : line.substr(0, 200);
}

}  // namespace

std::unique_ptr<GridFile> open_archive(const std::string& path) {
  return std::make_unique<Archive>(path);
}

void initialize_openvdb() {
  openvdb::initialize();
}

const char* openvdb_version() {
  return OPENVDB_LIBRARY_VERSION_STRING;
}

}  // namespace vdb
