// SPDX-License-Identifier: Apache-2.0
/// Scalar path tracer of the reference integrator, which traces one path after the other.
#pragma once

#include <utility>

#include "wavecomb/geometry/hit/hit_material.h"
#include "wavecomb/guiding/lookup.h"
#include "wavecomb/path/media.h"
#include "wavecomb/path/path_history.h"
#include "wavecomb/path/shading_record.h"
#include "wavecomb/path/steps/emit.h"
#include "wavecomb/path/steps/survive.h"
#include "wavecomb/reference/path_recorder.h"
#include "wavecomb/reference/reference.h"
#include "wavecomb/reference/single_rays.h"
#include "wavecomb/wave/kernels/program_dispatch.h"

namespace wavecomb {

/// Interface through which a joint transport (path/joint_transport.h) adds to the camera paths of
/// the reference integrator. This implementation, for renders without a joint transport, does
/// nothing.
struct NoJointTracer {
  NoJointTracer(const WaveContext& /*context*/, ReferenceWorker& /*worker*/) {}
  /// Begins a camera path. An implementation may trace the light paths that the camera path needs.
  void begin(uint32_t /*pixel*/, uint32_t /*sample*/) {}
  /// Processes the path vertex at `depth` after its shadow ray was traced, and adds the joint
  /// transport's contribution to the path. `rays` traces the rays of the path.
  void use_vertex(uint32_t /*depth*/, SingleRays& /*rays*/) {}
  /// Ends a path after its radiance was added to the film pixel with the given index.
  void end(size_t /*index*/) {}
  void end_task(const WaveTask& /*task*/) {}
};

/// Traces camera paths one at a time and depth first. `Media` samples the volumes, media and
/// subsurface random walks between mesh surfaces (path/media.h). `Joint` has the members of
/// NoJointTracer.
template <typename Media, typename Joint = NoJointTracer>
class PathTracer : PathRecorder {
 public:
  PathTracer(const WaveContext& context, ReferenceWorker& worker, const Media& media)
      : PathRecorder(context, worker),
        media_(media),
        clock_(worker.clock),
        history_(worker.history),
        buffers_(worker.joint),
        joint_(context, worker) {}

  Joint& joint() { return joint_; }

  /// Traces the path of `task`, which has one pixel and one sample, and returns the path's radiance
  /// times the camera's exposure. Slot 0 of the worker's AOVs then holds the AOVs of the path.
  Color<F> exposed_path(const WaveTask& task) {
    aovs_.clear(1);
    history_.clear(1);
    radiance_ = {};
    const uint32_t last = trace_path(*task.pixels, task.first_sample);
    events_.end_path(last, 1);
    if (context_.histories) context_.histories->ended(history_, radiance(), task);
    const F exposure = context_.camera->exposure;
    if (exposure != 1) {
      radiance_.sum *= exposure;
      aovs_.expose(exposure, 1);
    }
    return radiance_.sum;
  }
  /// Traces a path, and stores in `out`, at path index `path`, the lights that the vertices of the
  /// path sample.
  void probe(uint32_t pixel, uint32_t sample, size_t path, LightProbes& out) {
    probes_ = {out.probes.data() + path * out.most, out.most};
    probe_count_ = 0;
    aovs_.clear(1);
    radiance_ = {};
    trace_path(pixel, sample);
    out.luminance[path] = luminance(radiance_.sum);
    out.counts[path] = probe_count_;
  }
  const float* radiance() const { return &radiance_.sum.x; }

 private:
  /// Traces one camera path. Returns the number of depths for which end_depth() has stored the
  /// radiance.
  uint32_t trace_path(uint32_t pixel, uint32_t sample) {
    const SceneView& scene = context_.scene;
    const SampleKey<F> key = make_sample_key<F>(pixel, sample, context_.settings->seed);
    PathState<F> path;
    const CameraRay<F> ray = begin_path(key, pixel, path);
    const F time = rays_.time(), importance = path.importance;
    F cone_at_origin = ray.width;

    for (uint32_t depth = 0;; ++depth) {
      path.time = time;
      clock_.enter(Phase::kTrace);
      const F tfar = depth == 0 && context_.camera->has_far ? ray.tfar : kInfinity;
      SingleHit hit =
          rays_.intersect(path.o, path.dir, tfar, depth, depth > 0 ? &path.pdf : nullptr);
      clock_.enter(Phase::kShade);
      bool left_body = false;
      if (path.enters_body) {
        if (!walk(key, depth, path, hit, left_body)) return depth;
        cone_at_origin = path.cone_width;
      }
      if constexpr (Media::kAny) pass_media(key, depth, path, hit);
      path.cone_width = fma(path.cone_spread, hit.t, cone_at_origin);
      if (hit.inst == kNoHit || hit.inst == kLightShape) {
        add_ended(depth, path, hit);
        return depth;
      }
      const Vec3<F> p = fma(path.dir, hit.t, path.o);
      const bool on_surface = hit.inst != kNoSurface;
      if (depth == 0 && on_surface && scene.visibility &&
          is_holdout<F>(scene, hit.inst, hit.geom, true))
        return depth;
      const uint32_t mesh = on_surface ? rays_.mesh_of(hit) : 0;
      uint32_t material = on_surface ? rays_.material_of(hit, mesh) : hit.event_material;
      if constexpr (Media::kStreams)
        if (left_body && on_surface) material = media_.exit_material();
      if (depth == 0) note_first_hit(path.dir, p, hit, mesh, material);
      if (on_surface && settings_.cost_aware && depth >= settings_.roulette_depth) {
        const F q = cost_aware_survival<F>(scene, *context_.roulette_costs, material, path, true);
        events_.survive<F>(depth, kSlot, q, true);
        if (!(cost_aware_number<F>(key, depth) < q)) return depth;
        path.throughput *= 1.f / q;
      }
      VertexAovs<F> aovs = aovs_.wanted<F>(depth);
      aovs.wants_lights |= !probes_.empty();
      if (context_.joint.is_active() && depth == 0 && on_surface)
        buffers_.template begin_ratios<F>(context_.joint, *context_.camera, kSlot,
                                          {p, path.dir, time}, true);
      if (context_.has_medium_stack()) {
        path.outer = medium_stack_.outer;
        path.medium = medium_stack_.medium;
      }
      const VertexResult<F> v = shade(key, depth, hit, mesh, material, path, aovs);
      if (context_.has_medium_stack()) {
        medium_stack_.crossed = v.crossed;
      }
      const ShadedVertex<F> shaded{.path = path, .t = hit.t, .material = material, .result = v};
      const uint32_t group = events_.vertex<true, F>({depth, kSlot, key, shaded, aovs}, true);
      events_.end_depth(depth, 1);
      const float passed = v.has_shadow ? trace_shadow(key, depth, v, group) : 0.f;
      joint_.use_vertex(depth, rays_);
      if (!probes_.empty() && aovs.light_weight >= 0.f)
        record_choice(v, aovs, luminance(v.direct) * passed);
      if (!v.alive) return depth + 1;
      path = v.next;
      path.importance = importance;
      cone_at_origin = v.next.cone_width;
    }
  }

  /// Samples the camera ray of a path and its time.
  CameraRay<F> begin_path(const SampleKey<F>& key, uint32_t pixel, PathState<F>& path) {
    const Sample4<F> r = sample_4d<F>(settings_.sampler, key, kCameraSet);
    const auto x = static_cast<F>(pixel & 0xffffu), y = static_cast<F>(pixel >> 16);
    const F time = context_.moves() ? camera_time<F>(*context_.camera, x, y,
                                                     path_time<F>(settings_.sampler, key))
                                    : 0.f;
    rays_.begin(key, time);
    const CameraRay<F> ray = camera_ray<F>(*context_.camera, x, y, r, true, time);
    events_.begin<F>(r, kSlot, true);
    path = {.dir = ray.d,
            .throughput = Color<F>(1.f),
            .cone_spread = ray.spread,
            .o = ray.o,
            .importance = context_.uses_pixel_importance()
                              ? pixel_importance<F>(*context_.guide, x, y, true)
                              : 0.f};
    ++counts_.samples;
    return ray;
  }

  /// Adds the emission of volumes along the ray of a path, and samples its free flight to `hit`. If
  /// a volume event stops the flight, `hit` is replaced by the event.
  void pass_media(const SampleKey<F>& key, uint32_t depth, PathState<F>& path, SingleHit& hit) {
    const Flight<F> flight = sample_flight(key, depth, path, hit);
    if constexpr (Media::kHasEmission)
      if (media_.has_emission()) {
        const Color<F> c = clean<F>(
            path.throughput * media_.template emission<F>(passage_of(key, depth, path, hit), true),
            clamp_limit(settings_, depth));
        events_.light<Technique::kVolume, F>({depth, kSlot, c}, [] { return kNoLight; }, true);
      }
    path.throughput = path.throughput * flight.weight;
    events_.segment<F>(depth, kSlot, flight, path.throughput, true);
    if (flight.stopped) hit = {flight.t, 0.f, 0.f, 0, 0, kNoSurface, flight.material};
  }

  /// Traces the shadow ray of a vertex, and adds the vertex's light sample to the light group
  /// `group`. Returns the result of SingleRays::unoccluded().
  float trace_shadow(const SampleKey<F>& key, uint32_t depth, const VertexResult<F>& v,
                     uint32_t group) {
    clock_.enter(Phase::kShadow);
    const bool links = context_.scene.lights.links.members != nullptr;
    const float passed = rays_.unoccluded(v.shadow_o, v.shadow_d, v.shadow_tfar, depth,
                                          links ? &v.shadow_set : nullptr);
    if (passed > 0.f || max_component(v.shadow_tint) > 0.f)
      add_direct(key, depth, v, passed, group);
    return passed;
  }

  /// Runs the subsurface random walk of a ray that has entered a body. A ray that does not hit the
  /// body again continues as a normal ray. Sets `left_body` if the walk has left the body. Returns
  /// false if the path is terminated.
  bool walk(const SampleKey<F>& key, uint32_t depth, PathState<F>& path, SingleHit& hit,
            bool& left_body) {
    path.enters_body = false;
    path.receiver = 0u;
    path.cone_width = 0.f;
    const uint32_t object = path.entry.body;
    if constexpr (Media::kStreams) {
      PresenceKeys keys = rays_.keys();
      keys.object = &object;
      keys.passes_straight = false;
      return media_.walk(passage_of(key, depth, path, hit), keys, path, hit, left_body);
    }
    return true;
  }

  /// Returns the ray segment of a path to `hit`. The returned query holds references to the path
  /// and the hit.
  MediumQuery<F> passage_of(const SampleKey<F>& key, uint32_t depth, const PathState<F>& path,
                            const SingleHit& hit) const {
    return {settings_.sampler, key, depth, path.o, path.dir, hit.t, rays_.time()};
  }

  /// Samples the free flight of a path along its ray segment to `hit`.
  Flight<F> sample_flight(const SampleKey<F>& key, uint32_t depth, PathState<F>& path,
                          SingleHit& hit) {
    if constexpr (Media::kStreams)
      if (context_.has_medium_stack())
        return media_.sample_nested_flight(passage_of(key, depth, path, hit), rays_.keys(), path,
                                           hit, medium_stack_);
    return media_.template sample_flight<F>(passage_of(key, depth, path, hit), path.throughput,
                                            true);
  }

  /// Adds the contribution of the light sample in `v` to the light group `group`. Volumes always
  /// attenuate the contribution. Media inside meshes attenuate the contribution only if the shadow
  /// ray is free. `passed` is the result of SingleRays::unoccluded(). If it is 0, the contribution
  /// is multiplied by `v.shadow_tint`.
  void add_direct(const SampleKey<F>& key, uint32_t depth, const VertexResult<F>& v, float passed,
                  uint32_t group) {
    const bool is_free = passed > 0.f;
    Color<F> c = v.direct;
    if (is_free) c = c * tinted_transmittance<F>(v.shadow_tint, passed);
    if constexpr (Media::kAny) {
      const F t = v.shadow_tfar * (1.f / kShadowRayFraction);
      c = c * media_.template transmittance<F>(
                  {settings_.sampler, key, depth, v.shadow_o, v.shadow_d, t, rays_.time()}, true);
      if constexpr (Media::kStreams)
        if (is_free && context_.has_medium_stack())
          c = c * media_.nested_transmittance(rays_.keys(), rays_.time(), medium_stack_, v.shadow_o,
                                              v.shadow_d, t);
    }
    if (!is_free) c = c * v.shadow_tint;
    events_.light<Technique::kLightSample, F>({depth, kSlot, c}, [&] { return group; }, true);
  }

  VertexResult<F> shade(const SampleKey<F>& key, uint32_t depth, const SingleHit& hit,
                        uint32_t mesh, uint32_t material, PathState<F>& path, VertexAovs<F>& aovs) {
    const SceneView& scene = context_.scene;
    counts_.add_records(depth, 1);
    if (aovs_.models_cost()) aovs_.add_cost(kSlot, context_.roulette_costs->material(material));
    const MeshHit<F> mesh_hit{hit.inst, mesh, hit.prim, hit.u, hit.v, rays_.time()};
    JointTransport::Coupling<F> joint(context_.joint, buffers_);
    joint.load(kSlot, depth, settings_.max_depth, true, path);
    constexpr auto& kernels = kShadeVertex<F, typename Media::template Programs<F>>;
    const VertexResult<F> v = kernels[scene.material_program[material]](
        {scene, settings_, key, depth, mesh_hit, hit.geom, hit.t, material, path, &aovs, true,
         context_.guide},
        joint);
    joint.store(kSlot, v.next, v.alive, aovs_, true);
    return v;
  }

  [[maybe_unused]] const Media& media_;
  PhaseClock& clock_;
  PathHistory& history_;
  JointTransport::Buffers& buffers_;
  Joint joint_;
};

}  // namespace wavecomb
