// SPDX-License-Identifier: Apache-2.0
/// Construction of the mip levels of a texture.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>

#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// Statistics of the texel values of a mip pyramid, per stored channel.
struct PyramidTotals {
  double sum[4] = {0, 0, 0, 0};  ///< sum of the values of the finest level
  uint64_t nonfinite = 0;        ///< number of infinite or NaN values, which became 0
  /// Range of the stored values of all levels, converted to linear.
  std::array<float, 4> low{kNothing, kNothing, kNothing, kNothing};
  std::array<float, 4> high{-kNothing, -kNothing, -kNothing, -kNothing};

  static constexpr float kNothing = std::numeric_limits<float>::infinity();
};

/// Returns the size of one stored value of a texture format in bytes.
size_t value_bytes(TexelFormat format);

/// Converts one stored value to a linear value. `srgb` says whether the value is sRGB-encoded.
float decode_value(const std::byte* p, TexelFormat format, bool srgb);

/// Returns the index of a texel in the storage of a texture, in texels.
size_t texel_index(const TextureLevel& level, uint32_t x, uint32_t y);

/// Lays out the mip levels of a texture one after another and writes them to `view`, whose format
/// and channels must be set. Returns the size of all levels in bytes. Throws Error with the name of
/// the texture if indices would not fit in 32 bits, which happens with more than 2^32 texels or
/// with 8 GiB or more.
uint64_t lay_out(const TextureDesc& desc, TextureView& view);

/// Fills the storage of `view`, whose levels must be laid out, from the caller's pixels. Each level
/// is computed from float values of the previous level; only stored values are rounded to the
/// texture format. The result does not depend on the order in which `for_each` runs its bodies.
/// Temporary memory is a few rows per thread, and one level of floats with at most 1/4 of the
/// texels (1/4096 if both sides are multiples of 64).
PyramidTotals build_pyramid(const TextureDesc& desc, const TextureView& view, std::byte* storage,
                            const ForEach& for_each);

}  // namespace wavecomb
