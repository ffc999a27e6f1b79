// SPDX-License-Identifier: Apache-2.0
/// Stage 3a: hits become shading records; paths that left the scene or met a light's shape end
/// here.
#pragma once

#include "wavecomb/integrate/stages/order_rays.h"
#include "wavecomb/integrate/vertex.h"
#include "wavecomb/integrate/wave.h"

namespace wavecomb {

namespace detail {

/// Material of a hit: the face's, else the mesh's, else the instance's.
template <typename F>
inline UInt<F> hit_material(const SceneView& scene, const UInt<F>& inst, const UInt<F>& mesh,
                            const UInt<F>& prim, const Mask<F>& active) {
  using U = UInt<F>;
  const Mask<U> on(active);
  constexpr uint32_t kMeshWords = sizeof(MeshRecord) / 4;
  const U word = mesh * kMeshWords;
  U material =
      gather<U>(scene.meshes, word + static_cast<uint32_t>(offsetof(MeshRecord, material) / 4), on);
  const U lo = gather<U>(
      scene.meshes, word + static_cast<uint32_t>(offsetof(MeshRecord, face_materials) / 4), on);
  const U hi = gather<U>(
      scene.meshes, word + static_cast<uint32_t>(offsetof(MeshRecord, face_materials) / 4 + 1), on);
  const Mask<U> by_face = on & Mask<U>((lo | hi) != U(0u));
  if (any(by_face)) {
    using U64 = UInt64<F>;
    const U64 address = U64(lo) | (U64(hi) << 32);
    material = select(by_face, gather_at<U>(address, prim, by_face), material);
  }
  const Mask<U> inherits = on & Mask<U>(material == U(kInheritMaterial));
  if (any(inherits)) {
    constexpr uint32_t kInstanceWords = sizeof(InstanceRecord) / 4;
    const U at =
        inst * kInstanceWords + static_cast<uint32_t>(offsetof(InstanceRecord, material) / 4);
    material = select(inherits, gather<U>(scene.instances, at, inherits), material);
  }
  return material;
}

}  // namespace detail

/// Distance along the camera's axis, into the depth AOV.
template <typename F>
inline void store_depth(PathPool& pool, const CameraSetup& camera, const Vec3<F>& o,
                        const Vec3<F>& d, const F& t, const UInt<F>& slot, const Mask<F>& active) {
  const Vec3<F> p = fma(d, t, o) - Vec3<F>(camera.to_world.t);
  scatter<F>(pool.depth, -dot(p, Vec3<F>(camera.backward)), slot, active);
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
    PathState<F> path;
    path.dir = {load<F>(rays.dx + i), load<F>(rays.dy + i), load<F>(rays.dz + i)};
    path.throughput = {load<F>(rays.throughput_r + i), load<F>(rays.throughput_g + i),
                       load<F>(rays.throughput_b + i)};
    path.pdf = load<F>(rays.pdf + i);
    path.cone_spread = load<F>(rays.cone_spread + i);
    path.cone_width = fma(path.cone_spread, t, load<F>(rays.cone_width + i));
    path.eta_scale = load<F>(rays.eta_scale + i);

    if (any(missed)) {
      const Color<F> c = environment_emission<F>(scene, settings, depth, path, missed);
      add_radiance<F>(wave.pool, slot, c, missed & not_(is_black(c)));
    }
    if (any(shape)) {
      const Vec3<F> o{load<F>(rays.ox + i), load<F>(rays.oy + i), load<F>(rays.oz + i)};
      const Color<F> c =
          shape_emission<F>(scene, settings, depth, load<U>(hits.geom + i), o, t, path, shape);
      add_radiance<F>(wave.pool, slot, c, shape & not_(is_black(c)));
    }
    if (depth == 0 && wave.pool.has_aovs) {
      const Vec3<F> o{load<F>(rays.ox + i), load<F>(rays.oy + i), load<F>(rays.oz + i)};
      store_depth<F>(wave.pool, *context.camera, o, path.dir, t, slot, active & not_(missed));
    }
    if (none(surface)) continue;

    const U prim = load<U>(hits.prim + i);
    const U geom = load<U>(hits.geom + i);
    Mask<U> on(surface);
    constexpr uint32_t kInstanceWords = sizeof(InstanceRecord) / 4;
    const U first = gather<U>(
        scene.instances,
        inst * kInstanceWords + static_cast<uint32_t>(offsetof(InstanceRecord, geometry) / 4), on);
    const U mesh = gather<U>(scene.geometry_mesh, first + geom, on);
    const U material = detail::hit_material<F>(scene, inst, mesh, prim, surface);
    const U program = gather<U>(scene.material_program, material, on);
    if (settings.cost_aware && depth >= settings.roulette_depth) {
      const SampleKey<F> key{gather<U>(wave.pool.pixel_hash, slot, on),
                             gather<U>(wave.pool.sample, slot, on)};
      const F q = cost_aware_survival<F>(scene, *context.roulette_costs, material, path, surface);
      surface = surface & (cost_aware_number<F>(key, depth) < q);
      path.throughput *= F(1.f) / q;
      if (none(surface)) continue;
      on = Mask<U>(surface);
    }

    using Q = ShadingQueue;
    const auto put = [&](Q::Column column, const F& x) {
      compress_store<F>(queue.floats(column) + n, x, surface);
    };
    const auto put_id = [&](Q::Column column, const U& x) {
      compress_store<U>(queue.uints(column) + n, x, on);
    };
    put(Q::kDx, path.dir.x);
    put(Q::kDy, path.dir.y);
    put(Q::kDz, path.dir.z);
    put(Q::kThroughputR, path.throughput.x);
    put(Q::kThroughputG, path.throughput.y);
    put(Q::kThroughputB, path.throughput.z);
    put(Q::kPdf, path.pdf);
    put(Q::kEtaScale, path.eta_scale);
    put(Q::kConeWidth, path.cone_width);
    put(Q::kConeSpread, path.cone_spread);
    put(Q::kT, t);
    put(Q::kU, load<F>(hits.u + i));
    put(Q::kV, load<F>(hits.v + i));
    put_id(Q::kSlot, slot);
    put_id(Q::kInst, inst);
    put_id(Q::kMesh, mesh);
    put_id(Q::kGeom, geom);
    put_id(Q::kPrim, prim);
    put_id(Q::kMaterial, material);
    put_id(Q::kProgram, program);
    if (context.wants_position) {
      const Vec3<F> o{load<F>(rays.ox + i), load<F>(rays.oy + i), load<F>(rays.oz + i)};
      put_id(Q::kPositionKey, position_key<F>(context.grid, fma(path.dir, t, o)));
    }
    const size_t added = count<F>(surface);
    n += added;
  }
  queue.size = n;
  uint32_t* arrival = queue.uints(ShadingQueue::kArrival);
  for (uint32_t i = 0; i < n; i += kWidth<F>) store(arrival + i, lane_index<F>() + i);
  wave.counts.add_records(depth, n);
  ++wave.queues;
}

}  // namespace wavecomb
