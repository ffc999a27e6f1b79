// SPDX-License-Identifier: Apache-2.0
/// Textures: mip pyramids in tiled storage. For lookup in lanes, see lookup.h.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace wavecomb {

/// Texture index that means "no texture".
inline constexpr uint32_t kNoTexture = 0xffffffffu;

enum class TexelFormat : uint8_t { kU8, kF16, kF32 };
/// Wrap modes of USD: repeat, clamp to edge, mirror, black outside [0, 1].
enum class Wrap : uint8_t { kRepeat, kClamp, kMirror, kBlack };

/// Pixels provided by the caller. Row 0 is the top of the image; 1 to 4 `channels` are interleaved
/// (luminance; luminance, alpha; r, g, b; r, g, b, alpha). Half values are passed as 16-bit codes.
///
/// Contract: `data` must stay valid only during the constructor of Texture and needs no alignment.
struct TextureDesc {
  std::string name;
  const void* data = nullptr;
  uint32_t width = 0, height = 0, channels = 0;
  TexelFormat format = TexelFormat::kU8;
  /// Whether u8 values are sRGB-encoded (alpha never is); ignored for half and float.
  bool srgb = false;
  Wrap wrap_s = Wrap::kRepeat, wrap_t = Wrap::kRepeat;
};

/// Mip level within the storage of a texture.
struct TextureLevel {
  uint32_t width, height;  ///< in texels
  uint32_t tiles_x;        ///< number of tiles along the width
  /// offset of the first tile of the level from the start of the storage, in texels
  uint32_t offset;
};

struct TileSet;
class TileStore;

/// Read-only, non-owning view of a texture for kernels. Texels are stored in square tiles of kTile
/// x kTile in row-major order; single-channel textures have one value per texel, and all other
/// textures have four. All stored values are finite. The storage has fewer than 2^31 32-bit words
/// and at most 2^32 texels.
struct TextureView {
  static constexpr uint32_t kTile = 8;
  static constexpr uint32_t kMaxLevels = 16;
  const void* texels = nullptr;
  TexelFormat format = TexelFormat::kU8;
  uint8_t channels = 4;  ///< as stored: 1 or 4
  bool srgb = false;
  bool has_alpha = false;  ///< whether the texture has alpha; if not, alpha reads as 1
  Wrap wrap_s = Wrap::kRepeat, wrap_t = Wrap::kRepeat;
  uint32_t level_count = 0;
  TextureLevel levels[kMaxLevels] = {};
  /// Tiles of a UDIM texture, which lookups read instead of the texture itself. The single texel of
  /// the UDIM texture is the value of missing tiles.
  const TileSet* tiles = nullptr;
};

/// Tiles of a UDIM texture. Tile i has the UDIM number 1001 + i and covers s in [i % 10, i % 10 +
/// 1) and t in [i / 10, i / 10 + 1). Missing tiles are null.
struct TileSet {
  static constexpr uint32_t kColumns = 10, kCount = 100;
  std::array<const TextureView*, kCount> views{};
};

/// Bounds of lookup results per channel (linear r, g, b, alpha): low <= value <= high.
struct TexelRange {
  std::array<float, 4> low, high;
  bool operator==(const TexelRange&) const = default;
  /// Extends the range to include `other`.
  void add(const TexelRange& other);
};

/// Returns linear r, g, b, a of the texel at column x and row y (0 is the top) of a level. This
/// function is slow; only tools and tests use it.
std::array<float, 4> texel_at(const TextureView& view, uint32_t level, uint32_t x, uint32_t y);

/// Function that runs body(0) .. body(n - 1) in any order, possibly concurrently.
using ForEach = std::function<void(size_t n, const std::function<void(size_t)>& body)>;
/// Implements ForEach by running the bodies in order on the calling thread.
void in_order(size_t n, const std::function<void(size_t)>& body);

/// Immutable texture with a mip pyramid. Each level halves the size of the previous one, rounded
/// down, with a box filter in linear light (for odd sizes, boxes cover fractions of texels
/// exactly).
class Texture {
 public:
  /// Largest width and height.
  static constexpr uint32_t kMaxSize = 65536;
  /// Float values are clamped to +-kMaxTexel, so that no filter overflows.
  static constexpr float kMaxTexel = 1e30f;

  /// Builds a texture with its mip pyramid from an image. Values that are not finite become 0 and
  /// are counted. Throws Error naming desc.name if a side is 0 or above kMaxSize, channels or data
  /// are invalid, or the levels need 8 GiB or more or have more than 2^32 texels. `for_each` may
  /// process rows on several threads without changing the result. If `store` is not null, the
  /// levels are kept in this store, which limits their memory.
  explicit Texture(const TextureDesc& desc, const ForEach& for_each = in_order,
                   std::shared_ptr<TileStore> store = nullptr);
  /// Creates a UDIM texture from `tiles`, pairs of a tile number (1001 to 1100) and a shared
  /// texture. `missing` is the linear r, g, b, alpha of missing tiles. Throws Error naming `name`
  /// if there are no tiles, a number is out of range or repeated, or a tile is itself a UDIM
  /// texture.
  Texture(std::string name,
          const std::vector<std::pair<uint32_t, std::shared_ptr<const Texture>>>& tiles,
          const std::array<float, 4>& missing);

  const TextureView& view() const { return view_; }
  const std::string& name() const { return name_; }
  /// Memory of all levels in bytes, without the tiles of a UDIM texture.
  size_t bytes() const { return bytes_; }
  /// Returns the tile numbers and tile textures of a UDIM texture.
  const std::vector<std::pair<uint32_t, std::shared_ptr<const Texture>>>& tiles() const {
    return tiles_;
  }
  /// Returns the size in bytes of all levels, including the tiles of a UDIM texture.
  size_t spanned_bytes() const;
  /// Mean of the finest level, linear r, g, b, a.
  const float* mean() const { return mean_; }
  /// Bounds of all lookups with any coordinates, footprint and filter. The bounds cover the stored
  /// texels of all levels, and black if the wrap mode returns black outside the image. Unless all
  /// texels are equal, the bounds are slightly wider than the range of the texels, since filtering
  /// rounds. The lower bound is negative only if a texel is negative, and the upper bound is
  /// positive only if a texel is positive.
  const TexelRange& range() const { return range_; }
  /// Number of values of the finest level that were infinite or NaN and became 0.
  uint64_t nonfinite_count() const { return nonfinite_count_; }
  /// Returns the store that holds the levels, or null if the levels are in ordinary memory.
  const std::shared_ptr<TileStore>& store() const { return storage_.get_deleter().store; }

 private:
  struct Free {
    std::shared_ptr<TileStore> store{};
    void operator()(const std::byte* p) const;
  };
  using Storage = std::unique_ptr<const std::byte[], Free>;

  std::string name_;
  TextureView view_;
  Storage storage_;
  std::vector<std::pair<uint32_t, std::shared_ptr<const Texture>>> tiles_;
  std::unique_ptr<TileSet> tile_set_;
  size_t bytes_ = 0;
  uint64_t nonfinite_count_ = 0;
  float mean_[4] = {0, 0, 0, 1};
  TexelRange range_{{0, 0, 0, 1}, {0, 0, 0, 1}};
};

/// Shared texture; several scenes may use the same one.
using TexturePtr = std::shared_ptr<const Texture>;

}  // namespace wavecomb
