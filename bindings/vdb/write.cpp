// SPDX-License-Identifier: Apache-2.0
#include "write.h"

#include <cstring>
#include <stdexcept>

#include "bricks.h"

namespace vdb {

namespace {

bool is_plus_zero(float value) {
  uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof(bits));
  return bits == 0;
}

template <typename Grid>
openvdb::GridBase::Ptr fill(const GridDesc& desc) {
  using Value = typename Grid::ValueType;
  constexpr uint32_t channels = ChannelsOf<Value>::value;
  auto grid = Grid::create();
  for (const FilledBox& box : desc.boxes)
    grid->sparseFill(
        {{box.first[0], box.first[1], box.first[2]}, {box.last[0], box.last[1], box.last[2]}},
        Value(box.value));
  for (size_t b = 0; b < desc.count; ++b) {
    const int32_t* at = desc.origins + 3 * b;
    for (int axis = 0; axis < 3; ++axis)
      if (at[axis] % kBrickEdge != 0) throw std::invalid_argument("origins must be multiples of 8");
    auto* leaf = grid->tree().touchLeaf({at[0], at[1], at[2]});
    const float* voxel = desc.values + b * kBrickVoxels * channels;
    for (uint32_t i = 0; i < kBrickVoxels; ++i, voxel += channels) {
      bool is_off = true;
      for (uint32_t c = 0; c < channels; ++c) is_off = is_off && is_plus_zero(voxel[c]);
      if (is_off) continue;
      if constexpr (channels == 3)
        leaf->setValueOn(i, Value(voxel[0], voxel[1], voxel[2]));
      else
        leaf->setValueOn(i, *voxel);
    }
  }
  return grid;
}

}  // namespace

openvdb::GridBase::Ptr make_grid(const GridDesc& desc) {
  openvdb::GridBase::Ptr grid =
      desc.channels == 3 ? fill<openvdb::Vec3SGrid>(desc) : fill<openvdb::FloatGrid>(desc);
  if (desc.makes_tiles) grid->pruneGrid();
  grid->setName(desc.name);
  if (desc.channels == 1) grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  grid->setSaveFloatAsHalf(desc.is_half);
  openvdb::Mat4d matrix(desc.index_to_object.data());
  if (!openvdb::math::isInvertible(matrix))
    throw std::invalid_argument("a transform without an inverse");
  grid->setTransform(openvdb::math::Transform::createLinearTransform(matrix));
  return grid;
}

}  // namespace vdb
