// SPDX-License-Identifier: Apache-2.0
/// List of all kinds of lights. To add a kind, add a pair of files to this folder, include its
/// header here, and append an entry to the list.
///
/// A light kind is a struct <Name>Kind that satisfies LightKindClass. The struct derives from
/// InfiniteKind, FiniteKind or FlatKind (record_reader.h), which define common members. A light
/// kind that lacks a member does not compile.
#pragma once

#include <concepts>
#include <cstdint>

#include "wavecomb/light/description/kind_info.h"
#include "wavecomb/light/kinds/cylinder.h"
#include "wavecomb/light/kinds/disk.h"
#include "wavecomb/light/kinds/distant.h"
#include "wavecomb/light/kinds/dome.h"
#include "wavecomb/light/kinds/mesh_light.h"
#include "wavecomb/light/kinds/rect.h"
#include "wavecomb/light/kinds/sphere.h"

/// List of light kinds as X(name), in the order of the kind numbers in records and scene
/// fingerprints.
#define WAVECOMB_LIGHT_KINDS(X) X(Rect) X(Disk) X(Sphere) X(Cylinder) X(Distant) X(Dome) X(Triangle)

namespace wavecomb {

#define WAVECOMB_LIGHT_KIND(name) k##name,
enum class LightKind : uint8_t { WAVECOMB_LIGHT_KINDS(WAVECOMB_LIGHT_KIND) };
#undef WAVECOMB_LIGHT_KIND
#define WAVECOMB_LIGHT_KIND(name) +1
inline constexpr uint32_t kLightKindCount = 0 WAVECOMB_LIGHT_KINDS(WAVECOMB_LIGHT_KIND);
#undef WAVECOMB_LIGHT_KIND
static_assert(LightKind::kTriangle == kMeshLight);

namespace detail {

template <typename Kind>
concept FiniteKindClass = requires(const LightReader<float>& light, const Vec3<float>& p) {
  { Kind::template emission_normal<float>(light, p) } -> std::same_as<Vec3<float>>;
};

}  // namespace detail

/// Members of a kind of light, as templates on the float type F:
///   describe          properties for the scene and the accelerator (description/kind_info.h)
///   kIsInfinite       whether it surrounds the scene
///   sample            samples a direction from a point to the light, with radiance and density
///   hit               radiance and density for a ray that hits its shape
///   escape            radiance and density for a ray that leaves the scene
///   emit              samples the origin and direction of a light path
///   emission_density  density of such a path for a ray that hits the light
///   is_delta          lanes whose light no ray can hit by chance, such as a point light
///   emission_normal   finite kinds: unit normal at a point of the light; 0 if it has none
template <typename Kind>
concept LightKindClass =
    requires(const detail::LightQuery<float>& query, const detail::LightHitQuery<float>& hit_query,
             const detail::LightEscape<float>& escape, const detail::EmissionQuery<float>& emission,
             const detail::LightReader<float>& light) {
      { Kind::describe() } -> std::same_as<LightKindInfo>;
      { Kind::kIsInfinite } -> std::convertible_to<bool>;
      { Kind::template sample<float>(query) } -> std::same_as<detail::KindSample<float>>;
      { Kind::template hit<float>(hit_query) } -> std::same_as<detail::KindHit<float>>;
      { Kind::template escape<float>(escape) } -> std::same_as<detail::KindHit<float>>;
      { Kind::template emit<float>(emission) } -> std::same_as<detail::KindEmission<float>>;
      { Kind::template emission_density<float>(hit_query) } -> std::same_as<float>;
      { Kind::template is_delta<float>(light) } -> std::same_as<Mask<float>>;
    } &&
    (Kind::kIsInfinite || detail::FiniteKindClass<Kind>);

#define WAVECOMB_LIGHT_KIND(name) \
  static_assert(LightKindClass<name##Kind>, "a kind of light lacks a member of LightKindClass");
WAVECOMB_LIGHT_KINDS(WAVECOMB_LIGHT_KIND)
#undef WAVECOMB_LIGHT_KIND

/// Calls `f` with an object of the class that implements `kind`, for example RectKind, and returns
/// the result.
template <typename Function>
WAVECOMB_INLINE decltype(auto) visit(LightKind kind, const Function& f) {
  switch (kind) {
#define WAVECOMB_LIGHT_KIND(name) \
  case LightKind::k##name:        \
    return f(name##Kind{});
    WAVECOMB_LIGHT_KINDS(WAVECOMB_LIGHT_KIND)
#undef WAVECOMB_LIGHT_KIND
  }
  __builtin_unreachable();
}
/// Calls `f` for the kind number of a light record.
template <typename Function>
WAVECOMB_INLINE decltype(auto) visit(uint32_t kind, const Function& f) {
  return visit(static_cast<LightKind>(kind), f);
}

}  // namespace wavecomb
