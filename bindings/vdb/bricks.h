// SPDX-License-Identifier: Apache-2.0
/// A grid as bricks of 8^3 voxels: leaves as they are, and what is active in larger tiles.
#pragma once

#include <openvdb/openvdb.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace vdb {

constexpr int kBrickEdge = 8;
constexpr size_t kBrickVoxels = kBrickEdge * kBrickEdge * kBrickEdge;

/// More than there may be memory for; says how much in a line.
struct TooLarge : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Numbers of a voxel as they are given: 1 or 3, of 2 (half) or 4 bytes (float).
struct BrickFormat {
  uint32_t channels = 1;
  bool is_half = false;

  size_t voxel_bytes() const { return channels * (is_half ? sizeof(uint16_t) : sizeof(float)); }
  size_t brick_bytes() const { return kBrickVoxels * voxel_bytes() + 3 * sizeof(int32_t); }
};

/// What the values of a grid are like.
struct BrickFacts {
  uint64_t not_finite = 0;
  uint64_t negative = 0;
  float least = 0.0f;
  float greatest = 0.0f;
  /// Bricks that held nothing but zeros and were left out.
  uint64_t empty = 0;

  void see(float value) {
    if (!std::isfinite(value)) {
      ++not_finite;
      return;
    }
    negative += value < 0.0f;
    least = std::min(least, value);
    greatest = std::max(greatest, value);
  }
};

/// Bricks of one grid: origins (n, 3) and values (n, 8, 8, 8, channels).
struct Bricks {
  BrickFormat format;
  size_t count = 0;
  std::unique_ptr<int32_t[]> origins;
  std::unique_ptr<unsigned char[]> values;
  BrickFacts facts;
};

/// How bricks are made.
struct BrickOptions {
  /// That they may take.
  uint64_t most_bytes = 0;
  /// Voxels that are not active and hold the background become 0.
  bool background_is_zero = false;
  /// Bricks of zeros are left out.
  bool drops_empty = false;
};

template <typename T>
struct ChannelsOf : std::integral_constant<uint32_t, 1> {};
template <typename T>
struct ChannelsOf<openvdb::math::Vec3<T>> : std::integral_constant<uint32_t, 3> {};

inline float channel(float value, uint32_t) {
  return value;
}
inline float channel(double value, uint32_t) {
  return static_cast<float>(value);
}
template <typename T>
float channel(const openvdb::math::Vec3<T>& value, uint32_t c) {
  return static_cast<float>(value[static_cast<int>(c)]);
}

/// Bricks that the leaves and active tiles of a tree come to; of more than any memory holds, about.
template <typename Tree>
uint64_t count_bricks(const Tree& tree) {
  uint64_t count = tree.leafCount();
  auto tile = tree.cbeginValueOn();
  tile.setMaxDepth(Tree::ValueOnCIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) {
    const uint64_t edge = static_cast<uint64_t>(tile.getBoundingBox().dim().x()) / kBrickEdge;
    count += edge * edge * edge;
  }
  return count;
}

/// The line that says that something takes more bytes than there is room for.
inline std::string room_text(const std::string& what, uint64_t bytes, uint64_t most_bytes) {
  char text[160];
  std::snprintf(text, sizeof(text), "%s takes %.1f GB; there is room for %.1f GB", what.c_str(),
                1e-9 * static_cast<double>(bytes), 1e-9 * static_cast<double>(most_bytes));
  return text;
}

/// Throws TooLarge where bricks take more than they may.
inline void check_size(uint64_t bricks, const BrickFormat& format, uint64_t most_bytes) {
  if (bricks <= most_bytes / format.brick_bytes()) return;
  const double gigabytes =
      1e-9 * static_cast<double>(bricks) * static_cast<double>(format.brick_bytes());
  char text[160];
  std::snprintf(text, sizeof(text), "%llu million voxels take %.1f GB; there is room for %.1f GB",
                static_cast<unsigned long long>(bricks * kBrickVoxels / 1000000), gigabytes,
                1e-9 * static_cast<double>(most_bytes));
  throw TooLarge(text);
}

/// Fills bricks one after another.
class BrickWriter {
 public:
  BrickWriter(uint64_t most, const BrickFormat& format, bool drops_empty)
      : drops_empty_(drops_empty) {
    bricks_.format = format;
    bricks_.origins = std::make_unique_for_overwrite<int32_t[]>(3 * most);
    bricks_.values =
        std::make_unique_for_overwrite<unsigned char[]>(most * kBrickVoxels * format.voxel_bytes());
  }

  /// Adds a brick; `value_at(i)` is that of voxel i, x slowest.
  template <typename ValueAt>
  void add(const openvdb::Coord& origin, ValueAt&& value_at) {
    const uint32_t channels = bricks_.format.channels;
    bool is_empty = true;
    for (uint32_t i = 0; i < kBrickVoxels; ++i) {
      const auto value = value_at(i);
      for (uint32_t c = 0; c < channels; ++c) {
        const float v = channel(value, c);
        bricks_.facts.see(v);
        is_empty = is_empty && v == 0.0f;
        scratch_[i * channels + c] = v;
      }
    }
    if (is_empty && drops_empty_) {
      ++bricks_.facts.empty;
      return;
    }
    const size_t numbers = kBrickVoxels * channels;
    unsigned char* out =
        bricks_.values.get() + bricks_.count * kBrickVoxels * bricks_.format.voxel_bytes();
    if (bricks_.format.is_half) {
      for (size_t i = 0; i < numbers; ++i) {
        const openvdb::math::half h(scratch_[i]);
        const uint16_t bits = h.bits();
        std::memcpy(out + 2 * i, &bits, 2);
      }
    } else {
      std::memcpy(out, scratch_, numbers * sizeof(float));
    }
    for (int axis = 0; axis < 3; ++axis)
      bricks_.origins[3 * bricks_.count + static_cast<size_t>(axis)] = origin[axis];
    ++bricks_.count;
  }

  Bricks take() { return std::move(bricks_); }

 private:
  Bricks bricks_;
  bool drops_empty_;
  float scratch_[3 * kBrickVoxels];
};

template <typename Grid>
BrickFormat format_of(const Grid& grid) {
  return {ChannelsOf<typename Grid::ValueType>::value, grid.saveFloatAsHalf()};
}

/// The bricks of a grid. Throws TooLarge, std::bad_alloc.
template <typename Grid>
Bricks collect(const Grid& grid, const BrickOptions& options) {
  using Tree = typename Grid::TreeType;
  using Value = typename Grid::ValueType;
  static_assert(Tree::LeafNodeType::DIM == kBrickEdge);
  const Tree& tree = grid.tree();
  const uint64_t most = count_bricks(tree);
  const BrickFormat format = format_of(grid);
  check_size(most, format, options.most_bytes);
  BrickWriter writer(most, format, options.drops_empty);
  const Value background = grid.background(), zero = openvdb::zeroVal<Value>();
  for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf)
    writer.add(leaf->origin(), [&](uint32_t i) -> Value {
      const Value value = leaf->getValue(i);
      const bool is_outside = !leaf->isValueOn(i) && value == background;
      return options.background_is_zero && is_outside ? zero : value;
    });
  auto tile = tree.cbeginValueOn();
  tile.setMaxDepth(Tree::ValueOnCIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) {
    const openvdb::CoordBBox box = tile.getBoundingBox();
    const openvdb::Coord first = box.min();
    const int edge = box.dim().x();
    const Value value = *tile;
    for (int x = 0; x < edge; x += kBrickEdge)
      for (int y = 0; y < edge; y += kBrickEdge)
        for (int z = 0; z < edge; z += kBrickEdge)
          writer.add(first.offsetBy(x, y, z), [&](uint32_t) { return value; });
  }
  return writer.take();
}

}  // namespace vdb
