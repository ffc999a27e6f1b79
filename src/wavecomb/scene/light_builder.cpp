// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/light_builder.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "wavecomb/core/error.h"
#include "wavecomb/scene/parallel.h"

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

bool finite(const Vec3<float>& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

void check(const Light& light, size_t texture_count) {
  const std::string where = "light '" + light.name + "': ";
  const Affine& m = light.to_world;
  if (!finite(m.row[0]) || !finite(m.row[1]) || !finite(m.row[2]) || !finite(m.t)) {
    throw Error(where + "its transform is not finite");
  }
  if (!finite(light.color)) throw Error(where + "its colour times intensity is not finite");
  for (const float size : {light.width, light.height, light.radius, light.angle}) {
    if (!std::isfinite(size)) throw Error(where + "its size is not finite");
  }
  if (static_cast<uint32_t>(light.kind) >= static_cast<uint32_t>(LightKind::kTriangle)) {
    throw Error(where + "is of no kind that a stage can give");
  }
  if (light.texture != kNoTexture && light.texture >= texture_count) {
    throw Error(where + "there is no texture " + std::to_string(light.texture));
  }
}

bool is_infinite(LightKind kind) {
  return kind == LightKind::kDistant || kind == LightKind::kDome;
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

void make_dome(Made& made, LightSet& set, const Light& light, const Double3& color, double mean,
               double scene_radius, std::span<const std::unique_ptr<Texture>> textures) {
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
    set.distributions.push_back(build_dome_distribution(
        textures[light.texture]->view(),
        {made.record.radiance[0], made.record.radiance[1], made.record.radiance[2]},
        &mean_radiance));
    if (set.distributions.back().width == 0) {  // black
      set.distributions.pop_back();
      made.record.texture = kNoTexture;
      put(made.record.radiance, {0, 0, 0});
    }
  }
  made.power = 4 * kPiD * mean_radiance * kPiD * scene_radius * scene_radius;
}

Made make_light(LightSet& set, const Light& light, double scene_radius,
                std::span<const std::unique_ptr<Texture>> textures) {
  Made made;
  LightRecord& r = made.record;
  r.kind = static_cast<uint32_t>(light.kind);
  r.texture = kNoTexture;
  r.material = kNoLight;
  if (light.kind == LightKind::kRect || light.kind == LightKind::kDome) r.texture = light.texture;

  const Double3 color = {std::max(0.0, double{light.color.x}), std::max(0.0, double{light.color.y}),
                         std::max(0.0, double{light.color.z})};
  double mean = luminance(color.x, color.y, color.z);
  const Affine& m = light.to_world;
  const Double3 x = to_double(m.axis(0)), y = to_double(m.axis(1));
  switch (light.kind) {
    case LightKind::kRect: {
      if (light.texture != kNoTexture) {
        const float* texel = textures[light.texture]->mean();
        // A mean of negative values says nothing; some floor keeps the light in the game.
        mean = std::max(luminance(color.x * double{texel[0]}, color.y * double{texel[1]},
                                  color.z * double{texel[2]}),
                        1e-3 * mean);
      }
      // Seen from the front, looking along +z with +y up, +x is to the left: s runs along -x.
      const double w = std::fabs(double{light.width}), h = std::fabs(double{light.height});
      put(r.p, to_double(m.point({static_cast<float>(w / 2), static_cast<float>(-h / 2), 0})));
      finish_flat(made, light, x * -w, y * h, 1, color, mean);
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
    case LightKind::kDistant:
      make_distant(made, light, color, mean, scene_radius);
      break;
    case LightKind::kDome:
      make_dome(made, set, light, color, mean, scene_radius, textures);
      break;
    case LightKind::kTriangle:
      break;
  }
  return made;
}

Made make_triangle(const EmissiveTriangle& t) {
  Made made;
  LightRecord& r = made.record;
  r.kind = static_cast<uint32_t>(LightKind::kTriangle);
  r.texture = kNoTexture;
  r.material = t.material;
  const Double3 p0 = to_double(t.p0);
  const Double3 u = subtract(to_double(t.p1), p0), v = subtract(to_double(t.p2), p0);
  const Double3 m = cross(u, v);
  const double area = length(m) / 2;
  put(r.p, p0);
  put(r.u, u);
  put(r.v, v);
  put(r.n, unit(m));
  put_radiance(r, to_double(t.radiance));
  r.area = static_cast<float>(area);
  std::copy(t.uv0, t.uv0 + 2, r.uv0);
  std::copy(t.uv1, t.uv1 + 2, r.uv1);
  std::copy(t.uv2, t.uv2 + 2, r.uv2);
  const double mean =
      luminance(double{t.radiance[0]}, double{t.radiance[1]}, double{t.radiance[2]}) *
      double{t.mean_scale};
  made.power = area < kLeastArea ? 0 : 2 * kPiD * area * mean;
  return made;
}

}  // namespace

LightView LightSet::view(const MaterialView& materials) const {
  LightView v;
  v.lights = records.data();
  v.alias = alias.data();
  v.count = static_cast<uint32_t>(records.size());
  v.infinite_count = infinite_count;
  v.distributions = distributions.data();
  v.materials = materials;
  return v;
}

LightSet build_lights(std::span<const Light> lights, size_t triangle_count,
                      const TriangleSource& triangle, const Vec3<float>& centre, float radius,
                      std::span<const std::unique_ptr<Texture>> textures) {
  (void)centre;  // directions of infinite lights do not depend on it
  if (lights.size() + triangle_count > kMaxLights) {
    throw Error("the scene has " + std::to_string(lights.size() + triangle_count) +
                " lights and emissive triangles; " + std::to_string(kMaxLights) + " is the most");
  }
  const double scene_radius = std::isfinite(radius) && radius > 0 ? double{radius} : 1.0;
  LightSet set;
  std::vector<double> powers;
  set.records.reserve(lights.size() + triangle_count);
  powers.reserve(lights.size() + triangle_count);
  const auto power_of = [](const Made& made) {
    const bool sane = std::isfinite(made.power) && made.power > 0;
    return sane ? made.power : (made.power > 0 ? 1e300 : 0);
  };
  set.of_input.resize(lights.size());
  for (const bool infinite : {true, false}) {
    for (size_t i = 0; i < lights.size(); ++i) {
      if (infinite) check(lights[i], textures.size());
      if (is_infinite(lights[i].kind) != infinite) continue;
      set.of_input[i] = static_cast<uint32_t>(set.records.size());
      const Made made = make_light(set, lights[i], scene_radius, textures);
      set.records.push_back(made.record);
      powers.push_back(power_of(made));
    }
    if (infinite) set.infinite_count = static_cast<uint32_t>(set.records.size());
  }
  set.first_triangle = static_cast<uint32_t>(set.records.size());
  set.records.resize(set.first_triangle + triangle_count);
  powers.resize(set.records.size());
  constexpr size_t kChunk = 4096;
  parallel_for((triangle_count + kChunk - 1) / kChunk, [&](size_t chunk) {
    const size_t end = std::min(triangle_count, (chunk + 1) * kChunk);
    for (size_t i = chunk * kChunk; i < end; ++i) {
      const Made made = make_triangle(triangle(i));
      set.records[set.first_triangle + i] = made.record;
      powers[set.first_triangle + i] = power_of(made);
    }
  });

  for (const double power : powers) set.total_power += power;
  std::vector<float> probability;
  build_alias_table(powers, set.alias, probability);
  for (size_t i = 0; i < set.records.size(); ++i) set.records[i].pick_pdf = probability[i];
  return set;
}

void build_alias_table(std::span<const double> weights, std::vector<AliasEntry>& table,
                       std::vector<float>& probability) {
  const size_t n = weights.size();
  table.assign(n, {0, 0});
  probability.assign(n, 0);
  double total = 0, largest = 0;
  size_t lit = 0;
  for (const double w : weights) {
    largest = std::max(largest, w);
    lit += w > 0;
  }
  for (size_t i = 0; i < n; ++i) table[i].alias = static_cast<uint32_t>(i);
  if (lit == 0) return;
  for (const double w : weights) total += w / largest;

  // Share of the uniform floor: 1 %, or what gives each light 4 of the 2^24 random numbers.
  constexpr double kNumbers = 16777216.0;
  const double floor_share = std::min(0.5, std::max(0.01, 4 * static_cast<double>(lit) / kNumbers));
  std::vector<double> scaled(n);  // n times the probability
  std::vector<uint32_t> small, large;
  for (size_t i = 0; i < n; ++i) {
    const double p = weights[i] > 0 ? (1 - floor_share) * (weights[i] / largest / total) +
                                          floor_share / static_cast<double>(lit)
                                    : 0;
    scaled[i] = p * static_cast<double>(n);
    (scaled[i] < 1 ? small : large).push_back(static_cast<uint32_t>(i));
  }
  // Thresholds are multiples of 2^-24 so that comparing with them is exact.
  const auto keep = [&](uint32_t i, double part) {
    table[i].threshold =
        static_cast<float>(std::clamp(std::nearbyint(part * kNumbers), 0.0, kNumbers) / kNumbers);
  };
  while (!small.empty() && !large.empty()) {
    const uint32_t s = small.back(), l = large.back();
    small.pop_back();
    keep(s, scaled[s]);
    table[s].alias = l;
    scaled[l] = (scaled[l] + scaled[s]) - 1;
    if (scaled[l] < 1) {
      large.pop_back();
      small.push_back(l);
    }
  }
  for (const uint32_t i : large) keep(i, 1);
  // Left by rounding: full bins, or empty ones that any light may fill.
  const auto brightest =
      static_cast<uint32_t>(std::max_element(weights.begin(), weights.end()) - weights.begin());
  for (const uint32_t i : small) {
    keep(i, weights[i] > 0 ? 1 : 0);
    table[i].alias = weights[i] > 0 ? i : brightest;
  }

  // Count the numbers k of 2^24 that lead to each light: those of bin b are ceil(b 2^24 / n) and
  // on; the kept ones have k n - b 2^24 < threshold 2^24.
  std::vector<uint64_t> hits(n, 0);
  const auto ceil_div = [](uint64_t a, uint64_t b) { return (a + b - 1) / b; };
  constexpr uint64_t kAll = uint64_t{1} << 24;
  for (size_t b = 0; b < n; ++b) {
    const uint64_t begin = ceil_div(b * kAll, n), end = ceil_div((b + 1) * kAll, n);
    const auto part = static_cast<uint64_t>(double{table[b].threshold} * kNumbers);
    const uint64_t middle = std::clamp(ceil_div(b * kAll + part, n), begin, end);
    hits[b] += middle - begin;
    hits[table[b].alias] += end - middle;
  }
  for (size_t i = 0; i < n; ++i)
    probability[i] = static_cast<float>(static_cast<double>(hits[i]) / kNumbers);
}

}  // namespace wavecomb
