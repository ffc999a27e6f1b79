// SPDX-License-Identifier: Apache-2.0
/// Subsurface random walks of all paths of a wave, from the ray that enters a body to the point
/// where the path leaves the body.
#pragma once

#include <algorithm>
#include <bit>
#include <chrono>
#include <span>
#include <utility>

#include "wavecomb/geometry/hit/hit_material.h"
#include "wavecomb/medium/nested/ray_columns.h"
#include "wavecomb/medium/subsurface/walk_queue.h"
#include "wavecomb/medium/volume/tracking.h"
#include "wavecomb/wave/stages/trace.h"
#include "wavecomb/wave/wave.h"

namespace wavecomb {

/// Base class of Volumes, which runs subsurface random walks.
class SubsurfaceScattering {
 public:
  /// `counts` receives the statistics of walks. `walks` is the memory of the WalkQueue, with
  /// WalkQueue::kColumns columns.
  SubsurfaceScattering(const WaveContext& context, Counts& counts, const SoaBlock& walks)
      : context_(context), counts_(counts), walks_(walks) {}

  /// Returns whether the scene has subsurface scattering.
  bool has_subsurface() const { return context_.scene.subsurface.media != nullptr; }
  /// Runs the subsurface random walk of a single path, for the reference integrator. The ray of the
  /// path has entered a subsurface body and found the hit `hit`. Query `p` describes the ray
  /// segment to the hit. `keys` are the presence keys of the ray and include the object. If the
  /// walk leaves the body, sets `left_body`, and `path` and `hit` describe a ray that views the
  /// exit point from outside. Returns false if the walk was terminated inside. If the ray does not
  /// hit the object, returns true and leaves `path` and `hit` unchanged, except that path.pdf
  /// becomes 0, since no light sample competes with the path.
  template <typename Hit>
  bool walk(const MediumQuery<float>& p, const PresenceKeys& keys, PathState<float>& path, Hit& hit,
            bool& left_body) const {
    WalkQueue walk_queue(walks_);
    walk_queue.add<float>(begin_walk<float>(p.sampler, p.key, p.depth, path.o, path.dir,
                                            path.throughput, path.entry.normal),
                          0u, 0u, p.time, true);
    enter<float>(walk_queue, keys, 1, [](bool, uint32_t) {});
    if (walk_queue.size() == 0) {
      path.pdf = 0.f;
      return true;
    }
    walk_queue.run<float>(context_.scene, *context_.accel, 1, keys, counts_.walk_steps,
                          counts_.walk_lanes,
                          [&](bool, uint32_t, const WalkEnd<float>& end, bool reached_surface) {
                            left_body = reached_surface;
                            const ExitRay<float> exit_ray = make_exit_ray(end);
                            path.o = exit_ray.o;
                            path.dir = exit_ray.d;
                            path.throughput = end.throughput;
                            hit.t = exit_ray.t;
                            hit.u = end.u;
                            hit.v = end.v;
                            hit.prim = end.prim;
                            hit.geom = end.geom;
                            hit.inst = end.inst;
                          });
    return left_body;
  }
  /// For the packet of rays that starts at index `i`, returns the lanes whose rays view the exit
  /// point of a walk.
  template <typename F>
  Mask<F> left_body(const Wave& wave, size_t i) const {
    return Mask<F>(load<UInt<F>>(wave.segments.uints(kExit) + i) != UInt<F>(0u));
  }
  uint32_t exit_material() const { return context_.scene.subsurface.exit_material; }

 protected:
  /// Columns of Wave::segments.
  enum Column : size_t {
    kDistance,
    kMaterial,
    kRatio,
    kHero = kRatio + 3,
    kSeed,
    kFirst,
    kExit,
    kAbsorbed,
    kScratch = kAbsorbed + 3
  };
  static_assert(kScratch + 2 == Wave::kSegmentColumns);
  static_assert(WalkQueue::kColumns == Wave::kWalkColumns);

  /// Runs the walks of all rays of a wave that entered a subsurface body.
  template <typename F>
  void run_subsurface_walks(Wave& wave, uint32_t depth, SamplerKind sampler) const {
    using U = UInt<F>;
    if (!has_subsurface()) return;
    const SceneView& scene = context_.scene;
    const RayQueue& q = wave.rays;
    uint32_t* const exits = wave.segments.uints(kExit);
    WalkQueue walk_queue(walks_);
    for (size_t i = 0; i < q.size; i += kWidth<F>) {
      const Mask<F> active = first_lanes<F>(q.size - i);
      const U slot = load<U>(q.slot + i);
      store(exits + i, U(0u));
      PathRow<F> path = load_row<PathRow, F>(wave.pool.paths, slot, active);
      const Mask<F> entered = active & path.enters_body();
      if (none(entered)) continue;
      const UInt<F> normal = path.take_entry().normal;
      store_row<PathRow, F>(wave.pool.paths, slot, path, entered);
      const F time = scene.has_motion
                         ? gather_field<F>(wave.pool.cold, &PathColdRow<float>::time, slot, entered)
                         : F(0.f);
      walk_queue.add<F>(
          begin_walk<F>(sampler, path.key, depth, path.o, path.d, path.throughput, normal),
          lane_index<F>() + static_cast<uint32_t>(i), slot, time, entered);
    }
    if (walk_queue.size() == 0) return;
    PresenceKeys keys = presence_keys(wave.pool, depth, false);
    // The field `receiver` of PathRow holds BodyEntry::body, as set by PathRow::set_entry().
    keys.passes_straight = false;
    keys.object = &reinterpret_cast<const PathRow<float>*>(wave.pool.paths)->receiver;
    const auto leave = [&](const Mask<F>& lanes, const U& slot) {
      PathRow<F> path = load_row<PathRow, F>(wave.pool.paths, slot, lanes);
      path.receiver = U(0u);
      // No light sample competes with the path (path/steps/sample_light.h).
      path.pdf = F(0.f);
      store_row<PathRow, F>(wave.pool.paths, slot, path, lanes);
    };
    enter<F>(walk_queue, keys, context_.traversal_width, leave);
    if (walk_queue.size() == 0) return;
    const auto start = PhaseClock::Clock::now();
    if (context_.measures_costs) std::fill(wave.scratch.begin(), wave.scratch.end(), 0.f);
    walk_queue.run<F>(scene, *context_.accel, context_.traversal_width, keys, counts_.walk_steps,
                      counts_.walk_lanes,
                      [&](const Mask<F>& ended, const U& ray_index, const WalkEnd<F>& end,
                          const Mask<F>& reached_surface) {
                        finish_walks<F>(wave, ended, ray_index, end, reached_surface);
                        if (context_.measures_costs) count_collisions<F>(wave.scratch, end, ended);
                      });
    if (context_.measures_costs)
      charge_walks(
          wave, std::chrono::duration<double, std::nano>(PhaseClock::Clock::now() - start).count());
  }

  const WaveContext& context_;
  Counts& counts_;

 private:
  template <typename F>
  static SubsurfaceWalk<F> begin_walk(SamplerKind sampler, const SampleKey<F>& key, uint32_t depth,
                                      const Vec3<F>& o, const Vec3<F>& d,
                                      const Color<F>& throughput, const UInt<F>& entry_normal) {
    using U = UInt<F>;
    const SegmentRandom<F> segment(sampler, key, depth, VertexSet::kFlight);
    const Color<F> none(F(0.f));
    return {o,           d,
            throughput,  F(throughput.x + throughput.y + throughput.z),
            F(0.f),      segment.branch(0x51ee9u).seed,
            U(0u),       entry_normal,
            segment.r.y, segment.r.z,
            U(0u),       none,
            none};
  }
  /// Ray that views the exit point of a walk from outside.
  template <typename F>
  struct ExitRay {
    Vec3<F> o, d;
    F t;
  };
  template <typename F>
  ExitRay<F> make_exit_ray(const WalkEnd<F>& end) const {
    const F t(1e-3f * context_.scene.scale);
    return {fma(end.d, t, end.p), -end.d, t};
  }

  /// Starts walks inside the objects that `keys` specify. Calls leave(lanes, slot) for paths whose
  /// ray does not hit its object, or hits a material without a subsurface medium.
  template <typename F, typename Leave>
  void enter(WalkQueue& walk_queue, const PresenceKeys& keys, uint32_t width,
             const Leave& leave) const {
    using U = UInt<F>;
    walk_queue.enter<F>(
        context_.scene, *context_.accel, width, keys,
        [&](const U& inst, const U& geom, const U& prim, const Mask<F>& has_hit) {
          const U material = hit_object<F>(context_.scene, inst, geom, prim, has_hit).material;
          const Mask<F> walks =
              has_hit &
              (subsurface_medium<F>(context_.scene.subsurface, material, has_hit).extinction.x >
               0.f);
          return select(Mask<U>(walks), material, U(WalkQueue::kNoMedium));
        },
        leave);
    counts_.walks += walk_queue.size();
    counts_.walk_steps += walk_queue.size();
  }
  /// Adds the number of collisions of each ended walk to the counter of its material.
  template <typename F>
  static void count_collisions(std::span<float> of_material, const WalkEnd<F>& end,
                               const Mask<F>& ended) {
    constexpr size_t kLanes = kWidth<F>;
    alignas(64) uint32_t material[kLanes], collisions[kLanes];
    store(material, end.material);
    store(collisions, end.collisions);
    for (uint32_t bits = lane_bits<F>(ended); bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<size_t>(std::countr_zero(bits));
      of_material[material[lane]] += static_cast<float>(collisions[lane] + 1);
    }
  }
  /// Adds the time of walks to the costs of their materials, in proportion to the collision counts
  /// in Wave::scratch.
  static void charge_walks(Wave& wave, double ns) {
    double all = 0;
    for (const float steps : wave.scratch) all += double{steps};
    for (size_t m = 0; m < wave.scratch.size(); ++m)
      if (wave.scratch[m] > 0)
        wave.costs.charge_untimed(static_cast<uint32_t>(m), ns * double{wave.scratch[m]} / all);
  }
  template <typename F>
  void finish_walks(Wave& wave, const Mask<F>& ended, const UInt<F>& ray_index,
                    const WalkEnd<F>& end, const Mask<F>& reached_surface) const {
    using U = UInt<F>;
    const RayQueue& q = wave.rays;
    const HitBuffer& hits = wave.hits;
    const ExitRay<F> exit_ray = make_exit_ray(end);
    const U slot = gather<U>(q.slot, ray_index, Mask<U>(ended));
    PathRow<F> path = load_row<PathRow, F>(wave.pool.paths, slot, ended);
    path.o = exit_ray.o;
    path.d = exit_ray.d;
    path.throughput = select<F>(reached_surface, end.throughput, Color<F>(F(0.f)));
    path.receiver = U(0u);
    store_row<PathRow, F>(wave.pool.paths, slot, path, ended);
    const auto real = [&](float* column, const F& x) { scatter<F>(column, x, ray_index, ended); };
    const auto number = [&](uint32_t* column, const U& x) {
      scatter<U>(column, x, ray_index, Mask<U>(ended));
    };
    const auto three = [&](float* x, float* y, float* z, const Vec3<F>& v) {
      real(x, v.x);
      real(y, v.y);
      real(z, v.z);
    };
    three(q.ox, q.oy, q.oz, exit_ray.o);
    three(q.dx, q.dy, q.dz, exit_ray.d);
    real(hits.t, exit_ray.t);
    real(hits.u, end.u);
    real(hits.v, end.v);
    number(hits.prim, end.prim);
    number(hits.geom, end.geom);
    number(hits.inst, select(Mask<U>(reached_surface), end.inst, U(kNoHit)));
    number(wave.segments.uints(kExit), select(Mask<U>(reached_surface), U(1u), U(0u)));
  }

  const SoaBlock& walks_;
};

}  // namespace wavecomb
