// SPDX-License-Identifier: Apache-2.0
#include "writing.h"

#include <openvdb/io/Compression.h>
#include <openvdb/io/File.h>
#include <openvdb/math/Maps.h>
#include <openvdb/tools/Prune.h>

#include <bit>
#include <cerrno>
#include <memory>
#include <system_error>

#include "bricks.h"
#include "open_tree.h"

namespace vdb {

namespace {

openvdb::Coord coord_of(const int32_t* xyz) {
  return {xyz[0], xyz[1], xyz[2]};
}

float value_at(const float* from, float) {
  return *from;
}
openvdb::Vec3s value_at(const float* from, const openvdb::Vec3s&) {
  return {from[0], from[1], from[2]};
}

template <typename Grid>
void add_bricks(Grid& grid, const WrittenGrid& from) {
  const float* values = from.values;
  for (size_t brick = 0; brick < from.bricks; ++brick) {
    auto* leaf = grid.tree().touchLeaf(coord_of(from.origins + 3 * brick));
    for (openvdb::Index i = 0; i < kBrickVoxels; ++i, values += from.channels) {
      uint32_t bits = 0;
      for (uint32_t c = 0; c < from.channels; ++c) bits |= std::bit_cast<uint32_t>(values[c]);
      if (bits != 0) leaf->setValueOn(i, value_at(values, typename Grid::ValueType()));
    }
  }
}

template <typename Value>
openvdb::GridBase::Ptr make(const WrittenGrid& from) {
  // Created by the library. A constructor called here would compile the tree's virtual functions,
  // which takes half a minute.
  const auto grid = openvdb::StaticPtrCast<GridOf<Value>>(
      openvdb::GridBase::createGrid(GridOf<Value>::gridType()));
  for (const FilledBox& box : from.boxes)
    grid->fill({coord_of(box.first.data()), coord_of(box.last.data())}, Value(box.value));
  add_bricks(*grid, from);
  if (from.has_tiles) openvdb::tools::prune(grid->tree());
  if (from.channels == 1) grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  return grid;
}

openvdb::GridBase::Ptr make_grid(const WrittenGrid& from) {
  const auto grid = from.channels == 3 ? make<openvdb::Vec3s>(from) : make<float>(from);
  const auto map =
      std::make_shared<openvdb::math::AffineMap>(openvdb::Mat4d(from.index_to_object.data()));
  grid->setTransform(std::make_shared<openvdb::math::Transform>(map));
  grid->setName(from.name);
  grid->setSaveFloatAsHalf(from.is_half);
  return grid;
}

}  // namespace

void write_file(const std::string& path, const std::vector<WrittenGrid>& grids) {
  openvdb::GridPtrVec made;
  for (const WrittenGrid& grid : grids) made.push_back(make_grid(grid));
  errno = 0;
  try {
    openvdb::io::File file(path);
    file.setCompression(openvdb::io::COMPRESS_ZIP | openvdb::io::COMPRESS_ACTIVE_MASK);
    file.write(made);
    file.close();
  } catch (const openvdb::IoError&) {
    throw std::system_error(errno != 0 ? errno : EIO, std::generic_category());
  }
}

}  // namespace vdb
