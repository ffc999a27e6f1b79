// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/light_builder.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "wavecomb/core/error.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene_limits.h"

namespace wavecomb {

namespace {

constexpr double kPiD = 3.14159265358979323846;

struct Double3 {
  double x, y, z;
  Double3 operator*(double s) const { return {x * s, y * s, z * s}; }
};
Double3 to_double(const Vec3<float>& v) {
  return {v.x, v.y, v.z};
}
Double3 to_double(const float* v) {
  return {v[0], v[1], v[2]};
}
Double3 subtract(const Double3& a, const Double3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
Double3 cross(const Double3& a, const Double3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
double dot(const Double3& a, const Double3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
double length(const Double3& a) {
  return std::sqrt(dot(a, a));
}
/// a / |a|; +z for the zero vector.
Double3 unit(const Double3& a) {
  const double n = length(a);
  return n > 0 ? a * (1 / n) : Double3{0, 0, 1};
}
void put(float (&to)[3], const Double3& v) {
  to[0] = static_cast<float>(v.x);
  to[1] = static_cast<float>(v.y);
  to[2] = static_cast<float>(v.z);
}
double luminance(double r, double g, double b) {
  return 0.212656 * r + 0.715158 * g + 0.072186 * b;
}

/// Areas below are too small to be told from 0 in float: such lights are dark.
constexpr double kLeastArea = 1e-36;
/// Largest radiance; beyond it products overflow.
constexpr double kMostRadiance = 1e30;

void put_radiance(LightRecord& record, const Double3& v) {
  put(record.radiance,
      {std::min(v.x, kMostRadiance), std::min(v.y, kMostRadiance), std::min(v.z, kMostRadiance)});
}

bool is_infinite(LightKind kind) {
  return kind == LightKind::kDistant || kind == LightKind::kDome;
}

/// A power that can be compared with others.
double sane_power(double power) {
  const bool sane = std::isfinite(power) && power > 0;
  return sane ? power : (power > 0 ? 1e300 : 0);
}

/// A record in the making, and the power that its choice rests on.
struct Made {
  LightRecord record{};
  double power = 0;
};

/// Area, directions of emission and radiance of a light in the plane with the given edges or half
/// axes.
void finish_flat(Made& made, const Light& light, const Double3& u, const Double3& v,
                 double area_factor, const Double3& color, double mean) {
  const Double3 m = cross(u, v);
  // Light leaves on the side that -z is mapped to, whatever the handedness of the map.
  const Double3 minus_z = to_double(light.to_world.axis(2)) * -1.0;
  Double3 n = unit(m);
  if (dot(n, minus_z) < 0) n = n * -1.0;
  const double area = area_factor * length(m);
  put(made.record.u, u);
  put(made.record.v, v);
  put(made.record.n, n);
  made.record.area = static_cast<float>(area);
  const double scale = area < kLeastArea ? 0 : (light.normalize ? 1 / area : 1);
  put_radiance(made.record, color * scale);
  made.power = kPiD * area * scale * mean;
}

void make_sphere(Made& made, const Light& light, const Double3& color, double mean) {
  const Affine& m = light.to_world;
  const Double3 x = to_double(m.axis(0)), y = to_double(m.axis(1)), z = to_double(m.axis(2));
  const double radius = std::fabs(light.radius) * std::cbrt(std::fabs(dot(x, cross(y, z))));
  put(made.record.p, to_double(m.t));
  made.record.radius = static_cast<float>(radius);
  if (light.radius == 0) {
    const double scale = light.normalize ? 0.25 : 1;  // pi r^2 / (4 pi r^2)
    put_radiance(made.record, color * scale);
    made.power = 4 * kPiD * scale * mean;
    return;
  }
  const double area = 4 * kPiD * radius * radius;
  made.record.area = static_cast<float>(area);
  const bool there = area >= kLeastArea;
  const double scale = !there ? 0 : (light.normalize ? 1 / area : 1);
  put_radiance(made.record, color * scale);
  made.power = kPiD * area * scale * mean;
  if (!there) made.record.radius = 1e-18f;  // 0 would make it a point light
}

/// A round cylinder of as much volume as the transformed one has, about its transformed axis.
void make_cylinder(Made& made, const Light& light, const Double3& color, double mean) {
  const Affine& m = light.to_world;
  const Double3 x = to_double(m.axis(0)), y = to_double(m.axis(1)), z = to_double(m.axis(2));
  const Double3 axis = x * std::fabs(double{light.length});
  const double stretch = length(x) > 0 ? std::fabs(dot(x, cross(y, z))) / length(x) : 0;
  const double radius = std::fabs(double{light.radius}) * std::sqrt(stretch);
  const double area = 2 * kPiD * radius * length(axis);
  put(made.record.p, subtract(to_double(m.t), axis * 0.5));
  put(made.record.u, axis);
  made.record.radius = static_cast<float>(radius);
  made.record.area = static_cast<float>(area);
  const double scale = area < kLeastArea ? 0 : (light.normalize ? 1 / area : 1);
  put_radiance(made.record, color * scale);
  made.power = kPiD * area * scale * mean;
}

/// The shaping of any light but a dome, and what share of its power it lets out: each
/// part by its mean over all directions, as if they had nothing to do with one another.
void make_shaping(Made& made, LightSet& set, const Light& light,
                  std::span<const IesProfile> profiles) {
  const Shaping& s = light.shaping;
  const double power = made.power;
  const Double3 minus_z = unit(to_double(light.to_world.axis(2)) * -1.0);
  ShapingRecord r{};
  put(r.axis, minus_z);
  // The rows of the inverse; a length in common does not matter.
  const Double3 axes[3] = {to_double(light.to_world.axis(0)), to_double(light.to_world.axis(1)),
                           to_double(light.to_world.axis(2))};
  const double side = dot(axes[0], cross(axes[1], axes[2])) < 0 ? -1 : 1;
  double largest = 0;
  Double3 rows[3];
  for (size_t i = 0; i < 3; ++i) {
    rows[i] = cross(axes[(i + 1) % 3], axes[(i + 2) % 3]) * side;
    largest = std::max(largest, length(rows[i]));
  }
  float* const to_light[3] = {r.to_light_x, r.to_light_y, r.to_light_z};
  for (size_t i = 0; i < 3; ++i) {
    const Double3 row = rows[i] * (largest > 0 ? 1 / largest : 0);
    const double values[3] = {row.x, row.y, row.z};
    for (size_t j = 0; j < 3; ++j) to_light[i][j] = static_cast<float>(values[j]);
  }
  const auto tint = [](float x) { return std::max(0.0, double{x}); };
  put(r.tint, {tint(s.focus_tint.x), tint(s.focus_tint.y), tint(s.focus_tint.z)});
  r.focus = std::max(0.f, s.focus);
  const double cone = std::max(0.0, double{s.cone_angle}) * kPiD / 180;
  r.cone = s.cone_angle < 180 ? static_cast<float>(cone) : 4.f;
  r.cone_start = r.cone * (1 - std::clamp(s.cone_softness, 0.f, 1.f));
  r.ies = s.ies;
  r.angle_scale = s.ies_angle_scale;
  if (s.focus > 0) {
    const double left = 1.0 / (1.0 + double{s.focus});
    made.power *= left + (1 - left) * std::min(1.0, luminance(double{r.tint[0]}, double{r.tint[1]},
                                                              double{r.tint[2]}));
  }
  if (s.cone_angle < 180) made.power *= (1 - std::cos(cone)) / 2;
  if (s.ies != kNoIes) {
    const IesProfile& profile = profiles[s.ies];
    const double mean = profile.mean();
    r.ies_scale = s.ies_normalize && mean > 0 ? static_cast<float>(1 / mean) : 1.f;
    made.power *= mean * double{r.ies_scale} * (profile.covers_sphere() ? 1 : 0.5);
  }
  if (light.kind == LightKind::kDistant) made.power = power;  // all goes along the axis
  made.record.shaping = static_cast<uint32_t>(set.shapings.size());
  set.shapings.push_back(r);
}

void put_profiles(LightSet& set, std::span<const IesProfile> profiles) {
  const auto append = [&](const std::vector<float>& values) {
    const auto first = static_cast<uint32_t>(set.ies_numbers.size());
    set.ies_numbers.insert(set.ies_numbers.end(), values.begin(), values.end());
    return first;
  };
  for (const IesProfile& p : profiles) {
    IesRecord r{};
    r.vertical_count = static_cast<uint32_t>(p.vertical.size());
    r.horizontal_count = static_cast<uint32_t>(p.horizontal.size());
    r.vertical = append(p.vertical);
    r.horizontal = append(p.horizontal);
    append(p.candela);
    set.ies.push_back(r);
  }
}

void make_distant(Made& made, const Light& light, const Double3& color, double mean,
                  double scene_radius) {
  put(made.record.n, unit(to_double(light.to_world.axis(2)) * -1.0));
  const double half = std::clamp(double{light.angle}, 0.0, 360.0) / 2 * kPiD / 180;
  const double half_sin = std::sin(half / 2);
  double one_minus_cos = 2 * half_sin * half_sin;
  if (static_cast<float>(one_minus_cos) < 1e-30f) one_minus_cos = 0;
  made.record.one_minus_cos = static_cast<float>(one_minus_cos);
  double scale = 1;
  if (light.normalize && one_minus_cos > 0) {
    const double sin2 = std::sin(half) * std::sin(half);
    scale = 1 / (kPiD * (half <= kPiD / 2 ? sin2 : 2 - sin2));
  }
  put_radiance(made.record, color * scale);
  const double solid_angle = one_minus_cos > 0 ? 2 * kPiD * one_minus_cos : 1;
  made.power = kPiD * scene_radius * scene_radius * solid_angle * scale * mean;
}

/// The density of a light with that texture and radiance: of `before` where it is there.
Distribution2D distribution_of(const LightRecord& light, const LightSet* before,
                               std::span<const TexturePtr> textures) {
  if (before)
    for (const LightRecord& other : before->records)
      if (other.kind == light.kind && other.texture == light.texture &&
          other.distribution != kNoDistribution &&
          std::ranges::equal(other.radiance, light.radiance))
        return before->distributions[other.distribution];
  const bool dome = light.kind == static_cast<uint32_t>(LightKind::kDome);
  return (dome ? build_dome_distribution : build_rect_distribution)(
      textures[light.texture]->view(), {light.radiance[0], light.radiance[1], light.radiance[2]});
}

/// Pictures whose density has at least this spread are sampled evenly: it gives no more noise.
constexpr float kEvenSpread = 0.9f;

/// The density of a rect by its picture; power by its mean.
void add_picture(Made& made, LightSet& set, const LightSet* before,
                 std::span<const TexturePtr> textures) {
  Distribution2D d = distribution_of(made.record, before, textures);
  made.power = kPiD * double{made.record.area} * d.mean_luminance;
  if (d.width == 0) {  // black
    made.record.texture = kNoTexture;
    put(made.record.radiance, {0, 0, 0});
  } else if (d.spread < kEvenSpread) {
    made.record.distribution = static_cast<uint32_t>(set.distributions.size());
    set.distributions.push_back(std::move(d));
  }
}

void make_dome(Made& made, LightSet& set, const Light& light, const Double3& color, double mean,
               double scene_radius, std::span<const TexturePtr> textures, const LightSet* before) {
  const Affine& m = light.to_world;
  // Turned and mirrored, never stretched: axes orthonormal, the pole first.
  const Double3 y = unit(to_double(m.axis(1)));
  Double3 z = to_double(m.axis(2));
  z = subtract(z, y * dot(y, z));
  if (!(length(z) > 1e-6 * length(to_double(m.axis(2))))) {
    z = cross(y, std::fabs(y.x) < 0.5 ? Double3{1, 0, 0} : Double3{0, 0, 1});
  }
  z = unit(z);
  Double3 x = cross(y, z);
  if (dot(x, to_double(m.axis(0))) < 0) x = x * -1.0;
  put(made.record.u, x);
  put(made.record.v, y);
  put(made.record.n, z);
  put_radiance(made.record, color);
  double mean_radiance = mean;
  if (light.texture != kNoTexture) {
    made.record.distribution = static_cast<uint32_t>(set.distributions.size());
    set.distributions.push_back(distribution_of(made.record, before, textures));
    mean_radiance = set.distributions.back().mean_luminance;
    if (set.distributions.back().width == 0) {  // black
      set.distributions.pop_back();
      made.record.texture = kNoTexture;
      put(made.record.radiance, {0, 0, 0});
    }
  }
  made.power = 4 * kPiD * mean_radiance * kPiD * scene_radius * scene_radius;
  if (light.portals.empty()) return;
  made.record.portals = static_cast<uint32_t>(set.portal_groups.size());
  const auto first = static_cast<uint32_t>(set.portals.size());
  for (const Affine& square : light.portals) {
    Light portal;
    portal.to_world = square;
    Made rect;
    put(rect.record.p, to_double(square.point({0.5f, -0.5f, 0})));
    finish_flat(rect, portal, to_double(square.axis(0)) * -1, to_double(square.axis(1)), 1,
                {1, 1, 1}, 1);
    rect.record.texture = kNoTexture;
    set.portals.push_back(rect.record);
  }
  const double spread = made.record.texture == kNoTexture
                            ? 4 * kPiD
                            : image_solid_angle(set.distributions[made.record.distribution]);
  set.portal_groups.push_back(
      {first, static_cast<uint32_t>(light.portals.size()), static_cast<float>(spread)});
}

Made make_light(LightSet& set, const Light& light, double scene_radius,
                std::span<const TexturePtr> textures, const LightSet* before,
                std::span<const IesProfile> profiles) {
  Made made;
  LightRecord& r = made.record;
  r.kind = static_cast<uint32_t>(light.kind);
  r.texture = kNoTexture;
  r.shaping = kNoShaping;
  r.portals = kNoPortals;
  r.distribution = kNoDistribution;
  r.diffuse = std::max(0.f, light.diffuse);
  r.specular = std::max(0.f, light.specular);
  r.hidden = !light.visible && !is_infinite(light.kind);
  r.light_link = light.light_link;
  r.shadow_link = light.shadow_link;
  r.sampled_only = r.diffuse != 1 || r.specular != 1 || r.hidden != 0 || r.shadow_link != kNoSet;
  if (light.kind == LightKind::kRect || light.kind == LightKind::kDome) r.texture = light.texture;

  const Double3 color = {std::max(0.0, double{light.color.x}), std::max(0.0, double{light.color.y}),
                         std::max(0.0, double{light.color.z})};
  const double mean = luminance(color.x, color.y, color.z);
  const Affine& m = light.to_world;
  const Double3 x = to_double(m.axis(0)), y = to_double(m.axis(1));
  switch (light.kind) {
    case LightKind::kRect: {
      // Seen from the front, looking along +z with +y up, +x is to the left: s runs along -x.
      const double w = std::fabs(double{light.width}), h = std::fabs(double{light.height});
      put(r.p, to_double(m.point({static_cast<float>(w / 2), static_cast<float>(-h / 2), 0})));
      finish_flat(made, light, x * -w, y * h, 1, color, mean);
      if (r.texture != kNoTexture) add_picture(made, set, before, textures);
      break;
    }
    case LightKind::kDisk: {
      const double radius = std::fabs(double{light.radius});
      put(r.p, to_double(m.t));
      finish_flat(made, light, x * radius, y * radius, kPiD, color, mean);
      break;
    }
    case LightKind::kSphere:
      make_sphere(made, light, color, mean);
      break;
    case LightKind::kCylinder:
      make_cylinder(made, light, color, mean);
      break;
    case LightKind::kDistant:
      make_distant(made, light, color, mean, scene_radius);
      break;
    case LightKind::kDome:
      make_dome(made, set, light, color, mean, scene_radius, textures, before);
      break;
    case LightKind::kTriangle:
      break;
  }
  if (!light.shaping.is_plain() && light.kind != LightKind::kDome)
    make_shaping(made, set, light, profiles);
  return made;
}

struct MadeTriangle {
  TriangleLight light{};
  double power = 0;
};

/// What the triangles of a placed mesh light have in common.
LightRecord make_mesh_light(LightSet& set, const PlacedMeshLight& placed,
                            std::span<const IesProfile> profiles) {
  Light light = *placed.light;
  light.to_world = placed.to_world * light.to_world;
  LightRecord record = make_light(set, light, 1, {}, nullptr, profiles).record;
  const bool there = placed.area >= kLeastArea;
  put_radiance(record,
               to_double(light.color) * (!there ? 0 : (light.normalize ? 1 / placed.area : 1)));
  record.area = static_cast<float>(placed.area);
  record.sync = static_cast<uint32_t>(light.sync);
  // Of light that the material does not tell of, paths that meet the mesh get nothing.
  if (light.sync == MaterialSync::kIndependent) record.sampled_only = 1;
  if (!placed.is_sampled) record.sampled_only = 0;
  return record;
}

/// Index of the texture coordinates left to the caller.
MadeTriangle make_triangle(const LightSet& set, const EmissiveTriangle& t) {
  MadeTriangle made;
  TriangleLight& r = made.light;
  const Double3 p0 = to_double(t.p0);
  const Double3 u = subtract(to_double(t.p1), p0), v = subtract(to_double(t.p2), p0);
  const Double3 m = cross(u, v) * 0.5;
  const double area = length(m);
  put(r.p, p0);
  put(r.u, u);
  put(r.v, v);
  put(r.m, m);
  const auto sane = [](float x) { return std::clamp(double{x}, 0.0, kMostRadiance); };
  Double3 radiance{sane(t.radiance[0]), sane(t.radiance[1]), sane(t.radiance[2])};
  float varying = t.material == kNoLight ? 0.f : TriangleLight::kEmission;
  if (t.mesh_light != kNoLight) {
    const LightRecord& mesh = set.records[set.record_count + t.mesh_light];
    const Double3 tint = to_double(mesh.radiance);
    const bool independent = mesh.sync == static_cast<uint32_t>(MaterialSync::kIndependent);
    if (independent) varying = t.opacity_varies ? TriangleLight::kOpacity : 0.f;
    radiance =
        independent ? tint : Double3{radiance.x * tint.x, radiance.y * tint.y, radiance.z * tint.z};
  }
  radiance = radiance * double{t.opacity};
  const double mean = luminance(radiance.x, radiance.y, radiance.z) * double{t.mean_scale};
  put(r.radiance, {std::min(radiance.x, kMostRadiance), std::min(radiance.y, kMostRadiance),
                   std::min(radiance.z, kMostRadiance)});
  if (varying != 0) {
    r.radiance[0] = varying;
    r.radiance[1] = std::bit_cast<float>(t.material);
  }
  made.power = area < kLeastArea ? 0 : 2 * kPiD * area * mean;
  return made;
}

/// The triangles of `set`, whose powers go to `powers`.
void make_triangles(LightSet& set, size_t count, const TriangleSource& source, double* powers) {
  constexpr size_t kChunk = 4096;
  const size_t chunks = (count + kChunk - 1) / kChunk;
  std::vector<std::vector<TriangleUvs>> uvs(chunks);
  const auto each = [&](size_t chunk, const auto& one) {
    for (size_t i = chunk * kChunk; i < std::min(count, (chunk + 1) * kChunk); ++i) one(i);
  };
  set.triangles.resize(count);
  if (set.records.size() > set.record_count) set.mesh_lights.assign(count, kNoLight);
  parallel_for(chunks, [&](size_t chunk) {
    each(chunk, [&](size_t i) {
      const EmissiveTriangle t = source(i);
      const MadeTriangle made = make_triangle(set, t);
      set.triangles[i] = made.light;
      powers[i] = sane_power(made.power);
      if (t.mesh_light != kNoLight) set.mesh_lights[i] = set.record_count + t.mesh_light;
      if (!made.light.varies()) return;
      uvs[chunk].push_back({{t.uv0[0], t.uv0[1]},
                            {t.uv1[0], t.uv1[1]},
                            {t.uv2[0], t.uv2[1]},
                            t.mesh,
                            t.prim,
                            t.instance});
    });
  });
  for (size_t chunk = 0; chunk < chunks; ++chunk) {
    if (uvs[chunk].empty()) continue;
    auto next = static_cast<uint32_t>(set.triangle_uvs.size());
    each(chunk, [&](size_t i) {
      TriangleLight& t = set.triangles[i];
      if (t.varies()) t.radiance[2] = std::bit_cast<float>(next++);
    });
    set.triangle_uvs.insert(set.triangle_uvs.end(), uvs[chunk].begin(), uvs[chunk].end());
  }
}

/// Fills the bins of one group: light i has numbers[i] of the bins' 2^shift each, which they sum
/// to.
void fill_bins(std::span<const uint32_t> numbers, uint32_t shift, std::span<uint32_t> bins) {
  const uint32_t size = 1u << shift;
  std::vector<uint32_t> left(bins.size(), 0), small, large;
  std::copy(numbers.begin(), numbers.end(), left.begin());
  for (uint32_t b = 0; b < bins.size(); ++b) {
    bins[b] = b << shift;  // full
    if (left[b] != size) (left[b] < size ? small : large).push_back(b);
  }
  while (!small.empty()) {  // what one lacks another has
    const uint32_t s = small.back(), l = large.back();
    small.pop_back();
    bins[s] = (l << shift) | left[s];
    left[l] -= size - left[s];
    if (left[l] > size) continue;
    large.pop_back();
    if (left[l] < size) small.push_back(l);
  }
}

}  // namespace

LightView LightSet::view(const MaterialView& materials) const {
  LightView v;
  v.lights = records.data();
  v.triangles = triangles.data();
  v.triangle_uvs = triangle_uvs.data();
  v.pick = pick;
  v.pick.bins = pick_bins.empty() ? nullptr : pick_bins.data();
  v.tree = tree.view();
  v.count = static_cast<uint32_t>(size());
  v.first_triangle = first_triangle();
  v.infinite_count = infinite_count;
  v.distributions = distributions.data();
  if (!portals.empty()) {
    v.portals = portals.data();
    v.portal_groups = portal_groups.data();
  }
  if (!shapings.empty()) {
    v.shapings = shapings.data();
    v.ies = ies.data();
    v.ies_numbers = ies_numbers.data();
  }
  if (records.size() > record_count) v.mesh_lights = mesh_lights.data();
  for (const LightRecord& record : records) v.has_sampled_only |= record.sampled_only != 0;
  v.materials = materials;
  return v;
}

void check_light_count(uint64_t count) {
  if (count > kMaxLights)
    throw Error("the scene has " + with_commas(count) + " lights and emissive triangles; " +
                with_commas(kMaxLights) +
                " can be numbered; give meshes that emit fewer triangles or instances");
}

LightSet build_lights(std::span<const Light> lights, size_t triangle_count,
                      const TriangleSource& triangle, const Vec3<float>& centre, float radius,
                      std::span<const TexturePtr> textures, const LightSet* before,
                      std::span<const IesProfile> profiles,
                      std::span<const PlacedMeshLight> mesh_lights, size_t most_picked) {
  (void)centre;  // directions of infinite lights do not depend on it
  check_light_count(lights.size() + triangle_count);
  SceneCounts counts{.lights = lights.size() + mesh_lights.size()};
  for (const Light& light : lights) counts.lights += light.portals.size();
  for (const IesProfile& p : profiles)
    counts.profile_values += p.vertical.size() + p.horizontal.size() + p.candela.size();
  check_counts(counts);
  const double scene_radius = std::isfinite(radius) && radius > 0 ? double{radius} : 1.0;
  LightSet set;
  std::vector<double> powers;
  set.records.reserve(lights.size() + mesh_lights.size());
  powers.reserve(lights.size() + triangle_count);
  set.of_input.resize(lights.size());
  put_profiles(set, profiles);
  for (const bool infinite : {true, false}) {
    for (size_t i = 0; i < lights.size(); ++i) {
      if (is_infinite(lights[i].kind) != infinite) continue;
      set.of_input[i] = static_cast<uint32_t>(set.records.size());
      const Made made = make_light(set, lights[i], scene_radius, textures, before, profiles);
      set.records.push_back(made.record);
      powers.push_back(sane_power(made.power));
    }
    if (infinite) set.infinite_count = static_cast<uint32_t>(set.records.size());
  }
  set.record_count = static_cast<uint32_t>(set.records.size());
  for (const PlacedMeshLight& placed : mesh_lights)
    set.records.push_back(make_mesh_light(set, placed, profiles));
  powers.resize(lights.size() + triangle_count);
  make_triangles(set, triangle_count, triangle, powers.data() + lights.size());

  for (const double power : powers) set.total_power += power;
  if (powers.size() <= most_picked) {
    std::vector<uint32_t> numbers;
    set.pick = build_pick_table(powers, set.first_triangle(), set.pick_bins, numbers);
    const auto pdf = [&](size_t i) { return static_cast<float>(numbers[i]) * 0x1p-24f; };
    for (size_t i = 0; i < set.record_count; ++i) set.records[i].pick_pdf = pdf(i);
    for (size_t i = 0; i < triangle_count; ++i)
      set.triangles[i].pick_pdf = pdf(set.first_triangle() + i);
  }
  set.tree = build_light_tree(set, powers);
  return set;
}

PickTable build_pick_table(std::span<const double> weights, size_t first_triangle,
                           std::vector<uint32_t>& bins, std::vector<uint32_t>& numbers) {
  constexpr uint32_t kNumbers = 1u << 24;
  const size_t n = weights.size();
  const std::span<const double> groups[2] = {weights.first(first_triangle),
                                             weights.subspan(first_triangle)};
  bins.clear();
  numbers.assign(n, 0);
  const auto count_lit = [](std::span<const double> of) {
    return static_cast<size_t>(std::count_if(of.begin(), of.end(), [](double w) { return w > 0; }));
  };
  const size_t lit = count_lit(weights), lit_of[2] = {count_lit(groups[0]), count_lit(groups[1])};
  PickTable table;
  if (lit == 0) {  // number 0 for all; some table
    table.split = first_triangle > 0 ? kNumbers : 0;
    table.shift[0] = table.shift[1] = 24;
    bins.assign(1, 0);
    return table;
  }

  // One number in a hundred goes by heads, so that weak lights near by are found. (Every lit light
  // has one of the 2^24 besides.)
  constexpr double floor_share = 0.01;
  const double largest = *std::max_element(weights.begin(), weights.end());
  double sum[2] = {0, 0};
  for (size_t g = 0; g < 2; ++g)
    for (const double w : groups[g]) sum[g] += w / largest;
  const double total = sum[0] + sum[1];
  const auto share = [&](double w) {
    return w > 0
               ? (1 - floor_share) * (w / largest / total) + floor_share / static_cast<double>(lit)
               : 0;
  };

  // The numbers of a group are a multiple of those of its bins, and there are bins for all its
  // lights. Few and large bins stay in the cache; 1024 for all numbers divide them well enough.
  const auto least = [&](size_t g, uint32_t shift) {
    const uint64_t units = (groups[g].size() + (size_t{1} << shift) - 1) >> shift;
    return lit_of[g] > 0 ? units << shift : 0;
  };
  uint32_t unit = 14;
  while (unit > 0 && least(0, unit) + least(1, unit) > kNumbers) --unit;
  double first_share = 0;
  for (const double w : groups[0]) first_share += share(w);
  const auto wanted = static_cast<uint64_t>(std::nearbyint(first_share * kNumbers)) >> unit << unit;
  table.split = static_cast<uint32_t>(std::clamp<uint64_t>(
      wanted, least(0, unit), lit_of[1] > 0 ? kNumbers - least(1, unit) : kNumbers));
  if (lit_of[0] == 0) table.split = 0;
  if (lit_of[1] == 0) table.split = kNumbers;

  const uint32_t numbers_of[2] = {table.split, kNumbers - table.split};
  for (size_t g = 0; g < 2; ++g) {
    if (g == 1) table.triangle_bins = static_cast<uint32_t>(bins.size());
    if (numbers_of[g] == 0) continue;
    const std::span<uint32_t> counts(numbers.data() + (g == 0 ? 0 : first_triangle),
                                     groups[g].size());
    double all = 0, running = 0;
    for (const double w : groups[g]) all += share(w);
    // One number each, and the others by share: rounding the running sum makes the sum exact.
    const auto free = static_cast<double>(numbers_of[g] - lit_of[g]);
    const auto up_to = [&](double part) {
      return static_cast<uint32_t>(std::nearbyint(std::min(1.0, part / all) * free));
    };
    uint32_t given = 0;
    size_t last = 0;
    for (size_t i = 0; i < counts.size(); ++i) {
      if (!(groups[g][i] > 0)) continue;
      last = i;
      running += share(groups[g][i]);
      const uint32_t to = up_to(running);
      counts[i] = 1 + to - given;
      given = to;
    }
    counts[last] += static_cast<uint32_t>(free) - given;

    uint32_t shift = unit;
    while (numbers_of[g] >> shift < counts.size()) --shift;
    table.shift[g] = shift;
    const size_t first = bins.size();
    bins.resize(first + (numbers_of[g] >> shift));
    fill_bins(counts, shift, std::span(bins).subspan(first));
  }
  return table;
}

}  // namespace wavecomb
