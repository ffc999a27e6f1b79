// SPDX-License-Identifier: Apache-2.0
/// Textures: mip pyramids in tiled storage. Plain data here; lane lookup is in lookup.h.
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

inline constexpr uint32_t kNoTexture = 0xffffffffu;

enum class TexelFormat : uint8_t { kU8, kF16, kF32 };
/// USD's wrap modes: repeat, clamp to edge, mirror, black outside [0, 1].
enum class Wrap : uint8_t { kRepeat, kClamp, kMirror, kBlack };

/// Pixels as the caller has them: row 0 is the top of the image, `channels` 1 to 4 interleaved
/// (luminance; luminance, alpha; r, g, b; r, g, b, alpha). Halfs are their 16 bits.
/// Contract: `data` is only read during Texture's constructor; it needs no alignment.
struct TextureDesc {
  std::string name;
  const void* data = nullptr;
  uint32_t width = 0, height = 0, channels = 0;
  TexelFormat format = TexelFormat::kU8;
  bool srgb =
      false;  ///< u8 values are sRGB-encoded colour (alpha never is); ignored for half and float
  Wrap wrap_s = Wrap::kRepeat, wrap_t = Wrap::kRepeat;
};

/// One mip level inside the storage of a texture.
struct TextureLevel {
  uint32_t width, height;  ///< in texels
  uint32_t tiles_x;        ///< tiles in a row of tiles
  uint32_t offset;         ///< of the level's first tile, in texels from the start of the storage
};

struct TileSet;
class TileStore;

/// What kernels need of a texture, without ownership. Texels are stored in square tiles of
/// kTile x kTile, row by row; one-channel textures as one value a texel, all others as four.
/// Every stored value is finite; storage is below 2^31 words of 32 bits, and 2^32 texels at most.
struct TextureView {
  static constexpr uint32_t kTile = 8;
  static constexpr uint32_t kMaxLevels = 16;
  const void* texels = nullptr;
  TexelFormat format = TexelFormat::kU8;
  uint8_t channels = 4;  ///< as stored: 1 or 4
  bool srgb = false;
  bool has_alpha = false;  ///< false: alpha reads as 1
  Wrap wrap_s = Wrap::kRepeat, wrap_t = Wrap::kRepeat;
  uint32_t level_count = 0;
  TextureLevel levels[kMaxLevels] = {};
  /// Of a UDIM texture: what is looked up in its place; its own only texel is that of tiles that
  /// are missing.
  const TileSet* tiles = nullptr;
};

/// The tiles of a UDIM texture. Tile i, called 1001 + i, covers s in [i % 10, i % 10 + 1) and t in
/// [i / 10, i / 10 + 1); null where it is missing.
struct TileSet {
  static constexpr uint32_t kColumns = 10, kCount = 100;
  std::array<const TextureView*, kCount> views{};
};

/// What lookups may give, by channel (linear r, g, b, alpha): low <= value <= high.
struct TexelRange {
  std::array<float, 4> low, high;
  bool operator==(const TexelRange&) const = default;
  /// Makes it as wide as to have `other` in it.
  void add(const TexelRange& other);
};

/// Linear r, g, b, a of the texel in column x, row y (0: top) of a level. For tools and tests;
/// slow.
std::array<float, 4> texel_at(const TextureView& view, uint32_t level, uint32_t x, uint32_t y);

/// Runs body(0) to body(n - 1), in any order and perhaps at once.
using ForEach = std::function<void(size_t n, const std::function<void(size_t)>& body)>;
/// The one that runs them in order.
void in_order(size_t n, const std::function<void(size_t)>& body);

/// An immutable texture with its mip pyramid: each level is the box filter, in linear light, of the
/// one before at half its size, rounded down (odd sizes: boxes of 2 1/2 texels and so on, by exact
/// overlap).
class Texture {
 public:
  /// Largest width and height.
  static constexpr uint32_t kMaxSize = 65536;
  /// Float values are kept within +-kMaxTexel, so that no filter overflows.
  static constexpr float kMaxTexel = 1e30f;

  /// Builds the pyramid. Values that are not finite become 0 and are counted. Throws Error naming
  /// desc.name for sizes of 0 or above kMaxSize, bad channels, no data, 8 GiB or more, or more than
  /// 2^32 texels. `for_each` may share the rows among threads; it changes no bit. `store` keeps the
  /// levels where it is given, with others of its; else they are in memory.
  explicit Texture(const TextureDesc& desc, const ForEach& for_each = in_order,
                   std::shared_ptr<TileStore> store = nullptr);
  /// A UDIM texture of others, which it shares: `tiles` are pairs of tile number (1001 to 1100) and
  /// texture. `missing`: linear r, g, b, alpha wherever there is none. Throws Error naming `name`
  /// for a number out of range or given twice, no tiles, and tiles that are made of tiles.
  Texture(std::string name,
          const std::vector<std::pair<uint32_t, std::shared_ptr<const Texture>>>& tiles,
          const std::array<float, 4>& missing);

  const TextureView& view() const { return view_; }
  const std::string& name() const { return name_; }
  /// Memory of all levels, without that of tiles.
  size_t bytes() const { return bytes_; }
  /// The textures that a UDIM texture is made of, by tile number.
  const std::vector<std::pair<uint32_t, std::shared_ptr<const Texture>>>& tiles() const {
    return tiles_;
  }
  /// Memory that lookups may reach: of all levels and tiles.
  size_t spanned_bytes() const;
  /// Mean of the finest level in linear light (r, g, b, a).
  const float* mean() const { return mean_; }
  /// Of all lookups, whatever their place, footprint and filter: of the texels of all levels, as
  /// they are stored, and of black where that is beyond the image. Filters round, so that a range
  /// that is no single value is a little wider than its texels; it never passes 0, though.
  const TexelRange& range() const { return range_; }
  /// Values of the finest level that were infinite or NaN and read as 0.
  uint64_t nonfinite_count() const { return nonfinite_count_; }
  /// That keeps the levels; null: they are in memory.
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

/// Scenes may share textures.
using TexturePtr = std::shared_ptr<const Texture>;

}  // namespace wavecomb
