// SPDX-License-Identifier: Apache-2.0
/// Stage 3a: hits become shading records; paths that left the scene or met a light's shape end
/// here.
#pragma once

#include "wavecomb/core/rows.h"
#include "wavecomb/integrate/light_groups.h"
#include "wavecomb/integrate/stages/order_rays.h"
#include "wavecomb/integrate/vertex.h"
#include "wavecomb/integrate/wave.h"
#include "wavecomb/surface/hit.h"

namespace wavecomb {

/// Distance along the camera's axis, into the depth AOV.
template <typename F>
inline void store_depth(PathPool& pool, const CameraSetup& camera, const Vec3<F>& o,
                        const Vec3<F>& d, const F& t, const UInt<F>& slot, const Mask<F>& active) {
  const F time = camera.moves() ? gather<F>(pool.time, slot, active) : F(0.f);
  scatter<F>(pool.depth, camera_depth<F>(camera, fma(d, t, o), time, active), slot, active);
}

/// What camera rays met, into the rows of AovHit.
template <typename F>
inline void store_hit(const PathPool& pool, const UInt<F>& slot, const Vec3<F>& p,
                      const UInt<F>& object, const UInt<F>& material, const UInt<F>& instance,
                      const Mask<F>& active) {
  const F none(0.f);
  store_rows<PathPool::kHitWords, F>(pool.hits, slot * PathPool::kHitWords,
                                     {p.x, p.y, p.z, bits_float<F>(object), bits_float<F>(material),
                                      bits_float<F>(instance), none, none},
                                     active);
}

/// Splits the radiance of paths that end in lanes `missed` (the environment) or `shape` (light
/// `light`, `c`) by light group.
template <typename F>
inline void add_ended_groups(const PathPool& pool, const WaveContext& context,
                             const ShadeSettings& settings, uint32_t depth, const UInt<F>& slot,
                             const UInt<F>& light, const Color<F>& c, const PathState<F>& path,
                             const Mask<F>& missed, const Mask<F>& shape) {
  const uint32_t* kept = context.aovs->kept_group.data();
  if (any(missed))
    split_environment<F>(context.scene, settings, depth, kept, path, missed,
                         [&](uint32_t group, const Color<F>& share) {
                           add_group_radiance<F>(pool, slot, UInt<F>(group), share, missed);
                         });
  if (any(shape)) add_group_radiance<F>(pool, slot, kept_group<F>(kept, light, shape), c, shape);
}

/// Reads the ray queue and the hit buffer, fills the shading queue in the rays' order.
template <typename F>
void collect(Wave& wave, const WaveContext& context, const ShadeSettings& settings,
             uint32_t depth) {
  using U = UInt<F>;
  const RayQueue& rays = wave.rays;
  const HitBuffer& hits = wave.hits;
  ShadingQueue& queue = wave.shading;
  const SceneView& scene = context.scene;
  const bool cost_aware = settings.cost_aware && depth >= settings.roulette_depth;
  queue.clear();
  size_t n = 0;
  for (size_t i = 0; i < rays.size; i += kWidth<F>) {
    const Mask<F> active = first_lanes<F>(rays.size - i);
    const U inst = load<U>(hits.inst + i);
    const Mask<F> missed = active & Mask<F>(inst == U(kNoHit));
    const Mask<F> shape = active & Mask<F>(inst == U(kLightShape));
    Mask<F> surface = active & not_(missed) & not_(shape);
    const F t = load<F>(hits.t + i);
    const U slot = load<U>(rays.slot + i);
    const Vec3<F> o{load<F>(rays.ox + i), load<F>(rays.oy + i), load<F>(rays.oz + i)};
    const Vec3<F> d{load<F>(rays.dx + i), load<F>(rays.dy + i), load<F>(rays.dz + i)};
    const Mask<F> ended = missed | shape;
    const Mask<F> wanted = cost_aware ? active : ended;
    PathLanes<F> path;
    PathState<F> state;
    if (any(wanted)) {
      path = load_path<F>(wave.pool, slot, wanted);
      state = {path.d, path.throughput, path.pdf, path.eta_scale,
               F(0.f), F(0.f),          path.o,   path.receiver};
      if (wave.pool.link && depth > 0)
        state.link = gather<U>(wave.pool.link, slot, Mask<U>(wanted));
    }
    if (any(ended)) {
      Color<F> c(F(0.f));
      if (any(missed))
        c = select<F>(missed, environment_emission<F>(scene, settings, depth, state, missed), c);
      if (any(shape)) {
        const U light = load<U>(hits.geom + i);
        c = select<F>(shape, shape_emission<F>(scene, settings, depth, light, t, state, shape), c);
      }
      add_radiance<F>(wave.pool, slot, c, ended & not_(is_black(c)));
      if (wave.pool.groups)
        add_ended_groups<F>(wave.pool, context, settings, depth, slot, load<U>(hits.geom + i), c,
                            state, missed, shape);
    }
    const bool first_hits = depth == 0 && wave.pool.hits;
    if (depth == 0 && wave.pool.depth)
      store_depth<F>(wave.pool, *context.camera, o, d, t, slot, active & not_(missed));
    if (first_hits && any(shape))
      store_hit<F>(wave.pool, slot, fma(d, t, o),
                   context.aovs->light_object(load<U>(hits.geom + i)), U(kNothingHit),
                   U(kNothingHit), shape);
    if (none(surface)) continue;

    const U prim = load<U>(hits.prim + i);
    const U geom = load<U>(hits.geom + i);
    static_assert(offsetof(InstanceRecord, geometry) == 48);
    const auto row = load_rows<2, F>(scene.instances, inst * 16u + 12u, surface);
    const U first = float_bits<F>(row[0]), inherited = float_bits<F>(row[1]);
    const U mesh = gather<U>(scene.geometry_mesh, first + geom, Mask<U>(surface));
    const U material = hit_material<F>(scene, inherited, mesh, prim, surface);
    const U program = gather<U>(scene.material_program, material, Mask<U>(surface));
    if (first_hits)
      store_hit<F>(wave.pool, slot, fma(d, t, o),
                   context.aovs->template object<F>(inst, geom, surface), material, inst, surface);
    if (cost_aware) {
      const F q = cost_aware_survival<F>(scene, *context.roulette_costs, material, state, surface);
      surface = surface & (cost_aware_number<F>(path.key, depth) < q);
      path.throughput *= F(1.f) / q;
      if (none(surface)) continue;
      store_path<F>(wave.pool, slot, path, surface);
    }

    using Q = ShadingQueue;
    const Mask<U> on(surface);
    const auto put = [&](uint32_t* column, const U& x) { compress_store<U>(column + n, x, on); };
    put(queue.slot, slot);
    put(queue.uints(Q::kMaterial), material);
    put(queue.uints(Q::kProgram), program);
    if (context.wants_position)
      put(queue.uints(Q::kPositionKey), position_key<F>(context.grid, fma(d, t, o)));
    n += compress_rows<Q::kRowWords, F>(
        queue.rows() + n * Q::kRowWords,
        {t, load<F>(hits.u + i), load<F>(hits.v + i), bits_float<F>(prim), bits_float<F>(inst),
         bits_float<F>(mesh), bits_float<F>(geom), bits_float<F>(slot)},
        surface);
  }
  queue.size = n;
  wave.counts.add_records(depth, n);
  ++wave.queues;
}

}  // namespace wavecomb
