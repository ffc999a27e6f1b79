// SPDX-License-Identifier: Apache-2.0
/// Volumes: what fills space between surfaces, as grids of voxels or evenly.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "wavecomb/core/affine.h"

namespace wavecomb {

/// Voxels of a brick along an edge. Bricks are kept with one more row of voxels at their upper
/// faces, so that a trilinear lookup reads one brick.
inline constexpr uint32_t kBrickEdge = 8, kBrickRow = kBrickEdge + 1,
                          kBrickVoxels = kBrickRow * kBrickRow * kBrickRow;
/// In a grid's table: no brick is there.
inline constexpr uint32_t kNoBrick = 0xffffffffu;

/// A grid as kernels read it. Its space is measured in bricks: the table covers [0, size).
struct GridView {
  const uint32_t* table = nullptr;  ///< by cell, x quickest: number of its brick or kNoBrick
  const float* most = nullptr;      ///< by cell: greatest value of any component that it can give
  const void* voxels = nullptr;     ///< brick by brick: floats, or halves in pairs
  uint32_t size[3] = {0, 0, 0};     ///< cells
  uint32_t components = 1;          ///< 1 or 3, side by side
  bool is_half = false;
  float background = 0;  ///< where there is no brick
};

/// What a grid is made of: the voxels of bricks of 8^3, as files have them.
struct GridBricks {
  std::string name;                  ///< for messages
  std::span<const int32_t> origins;  ///< x, y, z of each brick's first voxel, multiples of 8
  std::span<const float> floats;     ///< voxels, x slowest, z quickest, components side by side; or
  std::span<const uint16_t> halves;  ///< the same as halves
  uint32_t components = 1;
  float background = 0;
  bool is_signed = false;  ///< values may be below 0: velocities
};

/// Voxels in bricks, with a table of where they are. Immutable.
class VolumeGrid {
 public:
  /// Throws Error with one line for numbers that are negative (unless all have signs) or not
  /// finite, bricks that are doubled or not at multiples of 8, and grids that are too large to be
  /// numbered.
  explicit VolumeGrid(const GridBricks& bricks);

  GridView view() const;
  /// Index of the voxel that the table begins with.
  const std::array<int32_t, 3>& first_voxel() const { return first_; }
  size_t brick_count() const { return voxel_words_.size() / words_per_brick(); }
  size_t bytes() const;
  /// Greatest value; of what has signs, regardless of them.
  float most() const { return greatest_; }
  bool is_signed() const { return is_signed_; }
  const std::vector<uint32_t>& table() const { return table_; }
  const std::vector<uint32_t>& voxel_words() const { return voxel_words_; }

 private:
  size_t words_per_brick() const;

  std::array<int32_t, 3> first_{};
  std::array<uint32_t, 3> size_{};
  uint32_t components_;
  bool is_half_;
  float background_;
  bool is_signed_;
  float greatest_ = 0;
  std::vector<uint32_t> table_;
  std::vector<float> most_;
  std::vector<uint32_t> voxel_words_;
};

/// A grid, and the map from its voxels' indices to the volume's own space.
struct VolumeField {
  std::shared_ptr<const VolumeGrid> grid;  ///< null: there is none
  Affine index_to_object;
};

class VolumeMotion;

/// One volume. At a point, with the values of its fields there,
///   extinction sigma_t = extinction * density     per unit of world length, per channel
///   albedo             = albedo * color           share of it that is scattered
///   emitted radiance   = emission * (emission field, or density)   per unit of world length
/// Scattering follows Henyey and Greenstein. With a velocity field v what is at p at the time t is
/// what the fields have at p - v(p) t.
struct Volume {
  std::string name;
  VolumeField density;  ///< one component; none: 1 everywhere in the box
  VolumeField color;    ///< none: 1
  VolumeField glow;     ///< none: as density
  /// Three components with signs, in the volume's own space over a second; none: it stands still.
  VolumeField velocity;
  std::array<float, 2> seconds{0, 0};          ///< t where the shutter opens and closes
  std::shared_ptr<const VolumeMotion> motion;  ///< made by SceneBuilder::add_volume
  std::array<Vec3<float>, 2> box{Vec3<float>(0.f),
                                 Vec3<float>(0.f)};  ///< own space; where there is no density field
  Affine to_world;
  Vec3<float> extinction{1, 1, 1}, albedo{0.5f, 0.5f, 0.5f}, emission{0, 0, 0};
  float anisotropy = 0;  ///< mean cosine of the scattering angle, in (-1, 1)

  bool emits() const { return emission.x > 0 || emission.y > 0 || emission.z > 0; }
  bool moves() const { return velocity.grid && (seconds[0] != 0 || seconds[1] != 0); }
};

/// A field as kernels read it: x_bricks = A x_world + t, rows of A each followed by t's component.
struct PlacedGrid {
  GridView grid;
  float to_bricks[12] = {};
};

/// How a field that moves is looked up: from one space, of cells or the world.
struct FieldDrift {
  float to_velocity[12];  ///< to bricks of the velocity grid
  float to_bricks[12];    ///< to bricks of the field
  float per_second[12];   ///< from velocities to bricks of the field; translation 0
};

/// A volume as kernels read it. All lanes of a packet look at one volume at a time, so records are
/// read as they stand.
struct VolumeRecord {
  PlacedGrid density;  ///< table null: 1 in its one cell
  PlacedGrid color;    ///< table null: 1 everywhere
  PlacedGrid glow;     ///< that of density, where there is none
  float extinction[3], albedo[3], emission[3];
  float most_extinction;  ///< of the channels
  float anisotropy;
  bool is_grey;  ///< extinction is the same in all channels
  bool emits;
  bool moves;  ///< if so, it is flown through by cells of their own, which bound what comes by

  PlacedGrid density_cells, glow_cells;  ///< without a table
  GridView velocity;
  FieldDrift density_drift, glow_drift;  ///< from the spaces of these cells
  FieldDrift color_drift;                ///< from the world
  float seconds_open, seconds_span;
};

/// Volumes that a scene may have: kernels look at one after the other.
inline constexpr size_t kMostVolumes = 65536;

/// What kernels need of all volumes.
struct VolumeView {
  const VolumeRecord* volumes = nullptr;
  uint32_t count = 0;
  uint32_t first_material = 0;  ///< volume i has material first_material + i
  bool emits = false;           ///< some do
};

/// Throws Error with one line that names the volume.
void check_volume(const Volume& volume);
VolumeRecord make_volume_record(const Volume& volume);
/// Corners of the cells that a volume fills, in the world.
std::array<Vec3<float>, 8> volume_corners(const Volume& volume);

}  // namespace wavecomb
