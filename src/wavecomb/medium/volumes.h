// SPDX-License-Identifier: Apache-2.0
/// What lies between surfaces and below them: the volumes of a scene, what fills its meshes, and
/// the walks of its light.
#pragma once

#include <algorithm>
#include <bit>
#include <chrono>
#include <span>
#include <utility>

#include "wavecomb/integrate/media.h"
#include "wavecomb/integrate/stages/trace.h"
#include "wavecomb/integrate/wave.h"
#include "wavecomb/material/program_list.h"
#include "wavecomb/medium/interiors.h"
#include "wavecomb/medium/tracking.h"
#include "wavecomb/medium/volume_bsdf.h"
#include "wavecomb/medium/walkers.h"
#include "wavecomb/surface/hit.h"

namespace wavecomb {

/// What integrate/media.h asks for.
class Volumes {
 public:
  static constexpr bool kAny = true, kShines = true, kStreams = true;
  template <typename F>
  using Programs = AppendedProgram<wavecomb::Programs<F>, VolumeBsdf<F>>;

  /// `counts` gets what ways through them take. `walks`: room for walks, of Walkers::kColumns;
  /// `interiors`: for rays through what fills meshes.
  Volumes(const WaveContext& context, Counts& counts, const SoaBlock& walks,
          const InteriorBuffers& interiors)
      : context_(context),
        volumes_(context.scene.volumes),
        counts_(counts),
        walks_(walks),
        lamps_(context.settings->equiangular && has_lamps(context.scene.lights) &&
                       std::any_of(volumes_.volumes, volumes_.volumes + volumes_.count,
                                   is_drawn_by_lamps)
                   ? &context.scene.lights
                   : nullptr),
        interiors_(context.scene, *context.accel, context.traversal_width, interiors, counts) {}

  /// Whether light walks below surfaces.
  bool has_walks() const { return context_.scene.walks.media != nullptr; }
  /// Walks of the reference: the path of a ray that led below a surface and hit `hit`. `keys`: of
  /// that ray, with the object. Afterwards the ray, in `path`, and its hit are those of who sees
  /// from outside where the walk has ended, if it `came_out`; false: it has ended below. Both are
  /// as they were where the object is not met.
  template <typename Hit>
  bool walk(const SampleKey<float>& key, uint32_t depth, SamplerKind sampler,
            const PresenceKeys& keys, float time, PathState<float>& path, Hit& hit,
            bool& came_out) const {
    Walkers walkers(walks_);
    walkers.add<float>(begin_walk<float>(sampler, key, depth, path.o, path.dir, path.throughput,
                                         std::exchange(path.cone_width, 0.f)),
                       0u, 0u, time, true);
    enter<float>(walkers, keys, 1, [](bool, uint32_t) {});
    if (walkers.size() == 0) return true;
    walkers.run<float>(context_.scene, *context_.accel, 1, keys, counts_.walk_steps,
                       counts_.walk_lanes,
                       [&](bool, uint32_t, const WalkEnd<float>& end, bool came) {
                         came_out = came;
                         const Seen<float> seen = from_outside(end);
                         path.o = seen.o;
                         path.dir = seen.d;
                         path.throughput = end.throughput;
                         hit.t = seen.t;
                         hit.u = end.u;
                         hit.v = end.v;
                         hit.prim = end.prim;
                         hit.geom = end.geom;
                         hit.inst = end.inst;
                       });
    return came_out;
  }
  /// Lanes, of the rays from `i` on, that see where a walk has ended.
  template <typename F>
  Mask<F> came_out(const Wave& wave, size_t i) const {
    return Mask<F>(load<UInt<F>>(wave.ways.uints(kExit) + i) != UInt<F>(0u));
  }
  uint32_t exit_material() const { return context_.scene.walks.exit_material; }

  /// `fly` of the reference where paths know what they are inside of: of the path in `path`, whose
  /// row is `inside` and whose ray, of `keys`, has hit `hit`. Both may be others afterwards.
  template <typename Hit>
  Flight<float> fly_inside(const SampleKey<float>& key, uint32_t depth, SamplerKind sampler,
                           const PresenceKeys& keys, float time, PathState<float>& path, Hit& hit,
                           InsideRow<float>& inside) const;
  /// What the shadow ray of the reference passes inside of meshes.
  Color<float> pass_inside(const PresenceKeys& keys, float time, const InsideRow<float>& inside,
                           const Vec3<float>& o, const Vec3<float>& d, float t) const;

  template <typename F>
  Flight<F> fly(const Passage<F>& p, const Color<F>& throughput, const Mask<F>& active) const {
    return fly_through<F>(volumes_, p, throughput, active, lamps_, counts_.volumes);
  }
  template <typename F>
  Color<F> transmittance(const Passage<F>& p, const Mask<F>& active) const {
    const Way<F> way(p, VertexSet::kShadow);
    return transmittance_through<F>(volumes_, way, p.o, p.d, p.t, active, counts_.volumes);
  }

  bool shines() const { return volumes_.emits; }
  template <typename F>
  Color<F> emission(const Passage<F>& p, const Mask<F>& active) const {
    Color<F> sum(F(0.f));
    const Way<F> way(p, VertexSet::kFlight);
    for (uint32_t i = 0; i < volumes_.count; ++i)
      if (volumes_.volumes[i].emits)
        sum += emission_of<F>(volumes_, i, way, p.o, p.d, p.t, active, counts_.volumes);
    return sum;
  }

  // The same of all rays of a wave, and of all its shadow rays that are free.

  template <typename F>
  void fly_all(Wave& wave, uint32_t depth, SamplerKind sampler) const {
    walk_all<F>(wave, depth, sampler);
    const RayQueue& q = wave.rays;
    const Flights flights = flights_of(wave);
    const bool knows_inside = context_.knows_inside();
    for (size_t i = 0; i < q.size; i += kWidth<F>) {
      const PathRow<F> path = path_at<F>(wave, q.slot, i, q.size);
      const Way<F> way(sampler, path.key, depth, VertexSet::kFlight);
      put_numbers<F>(wave, i, way);
      store(flights.t + i, knows_inside ? F(kInfinity) : load<F>(wave.hits.t + i));
      store(flights.material + i, UInt<F>(uint32_t{Flights::kNoEvent}));
      for (size_t c = 0; c < 3; ++c) {
        store(flights.ratio[c] + i, F(1.f));
        store(flights.scale[c] + i, F(1.f));
      }
      store(wave.ways.uints(kHero) + i, hero_of<F>(way.r.y, path.throughput));
    }
    const Ways ways{q.ox,
                    q.oy,
                    q.oz,
                    q.dx,
                    q.dy,
                    q.dz,
                    flights.t,
                    wave.ways.uints(kSeed),
                    wave.ways.floats(kFirst),
                    q.size};
    float* const scratch = wave.ways.floats(kScratch);
    if (!knows_inside)
      return fly_through<F>(volumes_, ways, flights, scratch, lamps_, counts_.volumes);
    stop_flights<F>(volumes_, ways, flights, scratch, lamps_, counts_.volumes);
    fly_inside_all<F>(wave, depth, sampler);
    if (weigh_anything(volumes_, lamps_))
      weigh_flights<F>(volumes_, ways, flights, scratch, lamps_, counts_.volumes);
  }
  /// Of the rays from `i` on, whose paths have this throughput.
  template <typename F>
  Flight<F> flight(const Wave& wave, size_t i, const Color<F>& throughput) const {
    const Flights f = flights_of(wave);
    const UInt<F> material = load<UInt<F>>(f.material + i);
    const auto three = [&](float* const(&columns)[3]) {
      return Color<F>(load<F>(columns[0] + i), load<F>(columns[1] + i), load<F>(columns[2] + i));
    };
    const Color<F> weight = flight_weight<F>(three(f.ratio), throughput) * three(f.scale);
    const Mask<F> walked(load<UInt<F>>(f.hero + i) == UInt<F>(uint32_t{Flights::kNoHero}));
    return {Mask<F>(material != UInt<F>(uint32_t{Flights::kNoEvent})), load<F>(f.t + i), material,
            weight, walked};
  }

  template <typename F>
  void pass_all(Wave& wave, uint32_t depth, SamplerKind sampler) const {
    const ShadowQueue& q = wave.shadows;
    float* const product[3] = {wave.ways.floats(kRatio), wave.ways.floats(kRatio + 1),
                               wave.ways.floats(kRatio + 2)};
    float* most = wave.ways.floats(kDistance);
    for (size_t i = 0; i < q.size; i += kWidth<F>) {
      const Mask<F> free(load<UInt<F>>(q.occluded + i) == UInt<F>(0u));
      store(most + i, select(free, F(load<F>(q.tfar + i) * (1.f / kShadowReach)), F(0.f)));
      for (float* one : product) store(one + i, F(1.f));
      const PathRow<F> path = path_at<F>(wave, q.slot, i, q.size);
      put_numbers<F>(wave, i, Way<F>(sampler, path.key, depth, VertexSet::kShadow));
    }
    const Ways ways{
        q.ox,  q.oy, q.oz, q.dx, q.dy, q.dz, most, wave.ways.uints(kSeed), wave.ways.floats(kFirst),
        q.size};
    transmittance_through<F>(volumes_, ways, product, counts_.volumes);
    if (!context_.knows_inside()) return;
    interiors_.pass<F>({{q.ox, q.oy, q.oz},
                        {q.dx, q.dy, q.dz},
                        q.slot,
                        q.size,
                        wave.times.floats(0),
                        wave.pool.paths,
                        wave.pool.inside},
                       most, product, presence_keys(wave.pool, depth, true));
  }
  template <typename F>
  Color<F> passed(const Wave& wave, size_t i) const {
    const auto column = [&](size_t k) { return load<F>(wave.ways.floats(kRatio + k) + i); };
    return {column(0), column(1), column(2)};
  }

 private:
  /// Columns of Wave::ways.
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
  static_assert(kScratch + 2 == Wave::kWayColumns);
  static_assert(Walkers::kColumns == Wave::kWalkColumns);

  template <typename F>
  static Walk<F> begin_walk(SamplerKind sampler, const SampleKey<F>& key, uint32_t depth,
                            const Vec3<F>& o, const Vec3<F>& d, const Color<F>& throughput,
                            const F& cone_width) {
    using U = UInt<F>;
    const Way<F> way(sampler, key, depth, VertexSet::kFlight);
    const Color<F> none(F(0.f));
    return {o,          d,
            throughput, F(throughput.x + throughput.y + throughput.z),
            F(0.f),     way.branch(0x51ee9u).seed,
            U(0u),      float_bits<F>(cone_width),
            way.r.y,    way.r.z,
            U(0u),      none,
            none};
  }
  /// Rays of a wave through what fills meshes.
  template <typename F>
  void fly_inside_all(Wave& wave, uint32_t depth, SamplerKind sampler) const {
    const RayQueue& q = wave.rays;
    const HitBuffer& h = wave.hits;
    const PresenceKeys keys = presence_keys(wave.pool, depth, false);
    const Flights f = flights_of(wave);
    const SoaBlock& c = wave.ways;
    const Inside<float> around = depth == 0 ? around_camera(keys) : Inside<float>();
    interiors_.fly<F>({{q.ox, q.oy, q.oz},
                       {q.dx, q.dy, q.dz},
                       q.slot,
                       q.size,
                       wave.times.floats(0),
                       wave.pool.paths,
                       wave.pool.inside},
                      {h.t, h.u, h.v, h.prim, h.geom, h.inst},
                      {volumes_.count > 0,
                       f.t,
                       f.material,
                       {f.ratio[0], f.ratio[1], f.ratio[2]},
                       {c.floats(kAbsorbed), c.floats(kAbsorbed + 1), c.floats(kAbsorbed + 2)},
                       c.uints(kHero)},
                      depth == 0 ? &around : nullptr, keys, [&](size_t, const PathRow<F>& path) {
                        return begin_inside<F>(sampler, path.key, depth, path.throughput);
                      });
  }
  /// Where the first distance is spread over a pixel's samples, unless volumes take that number.
  template <typename F>
  InteriorStart<F> begin_inside(SamplerKind sampler, const SampleKey<F>& key, uint32_t depth,
                                const Color<F>& throughput) const {
    const Way<F> way(sampler, key, depth, VertexSet::kFlight);
    const UInt<F> seed = way.branch(0x1d3a7u).seed;
    const F first = volumes_.count == 0 ? way.r.z : walk_numbers<F>(seed, UInt<F>(0u)).x;
    return {hero_of<F>(way.r.y, throughput), seed, first};
  }
  /// What the middle of the camera is inside of while the shutter is half open.
  Inside<float> around_camera(const PresenceKeys& keys) const {
    const Settings& s = *context_.settings;
    const CameraRay<float> ray = camera_ray<float>(
        *context_.camera, 0.5f * static_cast<float>(s.width), 0.5f * static_cast<float>(s.height),
        {0.5f, 0.5f, 0.5f, 0.5f}, true, 0.5f);
    return interiors_.surround(ray.o, 0.5f, keys);
  }
  /// A ray that sees from outside where a walk has ended.
  template <typename F>
  struct Seen {
    Vec3<F> o, d;
    F t;
  };
  template <typename F>
  Seen<F> from_outside(const WalkEnd<F>& end) const {
    const F t(1e-3f * context_.scene.scale);
    return {fma(end.d, t, end.p), -end.d, t};
  }

  /// Lets walks in below the objects of `keys`: those that leave(lanes, slot) is told of meet none,
  /// or walk in no medium.
  template <typename F, typename Leave>
  void enter(Walkers& walkers, const PresenceKeys& keys, uint32_t width, const Leave& leave) const {
    using U = UInt<F>;
    walkers.enter<F>(
        context_.scene, *context_.accel, width, keys,
        [&](const U& inst, const U& geom, const U& prim, const Mask<F>& met) {
          const U material = hit_place<F>(context_.scene, inst, geom, prim, met).material;
          const Mask<F> walks =
              met & (walk_medium<F>(context_.scene.walks, material, met).extinction.x > 0.f);
          return select(Mask<U>(walks), material, U(Walkers::kNoMedium));
        },
        leave);
    counts_.walks += walkers.size();
    counts_.walk_steps += walkers.size();
  }
  /// Walks of all rays of a wave that led below a surface.
  template <typename F>
  void walk_all(Wave& wave, uint32_t depth, SamplerKind sampler) const {
    using U = UInt<F>;
    if (!has_walks()) return;
    const SceneView& scene = context_.scene;
    const RayQueue& q = wave.rays;
    uint32_t* const exits = wave.ways.uints(kExit);
    Walkers walkers(walks_);
    for (size_t i = 0; i < q.size; i += kWidth<F>) {
      const Mask<F> active = first_lanes<F>(q.size - i);
      const U slot = load<U>(q.slot + i);
      store(exits + i, U(0u));
      PathRow<F> path = load_row<PathRow, F>(wave.pool.paths, slot, active);
      const Mask<F> below = active & (path.pdf < 0.f);
      if (none(below)) continue;
      path.pdf = abs(path.pdf);
      const F normal = std::exchange(path.cone_width, F(0.f));
      store_row<PathRow, F>(wave.pool.paths, slot, path, below);
      const F time = scene.has_motion
                         ? gather_field<F>(wave.pool.cold, &PathColdRow<float>::time, slot, below)
                         : F(0.f);
      walkers.add<F>(
          begin_walk<F>(sampler, path.key, depth, path.o, path.d, path.throughput, normal),
          lane_index<F>() + static_cast<uint32_t>(i), slot, time, below);
    }
    if (walkers.size() == 0) return;
    PresenceKeys keys = presence_keys(wave.pool, depth, false);
    keys.object = &reinterpret_cast<const PathRow<float>*>(wave.pool.paths)->receiver;
    const auto leave = [&](const Mask<F>& lanes, const U& slot) {
      PathRow<F> path = load_row<PathRow, F>(wave.pool.paths, slot, lanes);
      path.receiver = U(0u);
      store_row<PathRow, F>(wave.pool.paths, slot, path, lanes);
    };
    enter<F>(walkers, keys, context_.traversal_width, leave);
    if (walkers.size() == 0) return;
    const auto start = PhaseClock::Clock::now();
    if (context_.measures_costs) std::fill(wave.scratch.begin(), wave.scratch.end(), 0.f);
    walkers.run<F>(
        scene, *context_.accel, context_.traversal_width, keys, counts_.walk_steps,
        counts_.walk_lanes,
        [&](const Mask<F>& ended, const U& who, const WalkEnd<F>& end, const Mask<F>& came) {
          finish_walks<F>(wave, ended, who, end, came);
          if (context_.measures_costs) count_collisions<F>(wave.scratch, end, ended);
        });
    if (context_.measures_costs)
      charge_walks(
          wave, std::chrono::duration<double, std::nano>(PhaseClock::Clock::now() - start).count());
  }
  /// Adds what walks that have ended took to their materials.
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
  /// Charges the time of walks to their materials, by collisions, which Wave::scratch has.
  static void charge_walks(Wave& wave, double ns) {
    double all = 0;
    for (const float steps : wave.scratch) all += double{steps};
    for (size_t m = 0; m < wave.scratch.size(); ++m)
      if (wave.scratch[m] > 0)
        wave.costs.charge_beside(static_cast<uint32_t>(m), ns * double{wave.scratch[m]} / all);
  }
  template <typename F>
  void finish_walks(Wave& wave, const Mask<F>& ended, const UInt<F>& who, const WalkEnd<F>& end,
                    const Mask<F>& came) const {
    using U = UInt<F>;
    const RayQueue& q = wave.rays;
    const HitBuffer& hits = wave.hits;
    const Seen<F> seen = from_outside(end);
    const U slot = gather<U>(q.slot, who, Mask<U>(ended));
    PathRow<F> path = load_row<PathRow, F>(wave.pool.paths, slot, ended);
    path.o = seen.o;
    path.d = seen.d;
    path.throughput = select<F>(came, end.throughput, Color<F>(F(0.f)));
    path.receiver = U(0u);
    store_row<PathRow, F>(wave.pool.paths, slot, path, ended);
    const auto real = [&](float* column, const F& x) { scatter<F>(column, x, who, ended); };
    const auto number = [&](uint32_t* column, const U& x) {
      scatter<U>(column, x, who, Mask<U>(ended));
    };
    const auto three = [&](float* x, float* y, float* z, const Vec3<F>& v) {
      real(x, v.x);
      real(y, v.y);
      real(z, v.z);
    };
    three(q.ox, q.oy, q.oz, seen.o);
    three(q.dx, q.dy, q.dz, seen.d);
    real(hits.t, seen.t);
    real(hits.u, end.u);
    real(hits.v, end.v);
    number(hits.prim, end.prim);
    number(hits.geom, end.geom);
    number(hits.inst, select(Mask<U>(came), end.inst, U(kNoHit)));
    number(wave.ways.uints(kExit), select(Mask<U>(came), U(1u), U(0u)));
  }
  static Flights flights_of(const Wave& wave) {
    const SoaBlock& c = wave.ways;
    return {c.floats(kDistance),
            c.uints(kMaterial),
            {c.floats(kRatio), c.floats(kRatio + 1), c.floats(kRatio + 2)},
            c.uints(kHero),
            {c.floats(kAbsorbed), c.floats(kAbsorbed + 1), c.floats(kAbsorbed + 2)}};
  }
  template <typename F>
  static PathRow<F> path_at(const Wave& wave, const uint32_t* slots, size_t i, size_t size) {
    return load_row<PathRow, F>(wave.pool.paths, load<UInt<F>>(slots + i),
                                first_lanes<F>(size - i));
  }
  template <typename F>
  static void put_numbers(Wave& wave, size_t i, const Way<F>& way) {
    store(wave.ways.uints(kSeed) + i, way.seed);
    store(wave.ways.floats(kFirst) + i, way.r.z);
  }

  const WaveContext& context_;
  const VolumeView volumes_;
  Counts& counts_;
  const SoaBlock& walks_;
  const LightView* const lamps_;  ///< by which distances are drawn; null: not so
  const Interiors interiors_;
};

template <typename Hit>
Flight<float> Volumes::fly_inside(const SampleKey<float>& key, uint32_t depth, SamplerKind sampler,
                                  const PresenceKeys& keys, float time, PathState<float>& path,
                                  Hit& hit, InsideRow<float>& inside) const {
  using F = float;
  // A wave of one.
  alignas(64) float row[kRowWords<PathRow>], place[kRowWords<InsideRow>];
  store_row<PathRow, F>(
      row, 0u,
      {path.o, path.dir, path.throughput, path.pdf, path.eta_scale, 0.f, 0.f, key, path.receiver},
      true);
  store_row<InsideRow, F>(place, 0u, inside, true);
  float o[3] = {path.o.x, path.o.y, path.o.z}, d[3] = {path.dir.x, path.dir.y, path.dir.z};
  float t = kInfinity, ratio[3] = {1, 1, 1}, absorbed[3] = {1, 1, 1}, scratch[2];
  const uint32_t slot = 0;
  const Inside<float> around = depth == 0 ? around_camera(keys) : Inside<float>();
  const InteriorStart<F> begin = begin_inside<F>(sampler, key, depth, path.throughput);
  const Way<F> way(sampler, key, depth, VertexSet::kFlight);
  uint32_t material = Flights::kNoEvent, hero = begin.hero;
  const Ways ways{&o[0], &o[1], &o[2], &d[0], &d[1], &d[2], &t, &way.seed, &way.r.z, 1};
  const Flights flights{&t,
                        &material,
                        {&ratio[0], &ratio[1], &ratio[2]},
                        &hero,
                        {&absorbed[0], &absorbed[1], &absorbed[2]}};
  stop_flights<F>(volumes_, ways, flights, scratch, lamps_, counts_.volumes);
  interiors_.fly<F>({{&o[0], &o[1], &o[2]}, {&d[0], &d[1], &d[2]}, &slot, 1, &time, row, place},
                    {&hit.t, &hit.u, &hit.v, &hit.prim, &hit.geom, &hit.inst},
                    {volumes_.count > 0,
                     &t,
                     &material,
                     {&ratio[0], &ratio[1], &ratio[2]},
                     {&absorbed[0], &absorbed[1], &absorbed[2]},
                     &hero},
                    depth == 0 ? &around : nullptr, keys,
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
