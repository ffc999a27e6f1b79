// SPDX-License-Identifier: Apache-2.0
/// List of all kinds of lights. To add a kind, add a pair of files to this folder, include its
/// header here, and append an entry to the list.
///
/// A kind is a struct <Name>Kind with
///   describe()   the properties that the scene and the accelerator need
///   (light/description/kind_info.h), sample       samples a direction from a point to the light,
///   with radiance and density, hit          returns radiance and density for a ray that hits its
///   shape, escape       returns both for a ray that leaves the scene, emit         samples the
///   origin and direction of a light path, and emission_density    returns the density of such a
///   path for a ray that hits the light.
/// NoShape and NoEscape provide hit and escape for kinds that do not need them.
#pragma once

#include <cstdint>

#include "wavecomb/light/kinds/cylinder.h"
#include "wavecomb/light/kinds/disk.h"
#include "wavecomb/light/kinds/distant.h"
#include "wavecomb/light/kinds/dome.h"
#include "wavecomb/light/kinds/mesh_light.h"
#include "wavecomb/light/kinds/rect.h"
#include "wavecomb/light/kinds/sphere.h"

/// X(name), in the order of the kind numbers in records and fingerprints.
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

template <typename F>
inline KindSample<F> sample_kind(LightKind kind, const LightQuery<F>& query) {
  switch (kind) {
#define WAVECOMB_LIGHT_KIND(name) \
  case LightKind::k##name:        \
    return name##Kind::sample<F>(query);
    WAVECOMB_LIGHT_KINDS(WAVECOMB_LIGHT_KIND)
#undef WAVECOMB_LIGHT_KIND
  }
  return {};
}

template <typename F>
inline KindHit<F> hit_kind(LightKind kind, const LightMeeting<F>& meeting) {
  switch (kind) {
#define WAVECOMB_LIGHT_KIND(name) \
  case LightKind::k##name:        \
    return name##Kind::hit<F>(meeting);
    WAVECOMB_LIGHT_KINDS(WAVECOMB_LIGHT_KIND)
#undef WAVECOMB_LIGHT_KIND
  }
  return dark<F>();
}

template <typename F>
inline KindHit<F> escape_kind(LightKind kind, const LightEscape<F>& escape) {
  switch (kind) {
#define WAVECOMB_LIGHT_KIND(name) \
  case LightKind::k##name:        \
    return name##Kind::escape<F>(escape);
    WAVECOMB_LIGHT_KINDS(WAVECOMB_LIGHT_KIND)
#undef WAVECOMB_LIGHT_KIND
  }
  return dark<F>();
}

template <typename F>
inline KindEmission<F> emit_kind(LightKind kind, const EmissionQuery<F>& query) {
  switch (kind) {
#define WAVECOMB_LIGHT_KIND(name) \
  case LightKind::k##name:        \
    return name##Kind::emit<F>(query);
    WAVECOMB_LIGHT_KINDS(WAVECOMB_LIGHT_KIND)
#undef WAVECOMB_LIGHT_KIND
  }
  return {};
}

template <typename F>
inline F emission_density_of_kind(LightKind kind, const LightMeeting<F>& meeting) {
  switch (kind) {
#define WAVECOMB_LIGHT_KIND(name) \
  case LightKind::k##name:        \
    return name##Kind::emission_density<F>(meeting);
    WAVECOMB_LIGHT_KINDS(WAVECOMB_LIGHT_KIND)
#undef WAVECOMB_LIGHT_KIND
  }
  return F(0.f);
}

}  // namespace detail

}  // namespace wavecomb
