// SPDX-License-Identifier: Apache-2.0
/// Start of light paths. Light paths are numbered like the pixels of the image, and a pass traces
/// the same number of samples of each light path. Random numbers depend only on the path's number
/// and the sample index, not on scheduling.
#pragma once

#include "wavecomb/core/sampler.h"
#include "wavecomb/film/splats/light_splat_filter.h"
#include "wavecomb/geometry/hit/motion.h"
#include "wavecomb/light/emission/emission.h"
#include "wavecomb/light_paths/context.h"
#include "wavecomb/light_paths/light_path_row.h"
#include "wavecomb/light_paths/light_vertices.h"
#include "wavecomb/light_paths/merge_grid.h"
#include "wavecomb/path/camera/camera_ray.h"
#include "wavecomb/path/path_state.h"

namespace wavecomb {

/// Start of a light path. `eta_scale` is one over the largest component of the initial flux, so
/// that roulette, which multiplies the flux by `eta_scale`, depends on the fraction of the flux
/// that remains.
template <typename F>
struct LightPath {
  SampleKey<F> key;
  Emission<F> emission;
  Color<F> flux;
  F weight;  ///< 1 / D
  F eta_scale;

  /// Returns the state of the light path on its first ray.
  PathState<F> start() const {
    return {.dir = emission.d, .throughput = flux, .eta_scale = eta_scale, .o = emission.o};
  }
  LightPathState<F> light_state() const { return {weight, F(0.f), emission.light}; }
};

/// Parameters of a render for shading vertices of light paths.
struct LightPathSetup {
  const LightPathContext& paths;
  const CameraSetup& camera;
  const Merger* merger;  ///< null without merging
};

/// Returns the settings for shading light paths, which filter textures at every vertex, since each
/// vertex is connected to the camera.
inline ShadeSettings light_shade_settings(const Settings& settings) {
  ShadeSettings s(settings);
  s.filters_all_lookups = true;
  return s;
}

/// Returns the state of a light path at the end of its ray of length `t`. The ray cone equals that
/// of a camera ray to the hit, so that textures are filtered at the camera's resolution.
template <typename F>
inline PathState<F> light_path_state(const CameraSetup& camera, const LightPathRow<F>& row,
                                     const F& t, const F& time, const Mask<F>& active) {
  F width(kConeShare * camera.step_y);
  if (camera.projection != Projection::kOrthographic)
    width *= length(Vec3<F>(fma(row.d, t, row.o) - camera_transform<F>(camera, time, active).t));
  return {.dir = row.d,
          .throughput = row.throughput,
          .eta_scale = row.eta_scale,
          .cone_width = width,
          .o = row.o};
}

/// Result of shading a vertex of a light path. `v.direct` is the contribution of the vertex to the
/// pixels.
template <typename F>
struct LightVertexResult {
  VertexResult<F> v;
  LightPathState<F> next;  ///< state of the light path after the bounce, in addition to v.next
  /// Position of the contribution on the film, in pixels. Valid only if there is a shadow ray.
  F x, y;
  Vec3<F> p;             ///< position of the light path's vertex
  Mask<F> is_candidate;  ///< whether vertices of camera paths may connect to the vertex
};

/// Vertices of camera paths to which vertices of light paths are connected. Where shading takes no
/// such target, vertices of light paths are connected to the camera.
template <typename F>
struct ConnectionTarget {
  ConnectionRow<F> row;
  Mask<F> is_first;  ///< whether the light path's vertex is the first of its path
};

/// Returns the flux that reaches a vertex. Absorption between a light and the first vertex is left
/// out, but not the division by the probability with which traversal stops a ray.
template <typename Bsdf, typename F, typename V, typename Interaction>
WAVECOMB_INLINE Color<F> flux_at(const V& v, const Interaction& at, const Mask<F>& is_first) {
  if constexpr (!Bsdf::kAbsorbs) {
    return at.throughput;
  } else {
    Mask<F> unabsorbed = is_first;
    if constexpr (Bsdf::kTransmitsStraight) unabsorbed = is_first & not_(at.bsdf.is_clear());
    return select<F>(unabsorbed, v.path.throughput, at.throughput);
  }
}

}  // namespace wavecomb
