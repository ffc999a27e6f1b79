// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/integrate/reference.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/integrate/light_groups.h"
#include "wavecomb/integrate/vertex.h"
#include "wavecomb/surface/hit.h"

namespace wavecomb {
namespace {

using F = float;

/// What one path gives.
struct PathResult {
  Color<F> radiance{0.f, 0.f, 0.f};
  Color<F> parts[2];  ///< radiance before scattering 0 and 1
  Color<F> albedo{0.f, 0.f, 0.f};
  Vec3<F> normal{0.f, 0.f, 0.f};
  F uv[2] = {0.f, 0.f};
  F depth = INFINITY;
  AovHit hit;
  F centre2 = 0.f;
  std::array<F, 6> guides{};  ///< albedo, normal
};

class PathTracer {
 public:
  PathTracer(const WaveContext& context, PhaseClock& clock, Counts& counts)
      : context_(context),
        settings_(*context.settings),
        clock_(clock),
        counts_(counts),
        wants_guides_(context.film->aovs().layout().set.guides()),
        groups_(size_t{3} * context.film->aovs().layout().light_groups) {}

  /// Radiance of the last path by light group, rgb side by side; valid until the next one.
  const std::vector<F>& groups() const { return groups_; }

  /// Traces a path of which nothing is wanted but choices of lights.
  void probe(uint32_t pixel, uint32_t sample, size_t path, LightProbes& out) {
    probes_ = {out.probes.data() + path * out.most, out.most};
    probe_count_ = 0;
    out.luminance[path] = luminance(trace_path(pixel, sample).radiance);
    out.counts[path] = probe_count_;
  }

  /// A path as the camera's exposure shows it.
  PathResult exposed_path(uint32_t pixel, uint32_t sample) {
    PathResult result = trace_path(pixel, sample);
    const F exposure = context_.camera->exposure;
    if (exposure == 1) return result;
    result.radiance *= exposure;
    for (Color<F>& part : result.parts) part *= exposure;
    for (F& value : groups_) value *= exposure;
    return result;
  }

 private:
  PathResult trace_path(uint32_t pixel, uint32_t sample) {
    const SceneView& scene = context_.scene;
    const SampleKey<F> key = make_sample_key<F>(pixel, sample, context_.settings->seed);
    keys_ = {&key.pixel_hash, &key.sample, 1, 0};
    const Sample4<F> r = sample_4d<F>(settings_.sampler, key, kCameraSet);
    time_ = context_.moves() ? path_time<F>(settings_.sampler, key) : 0.f;
    const CameraRay<F> ray = camera_ray<F>(*context_.camera, static_cast<F>(pixel & 0xffffu),
                                           static_cast<F>(pixel >> 16), r, true, time_);
    PathResult result;
    result.centre2 = centre_distance2<F>(*context_.camera, r, true);
    std::fill(groups_.begin(), groups_.end(), 0.f);
    const auto keep_parts = [&](uint32_t first, uint32_t last) {
      for (uint32_t d = first; d <= last && d < 2; ++d) result.parts[d] = result.radiance;
    };
    F cone_at_origin = ray.width;
    bool is_seen = true;  // only clear surfaces so far
    PathState<F> path{ray.d, Color<F>(1.f), 0.f, 1.f, 0.f, ray.spread, ray.o, 0u};
    ++counts_.samples;

    for (uint32_t depth = 0;; ++depth) {
      clock_.enter(Phase::kTrace);
      const F tfar = depth == 0 && context_.camera->has_far ? ray.tfar : kInfinity;
      const Hit hit = intersect(path.o, path.dir, tfar, depth);
      clock_.enter(Phase::kShade);
      path.cone_width = fma(path.cone_spread, hit.t, cone_at_origin);
      if (hit.inst == kNoHit) {
        result.radiance += environment_emission<F>(scene, settings_, depth, path, true);
        if (!groups_.empty())
          split_environment<F>(
              scene, settings_, depth, context_.aovs->kept_group.data(), path, true,
              [&](uint32_t group, const Color<F>& share) { add_to_group(group, share); });
        keep_parts(depth, 1);
        return result;
      }
      if (depth == 0)
        result.depth = camera_depth<F>(*context_.camera, fma(path.dir, hit.t, path.o), time_, true);
      if (depth == 0) note_hit(result.hit, hit, fma(path.dir, hit.t, path.o));
      if (hit.inst == kLightShape) {
        const Color<F> c = shape_emission<F>(scene, settings_, depth, hit.geom, hit.t, path, true);
        result.radiance += c;
        add_light(hit.geom, c);
        keep_parts(depth, 1);
        return result;
      }
      const uint32_t mesh = mesh_of(hit), material = material_of(hit, mesh);
      if (depth == 0) result.hit.material = material;
      if (settings_.cost_aware && depth >= settings_.roulette_depth) {
        const F q = cost_aware_survival<F>(scene, *context_.roulette_costs, material, path, true);
        if (!(cost_aware_number<F>(key, depth) < q)) {
          keep_parts(depth, 1);
          return result;
        }
        path.throughput *= 1.f / q;
      }
      VertexAovs<F> aovs;
      aovs.wants_uv = depth == 0;
      aovs.wants_lights = !groups_.empty() || !probes_.empty();
      const VertexResult<F> v = shade(key, depth, hit, mesh, material, path, aovs);
      result.radiance += v.emitted;
      add_light(aovs.emitter, v.emitted);
      keep_parts(depth, depth);
      bool is_free = false;
      if (depth == 0) {
        result.uv[0] = aovs.uv.x;
        result.uv[1] = aovs.uv.y;
        result.albedo = aovs.albedo;
        result.normal = aovs.normal;
      }
      if (wants_guides_ && is_seen) {
        result.guides = guides_of<F>(aovs, path);
        is_seen = aovs.is_clear;
      }
      if (v.has_shadow) {
        clock_.enter(Phase::kShadow);
        shadow_set_ = v.shadow_set;
        is_free = !occluded(v.shadow_o, v.shadow_d, v.shadow_tfar, depth);
        if (is_free) {
          result.radiance += v.direct;
          add_light(aovs.lit_by, v.direct);
        }
      }
      if (!probes_.empty() && aovs.light_weight >= 0.f)
        note_choice(v, aovs, is_free ? luminance(v.direct) : 0.f);
      if (!v.alive) {
        keep_parts(depth + 1, 1);
        return result;
      }
      path = v.next;
      cone_at_origin = v.next.cone_width;
    }
  }

  void note_choice(const VertexResult<F>& v, const VertexAovs<F>& aovs, F brought) {
    if (probe_count_ == probes_.size()) return;
    probes_[probe_count_++] = {aovs.lit_by,
                               brought,
                               aovs.light_weight,
                               {aovs.lit_at.x, aovs.lit_at.y, aovs.lit_at.z},
                               v.next.receiver};
  }

  struct Hit {
    F t, u, v;
    uint32_t prim, geom, inst;
  };

  Hit intersect(const Vec3<F>& o, const Vec3<F>& d, F tfar, uint32_t depth) {
    Hit h;
    const RaySpan ray{&o.x, &o.y, &o.z, &d.x, &d.y, &d.z, &tfar, &kFirstSlot, 1, times()};
    keys_.salt = 2 * depth;
    keys_.shadow_set = nullptr;
    context_.accel->intersect(ray, {&h.t, &h.u, &h.v, &h.prim, &h.geom, &h.inst}, 1, false, keys_);
    counts_.add_rays(depth, 1);
    return h;
  }

  bool occluded(const Vec3<F>& o, const Vec3<F>& d, F tfar, uint32_t depth) {
    const RaySpan ray{&o.x, &o.y, &o.z, &d.x, &d.y, &d.z, &tfar, &kFirstSlot, 1, times()};
    uint32_t blocked = 0;
    keys_.salt = 2 * depth + 1;
    keys_.shadow_set = context_.scene.lights.links.members ? &shadow_set_ : nullptr;
    context_.accel->occluded(ray, &blocked, 1, false, keys_);
    counts_.add_shadow_rays(depth, 1);
    return blocked != 0;
  }

  /// All that the first hit says of itself but its material.
  void note_hit(AovHit& out, const Hit& hit, const Vec3<F>& p) const {
    const AovTables* tables = context_.aovs;
    out = {{p.x, p.y, p.z}, kNothingHit, kNothingHit, kNothingHit, {0, 0}};
    if (hit.inst == kLightShape) {
      if (tables) out.object = tables->light_object(hit.geom);
      return;
    }
    out.instance = hit.inst;
    if (tables) out.object = tables->object<F>(hit.inst, hit.geom, true);
  }

  void add_to_group(uint32_t group, const Color<F>& c) {
    if (group == kNoGroup) return;
    groups_[3 * group] += c.x;
    groups_[3 * group + 1] += c.y;
    groups_[3 * group + 2] += c.z;
  }
  /// Adds what light record `light` gave to its group.
  void add_light(uint32_t light, const Color<F>& c) {
    if (!groups_.empty())
      add_to_group(kept_group<F>(context_.aovs->kept_group.data(), light, true), c);
  }

  uint32_t mesh_of(const Hit& hit) const {
    const SceneView& scene = context_.scene;
    return scene.geometry_mesh[scene.instances[hit.inst].geometry + hit.geom];
  }

  uint32_t material_of(const Hit& hit, uint32_t mesh) const {
    const SceneView& scene = context_.scene;
    return hit_material<F>(scene, scene.instances[hit.inst].material, mesh, hit.prim, true);
  }

  VertexResult<F> shade(const SampleKey<F>& key, uint32_t depth, const Hit& hit, uint32_t mesh,
                        uint32_t material, const PathState<F>& path, VertexAovs<F>& aovs) {
    const SceneView& scene = context_.scene;
    counts_.add_records(depth, 1);
    const MeshHit<F> mesh_hit{hit.inst, mesh, hit.prim, hit.u, hit.v, time_};
    VertexResult<F> v{};
    visit_program<F>(static_cast<ProgramId>(scene.material_program[material]),
                     [&]<typename Bsdf>() {
                       v = shade_vertex<Bsdf, F>(scene, settings_, key, depth, mesh_hit, hit.geom,
                                                 hit.t, material, path, &aovs, true);
                     });
    return v;
  }

  const float* times() const { return context_.scene.has_motion ? &time_ : nullptr; }

  static constexpr uint32_t kFirstSlot = 0;
  const WaveContext& context_;
  const ShadeSettings settings_;
  PhaseClock& clock_;
  Counts& counts_;
  PresenceKeys keys_;
  uint32_t shadow_set_ = 0;
  F time_ = 0.f;  ///< of the path
  bool wants_guides_;
  std::vector<F> groups_;
  std::span<LightProbe> probes_;  ///< of the path; empty: none are wanted
  uint32_t probe_count_ = 0;
};

/// Adds what a path found beside radiance to its pixel.
void add_aovs(AovFilm& film, size_t pixel, const PathResult& path, const std::vector<F>& groups,
              const AovTables* tables) {
  const AovSet& set = film.layout().set;
  const auto rgb = [](const Color<F>& c) { return std::array<F, 3>{c.x, c.y, c.z}; };
  if (film.has_first()) {
    AovFilm::First& first = film.first(pixel);
    const auto albedo = rgb(path.albedo), normal = rgb(path.normal);
    for (size_t c = 0; c < 3; ++c) {
      first.albedo[c] += albedo[c];
      first.normal[c] += normal[c];
    }
    if (std::isfinite(path.depth)) {
      first.depth += path.depth;
      ++first.depth_samples;
    }
  }
  if (set.nearest() || set.crypto())
    film.add_hit(pixel, path.hit, path.centre2, path.uv, tables ? &tables->crypto : nullptr);
  if (set.parts())
    film.add_parts(pixel, rgb(path.parts[0]).data(), rgb(path.parts[1]).data(),
                   rgb(path.radiance).data());
  if (set.guides()) film.add_guides(pixel, path.guides.data());
  for (size_t i = 0; i < groups.size(); ++i) film.groups(pixel)[i] += double{groups[i]};
}

}  // namespace

void run_reference(const WaveContext& context, const WaveTask& task, PhaseClock& clock,
                   Counts& counts) {
  PathTracer tracer(context, clock, counts);
  Film& film = *context.film;
  clock.start(Phase::kGenerate);
  for (uint32_t i = 0; i < task.pixel_count; ++i) {
    const uint32_t pixel = task.pixels[i], x = pixel & 0xffffu, y = pixel >> 16;
    Film::Pixel sum = film.pixel(x, y);
    for (uint32_t s = 0; s < task.samples; ++s) {
      clock.enter(Phase::kGenerate);
      const auto start = PhaseClock::Clock::now();
      const PathResult path = tracer.exposed_path(pixel, task.first_sample + s);
      if (film.aovs().layout().set.has(Aov::kCost))
        film.aovs().add_cost(
            film.index(x, y),
            std::chrono::duration<double, std::nano>(PhaseClock::Clock::now() - start).count());
      clock.enter(Phase::kResolve);
      if (film.has_error()) {
        const F rgb[3] = {path.radiance.x, path.radiance.y, path.radiance.z};
        film.error(x, y).add(rgb, sum.samples, {sum.r, sum.g, sum.b});
      }
      sum.r += path.radiance.x;
      sum.g += path.radiance.y;
      sum.b += path.radiance.z;
      ++sum.samples;
      add_aovs(film.aovs(), film.index(x, y), path, tracer.groups(), context.aovs);
    }
    film.pixel(x, y) = sum;
  }
  clock.stop();
}

void run_light_probes(const WaveContext& context, std::span<const uint32_t> pixels, size_t first,
                      size_t count, LightProbes& out) {
  PhaseClock clock;
  Counts counts;
  PathTracer tracer(context, clock, counts);
  clock.start(Phase::kGenerate);
  for (size_t i = first; i < first + count; ++i)
    tracer.probe(pixels[i], static_cast<uint32_t>(i), i, out);
  clock.stop();
}

}  // namespace wavecomb
