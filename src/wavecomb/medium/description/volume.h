// SPDX-License-Identifier: Apache-2.0
/// Participating media in space: voxel grids, or homogeneous boxes.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "wavecomb/core/affine.h"

namespace wavecomb {

/// Edge length of a brick in voxels. A brick also stores copies of the next voxels beyond its upper
/// faces, so that a trilinear lookup reads a single brick.
inline constexpr uint32_t kBrickEdge = 8, kBrickRow = kBrickEdge + 1,
                          kBrickVoxels = kBrickRow * kBrickRow * kBrickRow;
/// Entry in the table of a grid for a cell without a brick.
inline constexpr uint32_t kNoBrick = 0xffffffffu;

/// Device view of a grid. In the grid's space, a brick has edge length 1, and the table of bricks
/// covers [0, size).
struct GridView {
  const uint32_t* table = nullptr;  ///< brick number of each cell, x fastest, or kNoBrick
  /// For each cell, the largest value of any component that a lookup in the cell can return.
  const float* most = nullptr;
  /// Voxels of the bricks, as 32-bit floats, or as 16-bit floats packed in pairs.
  const void* voxels = nullptr;
  uint32_t size[3] = {0, 0, 0};  ///< cells
  uint32_t components = 1;       ///< 1 or 3, interleaved
  bool is_half = false;
  float background = 0;  ///< value outside all bricks
};

/// Input voxels of a VolumeGrid, in bricks of 8^3 voxels, as volume files store them.
struct GridBricks {
  std::string name;                  ///< used in messages
  std::span<const int32_t> origins;  ///< x, y, z of the first voxel of each brick, multiples of 8
  /// Voxels as 32-bit floats in `floats` or as 16-bit floats in `halves` (the unused span is
  /// empty): x slowest, z fastest, components interleaved.
  std::span<const float> floats;
  std::span<const uint16_t> halves;
  uint32_t components = 1;
  float background = 0;
  bool is_signed = false;  ///< values may be negative, as for velocities
};

/// An immutable sparse voxel grid: bricks of voxels, and a table of their positions.
class VolumeGrid {
 public:
  /// Makes a grid. Throws Error if a value is not finite, if a value of an unsigned grid is
  /// negative, if two bricks have the same origin, if an origin is not a multiple of 8, or if the
  /// grid needs more than 32-bit indices.
  explicit VolumeGrid(const GridBricks& bricks);

  GridView view() const;
  /// Returns the voxel index (x, y, z) of the lower corner of the grid's table.
  const std::array<int32_t, 3>& first_voxel() const { return first_; }
  size_t brick_count() const { return voxel_words_.size() / words_per_brick(); }
  size_t bytes() const;
  /// Returns the maximum value, or the maximum magnitude of a signed grid.
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

/// A grid, and the map from voxel indices to the volume's local space.
struct VolumeField {
  std::shared_ptr<const VolumeGrid> grid;  ///< null if the volume does not have the field
  Affine index_to_object;
};

class VolumeMotion;

/// A volume. Its fields determine the optical properties at each point:
///   extinction sigma_t = extinction * density     per unit of world length, per channel
///   albedo             = albedo * color           fraction of extinction that is scattered
///   emitted radiance   = emission * (emission field, or density)   per unit of world length
/// Scattering uses the Henyey-Greenstein phase function. With a velocity field v, a lookup at point
/// p and time t reads the other fields at p - v(p) t.
struct Volume {
  std::string name;
  VolumeField density;  ///< one component; the density is 1 everywhere if there is no grid
  VolumeField color;    ///< three components; the colour is 1 everywhere if there is no grid
  VolumeField glow;     ///< emission field; the density field is used if there is no grid
  /// Velocity field: three signed components, in units of the volume's local space per second. A
  /// volume without velocity field does not move.
  VolumeField velocity;
  /// Times in seconds of shutter open and shutter close, relative to the time of the grids.
  std::array<float, 2> seconds{0, 0};
  std::shared_ptr<const VolumeMotion> motion;  ///< set by SceneBuilder::add_volume
  /// Corners of a homogeneous volume in local space, used if there is no density field.
  std::array<Vec3<float>, 2> box{Vec3<float>(0.f), Vec3<float>(0.f)};
  Affine to_world;
  Vec3<float> extinction{1, 1, 1}, albedo{0.5f, 0.5f, 0.5f}, emission{0, 0, 0};
  float anisotropy = 0;  ///< mean cosine of the scattering angle, in (-1, 1)

  bool emits() const { return emission.x > 0 || emission.y > 0 || emission.z > 0; }
  bool moves() const { return velocity.grid && (seconds[0] != 0 || seconds[1] != 0); }
};

/// Packed grid with its transform x_bricks = A x_world + t. `to_bricks` holds three rows, each a
/// row of A followed by a component of t.
struct TransformedGrid {
  GridView grid;
  float to_bricks[12] = {};
};

/// Transforms for looking up a moving field at points of a space, either world space or the space
/// of bounding cells.
struct FieldDrift {
  float to_velocity[12];  ///< transform to bricks of the velocity grid
  float to_bricks[12];    ///< transform to bricks of the field
  float per_second[12];   ///< transform from velocities to bricks of the field, without translation
};

/// Packed volume. All lanes of a packet process the same volume, so a record is read without
/// gathers.
struct VolumeRecord {
  TransformedGrid density;  ///< density field; the density is 1 everywhere if the grid has no table
  TransformedGrid color;    ///< colour field; the colour is 1 everywhere if the grid has no table
  /// Emission field; a copy of `density` if the volume has no emission field.
  TransformedGrid emission_field;
  float extinction[3], albedo[3], emission[3];
  float max_extinction;  ///< maximum over the channels
  float anisotropy;
  bool is_grey;  ///< extinction is the same in all channels
  bool emits;
  /// Whether the volume moves. Tracking then uses density_cells and emission_cells. The bounds of
  /// each cell include all values that move through the cell during the shutter interval.
  bool moves;

  TransformedGrid density_cells, emission_cells;  ///< without a table
  GridView velocity;
  /// Transforms for lookups from the spaces of `density_cells` and `emission_cells`.
  FieldDrift density_drift, emission_drift;
  FieldDrift color_drift;  ///< transforms for lookups from world space
  float seconds_open, seconds_span;
};

/// Maximum number of volumes of a scene. Kernels process all volumes of a scene in turn.
inline constexpr size_t kMaxVolumes = 65536;

/// Device view of all volumes.
struct VolumeView {
  const VolumeRecord* volumes = nullptr;
  uint32_t count = 0;
  uint32_t first_material = 0;  ///< volume i has material first_material + i
  bool emits = false;           ///< some volume emits
};

/// Throws Error if a value of the volume is invalid. The message names the volume.
void check_volume(const Volume& volume);
VolumeRecord make_volume_record(const Volume& volume);
/// Returns the world-space corners of the box of cells that a volume fills.
std::array<Vec3<float>, 8> volume_corners(const Volume& volume);

}  // namespace wavecomb
