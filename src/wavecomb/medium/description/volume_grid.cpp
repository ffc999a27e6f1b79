// SPDX-License-Identifier: Apache-2.0
/// Implementation of VolumeGrid, which converts the bricks of a volume file into bricks with a
/// border and a table of brick positions.
#include <algorithm>
#include <cmath>
#include <limits>

#include "wavecomb/core/error.h"
#include "wavecomb/medium/description/volume.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene_limits.h"
#include "wavecomb/texture/half.h"

namespace wavecomb {
namespace {

constexpr size_t kInner = size_t{kBrickEdge} * kBrickEdge * kBrickEdge;

size_t brick_words(uint32_t components, bool is_half) {
  const size_t values = size_t{kBrickVoxels} * components;
  return is_half ? (values + 1) / 2 : values;
}

/// Returns the bits of a value as a 16-bit or 32-bit float.
uint32_t value_bits(float value, bool is_half) {
  return is_half ? uint32_t{float_to_half(value)} : float_bits<float>(value);
}
float value_of(uint32_t bits, bool is_half) {
  return is_half ? half_to_float<float>(bits) : bits_float<float>(bits);
}

/// Input bricks, indexed by cell.
class BrickSource {
 public:
  BrickSource(const GridBricks& b, const std::array<int32_t, 3>& first,
              const std::array<uint32_t, 3>& size)
      : b_(b), size_(size), at_(size_t{size[0]} * size[1] * size[2], kNoBrick) {
    for (size_t i = 0; i < b.origins.size() / 3; ++i) {
      size_t cell = 0, stride = 1;
      for (int k = 0; k < 3; ++k) {
        cell += stride * static_cast<size_t>((b.origins[3 * i + k] - first[k]) / 8);
        stride *= size[k];
      }
      if (at_[cell] != kNoBrick)
        throw Error("grid '" + b.name + "' has two bricks at the same position; remove one");
      at_[cell] = static_cast<uint32_t>(i);
    }
  }
  /// The eight input bricks around the upper corner of a cell, which contain all voxels of the
  /// stored brick with its border.
  class Corner {
   public:
    Corner(const BrickSource& source, const std::array<uint32_t, 3>& cell)
        : b_(source.b_), background_(value_bits(source.b_.background, !b_.halves.empty())) {
      for (uint32_t i = 0; i < 8; ++i) {
        const uint32_t x = cell[0] + (i & 1), y = cell[1] + (i >> 1 & 1), z = cell[2] + (i >> 2);
        const bool in_range = x < source.size_[0] && y < source.size_[1] && z < source.size_[2];
        near_[i] = in_range
                       ? source.at_[x + size_t{source.size_[0]} * (y + size_t{source.size_[1]} * z)]
                       : kNoBrick;
      }
    }
    /// Returns the bits of component `c` of voxel (x, y, z) of the cell, with indices from 0 to
    /// kBrickRow - 1. Among values of the same sign, larger magnitudes have larger bits.
    uint32_t bits(uint32_t x, uint32_t y, uint32_t z, uint32_t c) const {
      const uint32_t brick = near_[x / kBrickEdge | y / kBrickEdge << 1 | z / kBrickEdge << 2];
      if (brick == kNoBrick) return background_;
      const size_t voxel =
          ((x % kBrickEdge) * kBrickEdge + y % kBrickEdge) * kBrickEdge + z % kBrickEdge;
      const size_t i = (size_t{brick} * kInner + voxel) * b_.components + c;
      if (!b_.halves.empty()) return b_.halves[i] & (b_.is_signed ? 0xffffu : 0x7fffu);
      return float_bits<float>(b_.floats[i]) & (b_.is_signed ? 0xffffffffu : 0x7fffffffu);
    }

   private:
    const GridBricks& b_;
    uint32_t background_;
    std::array<uint32_t, 8> near_;
  };

 private:
  const GridBricks& b_;
  std::array<uint32_t, 3> size_;
  std::vector<uint32_t> at_;
};

void check_values(const GridBricks& b) {
  constexpr float kMax = std::numeric_limits<float>::max();
  const float least = b.is_signed ? -kMax : 0.f;
  const auto check = [&](const auto& values, const auto& as_float) {
    const bool valid = std::all_of(values.begin(), values.end(), [&](auto v) {
      const float x = as_float(v);
      return x >= least && x <= kMax;
    });
    if (!valid)
      throw Error("grid '" + b.name + "' has values that are " +
                  (b.is_signed ? "" : "negative or ") + "not finite; fix the file");
  };
  check(b.floats, [](float x) { return x; });
  check(b.halves, [](uint16_t x) { return half_to_float<float>(uint32_t{x}); });
  if (!(b.background >= 0 && b.background <= kMax))
    throw Error("grid '" + b.name +
                "' has a background that is negative or not finite; fix the file");
}

/// Throws Error if the array sizes of a grid do not match the number of bricks and components.
void check_layout(const GridBricks& b, const std::string& name) {
  const size_t count = b.origins.size() / 3;
  if (b.components != 1 && b.components != 3)
    throw Error(name + " has " + std::to_string(b.components) + " components; it must be 1 or 3");
  if (count == 0) throw Error(name + " has no voxels; leave it out");
  if (b.origins.size() % 3 != 0 ||
      b.floats.size() + b.halves.size() != count * kInner * b.components)
    throw Error(name + " does not have 8 x 8 x 8 voxels for each brick");
}

/// Smallest and largest brick origins of a grid, in voxels.
struct BrickExtent {
  std::array<int64_t, 3> lo{}, hi{};
};
/// Returns the extent of a grid; throws Error if an origin is invalid.
BrickExtent extent_of(const GridBricks& b, const std::string& name) {
  BrickExtent extent;
  for (size_t i = 0; i < b.origins.size(); ++i) {
    const int64_t x = b.origins[i];
    if (x % kBrickEdge != 0 || std::abs(x) > (int64_t{1} << 24))
      throw Error(name + " has bricks that are not at multiples of 8, or beyond 2^24");
    const size_t k = i % 3;
    extent.lo[k] = i < 3 ? x : std::min(extent.lo[k], x);
    extent.hi[k] = i < 3 ? x : std::max(extent.hi[k], x);
  }
  return extent;
}

}  // namespace

size_t VolumeGrid::words_per_brick() const {
  return brick_words(components_, is_half_);
}

VolumeGrid::VolumeGrid(const GridBricks& b)
    : components_(b.components),
      is_half_(!b.halves.empty()),
      background_(b.background),
      is_signed_(b.is_signed) {
  const std::string name = "grid '" + b.name + "'";
  check_layout(b, name);
  check_values(b);
  const auto [lo, hi] = extent_of(b, name);
  uint64_t cells = 1;
  for (size_t k = 0; k < 3; ++k) {
    // Add a cell at the lower end, for interpolation between the background and the first voxels.
    first_[k] = static_cast<int32_t>(lo[k]) - static_cast<int32_t>(kBrickEdge);
    size_[k] = static_cast<uint32_t>((hi[k] - first_[k]) / kBrickEdge + 1);
    cells *= size_[k];
  }
  if (cells >= kGatherWords / 4)
    throw Error(name + " spans " + with_commas(cells) + " bricks of 8^3 voxels, more than the " +
                with_commas(kGatherWords / 4) + " that can be numbered; crop or resample it");
  const BrickSource source(b, first_, size_);
  table_.assign(cells, kNoBrick);
  most_.assign(cells, background_);
  const size_t words = words_per_brick();
  const uint32_t background = value_bits(background_, is_half_);
  const uint32_t magnitude = is_half_ ? 0x7fffu : 0x7fffffffu;

  // Find the cells that differ from the background and their maximum values, then copy their
  // voxels.
  const auto fill = [&](size_t cell, uint32_t* out) {
    const BrickSource::Corner corner(source, {static_cast<uint32_t>(cell % size_[0]),
                                              static_cast<uint32_t>(cell / size_[0] % size_[1]),
                                              static_cast<uint32_t>(cell / size_[0] / size_[1])});
    uint32_t most = background;
    bool differs = false;
    size_t i = 0;
    for (uint32_t z = 0; z < kBrickRow; ++z)
      for (uint32_t y = 0; y < kBrickRow; ++y)
        for (uint32_t x = 0; x < kBrickRow; ++x)
          for (uint32_t c = 0; c < components_; ++c, ++i) {
            const uint32_t bits = corner.bits(x, y, z, c);
            if (out) {
              if (is_half_)
                out[i / 2] |= bits << (i % 2 * 16);
              else
                out[i] = bits;
            }
            most = std::max(most, bits & magnitude);
            differs = differs || bits != background;
          }
    if (!out && differs) {
      table_[cell] = 0;
      most_[cell] = value_of(most, is_half_);
    }
  };
  parallel_for(size_[2], [&](size_t z) {
    const size_t layer = size_t{size_[0]} * size_[1];
    for (size_t cell = z * layer; cell < (z + 1) * layer; ++cell) fill(cell, nullptr);
  });
  std::vector<size_t> filled;
  for (size_t cell = 0; cell < cells; ++cell)
    if (table_[cell] != kNoBrick) {
      table_[cell] = static_cast<uint32_t>(filled.size());
      filled.push_back(cell);
    }
  const uint64_t values = uint64_t{filled.size()} * kBrickVoxels * components_;
  if (values >= kGatherWords)
    throw Error(name + " has " + with_commas(values) + " voxels in its bricks, more than the " +
                with_commas(kGatherWords) + " that can be numbered; crop or resample it");
  voxel_words_.assign(filled.size() * words, 0);
  parallel_for(filled.size(), [&](size_t i) { fill(filled[i], voxel_words_.data() + i * words); });
  greatest_ = *std::max_element(most_.begin(), most_.end());
}

GridView VolumeGrid::view() const {
  GridView v;
  v.table = table_.data();
  v.most = most_.data();
  v.voxels = voxel_words_.data();
  std::copy(size_.begin(), size_.end(), v.size);
  v.components = components_;
  v.is_half = is_half_;
  v.background = background_;
  return v;
}

size_t VolumeGrid::bytes() const {
  return 4 * (table_.size() + most_.size() + voxel_words_.size());
}

}  // namespace wavecomb
