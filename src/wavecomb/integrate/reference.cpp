// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/integrate/reference.h"

#include <cmath>

#include "wavecomb/integrate/vertex.h"

namespace wavecomb {
namespace {

using F = float;

/// What one path gives.
struct PathResult {
  Color<F> radiance{0.f, 0.f, 0.f};
  Color<F> albedo{0.f, 0.f, 0.f};
  Vec3<F> normal{0.f, 0.f, 0.f};
  F depth = INFINITY;
};

class PathTracer {
 public:
  PathTracer(const WaveContext& context, PhaseClock& clock, Counts& counts)
      : context_(context), settings_(*context.settings), clock_(clock), counts_(counts) {}

  PathResult trace_path(uint32_t pixel, uint32_t sample) {
    const SceneView& scene = context_.scene;
    const SampleKey<F> key = make_sample_key<F>(pixel, sample, context_.settings->seed);
    keys_ = {&key.pixel_hash, &key.sample, 1, 0};
    const Sample4<F> r = sample_4d<F>(settings_.sampler, key, kCameraSet);
    const CameraRay<F> ray = camera_ray<F>(*context_.camera, static_cast<F>(pixel & 0xffffu),
                                           static_cast<F>(pixel >> 16), r, true);
    PathResult result;
    Vec3<F> o = ray.o;
    F cone_at_origin = 0.f;
    PathState<F> path{ray.d, Color<F>(1.f), 0.f, 1.f, 0.f, ray.spread};
    ++counts_.samples;

    for (uint32_t depth = 0;; ++depth) {
      clock_.enter(Phase::kTrace);
      const F tfar = depth == 0 && context_.camera->has_far ? ray.tfar : kInfinity;
      const Hit hit = intersect(o, path.dir, tfar, depth);
      clock_.enter(Phase::kShade);
      path.cone_width = fma(path.cone_spread, hit.t, cone_at_origin);
      if (hit.inst == kNoHit) {
        result.radiance += environment_emission<F>(scene, settings_, depth, path, true);
        return result;
      }
      if (depth == 0) result.depth = camera_depth(o, path.dir, hit.t);
      if (hit.inst == kLightShape) {
        result.radiance +=
            shape_emission<F>(scene, settings_, depth, hit.geom, o, hit.t, path, true);
        return result;
      }
      const uint32_t mesh = mesh_of(hit), material = material_of(hit, mesh);
      if (settings_.cost_aware && depth >= settings_.roulette_depth) {
        const F q = cost_aware_survival<F>(scene, *context_.roulette_costs, material, path, true);
        if (!(cost_aware_number<F>(key, depth) < q)) return result;
        path.throughput *= 1.f / q;
      }
      const VertexResult<F> v = shade(key, depth, hit, mesh, material, path);
      result.radiance += v.emitted;
      if (depth == 0) {
        result.albedo = v.albedo;
        result.normal = v.normal;
      }
      if (v.has_shadow) {
        clock_.enter(Phase::kShadow);
        if (!occluded(v.shadow_o, v.shadow_d, v.shadow_tfar, depth)) result.radiance += v.direct;
      }
      if (!v.alive) return result;
      o = v.o;
      path = v.next;
      cone_at_origin = v.next.cone_width;
    }
  }

 private:
  struct Hit {
    F t, u, v;
    uint32_t prim, geom, inst;
  };

  Hit intersect(const Vec3<F>& o, const Vec3<F>& d, F tfar, uint32_t depth) {
    Hit h;
    const RaySpan ray{&o.x, &o.y, &o.z, &d.x, &d.y, &d.z, &tfar, &kFirstSlot, 1};
    keys_.salt = 2 * depth;
    context_.accel->intersect(ray, {&h.t, &h.u, &h.v, &h.prim, &h.geom, &h.inst}, 1, false, keys_);
    counts_.add_rays(depth, 1);
    return h;
  }

  bool occluded(const Vec3<F>& o, const Vec3<F>& d, F tfar, uint32_t depth) {
    const RaySpan ray{&o.x, &o.y, &o.z, &d.x, &d.y, &d.z, &tfar, &kFirstSlot, 1};
    uint32_t blocked = 0;
    keys_.salt = 2 * depth + 1;
    context_.accel->occluded(ray, &blocked, 1, false, keys_);
    counts_.add_shadow_rays(depth, 1);
    return blocked != 0;
  }

  uint32_t mesh_of(const Hit& hit) const {
    const SceneView& scene = context_.scene;
    return scene.geometry_mesh[scene.instances[hit.inst].geometry + hit.geom];
  }

  uint32_t material_of(const Hit& hit, uint32_t mesh) const {
    const MeshRecord& record = context_.scene.meshes[mesh];
    uint32_t material = record.material;
    if (record.face_materials != 0)
      material = reinterpret_cast<const uint32_t*>(record.face_materials)[hit.prim];
    return material == kInheritMaterial ? context_.scene.instances[hit.inst].material : material;
  }

  VertexResult<F> shade(const SampleKey<F>& key, uint32_t depth, const Hit& hit, uint32_t mesh,
                        uint32_t material, const PathState<F>& path) {
    const SceneView& scene = context_.scene;
    counts_.add_records(depth, 1);
    const MeshHit<F> mesh_hit{hit.inst, mesh, hit.prim, hit.u, hit.v};
    VertexResult<F> v{};
    visit_program<F>(static_cast<ProgramId>(scene.material_program[material]),
                     [&]<typename Bsdf>() {
                       v = shade_vertex<Bsdf, F>(scene, settings_, key, depth, mesh_hit, hit.geom,
                                                 hit.t, material, path, depth == 0, true);
                     });
    return v;
  }

  F camera_depth(const Vec3<F>& o, const Vec3<F>& d, F t) const {
    const CameraSetup& c = *context_.camera;
    const Vec3<F> p = fma(d, t, o) - c.to_world.t;
    return -dot(p, c.backward);
  }

  static constexpr uint32_t kFirstSlot = 0;
  const WaveContext& context_;
  const ShadeSettings settings_;
  PhaseClock& clock_;
  Counts& counts_;
  PresenceKeys keys_;
};

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
      const PathResult path = tracer.trace_path(pixel, task.first_sample + s);
      clock.enter(Phase::kResolve);
      if (film.has_error()) {
        const F rgb[3] = {path.radiance.x, path.radiance.y, path.radiance.z};
        film.error(x, y).add(rgb, sum.samples, {sum.r, sum.g, sum.b});
      }
      sum.r += path.radiance.x;
      sum.g += path.radiance.y;
      sum.b += path.radiance.z;
      ++sum.samples;
      if (film.has_aovs()) {
        Film::AovPixel& aov = film.aov(x, y);
        const F albedo[3] = {path.albedo.x, path.albedo.y, path.albedo.z};
        const F normal[3] = {path.normal.x, path.normal.y, path.normal.z};
        for (int c = 0; c < 3; ++c) {
          aov.albedo[c] += albedo[c];
          aov.normal[c] += normal[c];
        }
        if (std::isfinite(path.depth)) {
          aov.depth += path.depth;
          ++aov.depth_samples;
        }
      }
    }
    film.pixel(x, y) = sum;
  }
  clock.stop();
}

}  // namespace wavecomb
