// SPDX-License-Identifier: Apache-2.0
/// How a path from a light begins. A pass has as many of them as the picture has pixels, each
/// numbered as a pixel: what is drawn depends on the number and the sample, and on no schedule.
#pragma once

#include "wavecomb/core/sampler.h"
#include "wavecomb/film/splat_filter.h"
#include "wavecomb/integrate/camera_ray.h"
#include "wavecomb/integrate/path_state.h"
#include "wavecomb/integrate/visible_points.h"
#include "wavecomb/light/emission.h"
#include "wavecomb/surface/motion.h"

namespace wavecomb {

/// A path at its start. `eta_scale` is one over its largest flux, so that roulette, which
/// multiplies the two, sees what share is left.
template <typename F>
struct LightPath {
  SampleKey<F> key;
  Emission<F> emission;
  Color<F> flux;
  F weight;  ///< 1 / D
  F eta_scale;
};

/// The number of the path of a pixel of the whole picture, x | y << 16.
template <typename U>
inline U light_path_number(const Settings& settings, const U& pixel) {
  return (pixel >> 16) * settings.width + (pixel & 0xffffu);
}

/// Points of one sequence for all paths of a sample, so that they are spread over the lights and
/// their directions together: by the number's low bits, as many as sequences have.
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
  const Sample4<F> way = sample_4d<F>(settings.sampler, path.key, kCameraSet);
  const Sample4<F> choice =
      sample_4d<F>(settings.sampler, path.key, vertex_set(VertexSet::kEmission, 0));
  path.emission =
      sample_emission<F>(lights, {choice.x, way.z, way.w, way.x, way.y, choice.y}, active);
  const F largest = max_component(path.emission.flux);
  const F scale = 1.f / select(path.emission.valid, largest, F(1.f));
  path.flux = path.emission.flux;
  path.eta_scale = scale;
  path.weight = 1.f / select(path.emission.valid, path.emission.density, F(1.f));
  return path;
}

/// What vertices of paths from lights are told of the picture.
struct LightPathSetup {
  const CameraSetup& camera;
  const SplatFilter& filter;
  float share;           ///< 1 / N, N as many paths as the picture has pixels
  float camera_squares;  ///< as WaveContext says
  const Merger* merger;  ///< null where vertices are not merged
};

/// Of a WaveContext.
template <typename Context>
inline LightPathSetup light_path_setup(const Context& context, const Merger* merger = nullptr) {
  return {*context.camera, *context.splat_filter, context.light_path_share(),
          context.camera_squares, context.lessons ? nullptr : merger};
}

/// What camera paths are shaded with, beside which paths from lights may be.
template <typename Context>
inline ShadeSettings camera_shade_settings(const Context& context) {
  ShadeSettings s(*context.settings);
  s.joins_light = context.joins_light() && !context.has_media();
  if (context.merges()) {
    s.merge_scale = context.settings->merge_radius / kConeShare;
    s.light_paths = 1.f / context.light_path_share();
  }
  return s;
}

/// The time of the path of a pixel and sample: that of the camera's path, where it is connected to
/// that.
template <typename F>
inline F light_path_time(const Settings& settings, const SampleKey<F>& key, const UInt<F>& pixel,
                         const UInt<F>& sample) {
  return path_time<F>(settings.sampler,
                      settings.connects() ? make_sample_key<F>(pixel, sample, settings.seed) : key);
}

/// What a path from a light carries to the end of its ray of length t. Textures are seen as the
/// camera sees them: the cone is that of a ray from there.
template <typename F>
inline PathState<F> light_path_state(const CameraSetup& camera, const Vec3<F>& d,
                                     const Color<F>& flux, const F& weight, const F& eta_scale,
                                     const F& ratio, const Vec3<F>& o, const UInt<F>& light,
                                     const F& t, const F& time, const Mask<F>& active) {
  F width(kConeShare * camera.step_y);
  if (camera.projection != Projection::kOrthographic)
    width *= length(Vec3<F>(fma(d, t, o) - camera_place<F>(camera, time, active).t));
  PathState<F> state{d, flux, weight, eta_scale, width, F(0.f), o, light};
  state.ratio = ratio;
  return state;
}

/// Of the members of `v`, `direct` is what the pixels get, `next.pdf` is S and `next.ratio` p<- of
/// the bounce.
template <typename F>
struct LightVertexResult {
  VertexResult<F> v;
  F x, y;           ///< on the film, where a shadow ray is wanted
  Vec3<F> p;        ///< where the vertex is
  Mask<F> offered;  ///< vertices of camera paths may connect to it
};

/// The vertices of camera paths that vertices from lights are shown to, in place of the camera.
template <typename F>
struct ConnectionTarget {
  ConnectionRow<F> row;
  Mask<F> is_first;  ///< the vertex from the light is its path's first
};

}  // namespace wavecomb
