// SPDX-License-Identifier: Apache-2.0
/// Makes the mip levels of a texture.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>

#include "wavecomb/texture/texture.h"

namespace wavecomb {

/// What there is to know of a pyramid, by stored channel.
struct PyramidTotals {
  double sum[4] = {0, 0, 0, 0};  ///< of the values of the finest level
  uint64_t nonfinite = 0;        ///< of those, how many were infinite or NaN and read as 0
  /// Of the linear values of all levels, as they are stored.
  std::array<float, 4> low{kNothing, kNothing, kNothing, kNothing};
  std::array<float, 4> high{-kNothing, -kNothing, -kNothing, -kNothing};

  static constexpr float kNothing = std::numeric_limits<float>::infinity();
};

/// Bytes of one value.
size_t value_bytes(TexelFormat format);

/// Decodes one stored value to linear light; `srgb`: its code is sRGB-encoded.
float decode_value(const std::byte* p, TexelFormat format, bool srgb);

/// Place of a texel in the storage of a texture, in texels.
size_t texel_index(const TextureLevel& level, uint32_t x, uint32_t y);

/// Puts the mip levels of a texture of that size, channels and format one behind the other in
/// `view`, whose format and channels are set; returns their bytes. Throws Error naming desc.name
/// where lanes cannot number the texels or words: more than 2^32 texels, 8 GiB or more.
uint64_t lay_out(const TextureDesc& desc, TextureView& view);

/// Fills the storage of `view`, whose levels are laid out, from the caller's pixels. Levels come of
/// one another in float; only what is stored is rounded to the format. The bits do not depend on
/// the order in which `for_each` runs its bodies. Scratch memory is some rows for each thread, and
/// one level of floats of at most 1/4 of the texels (1/4096 where sides are multiples of 64).
PyramidTotals build_pyramid(const TextureDesc& desc, const TextureView& view, std::byte* storage,
                            const ForEach& for_each);

}  // namespace wavecomb
