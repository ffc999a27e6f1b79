// SPDX-License-Identifier: Apache-2.0
#include "integrator.h"

#include <cmath>
#include <random>

#include "light_shapes.h"
#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/material/energy_tables.h"
#include "wavecomb/material/program_table.h"
#include "wavecomb/path/camera/camera_ray.h"
#include "wavecomb/path/vertex.h"

namespace wavecomb {
namespace {

using F = float;
using Rgb = Vec3<F>;
/// Maximum number of surfaces that a ray crosses in search of mesh lights.
constexpr uint32_t kMostCrossings = 32;

Vec3<F> triple(const float* v) {
  return {v[0], v[1], v[2]};
}
bool is_positive(const Rgb& c) {
  return c.x > 0 || c.y > 0 || c.z > 0;
}

/// A ray, with the data that emission depends on.
struct Ray {
  Vec3<F> o, d;
  bool is_seen = true;  ///< set for camera rays and mirror directions, false for uniform directions
  uint32_t link = 0;
  F cone_width = 0, cone_spread = 0;

  /// Returns the path state that production functions expect. These functions use the density only
  /// to check that it is above 0, which means that a bounce made the ray.
  PathState<F> state() const {
    return {d, Rgb(1.f), is_seen ? 0.f : 1.f, 1.f, cone_width, cone_spread, o, 0u, link};
  }
};

struct Hit {
  F t, u, v;
  uint32_t prim, geom, inst;
};

class Integrator {
 public:
  Integrator(const std::shared_ptr<const Scene>& scene, const NaiveSettings& settings)
      : settings_(settings),
        owner_(scene),
        scene_(scene->view()),
        accel_(scene, 1),
        filter_(FilterKind::kBox, 1.f),
        camera_(scene->camera(), settings.width, settings.height, filter_),
        random_(settings.seed * 0x9e3779b97f4a7c15ull + 0x2545f4914f6cdd1dull) {
    for (const Material& m : scene->materials())
      if (m.program == ProgramId::kOpenPbr) scene_.materials.energy = EnergyTables::shared().data();
  }

  /// Returns the radiance of one path through a pixel.
  Rgb sample(uint32_t x, uint32_t y) {
    time_ = scene_.has_motion || camera_.moves() ? number() : 0.f;
    const F u = number(), v = number(), lens_u = number(), lens_v = number();
    const CameraRay<F> first = ray_through<F>(camera_, static_cast<F>(x) + u, static_cast<F>(y) + v,
                                              lens_u, lens_v, time_, true);
    const F tfar = camera_.has_far ? first.tfar : kInfinity;
    return radiance({first.o, first.d, true, 0, first.width, first.spread}, 0, tfar) *
           camera_.exposure;
  }

 private:
  F number() { return static_cast<F>(random_() >> 40) * 0x1p-24f; }

  PresenceKeys fresh_keys(uint32_t* words) {
    words[0] = static_cast<uint32_t>(random_());
    words[1] = static_cast<uint32_t>(random_());
    PresenceKeys keys;
    keys.pixel_hash = words;
    keys.sample = words + 1;
    keys.salt = static_cast<uint32_t>(random_());
    return keys;
  }
  RaySpan span(const Vec3<F>& o, const Vec3<F>& d, const F& tfar) const {
    return {&o.x, &o.y,  &o.z,   &d.x, &d.y,
            &d.z, &tfar, &kSlot, 1,    scene_.has_motion ? &time_ : nullptr};
  }
  /// `after_delta` is whether the ray starts with a delta bounce.
  Hit closest(const Vec3<F>& o, const Vec3<F>& d, F tfar, bool after_delta = false) {
    Hit h;
    uint32_t words[2];
    PresenceKeys keys = fresh_keys(words);
    const F delta_pdf = 0;
    if (after_delta) keys.bounce_pdf = &delta_pdf;
    accel_.intersect(span(o, d, tfar), {&h.t, &h.u, &h.v, &h.prim, &h.geom, &h.inst}, 1, false,
                     keys);
    return h;
  }
  /// Returns the fraction of light that reaches `o` from light `light` at distance t along d.
  F visibility(const Vec3<F>& o, const Vec3<F>& d, F t, uint32_t light) {
    const F tfar = t * 0.9999f;
    uint32_t words[2], blocked = 0, set = 0, optical_depth = 0;
    PresenceKeys keys = fresh_keys(words);
    keys.passes_straight = true;
    keys.optical_depth = &optical_depth;
    if (scene_.lights.links.members) {
      set = scene_.lights.lights[light].shadow_link + 1;
      keys.shadow_set = &set;
    }
    accel_.occluded(span(o, d, tfar), &blocked, 1, false, keys);
    return blocked != 0 ? 0.f : surface_transmittance<F>(optical_depth);
  }

  bool lights_class(uint32_t record, uint32_t link) const {
    return !scene_.lights.links.members ||
           is_linked<F>(scene_.lights.links, link, scene_.lights.lights[record].light_link, true);
  }
  /// Returns whether the contribution of a light is computed separately, not when rays hit it.
  static bool is_apart(const LightRecord& light) {
    return light.sampled_only != 0 || light.diffuse != 1 || light.specular != 1;
  }
  /// Returns the factor of the radiance of record `light` for a ray that hits it.
  F share_met(uint32_t record, const Ray& ray, bool from_camera) const {
    const LightRecord& light = scene_.lights.lights[record];
    if (!lights_class(record, ray.link)) return 0;
    if (!is_apart(light)) return 1;
    return !ray.is_seen ? 0.f : (from_camera ? 1.f : light.specular);
  }

  /// Returns the radiance of infinite light `i` along d.
  Rgb infinite(uint32_t i, const Vec3<F>& o, const Vec3<F>& d) const {
    const LightView& view = scene_.lights;
    const LightRecord& record = view.lights[i];
    Rgb c = static_cast<LightKind>(record.kind) == LightKind::kDome
                ? detail::hit_dome_from<F>(view, record, o, d, true).radiance
                : detail::hit_distant<F>(detail::LightReader<F>(record, true), d).radiance;
    return record.shaping == kNoShaping ? c : detail::shaped<F>(view, record.shaping, -d, c, true);
  }
  /// Returns the radiance of the shape of light `i`, hit along d at distance t.
  Rgb finite(uint32_t i, const Vec3<F>& o, const Vec3<F>& d, F t) const {
    return light_hit<F>(scene_.lights, i, LightReceiver<F>(o, 0u), d, t, true).radiance;
  }

  uint32_t mesh_of(const Hit& hit) const {
    return scene_.geometry_mesh[scene_.instances[hit.inst].geometry + hit.geom];
  }
  uint32_t material_of(const Hit& hit) const {
    const MeshRecord& mesh = scene_.meshes[mesh_of(hit)];
    const uint32_t material = mesh.face_materials != 0
                                  ? reinterpret_cast<const uint32_t*>(mesh.face_materials)[hit.prim]
                                  : mesh.material;
    return material == kInheritMaterial ? scene_.instances[hit.inst].material : material;
  }
  /// Returns the record of the mesh light at a hit, or kNoLight.
  uint32_t mesh_light_of(const Hit& hit) const {
    return scene_.mesh_lights
               ? scene_.mesh_lights[instance_geometry<F>(scene_, hit.inst, hit.geom, true)]
               : kNoLight;
  }

  /// Returns whether sampled_only() adds the light of the mesh that a ray hits.
  bool is_counted_apart(const Hit& hit, const Ray& ray) const {
    const uint32_t light = ray.is_seen ? kNoLight : mesh_light_of(hit);
    return light != kNoLight && is_apart(scene_.lights.lights[light]);
  }

  Rgb radiance(Ray ray, uint32_t depth, F tfar) {
    const Hit hit = closest(ray.o, ray.d, tfar, ray.is_seen && depth > 0);
    ray.cone_width = ray.cone_spread * hit.t + ray.cone_width;
    if (hit.inst == kNoHit) {
      Rgb sum(0.f);
      for (uint32_t i = 0; i < scene_.lights.infinite_count; ++i)
        sum += infinite(i, ray.o, ray.d) * share_met(i, ray, depth == 0);
      return sum;
    }
    if (hit.inst == kLightShape)
      return finite(hit.geom, ray.o, ray.d, hit.t) * share_met(hit.geom, ray, depth == 0);
    Rgb out;
    visit_program<F>(static_cast<ProgramId>(scene_.material_program[material_of(hit)]),
                     [&]<typename Bsdf>() { out = vertex<Bsdf>(hit, ray, depth, tfar); });
    return out;
  }

  /// The shading point of a hit, with its material parameters.
  template <typename Bsdf>
  struct Point {
    static constexpr uint32_t kInputs = kVertexInputs<Bsdf>;
    Surface<F> s;
    MaterialRecord record;
    bool reads_texture;
    ParamsOf<Bsdf, F> params;

    Point(const SceneView& scene, const Hit& hit, uint32_t mesh, uint32_t material, const Ray& ray,
          F time)
        : Point(scene, hit, MeshHit<F>{hit.inst, mesh, hit.prim, hit.u, hit.v, time}, material, ray,
                setup_surface<F>(scene, {hit.inst, mesh, hit.prim, hit.u, hit.v, time}, ray.d, true,
                                 Bsdf::kHasTerminator, true)) {}
    Point(const SceneView& scene, const Hit&, const MeshHit<F>& at, uint32_t material,
          const Ray& ray, const Surface<F>& surface)
        : s(surface),
          record(scene.materials.materials[material]),
          reads_texture((record.textured_inputs & (kInputs | kReadsGraph)) != 0),
          params(fetch(scene, at, material, ray)) {}

    auto fetch(const SceneView& scene, const MeshHit<F>& at, uint32_t material, const Ray& ray) {
      const F seen = std::max(std::abs(dot(ray.d, s.ng)), 0.05f);
      const F uv_width = ray.cone_width * s.uv_per_length / std::sqrt(seen);
      const auto make_point = [&](const Mask<F>& lanes) {
        return graph_point<F>(scene, at, s, ray.d, uv_width, lanes);
      };
      return fetch_for<Bsdf, kInputs, F>(scene.materials, material, s.uv, uv_width, make_point,
                                         true);
    }
    /// Returns the shading frame: along u if the material reads a texture, with the normal of a
    /// normal map.
    Frame<F> frame(const Ray& ray) const {
      if (!reads_texture) return make_frame<F>(s.ns);
      Vec3<F> n = s.ns;
      if ((record.textured_inputs & (input_bit(Input::kNormal) | kGraphNormal)) != 0) {
        n = normalize(make_frame<F>(n, s.dpdu, s.handedness).to_world(params.normal));
        // Bends a normal that points away from the viewer until it is perpendicular to the ray.
        const F towards = dot(ray.d, s.ng) < 0 ? 1.f : -1.f, seen = -dot(ray.d, n) * towards;
        if (seen < 1e-3f) n = normalize(n + ray.d * (-towards * (1e-3f - seen)));
      }
      return make_frame<F>(n, s.dpdu, s.handedness);
    }
  };

  /// Returns the radiance that passes straight through the surface of a hit, and sets the opacity
  /// of `at`. The same ray continues behind the surface.
  template <typename Bsdf>
  Rgb straight(const Hit& hit, const Ray& ray, uint32_t depth, F tfar, Point<Bsdf>& at) {
    const uint32_t material = material_of(hit);
    if ((scene_.materials.materials[material].flags & kTransmitsStraight) == 0) return Rgb(0.f);
    const MeshHit<F> on_mesh{hit.inst, mesh_of(hit), hit.prim, hit.u, hit.v, time_};
    const auto cosine = [&](bool) { return unadjusted_cosine<F>(at.s.unadjusted, ray.d); };
    const StraightTransmission<F> t =
        straight_transmission<F>(scene_, on_mesh, material, cosine, true);
    at.params.opacity = t.opacity;
    if (t.probability == 0.f) return Rgb(0.f);
    Ray behind = ray;
    behind.o = spawn_origin<F>(at.s, ray.d);
    return radiance(behind, depth, tfar - hit.t) * t.probability;
  }

  template <typename Bsdf>
  Rgb vertex(const Hit& hit, const Ray& ray, uint32_t depth, F tfar) {
    Point<Bsdf> at(scene_, hit, mesh_of(hit), material_of(hit), ray, time_);
    const Surface<F>& s = at.s;
    Rgb passed(1.f);
    if constexpr (Bsdf::kAbsorbs) passed = at.params.transmittance(hit.t, -dot(ray.d, s.ng));
    Rgb out(0.f);
    if constexpr (Bsdf::kEmits) {
      out = at.params.emission;
      if (is_counted_apart(hit, ray))
        out = Rgb(0.f);
      else if (scene_.mesh_lights)
        out =
            mesh_light_emission<F>(scene_, hit.inst, hit.geom, out, ray.state(), depth == 0, true);
    }
    if constexpr (Bsdf::kTransmitsStraight) out += straight(hit, ray, depth, tfar, at);
    if (depth >= settings_.max_depth) return passed * out;

    const Bsdf bsdf(at.params, settings_.schlick_fresnel);
    const Frame<F> frame = at.frame(ray);
    const Vec3<F> wo = frame.to_local(-ray.d);
    Ray next;
    next.cone_width = ray.cone_width;
    if (scene_.lights.links.members) next.link = link_class<F>(scene_, hit.inst, hit.geom, true);

    for (const BsdfSample<F>& lobe : delta_lobes(bsdf, wo)) {
      next.d = normalize(frame.to_world(lobe.wi));
      if (!(dot(next.d, s.ng) * lobe.wi.z > 0)) continue;
      next.o = spawn_origin<F>(s, next.d);
      next.is_seen = true;
      next.cone_spread = std::max(ray.cone_spread, lobe.roughness * lobe.roughness * 0.25f);
      out += lobe.weight * lobe.pdf * radiance(next, depth + 1, kInfinity);
    }
    if (!bsdf.has_non_delta()) return passed * out;

    // Starts light rays at the same point as production's light samples, so that all estimates
    // agree.
    next.o = spawn_origin<F>(s, -ray.d);
    next.is_seen = false;
    out += delta_lights(bsdf, s, frame, wo, next);

    constexpr bool kOpaque = !Bsdf::kTransmits;
    const uint32_t n = depth == 0 ? settings_.directions : 1u;
    next.cone_spread = std::max(ray.cone_spread, 0.25f);
    for (uint32_t i = 0; i < n; ++i) {
      Vec3<F> wi = uniform_direction();
      if (kOpaque) wi.z = std::copysign(wi.z, wo.z);
      const BsdfEval<F> e = bsdf.eval(wo, wi);
      next.d = normalize(frame.to_world(wi));
      if (!is_positive(e.f_cos) || !(dot(next.d, s.ng) * wi.z > 0)) continue;
      next.o = spawn_origin<F>(s, next.d);
      const F sphere = (kOpaque ? 2.f : 4.f) * kPi / static_cast<F>(n);
      out += e.f_cos * radiance(next, depth + 1, kInfinity) * sphere;
      if (scene_.lights.has_effects)
        out += sampled_only(e.f_cos, bsdf.diffuse_f_cos(wo, wi), next) * sphere;
    }
    return passed * out;
  }

  Vec3<F> uniform_direction() {
    const double z = 2 * number() - 1., phi = 2 * M_PI * number(), r = std::sqrt(1 - z * z);
    return {static_cast<F>(r * std::cos(phi)), static_cast<F>(r * std::sin(phi)),
            static_cast<F>(z)};
  }

  /// Returns all delta lobes that a set of random numbers selects, each once. weight * pdf is the
  /// factor of a lobe.
  template <typename Bsdf>
  std::vector<BsdfSample<F>> delta_lobes(const Bsdf& bsdf, const Vec3<F>& wo) const {
    std::vector<BsdfSample<F>> lobes;
    for (uint32_t i = 0; i < settings_.delta_tries; ++i) {
      const F u = (static_cast<F>(i) + 0.5f) / static_cast<F>(settings_.delta_tries);
      const BsdfSample<F> b = bsdf.sample(wo, u, 0.37f, 0.61f);
      if (!b.is_delta || !(b.pdf > 0)) continue;
      bool is_new = true;
      for (const BsdfSample<F>& known : lobes) is_new = is_new && dot(known.wi, b.wi) < 0.9999f;
      if (is_new) lobes.push_back(b);
    }
    return lobes;
  }

  /// Returns f |cos| with the multipliers of a light applied.
  Rgb lit(const LightRecord& light, const Rgb& f_cos, const Rgb& diffuse) const {
    if (!is_apart(light)) return f_cos;
    return (f_cos - diffuse) * light.specular + diffuse * light.diffuse;
  }

  /// Returns the contribution of lights from a single point or direction.
  template <typename Bsdf>
  Rgb delta_lights(const Bsdf& bsdf, const Surface<F>& s, const Frame<F>& frame, const Vec3<F>& wo,
                   const Ray& from) {
    const LightView& view = scene_.lights;
    Rgb sum(0.f);
    for (uint32_t i = 0; i < view.first_triangle; ++i) {
      const LightRecord& light = view.lights[i];
      const auto kind = static_cast<LightKind>(light.kind);
      const bool is_point = kind == LightKind::kSphere && light.radius == 0;
      const bool is_sun = kind == LightKind::kDistant && light.one_minus_cos == 0;
      if ((!is_point && !is_sun) || !lights_class(i, from.link)) continue;
      const Vec3<F> to = triple(light.p) - from.o;
      const F t = is_sun ? kFarAway : length(to);
      const Vec3<F> d = is_sun ? -triple(light.n) : normalize(to);
      const Vec3<F> wi = frame.to_local(d);
      if (!(dot(d, s.ng) * wi.z > 0)) continue;
      Rgb c = triple(light.radiance) * (is_sun ? 1.f : 1.f / (t * t));
      if (light.shaping != kNoShaping) c = detail::shaped<F>(view, light.shaping, -d, c, true);
      c = c * lit(light, bsdf.eval(wo, wi).f_cos, bsdf.diffuse_f_cos(wo, wi));
      if (is_positive(c)) sum += c * visibility(spawn_origin<F>(s, d), d, t, i);
    }
    return sum;
  }

  /// Returns the contribution from a direction of lights that production finds only by light
  /// samples, times f |cos|.
  Rgb sampled_only(const Rgb& f_cos, const Rgb& diffuse, const Ray& ray) {
    const LightView& view = scene_.lights;
    Rgb sum(0.f);
    for (uint32_t i = 0; i < view.first_triangle; ++i) {
      const LightRecord& light = view.lights[i];
      if (!is_apart(light) || !lights_class(i, ray.link)) continue;
      const bool is_far = i < view.infinite_count;
      const F t = is_far ? kFarAway : static_cast<F>(meets(light, ray.o, ray.d));
      if (!(t > 0)) continue;
      const Rgb c = (is_far ? infinite(i, ray.o, ray.d) : finite(i, ray.o, ray.d, t)) *
                    lit(light, f_cos, diffuse);
      if (is_positive(c)) sum += c * visibility(ray.o, ray.d, t, i);
    }
    if (!view.mesh_lights) return sum;
    return sum + sampled_only_meshes(f_cos, diffuse, ray) + hidden_meshes(f_cos, diffuse, ray);
  }

  /// Returns the contribution of mesh lights that production finds only by light samples, from all
  /// surfaces along the ray.
  Rgb sampled_only_meshes(const Rgb& f_cos, const Rgb& diffuse, const Ray& ray) {
    Rgb sum(0.f);
    F before = 0;
    for (uint32_t k = 0; k < kMostCrossings; ++k) {
      Hit hit = closest(ray.o + ray.d * before, ray.d, kInfinity);
      if (hit.inst == kNoHit) break;
      const F t = before + hit.t;
      before = t * 1.0001f + 1e-5f;
      const uint32_t i = hit.inst == kLightShape ? kNoLight : mesh_light_of(hit);
      if (i == kNoLight) continue;
      const LightRecord& light = scene_.lights.lights[i];
      if (!is_apart(light) || light.visibility != 0 || !lights_class(i, ray.link)) continue;
      Rgb c = triple(light.radiance);
      if (static_cast<MaterialSync>(light.sync) != MaterialSync::kIndependent)
        c = c * glow(hit, ray);
      if (light.shaping != kNoShaping)
        c = detail::shaped<F>(scene_.lights, light.shaping, -ray.d, c, true);
      c = c * lit(light, f_cos, diffuse);
      if (is_positive(c)) sum += c * visibility(ray.o, ray.d, t, i);
    }
    return sum;
  }

  /// Returns the contribution of mesh lights that rays cannot hit, triangle by triangle.
  Rgb hidden_meshes(const Rgb& f_cos, const Rgb& diffuse, const Ray& ray) {
    const LightView& view = scene_.lights;
    Rgb sum(0.f);
    for (uint32_t i = view.first_triangle; i < view.count; ++i) {
      const uint32_t record = view.mesh_lights[i - view.first_triangle];
      if (record == kNoLight) continue;
      const LightRecord& light = view.lights[record];
      if (light.visibility == 0 || !lights_class(record, ray.link)) continue;
      const TriangleLight& triangle = view.triangles[i - view.first_triangle];
      const F t = static_cast<F>(meets(triangle, ray.o, ray.d));
      if (!(t > 0) || triangle.varies()) continue;
      Rgb c = triple(triangle.radiance);
      if (light.shaping != kNoShaping) c = detail::shaped<F>(view, light.shaping, -ray.d, c, true);
      c = c * lit(light, f_cos, diffuse);
      if (is_positive(c)) sum += c * visibility(ray.o, ray.d, t, record);
    }
    return sum;
  }

  Rgb glow(const Hit& hit, const Ray& ray) {
    Rgb out(0.f);
    visit_program<F>(static_cast<ProgramId>(scene_.material_program[material_of(hit)]),
                     [&]<typename Bsdf>() {
                       if constexpr (Bsdf::kEmits)
                         out = Point<Bsdf>(scene_, hit, mesh_of(hit), material_of(hit), ray, time_)
                                   .params.emission;
                     });
    return out;
  }

  static constexpr uint32_t kSlot = 0;
  const NaiveSettings settings_;
  std::shared_ptr<const Scene> owner_;
  SceneView scene_;
  EmbreeAccelerator accel_;
  FilterTable filter_;
  CameraSetup camera_;
  std::mt19937_64 random_;
  F time_ = 0;
};

}  // namespace

std::vector<double> render_naively(const std::shared_ptr<const Scene>& scene,
                                   const NaiveSettings& settings) {
  Integrator integrator(scene, settings);
  std::vector<double> picture(size_t{3} * settings.width * settings.height);
  double* out = picture.data();
  for (uint32_t y = 0; y < settings.height; ++y)
    for (uint32_t x = 0; x < settings.width; ++x, out += 3)
      for (uint32_t s = 0; s < settings.samples; ++s) {
        const Rgb c = integrator.sample(x, y);
        out[0] += double{c.x} / settings.samples;
        out[1] += double{c.y} / settings.samples;
        out[2] += double{c.z} / settings.samples;
      }
  return picture;
}

}  // namespace wavecomb
