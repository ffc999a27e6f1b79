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

/// Returns the number of the light path of a pixel (x | y << 16) of the whole image.
template <typename U>
inline U light_path_number(const Settings& settings, const U& pixel) {
  return (pixel >> 16) * settings.width + (pixel & 0xffffu);
}

/// Returns the sampler key of a light path. All light paths of one sample index are points of a
/// single sequence, so that they are well distributed over lights and directions. The low bits of
/// the path's number are its index in the sequence.
template <typename F>
inline SampleKey<F> light_path_key(const Settings& settings, const UInt<F>& pixel,
                                   const UInt<F>& sample) {
  using U = UInt<F>;
  const U number = light_path_number<U>(settings, pixel);
  const U block = number >> detail::kIndexBits;
  const U sequence = hash_u32<U>(hash_u32<U>(sample, block), U(settings.seed ^ 0x2c1b3c6du));
  return {sequence, number & ((1u << detail::kIndexBits) - 1u)};
}

template <typename F>
inline LightPath<F> begin_light_path(const LightView& lights, const Settings& settings,
                                     const UInt<F>& pixel, const UInt<F>& sample,
                                     const Mask<F>& active) {
  LightPath<F> path;
  path.key = light_path_key<F>(settings, pixel, sample);
  const Sample4<F> camera_sample = sample_4d<F>(settings.sampler, path.key, kCameraSet);
  const Sample4<F> choice =
      sample_4d<F>(settings.sampler, path.key, vertex_set(VertexSet::kEmission, 0));
  path.emission = sample_emission<F>(
      lights,
      {choice.x, camera_sample.z, camera_sample.w, camera_sample.x, camera_sample.y, choice.y},
      active);
  const F largest = max_component(path.emission.flux);
  const F scale = 1.f / select(path.emission.valid, largest, F(1.f));
  path.flux = path.emission.flux;
  path.eta_scale = scale;
  path.weight = 1.f / select(path.emission.valid, path.emission.density, F(1.f));
  return path;
}

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

/// Returns the shutter time of the light path of a pixel and sample. With connections, the light
/// path has the time of the camera path that connects to it.
template <typename F>
inline F light_path_time(const Settings& settings, const SampleKey<F>& key, const UInt<F>& pixel,
                         const UInt<F>& sample) {
  return path_time<F>(settings.sampler,
                      settings.connects() ? make_sample_key<F>(pixel, sample, settings.seed) : key);
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

}  // namespace wavecomb
