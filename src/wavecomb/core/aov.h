// SPDX-License-Identifier: Apache-2.0
/// Names of what a render can keep beside the beauty.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace wavecomb {

/// Arbitrary output variables (docs/aovs.md), one bit each.
enum class Aov : uint32_t {
  // Of what camera rays meet first, means over the pixel's samples.
  kAlbedo = 1u << 0,
  kNormal = 1u << 1,
  kDepth = 1u << 2,
  // Of the sample nearest the pixel's centre: a mean of these means nothing.
  kPosition = 1u << 3,
  kUv = 1u << 4,
  kMaterialId = 1u << 5,
  kInstanceId = 1u << 6,
  // Ids and how much of the pixel each covers.
  kCryptoObject = 1u << 7,
  kCryptoMaterial = 1u << 8,
  kCryptoAsset = 1u << 9,
  // Parts of the beauty: emission + direct + indirect, and the sum of all light groups.
  kEmission = 1u << 10,
  kDirect = 1u << 11,
  kIndirect = 1u << 12,
  kLightGroups = 1u << 13,
  // Measured.
  kCost = 1u << 14,
  // For denoisers: means of what is seen, also in mirrors and through clear glass.
  kGuideAlbedo = 1u << 15,
  kGuideNormal = 1u << 16,
};
inline constexpr uint32_t kAovCount = 17;

/// Names in the order of the bits: "albedo", "normal" ... "guide_normal".
extern const char* const kAovNames[kAovCount];
/// The name of one.
const char* aov_name(Aov aov);

constexpr uint32_t operator|(Aov a, Aov b) {
  return static_cast<uint32_t>(a) | static_cast<uint32_t>(b);
}
constexpr uint32_t operator|(uint32_t a, Aov b) {
  return a | static_cast<uint32_t>(b);
}

/// A set of AOVs.
struct AovSet {
  static constexpr uint32_t kFirst = Aov::kAlbedo | Aov::kNormal | Aov::kDepth;
  static constexpr uint32_t kNearest =
      Aov::kPosition | Aov::kUv | Aov::kMaterialId | Aov::kInstanceId;
  static constexpr uint32_t kCrypto = Aov::kCryptoObject | Aov::kCryptoMaterial | Aov::kCryptoAsset;
  static constexpr uint32_t kGuides = Aov::kGuideAlbedo | Aov::kGuideNormal;
  static constexpr uint32_t kParts = Aov::kEmission | Aov::kDirect | Aov::kIndirect;

  uint32_t bits = kFirst;

  bool has(Aov a) const { return any(static_cast<uint32_t>(a)); }
  bool any(uint32_t mask) const { return (bits & mask) != 0; }
  /// Mean attributes of the first hit.
  bool first() const { return any(kFirst); }
  /// Attributes of the sample nearest the pixel's centre.
  bool nearest() const { return any(kNearest); }
  bool crypto() const { return any(kCrypto); }
  bool parts() const { return any(kParts); }
  bool guides() const { return any(kGuides); }

  std::vector<std::string> names() const;
  /// Throws Error that lists what there is.
  static Aov parse(std::string_view name);
};

/// What a film and the waves that fill it make room for.
struct AovLayout {
  AovSet set;
  uint32_t light_groups = 0;  ///< how many are kept
};

}  // namespace wavecomb
