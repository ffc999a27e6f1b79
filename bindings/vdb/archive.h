// SPDX-License-Identifier: Apache-2.0
/// A .vdb file, read by OpenVDB from a stream that throws where the file ends too early.
#pragma once

#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/io.h>
#include <openvdb/openvdb.h>

#include <fstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace vdb {

/// Not a .vdb file, or one that ends too early or holds what no library wrote; says what in a line.
struct BrokenFile : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Where a grid is in a file.
struct Entry {
  openvdb::io::GridDescriptor descriptor;
  /// Among the grids of its name, in the file's order.
  uint32_t index = 0;

  /// Its name without what makes it unique.
  const std::string& name() const { return descriptor.gridName(); }
};

/// What is read of a grid: transform and metadata, the tree without values of voxels, or all.
enum class Part { kHead, kTopology, kWhole };

/// A file that is open. openvdb::io::File goes on behind the end of a file and gives zeros.
class Archive : private openvdb::io::Archive {
 public:
  /// Opens a file and finds its grids. Throws BrokenFile, std::system_error, std::bad_alloc.
  explicit Archive(const std::string& path);

  const std::vector<Entry>& entries() const { return entries_; }

  /// Reads a grid; null where the library knows no grids of its type. `before_values` is called
  /// with the tree's topology, before there is memory for its values. Throws as the constructor.
  template <typename BeforeValues>
  openvdb::GridBase::Ptr read(const Entry& entry, Part part, BeforeValues&& before_values) {
    return guarded([&] {
      openvdb::GridBase::Ptr grid = begin(entry);
      if (grid == nullptr || part == Part::kHead) return grid;
      if (entry.descriptor.isInstance()) {
        const openvdb::GridBase::Ptr parent =
            read(instance_parent(entry), part, std::forward<BeforeValues>(before_values));
        if (parent == nullptr || parent->type() != grid->type())
          throw BrokenFile("a grid shares the voxels of one of another type");
        grid->setTree(parent->baseTreePtr());
        return grid;
      }
      grid->readTopology(stream_);
      if (part == Part::kTopology) return grid;
      before_values(*grid);
      grid->readBuffers(stream_);
      return grid;
    });
  }

 private:
  /// What `read` gives, with the library's exceptions as BrokenFile.
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
  /// Gives the stream what the library's functions ask it for; nothing stays of a grid before.
  void tag_stream();
  /// A grid with its metadata and transform; the stream is at its tree.
  openvdb::GridBase::Ptr begin(const Entry& entry);
  const Entry& instance_parent(const Entry& entry) const;

  std::ifstream stream_;
  /// The stream holds the address of this.
  openvdb::io::StreamMetadata::Ptr metadata_;
  std::vector<Entry> entries_;
};

}  // namespace vdb
