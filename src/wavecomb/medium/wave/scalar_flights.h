// SPDX-License-Identifier: Apache-2.0
/// Ray segments of the reference integrator through media inside meshes. Included by volumes.h.
#pragma once

#include "wavecomb/medium/wave/volumes.h"

namespace wavecomb {

template <typename Hit>
Flight<float> Volumes::sample_nested_flight(const MediumQuery<float>& p, const PresenceKeys& keys,
                                            PathState<float>& path, Hit& hit,
                                            MediumStackRow<float>& stack) const {
  using F = float;
  // Make a wave that contains a single path.
  alignas(64) float row[kRowWords<PathRow>], row_words[kRowWords<MediumStackRow>];
  store_row<PathRow, F>(row, 0u, path_row<false, F>(path, p.key), true);
  store_row<MediumStackRow, F>(row_words, 0u, stack, true);
  float o[3] = {path.o.x, path.o.y, path.o.z}, d[3] = {path.dir.x, path.dir.y, path.dir.z};
  float t = kInfinity, ratio[3] = {1, 1, 1}, absorbed[3] = {1, 1, 1}, scratch[2];
  const uint32_t slot = 0;
  const MediumStack<float> around = p.depth == 0 ? around_camera(keys) : MediumStack<float>();
  const NestedRayStart<F> begin =
      begin_nested_flight<F>(p.sampler, p.key, p.depth, path.throughput);
  const SegmentRandom<F> segment(p, VertexSet::kFlight);
  uint32_t material = Flights::kNoEvent, hero = begin.hero;
  const RaySegments segments{&o[0], &o[1],         &o[2],        &d[0], &d[1],  &d[2],
                             &t,    &segment.seed, &segment.r.z, 1,     &p.time};
  const Flights flights{&t,
                        &material,
                        {&ratio[0], &ratio[1], &ratio[2]},
                        &hero,
                        {&absorbed[0], &absorbed[1], &absorbed[2]}};
  sample_stops<F>(volumes_, segments, flights, scratch, distance_lights_, counts_.volumes);
  nested_media_.sample_flight<F>(
      {{&o[0], &o[1], &o[2]}, {&d[0], &d[1], &d[2]}, &slot, 1, &p.time, row, row_words},
      {&hit.t, &hit.u, &hit.v, &hit.prim, &hit.geom, &hit.inst},
      {volumes_.count > 0,
       &t,
       &material,
       {&ratio[0], &ratio[1], &ratio[2]},
       {&absorbed[0], &absorbed[1], &absorbed[2]},
       &hero},
      p.depth == 0 ? &around : nullptr, keys, [&](size_t, const PathRow<F>&) { return begin; });
  const auto end = load_row<PathRow, F>(row, 0u, true);
  path.o = end.o;
  path.dir = end.d;
  path.throughput = end.throughput;
  path.pdf = end.pdf;
  path.receiver = end.receiver;
  stack = load_row<MediumStackRow, F>(row_words, 0u, true);
  if (has_flight_weights(volumes_, distance_lights_))
    compute_flight_ratios<F>(volumes_, segments, flights, scratch, distance_lights_,
                             counts_.volumes);
  const Color<F> left{absorbed[0], absorbed[1], absorbed[2]};
  return {material != Flights::kNoEvent, t, material,
          flight_weight<F>({ratio[0], ratio[1], ratio[2]}, path.throughput) * left,
          hero == Flights::kNoHero};
}

inline Color<float> Volumes::nested_transmittance(const PresenceKeys& keys, float time,
                                                  const MediumStackRow<float>& stack,
                                                  const Vec3<float>& o, const Vec3<float>& d,
                                                  float t) const {
  alignas(64) float row_words[kRowWords<MediumStackRow>];
  store_row<MediumStackRow, float>(row_words, 0u, stack, true);
  float from[3] = {o.x, o.y, o.z}, along[3] = {d.x, d.y, d.z}, product[3] = {1, 1, 1};
  float* const columns[3] = {&product[0], &product[1], &product[2]};
  const uint32_t slot = 0;
  nested_media_.attenuate<float>({{&from[0], &from[1], &from[2]},
                                  {&along[0], &along[1], &along[2]},
                                  &slot,
                                  1,
                                  &time,
                                  nullptr,
                                  row_words},
                                 &t, columns, keys);
  return {product[0], product[1], product[2]};
}

}  // namespace wavecomb
