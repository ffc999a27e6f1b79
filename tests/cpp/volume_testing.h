// SPDX-License-Identifier: Apache-2.0
/// Small grids and volumes for tests.
#pragma once

#include <functional>
#include <map>

#include "scene_testing.h"
#include "wavecomb/medium/description/volume.h"
#include "wavecomb/texture/half.h"

namespace wavecomb::volume_testing {

using namespace scene_testing;

using Voxels = std::function<float(int, int, int)>;

/// Makes a grid of value(x, y, z) at the voxels 0 <= x, y, z < size, as bricks. With 3 components,
/// r, g and b are 1, 2 and 3 times the value.
inline std::shared_ptr<const VolumeGrid> make_grid(int size, const Voxels& value,
                                                   uint32_t components = 1, bool is_half = false,
                                                   int first = 0) {
  std::vector<int32_t> origins;
  std::vector<float> voxels;
  std::vector<uint16_t> halves;
  for (int x = 0; x < size; x += 8)
    for (int y = 0; y < size; y += 8)
      for (int z = 0; z < size; z += 8) {
        origins.insert(origins.end(), {first + x, first + y, first + z});
        for (int i = 0; i < 512; ++i)
          for (uint32_t c = 0; c < components; ++c) {
            const int at[3] = {x + i / 64, y + i / 8 % 8, z + i % 8};
            const bool there = std::max({at[0], at[1], at[2]}) < size;
            const float v = there ? value(at[0], at[1], at[2]) * static_cast<float>(c + 1) : 0.f;
            if (is_half)
              halves.push_back(float_to_half(v));
            else
              voxels.push_back(v);
          }
      }
  return std::make_shared<const VolumeGrid>(
      GridBricks{"grid", origins, voxels, halves, components, 0.f});
}

/// Makes a velocity grid of value(x, y, z) at the voxels 0 <= x, y, z < size; size is a multiple of
/// 8.
inline std::shared_ptr<const VolumeGrid> make_wind(
    int size, const std::function<Vec3<float>(int, int, int)>& value, bool is_half = false) {
  std::vector<int32_t> origins;
  std::vector<float> voxels;
  std::vector<uint16_t> halves;
  for (int x = 0; x < size; x += 8)
    for (int y = 0; y < size; y += 8)
      for (int z = 0; z < size; z += 8) {
        origins.insert(origins.end(), {x, y, z});
        for (int i = 0; i < 512; ++i) {
          const Vec3<float> v = value(x + i / 64, y + i / 8 % 8, z + i % 8);
          for (const float c : {v.x, v.y, v.z})
            if (is_half)
              halves.push_back(float_to_half(c));
            else
              voxels.push_back(c);
        }
      }
  GridBricks bricks{"wind", origins, voxels, halves, 3, 0.f};
  bricks.is_signed = true;
  return std::make_shared<const VolumeGrid>(bricks);
}

/// Places voxels 0 to size - 1 between lo and hi along each axis.
inline VolumeField between(std::shared_ptr<const VolumeGrid> grid, int size, float lo, float hi) {
  const float step = (hi - lo) / static_cast<float>(size - 1);
  Affine map = scale(step, step, step);
  map.t = {lo, lo, lo};
  return {std::move(grid), map};
}

inline Volume make_box(const Vec3<float>& lo, const Vec3<float>& hi,
                       const Vec3<float>& extinction) {
  Volume v;
  v.box = {lo, hi};
  v.extinction = extinction;
  return v;
}

}  // namespace wavecomb::volume_testing
