// SPDX-License-Identifier: Apache-2.0
/// Conversion of OpenVDB and NanoVDB grids to bricks of 8^3 voxels. A leaf node becomes one brick,
/// and an active tile of a higher tree level is split into bricks.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>

#include "grid.h"

namespace vdb {

constexpr int kBrickEdge = 8;
constexpr size_t kBrickVoxels = kBrickEdge * kBrickEdge * kBrickEdge;

/// Storage format of a voxel, which has 1 or 3 components of 2 bytes (half) or 4 bytes (float)
/// each.
struct BrickFormat {
  uint32_t channels = 1;
  bool is_half = false;

  size_t voxel_bytes() const { return channels * (is_half ? sizeof(uint16_t) : sizeof(float)); }
  size_t brick_bytes() const { return kBrickVoxels * voxel_bytes() + 3 * sizeof(int32_t); }
};

/// Statistics of a grid's voxel values.
struct BrickFacts {
  uint64_t not_finite = 0;
  uint64_t negative = 0;
  /// Smallest and largest finite value of the grid, where 0 always counts as a value.
  float least = 0.0f;
  float greatest = 0.0f;
  /// Number of bricks that held only zeros and were left out.
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

/// Bricks of one grid. The array `origins` has the shape (n, 3), and `values` has the shape (n, 8,
/// 8, 8, channels).
struct Bricks {
  BrickFormat format;
  size_t count = 0;
  std::unique_ptr<int32_t[]> origins;
  std::unique_ptr<unsigned char[]> values;
  BrickFacts facts;
};

/// Options for making bricks.
struct BrickOptions {
  /// Upper limit of the bricks' memory in bytes.
  uint64_t max_bytes = 0;
  /// Whether inactive voxels that hold the background value are set to 0.
  bool background_is_zero = false;
  /// Whether bricks that hold only zeros are left out.
  bool drops_empty = false;
};

/// Returns the number of bricks in a tile of `edge`^3 voxels.
inline uint64_t bricks_of_tile(uint64_t edge) {
  const uint64_t along = edge / kBrickEdge;
  return along * along * along;
}

/// Returns a one-line message that `what` needs more memory than allowed.
std::string limit_message(const std::string& what, uint64_t bytes, uint64_t max_bytes);

/// Throws TooLarge if the given number of bricks takes more than `max_bytes`.
void check_size(uint64_t bricks, const BrickFormat& format, uint64_t max_bytes);

/// Converts floats to 16-bit floats. The values must be exactly representable in 16 bits.
void to_halves(const float* values, size_t count, uint16_t* halves);

/// Writer that appends bricks to an array. The caller converts voxel values to float.
class BrickWriter {
 public:
  using Origin = std::array<int32_t, 3>;

  /// Allocates memory for at most `most` bricks. Throws `TooLarge` if the bricks exceed the limit
  /// of `options`, and `std::bad_alloc` if the allocation fails.
  BrickWriter(uint64_t most, const BrickFormat& format, const BrickOptions& options);

  /// Buffer for the values of the next brick. In memory, the channel index varies fastest and the x
  /// coordinate slowest.
  float* scratch() { return scratch_; }
  /// Appends the brick whose values are in the buffer scratch().
  void add(const Origin& origin);
  /// Appends the bricks of a tile, whose voxels all have the same value (`channels` components).
  void add_tile(const Origin& first, int32_t edge, const float* value);

  Bricks take() { return std::move(bricks_); }

 private:
  Bricks bricks_;
  uint64_t most_;
  bool drops_empty_;
  float scratch_[3 * kBrickVoxels];
};

}  // namespace vdb
