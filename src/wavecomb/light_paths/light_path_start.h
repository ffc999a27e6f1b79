// SPDX-License-Identifier: Apache-2.0
/// Starts of light paths: their numbers, random numbers, shutter times and first rays.
#pragma once

#include "wavecomb/core/settings.h"
#include "wavecomb/light_paths/light_path.h"

namespace wavecomb {

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

/// Returns the shutter time of the light path of a pixel and sample. With connections, the light
/// path has the time of the camera path that connects to it.
template <typename F>
inline F light_path_time(const Settings& settings, const SampleKey<F>& key, const UInt<F>& pixel,
                         const UInt<F>& sample) {
  return path_time<F>(settings.sampler,
                      settings.connects() ? make_sample_key<F>(pixel, sample, settings.seed) : key);
}

}  // namespace wavecomb
