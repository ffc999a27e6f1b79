// SPDX-License-Identifier: Apache-2.0
/// A file of grids, whichever of the two libraries wrote it.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <memory>
#include <string>

#include "archive.h"
#include "nano_file.h"

namespace vdb {

/// A grid as the table of its file has it.
struct Head {
  std::string name;
  /// Among the grids of its name.
  uint32_t index = 0;
  /// As OpenVDB calls it: "Tree_float_5_4_3".
  std::string type;
  bool is_half = false;
};

/// Calls `use` with the grid as its own type; false where bricks are not made of that type.
template <typename Use>
bool with_grid(const openvdb::GridBase& grid, Use&& use) {
  const auto as = [&]<typename Grid>() {
    if (!grid.isType<Grid>()) return false;
    use(static_cast<const Grid&>(grid));
    return true;
  };
  return as.template operator()<openvdb::FloatGrid>() ||
         as.template operator()<openvdb::DoubleGrid>() ||
         as.template operator()<openvdb::Vec3SGrid>() ||
         as.template operator()<openvdb::Vec3DGrid>();
}

/// A file that is open: .nvdb by how it begins, else .vdb.
class GridFile {
 public:
  /// Throws BrokenFile, std::system_error, std::bad_alloc.
  explicit GridFile(const std::string& path);

  size_t size() const;
  Head head(size_t number) const;

  /// A grid, without values where `part` is its topology (of .nvdb files with them); null where it
  /// is of a type that is not known. Throws TooLarge where its bricks would take more than
  /// `most_bytes`, and as the constructor.
  openvdb::GridBase::Ptr read(size_t number, Part part, uint64_t most_bytes);

 private:
  std::unique_ptr<Archive> archive_;
  std::unique_ptr<NanoFile> nano_;
};

}  // namespace vdb
