// SPDX-License-Identifier: Apache-2.0
/// Table of arbitrary output variables (AOVs), which are layers that a render can store in addition
/// to the beauty (docs/aovs.md).
///
/// To add an AOV, add a row at the end of WAVECOMB_AOVS and a line that provides its value
/// (aov/path_aovs.h). The film's storage, the image layer, the checkpoint entry, and the names in
/// Python, on the command line and in the window are derived from the row.
#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace wavecomb {

/// Method that combines the samples of a pixel into the pixel's value.
enum class AovKind : uint8_t {
  kMean,         ///< the mean over all samples of the pixel
  kMeanOfHits,   ///< the mean over samples that hit something; infinite if no sample did
  kNearest,      ///< the value of the sample nearest to the pixel centre, for values that cannot be
                 ///< averaged
  kCoverage,     ///< Cryptomatte ids, and the fraction of the pixel that each id covers
  kGroups,       ///< one layer for each light group, with the means of samples
  kExpressions,  ///< one layer for each light path expression, with the means of samples
  kSum,          ///< the sum over all samples of the pixel
  kDeep,         ///< deep samples, written to a separate file (film/deep_film.h)
  kMedian,       ///< the estimated median of the pixel's samples (film/median.h); may be infinite
};

/// Point in the evaluation of a path at which the value of an AOV is known.
enum class AovSource : uint8_t {
  kHit,        ///< The value is known at the hit of the camera ray, before shading.
  kVertex,     ///< The value is known after the first vertex has been shaded.
  kGuide,      ///< The value is known after the last vertex that provides denoiser features.
  kLight,      ///< The value changes whenever light contributes to the path.
  kTechnique,  ///< The value is the light that certain techniques found, such as light sampling.
  kTime,       ///< The value is a time that was measured with the clock.
  kBounce,     ///< The value accumulates over all bounces of the path.
};

/// Meaning of the numbers in a layer. It determines how image files store the layer and how the
/// window displays the layer.
enum class AovContent : uint8_t {
  kLight,      ///< radiance, which is displayed with exposure and tone mapping
  kColour,     ///< reflectance or transmittance, between 0 and 1
  kDirection,  ///< unit vector
  kId,         ///< index of an object or material, or hashes of names
  kExact,      ///< number that must be stored without lossy compression
  kValue,      ///< any other number, which the window displays in false colours
  kMagnitude,  ///< positive number of any order of magnitude, which the window displays in false
               ///< colours on a logarithmic scale
};

/// Table of the AOVs with rows `X(enumerator, name, channels, letters, content, kind, source,
/// title)`. The position of a row in the table determines the AOV's bit. `channels` is 0 for AOVs
/// that are not numeric or have several layers. `letters` are the names of the channels in files,
/// or "" if the channels have no names. `title` is the label of the layer in the window, which does
/// not show layers with the title "".
// clang-format off
#define WAVECOMB_AOVS(X)                                                                          \
  X(Albedo, "albedo", 3, "RGB", kColour, kMean, kVertex, "Albedo")                                \
  X(Normal, "normal", 3, "XYZ", kDirection, kMean, kVertex, "Normal")                             \
  X(Depth, "depth", 1, "Z", kValue, kMeanOfHits, kHit, "Depth, scene units")                      \
  X(Position, "position", 3, "XYZ", kExact, kNearest, kHit, "Position")                           \
  X(Uv, "uv", 2, "UV", kValue, kNearest, kVertex, "Texture coordinates")                          \
  X(MaterialId, "material_id", 1, "", kId, kNearest, kHit, "Materials")                           \
  X(InstanceId, "instance_id", 1, "", kId, kNearest, kHit, "Instances")                           \
  X(CryptoObject, "crypto_object", 0, "", kId, kCoverage, kHit, "Objects (Cryptomatte)")          \
  X(CryptoMaterial, "crypto_material", 0, "", kId, kCoverage, kHit, "Materials (Cryptomatte)")    \
  X(CryptoAsset, "crypto_asset", 0, "", kId, kCoverage, kHit, "Assets (Cryptomatte)")             \
  X(Emission, "emission", 3, "RGB", kLight, kMean, kLight, "Emission")                            \
  X(Direct, "direct", 3, "RGB", kLight, kMean, kLight, "Direct light")                            \
  X(Indirect, "indirect", 3, "RGB", kLight, kMean, kLight, "Indirect light")                      \
  X(LightGroups, "light_groups", 0, "RGB", kLight, kGroups, kLight, "")                           \
  X(Cost, "cost", 1, "", kMagnitude, kSum, kTime, "Cost, ns per pixel")                           \
  X(GuideAlbedo, "guide_albedo", 3, "RGB", kColour, kMean, kGuide, "")                            \
  X(GuideNormal, "guide_normal", 3, "XYZ", kDirection, kMean, kGuide, "")                         \
  X(Alpha, "alpha", 1, "", kValue, kMean, kHit, "Alpha")                                          \
  X(ByBounces, "by_bounces", 3, "RGB", kLight, kMean, kTechnique, "Found by bounces")             \
  X(ByLightSamples, "by_light_samples", 3, "RGB", kLight, kMean, kTechnique,                      \
    "Found by light samples")                                                                     \
  X(ByLightPaths, "by_light_paths", 3, "RGB", kLight, kMean, kTechnique, "Found by light paths")  \
  X(GuidedShare, "guided_share", 1, "", kValue, kMean, kBounce, "Guided share")                   \
  X(Survival, "survival", 1, "", kValue, kMean, kBounce, "Survival of roulette")                  \
  X(Expressions, "lpe", 0, "RGB", kLight, kExpressions, kLight, "")                               \
  X(DepthNearest, "depth_nearest", 1, "Z", kExact, kNearest, kHit, "Depth, unfiltered")           \
  X(Distance, "distance", 1, "", kExact, kNearest, kHit, "Distance, unfiltered")                  \
  X(Motion, "motion", 2, "UV", kExact, kNearest, kHit, "Motion in the picture")                   \
  X(Deep, "deep", 0, "", kValue, kDeep, kHit, "")                                                 \
  X(Transmittance, "transmittance", 3, "RGB", kColour, kMean, kHit, "Transmittance of volumes")   \
  X(HalfDepth, "half_depth", 1, "Z", kValue, kMedian, kHit, "Depth to half opacity, scene units")
// clang-format on

namespace detail {
#define WAVECOMB_AOV(id, name, channels, letters, content, kind, source, title) k##id,
enum class AovIndex : uint32_t { WAVECOMB_AOVS(WAVECOMB_AOV) kCount };
#undef WAVECOMB_AOV
}  // namespace detail

inline constexpr auto kAovCount = static_cast<uint32_t>(detail::AovIndex::kCount);
static_assert(kAovCount <= 32);

/// AOV flags, one bit each.
enum class Aov : uint32_t {
#define WAVECOMB_AOV(id, name, channels, letters, content, kind, source, title) \
  k##id = 1u << static_cast<uint32_t>(detail::AovIndex::k##id),
  WAVECOMB_AOVS(WAVECOMB_AOV)
#undef WAVECOMB_AOV
};

/// AOV of light splats, which are the light that paths of other pixels contribute to a pixel.
inline constexpr Aov kSplatAov = Aov::kByLightPaths;

/// Row of the AOV table.
struct AovRow {
  Aov aov;
  const char* name;
  uint32_t channels;
  const char* letters;
  AovContent content;
  AovKind kind;
  AovSource source;
  const char* title;
};
inline constexpr AovRow kAovs[] = {
#define WAVECOMB_AOV(id, name, channels, letters, content, kind, source, title) \
  {Aov::k##id,          name,          channels,          letters,              \
   AovContent::content, AovKind::kind, AovSource::source, title},
    WAVECOMB_AOVS(WAVECOMB_AOV)
#undef WAVECOMB_AOV
};
/// Returns the row index of an AOV.
constexpr uint32_t aov_index(Aov aov) {
  return static_cast<uint32_t>(std::countr_zero(static_cast<uint32_t>(aov)));
}
constexpr const AovRow& row_of(Aov aov) {
  return kAovs[aov_index(aov)];
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
/// Returns the bits of the AOVs for which `is_wanted` is true.
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
  /// AOVs that are stored by default. `Film::Layers` and `RenderedImage` have a member for each of
  /// them.
  static constexpr uint32_t kStoredByDefault = Aov::kAlbedo | Aov::kNormal | Aov::kDepth;
  /// AOVs that add up to the beauty: emission, direct and indirect light.
  static constexpr uint32_t kParts = Aov::kEmission | Aov::kDirect | Aov::kIndirect;
  /// All AOVs that are requested by name and written as layers of an image.
  static constexpr uint32_t kAll = aov_bits([](const AovRow& row) {
    return row.kind != AovKind::kExpressions && row.kind != AovKind::kDeep;
  });

  uint32_t bits = kStoredByDefault;
  bool operator==(const AovSet&) const = default;

  bool has(Aov a) const { return any(static_cast<uint32_t>(a)); }
  bool has(AovKind kind) const { return any(aov_bits(kind)); }
  bool has(AovSource source) const { return any(aov_bits(source)); }
  bool any(uint32_t mask) const { return (bits & mask) != 0; }

  /// Returns the names of the AOVs in the set, without light path expressions.
  std::vector<std::string> names() const;
  /// Returns the AOV with the given name. Throws an `Error` that lists the known names if the name
  /// is unknown.
  static Aov parse(std::string_view name);
};

/// Upper limit of deep samples per pixel.
inline constexpr uint32_t kMaxDeepSamples = 64;

/// Limits on the deep samples of a pixel.
struct DeepLimits {
  uint32_t most = 16;  ///< maximum number of deep samples per pixel
  /// Two deep samples are merged if their depths differ by less than this fraction of the depth.
  float tolerance = 0.01f;
};

/// AOVs that a film stores, with their sizes.
struct AovLayout {
  AovSet set;
  uint32_t light_groups = 0;  ///< number of stored light groups
  uint32_t expressions = 0;   ///< number of light path expressions
  DeepLimits deep{};          ///< for Aov::kDeep
};

}  // namespace wavecomb
