// SPDX-License-Identifier: Apache-2.0
/// Ray segments of the reference integrator through media inside meshes. Included by volumes.h.
#pragma once

#include "wavecomb/medium/wave/volumes.h"

namespace wavecomb {

template <typename Hit>
Flight<float> Volumes::fly_inside(const Passage<float>& p, const PresenceKeys& keys,
                                  PathState<float>& path, Hit& hit,
                                  InsideRow<float>& inside) const {
  using F = float;
  // A wave with one path.
  alignas(64) float row[kRowWords<PathRow>], place[kRowWords<InsideRow>];
  store_row<PathRow, F>(row, 0u, path_row<false, F>(path, p.key), true);
  store_row<InsideRow, F>(place, 0u, inside, true);
  float o[3] = {path.o.x, path.o.y, path.o.z}, d[3] = {path.dir.x, path.dir.y, path.dir.z};
  float t = kInfinity, ratio[3] = {1, 1, 1}, absorbed[3] = {1, 1, 1}, scratch[2];
  const uint32_t slot = 0;
  const Inside<float> around = p.depth == 0 ? around_camera(keys) : Inside<float>();
  const InteriorStart<F> begin = begin_inside<F>(p.sampler, p.key, p.depth, path.throughput);
  const Way<F> way(p, VertexSet::kFlight);
  uint32_t material = Flights::kNoEvent, hero = begin.hero;
  const Ways ways{&o[0], &o[1], &o[2], &d[0], &d[1], &d[2], &t, &way.seed, &way.r.z, 1, &p.time};
  const Flights flights{&t,
                        &material,
                        {&ratio[0], &ratio[1], &ratio[2]},
                        &hero,
                        {&absorbed[0], &absorbed[1], &absorbed[2]}};
  stop_flights<F>(volumes_, ways, flights, scratch, lamps_, counts_.volumes);
  interiors_.fly<F>({{&o[0], &o[1], &o[2]}, {&d[0], &d[1], &d[2]}, &slot, 1, &p.time, row, place},
                    {&hit.t, &hit.u, &hit.v, &hit.prim, &hit.geom, &hit.inst},
                    {volumes_.count > 0,
                     &t,
                     &material,
                     {&ratio[0], &ratio[1], &ratio[2]},
                     {&absorbed[0], &absorbed[1], &absorbed[2]},
                     &hero},
                    p.depth == 0 ? &around : nullptr, keys,
                    [&](size_t, const PathRow<F>&) { return begin; });
  const auto walked = load_row<PathRow, F>(row, 0u, true);
  path.o = walked.o;
  path.dir = walked.d;
  path.throughput = walked.throughput;
  path.pdf = walked.pdf;
  path.receiver = walked.receiver;
  inside = load_row<InsideRow, F>(place, 0u, true);
  if (weigh_anything(volumes_, lamps_))
    weigh_flights<F>(volumes_, ways, flights, scratch, lamps_, counts_.volumes);
  const Color<F> left{absorbed[0], absorbed[1], absorbed[2]};
  return {material != Flights::kNoEvent, t, material,
          flight_weight<F>({ratio[0], ratio[1], ratio[2]}, path.throughput) * left,
          hero == Flights::kNoHero};
}

inline Color<float> Volumes::pass_inside(const PresenceKeys& keys, float time,
                                         const InsideRow<float>& inside, const Vec3<float>& o,
                                         const Vec3<float>& d, float t) const {
  alignas(64) float place[kRowWords<InsideRow>];
  store_row<InsideRow, float>(place, 0u, inside, true);
  float from[3] = {o.x, o.y, o.z}, along[3] = {d.x, d.y, d.z}, product[3] = {1, 1, 1};
  float* const columns[3] = {&product[0], &product[1], &product[2]};
  const uint32_t slot = 0;
  interiors_.pass<float>({{&from[0], &from[1], &from[2]},
                          {&along[0], &along[1], &along[2]},
                          &slot,
                          1,
                          &time,
                          nullptr,
                          place},
                         &t, columns, keys);
  return {product[0], product[1], product[2]};
}

}  // namespace wavecomb
