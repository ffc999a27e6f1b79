// SPDX-License-Identifier: Apache-2.0
/// What a render can keep beside the beauty, as a table: arbitrary output variables (docs/aovs.md).
///
/// A new one is a row at the end of WAVECOMB_AOVS, and a line where paths find its value
/// (integrate/path_aovs.h). Its place in the film, its layer, its block in checkpoints, its name in
/// Python, on the command line and in the window follow from the row.
#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace wavecomb {

/// How the samples of a pixel become its value.
enum class AovKind : uint8_t {
  kMean,         ///< the mean over its samples
  kMeanOfHits,   ///< the mean over those that hit something, infinite where none did
  kNearest,      ///< that of the sample nearest its centre: a mean of these means nothing
  kCoverage,     ///< ids, and how much of the pixel each covers (Cryptomatte)
  kGroups,       ///< a layer of means for each light group
  kExpressions,  ///< a layer of means for each light path expression
  kSum,          ///< the sum over its samples
  kDeep,         ///< samples by depth, which go to a file of their own (film/deep_film.h)
  kMedian,       ///< about the median of its samples (film/median.h), which may be infinite
};

/// Who finds the value of a path.
enum class AovSource : uint8_t {
  kHit,     ///< what the camera's ray met, before it is shaded
  kVertex,  ///< the first vertex, once it was shaded
  kGuide,   ///< the last vertex that guides a denoiser
  kLight,   ///< the light that reaches the path
  kWay,     ///< the same by the techniques that found it
  kTime,    ///< the clock
  kBounce,  ///< all bounces of the path
};

/// X(enumerator, name, channels, kind, source, title): a bit each, in this order. Channels are 0
/// where the layer is none of numbers, or there are several; the title is the window's, "" where it
/// does not offer the layer.
// clang-format off
#define WAVECOMB_AOVS(X)                                                                      \
  X(Albedo, "albedo", 3, kMean, kVertex, "Albedo")                                            \
  X(Normal, "normal", 3, kMean, kVertex, "Normal")                                            \
  X(Depth, "depth", 1, kMeanOfHits, kHit, "Depth")                                            \
  X(Position, "position", 3, kNearest, kHit, "Position")                                      \
  X(Uv, "uv", 2, kNearest, kVertex, "Texture coordinates")                                    \
  X(MaterialId, "material_id", 1, kNearest, kHit, "Materials")                                \
  X(InstanceId, "instance_id", 1, kNearest, kHit, "Instances")                                \
  X(CryptoObject, "crypto_object", 0, kCoverage, kHit, "Objects (Cryptomatte)")               \
  X(CryptoMaterial, "crypto_material", 0, kCoverage, kHit, "Materials (Cryptomatte)")         \
  X(CryptoAsset, "crypto_asset", 0, kCoverage, kHit, "Assets (Cryptomatte)")                  \
  X(Emission, "emission", 3, kMean, kLight, "Emission")                                       \
  X(Direct, "direct", 3, kMean, kLight, "Direct light")                                       \
  X(Indirect, "indirect", 3, kMean, kLight, "Indirect light")                                 \
  X(LightGroups, "light_groups", 0, kGroups, kLight, "")                                      \
  X(Cost, "cost", 1, kSum, kTime, "Cost per pixel")                                           \
  X(GuideAlbedo, "guide_albedo", 3, kMean, kGuide, "")                                        \
  X(GuideNormal, "guide_normal", 3, kMean, kGuide, "")                                        \
  X(Alpha, "alpha", 1, kMean, kHit, "Alpha")                                                  \
  X(ByBounces, "by_bounces", 3, kMean, kWay, "Found by bounces")                              \
  X(ByLightSamples, "by_light_samples", 3, kMean, kWay, "Found by light samples")             \
  X(ByLightPaths, "by_light_paths", 3, kMean, kWay, "Found by light paths")                   \
  X(GuidedShare, "guided_share", 1, kMean, kBounce, "Guided share")                           \
  X(Survival, "survival", 1, kMean, kBounce, "Survival of roulette")                          \
  X(Expressions, "lpe", 0, kExpressions, kLight, "")                                          \
  X(DepthNearest, "depth_nearest", 1, kNearest, kHit, "Depth, unfiltered")                    \
  X(Distance, "distance", 1, kNearest, kHit, "Distance, unfiltered")                          \
  X(Motion, "motion", 2, kNearest, kHit, "Motion in the picture")                             \
  X(Deep, "deep", 0, kDeep, kHit, "")                                                         \
  X(Transmittance, "transmittance", 3, kMean, kHit, "Transmittance of volumes")               \
  X(HalfDepth, "half_depth", 1, kMedian, kHit, "Depth to half opacity")
// clang-format on

namespace detail {
#define WAVECOMB_AOV(id, name, channels, kind, source, title) k##id,
enum class AovPlace : uint32_t { WAVECOMB_AOVS(WAVECOMB_AOV) kCount };
#undef WAVECOMB_AOV
}  // namespace detail

inline constexpr auto kAovCount = static_cast<uint32_t>(detail::AovPlace::kCount);
static_assert(kAovCount <= 32);

/// One bit each.
enum class Aov : uint32_t {
#define WAVECOMB_AOV(id, name, channels, kind, source, title) \
  k##id = 1u << static_cast<uint32_t>(detail::AovPlace::k##id),
  WAVECOMB_AOVS(WAVECOMB_AOV)
#undef WAVECOMB_AOV
};

struct AovRow {
  Aov aov;
  const char* name;
  uint32_t channels;
  AovKind kind;
  AovSource source;
  const char* title;
};
inline constexpr AovRow kAovs[] = {
#define WAVECOMB_AOV(id, name, channels, kind, source, title) \
  {Aov::k##id, name, channels, AovKind::kind, AovSource::source, title},
    WAVECOMB_AOVS(WAVECOMB_AOV)
#undef WAVECOMB_AOV
};
/// The place of its row.
constexpr uint32_t place_of(Aov aov) {
  return static_cast<uint32_t>(std::countr_zero(static_cast<uint32_t>(aov)));
}
constexpr const AovRow& row_of(Aov aov) {
  return kAovs[place_of(aov)];
}
constexpr const char* aov_name(Aov aov) {
  return row_of(aov).name;
}

constexpr uint32_t operator|(Aov a, Aov b) {
  return static_cast<uint32_t>(a) | static_cast<uint32_t>(b);
}
constexpr uint32_t operator|(uint32_t a, Aov b) {
  return a | static_cast<uint32_t>(b);
}
/// Bits of the rows for which `is_wanted`.
template <typename IsWanted>
constexpr uint32_t aov_bits(const IsWanted& is_wanted) {
  uint32_t bits = 0;
  for (const AovRow& row : kAovs)
    if (is_wanted(row)) bits = bits | row.aov;
  return bits;
}
constexpr uint32_t aov_bits(AovKind kind) {
  return aov_bits([&](const AovRow& row) { return row.kind == kind; });
}
constexpr uint32_t aov_bits(AovSource source) {
  return aov_bits([&](const AovRow& row) { return row.source == source; });
}

/// A set of AOVs.
struct AovSet {
  /// Those that are kept where nothing is asked for. A picture has fields for them.
  static constexpr uint32_t kUsual = Aov::kAlbedo | Aov::kNormal | Aov::kDepth;
  /// Parts of the beauty: emission + direct + indirect.
  static constexpr uint32_t kParts = Aov::kEmission | Aov::kDirect | Aov::kIndirect;
  /// All that have names of their own and are layers of a picture.
  static constexpr uint32_t kAll = aov_bits([](const AovRow& row) {
    return row.kind != AovKind::kExpressions && row.kind != AovKind::kDeep;
  });

  uint32_t bits = kUsual;
  bool operator==(const AovSet&) const = default;

  bool has(Aov a) const { return any(static_cast<uint32_t>(a)); }
  bool has(AovKind kind) const { return any(aov_bits(kind)); }
  bool has(AovSource source) const { return any(aov_bits(source)); }
  bool any(uint32_t mask) const { return (bits & mask) != 0; }

  /// Light path expressions have names of their own.
  std::vector<std::string> names() const;
  /// Throws Error that lists what there is.
  static Aov parse(std::string_view name);
};

/// Samples that a pixel of a deep picture may have.
inline constexpr uint32_t kMostDeepSamples = 64;

/// How finely a pixel's samples are told apart by depth.
struct DeepLimits {
  uint32_t most = 16;       ///< deep samples of a pixel
  float tolerance = 0.01f;  ///< samples whose depths differ by no more than this share are one
};

/// What a film and the waves that fill it make room for.
struct AovLayout {
  AovSet set;
  uint32_t light_groups = 0;  ///< how many are kept
  uint32_t expressions = 0;   ///< light path expressions
  DeepLimits deep{};          ///< of Aov::kDeep
};

}  // namespace wavecomb
