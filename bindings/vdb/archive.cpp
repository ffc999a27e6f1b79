// SPDX-License-Identifier: Apache-2.0
#include "archive.h"

#include <openvdb/io/Compression.h>
#include <openvdb/io/io.h>

#include <algorithm>
#include <map>

#include "opened.h"

namespace vdb {

namespace {

namespace vio = openvdb::io;

}  // namespace

Archive::Archive(const std::string& path) {
  // Whatever is missing from the file throws; OpenVDB does not look.
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
  if (count < 0) throw BrokenFile("a count of grids below 0");
  std::map<std::string, uint32_t> known;
  for (int32_t i = 0; i < count; ++i) {
    Entry entry;
    entry.descriptor.read(stream_);
    const auto& d = entry.descriptor;
    const int64_t here = stream_.tellg();
    // A file that is cut off loses what is last; and no table leads in a circle.
    if (d.getEndPos() > size) throw BrokenFile("the file ends too early");
    if (d.getGridPos() < here || d.getBlockPos() < d.getGridPos() ||
        d.getEndPos() < d.getBlockPos())
      throw BrokenFile("grids lie where they cannot be");
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
  throw BrokenFile("a grid shares the voxels of one that is not there");
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

std::string Archive::one_line(const char* text) {
  std::string line(text);
  // The library's exceptions begin with their names.
  const size_t colon = line.find("Error: ");
  if (colon != std::string::npos && line.find(' ') == colon + 6) line.erase(0, colon + 7);
  std::replace_if(
      line.begin(), line.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, ' ');
  return line.empty() ? "it is damaged" : line.substr(0, 200);
}

}  // namespace vdb
