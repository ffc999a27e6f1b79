// SPDX-License-Identifier: Apache-2.0
/// Implementation of VolumeMotion. A lookup at point p and time t reads a field at p - v(p) t. The
/// velocities v in a cell are bounded, so all lookups from the cell read points within a box. The
/// field's maximum over this box bounds the values of these lookups. Maxima over boxes are read
/// from tables of maxima over 2^3, 4^3, ... cells.
#include "wavecomb/medium/description/volume_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "wavecomb/scene/parallel.h"
#include "wavecomb/texture/half.h"

namespace wavecomb {
namespace {

/// Maximum number of bounding cells of a field. If more cells would be needed, the cells are made
/// larger.
constexpr double kMaxCells = 1 << 22;
/// Rounding tolerance of kernels, in bricks. This tolerance prevents the box of a cell without
/// motion from reaching into neighbouring cells.
constexpr double kBrickSlack = 1e-5;

struct WideBox {
  std::array<double, 3> lo, hi;
};

/// Returns the bounding box of the image of a box.
WideBox image_of(const WideMap& map, const WideBox& box) {
  WideBox out{};
  for (size_t i = 0; i < 3; ++i) {
    out.lo[i] = out.hi[i] = map.m[i][3];
    for (size_t j = 0; j < 3; ++j) {
      const double a = map.m[i][j] * box.lo[j], b = map.m[i][j] * box.hi[j];
      out.lo[i] += std::min(a, b);
      out.hi[i] += std::max(a, b);
    }
  }
  return out;
}

/// Tables for the maximum of a field over boxes of cells.
class MaxPyramid {
 public:
  /// `cells` holds the values of the cells, x fastest, and `outside` is the value outside all
  /// cells.
  MaxPyramid(const uint32_t (&size)[3], std::vector<float> cells, float outside)
      : outside_(outside) {
    levels_.push_back({{size[0], size[1], size[2]}, std::move(cells)});
    while (levels_.back().values.size() > 1) levels_.push_back(halved(levels_.back()));
  }
  float most(const WideBox& box) const {
    const std::array<uint32_t, 3>& size = levels_[0].size;
    std::array<uint32_t, 3> lo{}, hi{};
    uint32_t widest = 0;
    bool beyond = false, overlaps = true;
    for (size_t k = 0; k < 3; ++k) {
      const double end = size[k];
      beyond = beyond || box.lo[k] < 0 || box.hi[k] > end;
      overlaps = overlaps && box.hi[k] >= 0 && box.lo[k] <= end;
      lo[k] = static_cast<uint32_t>(std::clamp(std::floor(box.lo[k]), 0.0, end - 1));
      hi[k] = static_cast<uint32_t>(std::clamp(std::floor(box.hi[k]), 0.0, end - 1));
      widest = std::max(widest, hi[k] - lo[k]);
    }
    if (!overlaps) return outside_;
    uint32_t level = 0;
    while (widest >> level > 2 && level + 1 < levels_.size()) ++level;
    float most = levels_[level].most(lo, hi, level);
    return beyond ? std::max(most, outside_) : most;
  }

 private:
  struct Level {
    std::array<uint32_t, 3> size;
    std::vector<float> values;

    float at(uint32_t x, uint32_t y, uint32_t z) const {
      return values[x + size_t{size[0]} * (y + size_t{size[1]} * z)];
    }
    /// Returns the maximum over a box of cells of level 0.
    float most(const std::array<uint32_t, 3>& lo, const std::array<uint32_t, 3>& hi,
               uint32_t level) const {
      float greatest = at(lo[0] >> level, lo[1] >> level, lo[2] >> level);
      for (uint32_t z = lo[2] >> level; z <= hi[2] >> level; ++z)
        for (uint32_t y = lo[1] >> level; y <= hi[1] >> level; ++y)
          for (uint32_t x = lo[0] >> level; x <= hi[0] >> level; ++x)
            greatest = std::max(greatest, at(x, y, z));
      return greatest;
    }
  };
  static Level halved(const Level& fine) {
    Level coarse{{(fine.size[0] + 1) / 2, (fine.size[1] + 1) / 2, (fine.size[2] + 1) / 2}, {}};
    coarse.values.reserve(size_t{coarse.size[0]} * coarse.size[1] * coarse.size[2]);
    for (uint32_t z = 0; z < coarse.size[2]; ++z)
      for (uint32_t y = 0; y < coarse.size[1]; ++y)
        for (uint32_t x = 0; x < coarse.size[0]; ++x) {
          const std::array<uint32_t, 3> lo{2 * x, 2 * y, 2 * z};
          std::array<uint32_t, 3> hi{};
          for (size_t k = 0; k < 3; ++k) hi[k] = std::min(lo[k] + 1, fine.size[k] - 1);
          coarse.values.push_back(fine.most(lo, hi, 0));
        }
    return coarse;
  }

  std::vector<Level> levels_;
  float outside_;
};

/// Tables for the bounds of velocities over boxes of a velocity grid.
class VelocityBounds {
 public:
  explicit VelocityBounds(const VolumeGrid& grid) : view_(grid.view()) {
    const size_t cells = size_t{view_.size[0]} * view_.size[1] * view_.size[2];
    std::array<std::vector<float>, 6> ends;
    for (auto& one : ends) one.assign(cells, 0.f);
    parallel_for(cells, [&](size_t cell) {
      if (view_.table[cell] == kNoBrick) return;
      std::array<float, 6> most;
      most.fill(-std::numeric_limits<float>::infinity());
      for (uint32_t i = 0; i < kBrickVoxels; ++i)
        for (uint32_t c = 0; c < 3; ++c) {
          const float x = value(view_.table[cell], 3 * i + c);
          most[c] = std::max(most[c], x);
          most[3 + c] = std::max(most[3 + c], -x);
        }
      for (size_t e = 0; e < 6; ++e) ends[e][cell] = most[e];
    });
    for (auto& one : ends) pyramids_.emplace_back(view_.size, std::move(one), 0.f);
  }
  /// Returns the bounds of the velocities in a box of the grid's space.
  WideBox within(const WideBox& box) const {
    WideBox v{};
    for (size_t c = 0; c < 3; ++c) {
      v.hi[c] = pyramids_[c].most(box);
      v.lo[c] = -double{pyramids_[3 + c].most(box)};
    }
    return v;
  }
  /// Returns the box outside which the velocity is 0.
  WideBox table() const {
    return {{0, 0, 0}, {double(view_.size[0]), double(view_.size[1]), double(view_.size[2])}};
  }

 private:
  float value(uint32_t brick, uint32_t i) const {
    const size_t values = size_t{kBrickVoxels} * 3;
    if (!view_.is_half) return static_cast<const float*>(view_.voxels)[brick * values + i];
    const uint32_t word =
        static_cast<const uint32_t*>(view_.voxels)[brick * ((values + 1) / 2) + i / 2];
    return half_to_float<float>(word >> (i % 2 * 16) & 0xffffu);
  }

  GridView view_;
  std::vector<MaxPyramid> pyramids_;
};

/// Field of a volume, with the velocity field that moves it.
class MovedField {
 public:
  MovedField(const Volume& v, const VolumeField& field, const VelocityBounds& velocity)
      : grid_(field.grid->view()), velocity_(velocity) {
    const WideMap object = bricks_to_object(field);
    to_velocity_ = bricks_to_object(v.velocity).inverse().after(object);
    from_velocity_ = to_velocity_.inverse();
    drift_ = object.inverse();
    for (auto& row : drift_.m) row[3] = 0;
    const auto [open, close] = v.seconds;
    first_ = std::min({double{open}, double{close}, 0.0});
    last_ = std::max({double{open}, double{close}, 0.0});
  }
  MovedCells cells() const {
    MovedCells cells = space();
    const size_t count = size_t{cells.size[0]} * cells.size[1] * cells.size[2];
    const size_t table = size_t{grid_.size[0]} * grid_.size[1] * grid_.size[2];
    const MaxPyramid values(grid_.size, {grid_.most, grid_.most + table}, grid_.background);
    cells.most.resize(count);
    parallel_for(cells.size[2], [&](size_t z) {
      const size_t layer = size_t{cells.size[0]} * cells.size[1];
      for (size_t i = 0; i < layer; ++i) {
        const size_t at[3] = {i % cells.size[0], i / cells.size[0], z};
        WideBox box{};
        for (size_t k = 0; k < 3; ++k) {
          box.lo[k] = cells.first[k] + cells.edge * static_cast<double>(at[k]) + kBrickSlack;
          box.hi[k] = box.lo[k] + cells.edge - 2 * kBrickSlack;
        }
        const WideBox displacement = drift_in(velocity_.within(image_of(to_velocity_, box)));
        for (size_t k = 0; k < 3; ++k) {
          if (displacement.hi[k] > 0) box.lo[k] -= displacement.hi[k] + 2 * kBrickSlack;
          if (displacement.lo[k] < 0) box.hi[k] -= displacement.lo[k] - 2 * kBrickSlack;
        }
        cells.most[z * layer + i] = values.most(box);
      }
    });
    return cells;
  }

 private:
  /// Returns the bounds of the displacement, in bricks of the field, for velocities in a box.
  WideBox drift_in(const WideBox& velocities) const {
    const WideBox over = image_of(drift_, velocities);
    WideBox out{};
    for (size_t k = 0; k < 3; ++k) {
      const auto [least, most] = std::minmax(
          {over.lo[k] * first_, over.lo[k] * last_, over.hi[k] * first_, over.hi[k] * last_});
      out.lo[k] = std::min(least, 0.0);
      out.hi[k] = std::max(most, 0.0);
    }
    return out;
  }
  /// Returns the cells of the space that the field can reach: its table, and the space outside the
  /// table in which velocities are not 0.
  MovedCells space() const {
    const WideBox displacement = drift_in(velocity_.within(velocity_.table()));
    const WideBox windy = image_of(from_velocity_, velocity_.table());
    WideBox beyond{};
    bool overlaps = true;
    for (size_t k = 0; k < 3; ++k) {
      beyond.lo[k] = std::max(displacement.lo[k], windy.lo[k]);
      beyond.hi[k] = std::min(grid_.size[k] + displacement.hi[k], windy.hi[k]);
      overlaps = overlaps && beyond.lo[k] < beyond.hi[k];
    }
    MovedCells cells;
    std::array<double, 3> end{};
    for (size_t k = 0; k < 3; ++k) {
      const double size = grid_.size[k];
      cells.first[k] = overlaps ? std::floor(std::min(0.0, beyond.lo[k])) : 0.0;
      end[k] = overlaps ? std::ceil(std::max(size, beyond.hi[k])) : size;
    }
    const auto count = [&](size_t k) { return std::ceil((end[k] - cells.first[k]) / cells.edge); };
    while (count(0) * count(1) * count(2) > kMaxCells) cells.edge *= 2;
    for (size_t k = 0; k < 3; ++k) cells.size[k] = static_cast<uint32_t>(count(k));
    return cells;
  }

  GridView grid_;
  const VelocityBounds& velocity_;
  WideMap to_velocity_{Affine{}}, from_velocity_{Affine{}}, drift_{Affine{}};
  double first_ = 0, last_ = 0;
};

bool is_same(const VolumeField& a, const VolumeField& b) {
  const auto same = [](const Vec3<float>& x, const Vec3<float>& y) {
    return x.x == y.x && x.y == y.y && x.z == y.z;
  };
  const Affine &m = a.index_to_object, &n = b.index_to_object;
  return a.grid == b.grid && same(m.row[0], n.row[0]) && same(m.row[1], n.row[1]) &&
         same(m.row[2], n.row[2]) && same(m.t, n.t);
}

}  // namespace

WideMap bricks_to_object(const VolumeField& field) {
  const auto& first = field.grid->first_voxel();
  const double origin[3] = {double(first[0]), double(first[1]), double(first[2])};
  return WideMap(field.index_to_object).after(WideMap(origin, kBrickEdge));
}

VolumeMotion::VolumeMotion(const Volume& v) {
  const VelocityBounds velocity(*v.velocity.grid);
  density_ = MovedField(v, v.density, velocity).cells();
  if (v.glow.grid) emission_ = MovedField(v, v.glow, velocity).cells();
}

bool has_same_motion(const Volume& a, const Volume& b) {
  return a.seconds == b.seconds && is_same(a.velocity, b.velocity) &&
         is_same(a.density, b.density) && is_same(a.glow, b.glow);
}

}  // namespace wavecomb
