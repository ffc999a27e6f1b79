// SPDX-License-Identifier: Apache-2.0
/// Charts of lights as seen from a point, for chi_square.h. Each light has a chart on its surface,
/// so cells resolve narrow and wide lights equally well, and edges of lights are edges of charts.
/// All quantities are computed in double precision, without code of the renderer.
///
///    rect      fractions of its edges
///    disk      squared distance from its centre, azimuth
///    triangle  (b1 + b2)^2, b2 / (b1 + b2)
///    sphere    1 - cos of the angle to its centre, azimuth, both relative to the visible cone
///    cylinder  angle across, relative to the visible range; fraction of the axis
///    distant   as sphere
///    dome      x and y of its image, y down; portals have separate charts, after those of
///              all lights; where several overlap, the chart of the first one
/// Points and distant lights of angle 0 have empty charts.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "chi_square.h"
#include "light_testing.h"
#include "parts.h"

namespace wavecomb::light_testing {

/// A vector in double precision.
struct D3 {
  double x = 0, y = 0, z = 0;
  D3() = default;
  D3(double x_, double y_, double z_) : x(x_), y(y_), z(z_) {}
  explicit D3(const float* v) : x(v[0]), y(v[1]), z(v[2]) {}
  explicit D3(const Vec3<float>& v) : x(v.x), y(v.y), z(v.z) {}
  D3 operator+(const D3& b) const { return {x + b.x, y + b.y, z + b.z}; }
  D3 operator-(const D3& b) const { return {x - b.x, y - b.y, z - b.z}; }
  D3 operator-() const { return {-x, -y, -z}; }
  D3 operator*(double s) const { return {x * s, y * s, z * s}; }
};
inline double dot(const D3& a, const D3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline D3 cross(const D3& a, const D3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double length(const D3& a) {
  return std::sqrt(dot(a, a));
}
inline D3 unit(const D3& a) {
  return a * (1 / length(a));
}

class LightCharts {
 public:
  /// The light view and the arrays that it points to must outlive this object.
  LightCharts(const LightView& view, const Vec3<float>& from) : view_(view), from_(from) {
    for (uint32_t i = 0; i < view.count; ++i) seen_.push_back(see(i));
    for (uint32_t i = 0; i < view.infinite_count; ++i) {
      const uint32_t group = view.lights[i].portals;
      if (group == kNoPortals) continue;
      const PortalGroup& portals = view.portal_groups[group];
      seen_[i].first_portal = static_cast<uint32_t>(seen_.size());
      seen_[i].portals = portals.count;
      for (uint32_t k = 0; k < portals.count; ++k) {
        const LightRecord& r = view.portals[portals.first + k];
        Seen s;
        s.light = i;
        make_flat(s, D3(r.p), D3(r.u), D3(r.v), 1);
        s.is_seen = -dot(s.p, D3(r.n)) > 0;
        seen_.push_back(s);
      }
    }
  }
  /// Returns the light that a chart belongs to.
  uint32_t light(uint32_t chart) const { return seen_[chart].light; }

  std::vector<chi_square::Chart> charts() const {
    std::vector<chi_square::Chart> charts(seen_.size());
    for (uint32_t i = 0; i < view_.first_triangle; ++i) {
      const LightRecord& r = view_.lights[i];
      if (r.texture == kNoTexture || r.distribution == kNoDistribution) continue;
      charts[i].columns = view_.distributions[r.distribution].width;
      charts[i].rows = view_.distributions[r.distribution].height;
    }
    return charts;
  }

  /// Ray from the receiver to a point of a chart.
  struct Ray {
    D3 dir;
    double distance = 0;
    double solid_angle = 0;
  };
  Ray ray(const chi_square::Place& p) const {
    Ray r = any_ray(p);
    const uint32_t of = seen_[p.chart].light;
    // This direction belongs to the chart of a portal. Set its solid angle in this chart to 0.
    if (r.solid_angle > 0 && seen_[of].portals > 0 && portal(of, r.dir) != p.chart)
      r.solid_angle = 0;
    if (seen_[p.chart].light != p.chart) r.distance = double{kFarAway};
    return r;
  }

  /// Returns the chart point at which the unit direction hits `light`, or the nearest chart point
  /// if rounding makes the direction miss the light.
  chi_square::Place place(uint32_t light, const Vec3<float>& direction) const {
    const D3 w(direction);
    const uint32_t chart = seen_[light].portals > 0 ? portal(light, w) : light;
    const std::array<double, 2> at = any_place(seen_[chart], w);
    return {chart, std::clamp(at[0], 0.0, 1.0), std::clamp(at[1], 0.0, 1.0)};
  }

 private:
  struct Seen {
    LightKind kind = LightKind::kRect;
    uint32_t light = 0, first_portal = 0, portals = 0;
    bool is_seen = true;
    D3 p, u, v, n;
    double area = 0;
    double size = 0;
    double distance = 0;
    double radius = 0, begin = 0, axis = 0;
  };

  /// Returns the chart of the first portal of dome `light` that a direction passes through, or else
  /// the chart of the dome.
  uint32_t portal(uint32_t light, const D3& w) const {
    for (uint32_t k = 0; k < seen_[light].portals; ++k) {
      const uint32_t chart = seen_[light].first_portal + k;
      const Seen& s = seen_[chart];
      const double t = dot(s.p, s.n) / dot(w, s.n);
      if (!s.is_seen || !(t > 0)) continue;
      const std::array<double, 2> at = flat_place(s, w);
      if (at[0] >= 0 && at[0] <= 1 && at[1] >= 0 && at[1] <= 1) return chart;
    }
    return light;
  }

  Ray any_ray(const chi_square::Place& p) const {
    const Seen& s = seen_[p.chart];
    if (!s.is_seen) return {};
    switch (s.kind) {
      case LightKind::kRect:
      case LightKind::kDisk:
      case LightKind::kTriangle:
        return flat_ray(s, p);
      case LightKind::kSphere:
      case LightKind::kDistant:
        return cone_ray(s, p);
      case LightKind::kCylinder:
        return cylinder_ray(s, p);
      case LightKind::kDome:
        break;
    }
    const double theta = kPiD * p.y, lon = 2 * kPiD * (0.5 - p.x), sine = std::sin(theta);
    return {s.u * (sine * std::sin(lon)) + s.v * std::cos(theta) + s.n * (sine * std::cos(lon)),
            double{kFarAway}, 2 * kPiD * kPiD * sine};
  }

  static std::array<double, 2> any_place(const Seen& s, const D3& w) {
    switch (s.kind) {
      case LightKind::kRect:
      case LightKind::kDisk:
      case LightKind::kTriangle:
        return flat_place(s, w);
      case LightKind::kSphere:
      case LightKind::kDistant:
        return cone_place(s, w);
      case LightKind::kCylinder:
        return cylinder_place(s, w);
      case LightKind::kDome:
        break;
    }
    const double x = dot(w, s.u), y = dot(w, s.v), z = dot(w, s.n);
    return {0.5 - std::atan2(x, z) / (2 * kPiD), std::atan2(std::hypot(x, z), y) / kPiD};
  }

  Seen see(uint32_t light) const {
    Seen s;
    s.light = light;
    if (light >= view_.first_triangle) {
      const TriangleLight& t = view_.triangles[light - view_.first_triangle];
      s.kind = LightKind::kTriangle;
      make_flat(s, D3(t.p), D3(t.u), D3(t.v), 0.5);
      return s;
    }
    const LightRecord& r = view_.lights[light];
    s.kind = static_cast<LightKind>(r.kind);
    s.radius = r.radius;
    const D3 to = D3(r.p) - D3(from_);
    switch (s.kind) {
      case LightKind::kRect:
        make_flat(s, D3(r.p), D3(r.u), D3(r.v), 1);
        break;
      case LightKind::kDisk:
        make_flat(s, D3(r.p), D3(r.u), D3(r.v), kPiD);
        break;
      case LightKind::kSphere: {
        s.distance = length(to);
        s.is_seen = s.radius > 0 && s.distance > s.radius;
        if (!s.is_seen) break;
        const double sine = s.radius / s.distance, sin2 = sine * sine;
        make_cone(s, to, sin2 / (1 + std::sqrt(1 - sin2)));
        break;
      }
      case LightKind::kDistant:
        s.is_seen = r.one_minus_cos > 0;
        if (s.is_seen) make_cone(s, -D3(r.n), r.one_minus_cos);
        break;
      case LightKind::kCylinder: {
        const D3 axis = D3(r.u);
        s.axis = length(axis);
        s.u = unit(axis);
        s.begin = dot(to, s.u);
        const D3 across = to - s.u * s.begin;
        s.distance = length(across);
        s.is_seen = s.distance > s.radius;
        if (!s.is_seen) break;
        s.v = unit(across);
        s.n = cross(s.u, s.v);
        s.size = std::asin(s.radius / s.distance);
        break;
      }
      case LightKind::kDome:
        s.u = D3(r.u);
        s.v = D3(r.v);
        s.n = D3(r.n);
        break;
      case LightKind::kTriangle:
        break;  // no packed record
    }
    return s;
  }
  void make_flat(Seen& s, const D3& p, const D3& u, const D3& v, double shape) const {
    s.p = p - D3(from_);
    s.u = u;
    s.v = v;
    const D3 m = cross(u, v);
    s.area = shape * length(m);
    s.n = unit(m);
  }
  static void make_cone(Seen& s, const D3& axis, double one_minus_cos) {
    s.u = unit(axis);
    s.v = unit(cross(s.u, std::abs(s.u.x) < 0.6 ? D3(1, 0, 0) : D3(0, 1, 0)));
    s.n = cross(s.u, s.v);
    s.size = one_minus_cos;
  }

  static Ray flat_ray(const Seen& s, const chi_square::Place& p) {
    double a = p.x, b = p.y;
    if (s.kind == LightKind::kDisk) {
      const double r = std::sqrt(p.x), phi = 2 * kPiD * p.y;
      a = r * std::cos(phi);
      b = r * std::sin(phi);
    } else if (s.kind == LightKind::kTriangle) {
      const double sum = std::sqrt(p.x);
      a = sum * (1 - p.y);
      b = sum * p.y;
    }
    const D3 d = s.p + s.u * a + s.v * b;
    const double t = length(d);
    const D3 w = d * (1 / t);
    return {w, t, s.area * std::abs(dot(w, s.n)) / (t * t)};
  }
  static std::array<double, 2> flat_place(const Seen& s, const D3& w) {
    const double t = dot(s.p, s.n) / dot(w, s.n);
    const D3 h = w * t - s.p, m = cross(s.u, s.v);
    const double m2 = dot(m, m), a = dot(cross(h, s.v), m) / m2, b = dot(cross(s.u, h), m) / m2;
    if (s.kind == LightKind::kDisk) {
      const double turn = std::atan2(b, a) / (2 * kPiD);
      return {a * a + b * b, turn < 0 ? turn + 1 : turn};
    }
    if (s.kind == LightKind::kTriangle) return {(a + b) * (a + b), a + b > 0 ? b / (a + b) : 0};
    return {a, b};
  }

  static Ray cone_ray(const Seen& s, const chi_square::Place& p) {
    const double h = p.x * s.size, sine = std::sqrt(h * (2 - h)), phi = 2 * kPiD * p.y;
    const D3 w = s.u * (1 - h) + s.v * (sine * std::cos(phi)) + s.n * (sine * std::sin(phi));
    double t = kFarAway;
    if (s.kind == LightKind::kSphere) {
      const double off = s.distance * sine;
      t = s.distance * (1 - h) - std::sqrt(std::max(0.0, s.radius * s.radius - off * off));
    }
    return {w, t, 2 * kPiD * s.size};
  }
  static std::array<double, 2> cone_place(const Seen& s, const D3& w) {
    const double x = dot(w, s.v), y = dot(w, s.n), z = dot(w, s.u), r2 = x * x + y * y;
    const double length = std::sqrt(r2 + z * z);
    const double h = z > 0 ? r2 / (length * (length + z)) : 1 - z / length;
    const double turn = std::atan2(y, x) / (2 * kPiD);
    return {h / s.size, turn < 0 ? turn + 1 : turn};
  }

  /// Returns the distance from the receiver to the near side of a cylinder, in the plane
  /// perpendicular to its axis and at an angle from the direction to the axis.
  static double across(const Seen& s, double angle) {
    const double off = s.distance * std::sin(angle);
    return s.distance * std::cos(angle) - std::sqrt(std::max(0.0, s.radius * s.radius - off * off));
  }
  static Ray cylinder_ray(const Seen& s, const chi_square::Place& p) {
    const double angle = (2 * p.x - 1) * s.size, flat = across(s, angle);
    const double z = s.begin + p.y * s.axis, t = std::hypot(flat, z);
    const D3 w = (s.v * (flat * std::cos(angle)) + s.n * (flat * std::sin(angle)) + s.u * z);
    // The solid angle element is d(angle) d(sin gamma), where sin gamma = z / t for the ray to the
    // point.
    return {w * (1 / t), t, 2 * s.size * s.axis * flat * flat / (t * t * t)};
  }
  static std::array<double, 2> cylinder_place(const Seen& s, const D3& w) {
    const double x = dot(w, s.v), y = dot(w, s.n);
    const double angle = std::clamp(std::atan2(y, x), -s.size, s.size);
    const double z = across(s, angle) * dot(w, s.u) / std::hypot(x, y);
    return {0.5 * (angle / s.size + 1), (z - s.begin) / s.axis};
  }

  const LightView& view_;
  Vec3<float> from_;
  std::vector<Seen> seen_;
};

/// Makes a chi-square case of sample_light() for one receiver and all lights of a view. It tests
/// the selection of the light together with the point on the light. Lights without extent are
/// atoms.
///
/// The expected density is the light sampling density that MIS uses when a ray hits a light; it is
/// 0 where no light arrives. A sample agrees if its density and weight equal the values for a ray
/// that hits the light at the same point.
inline chi_square::Case light_case(std::string name, const LightView& view,
                                   const LightReceiver<float>& receiver) {
  struct Seen {
    LightView view;
    LightReceiver<float> to;
    LightCharts charts;
    Seen(const LightView& v, const LightReceiver<float>& r) : view(v), to(r), charts(view, r.p) {}

    LightHit<float> hit(uint32_t light, const Vec3<float>& dir, float distance) const {
      LightHit<float> h{Color<float>(1.f), 0.f};
      if (light < view.infinite_count) {
        const LightRecord& r = view.lights[light];
        const bool is_dome = r.kind == static_cast<uint32_t>(LightKind::kDome);
        h.pdf = is_dome ? detail::hit_dome_from<float>(view, r, to.p, dir, true).pdf
                        : detail::hit_distant<float>(detail::LightReader<float>(r, true), dir).pdf;
        h.pdf *= view.by_tree ? view.tree.infinite_pdf[light] : r.selection_pdf;
        h.radiance = infinite_light_radiance<float>(
            view, light, {.from = to.p, .dir = dir, .is_delta = true}, true);
      } else if (light < view.first_triangle) {
        h = light_hit<float>(view, light, to, dir, distance, true);
      } else {
        h.pdf = triangle_light_pdf<float>(view, light, to, dir, distance, true);
      }
      if (is_black(h.radiance)) h.pdf = 0;
      return h;
    }
  };
  const auto seen = std::make_shared<const Seen>(view, receiver);
  chi_square::Case c;
  c.name = std::move(name);
  c.charts = seen->charts.charts();
  c.is_smooth = false;
  // The density can jump inside charts because of shaping cones, IES profiles and portals.
  const bool is_cut = view.shapings || view.portals;
  if (is_cut && c.charts.size() < 8) c.boxes = is_long() ? 256 : 32;
  c.density = [seen](const chi_square::Place& p) {
    const LightCharts::Ray ray = seen->charts.ray(p);
    if (!(ray.solid_angle > 0)) return 0.0;
    const Vec3<float> dir(static_cast<float>(ray.dir.x), static_cast<float>(ray.dir.y),
                          static_cast<float>(ray.dir.z));
    return double{
               seen->hit(seen->charts.light(p.chart), dir, static_cast<float>(ray.distance)).pdf} *
           ray.solid_angle;
  };
  c.draw = [seen](chi_square::Random& random, bool check) {
    LightReceiver<float> to = seen->to;
    if (seen->view.by_tree) to.seed = random.bits();
    const float pick = random(), u = random(), v = random();
    const auto s = sample_light<float>(seen->view, to, pick, u, v, true);
    if (!s.valid) return chi_square::Draw::nothing();
    const uint32_t light = select_light_index<float>(seen->view, to, pick, true);
    if (s.is_delta) return chi_square::Draw::of_atom(light, double{s.pdf});
    bool agrees = true;
    if (check) {
      const LightHit<float> h = seen->hit(light, s.wi, s.distance);
      const float radiance = s.weight.y * s.pdf;
      agrees = std::abs(h.pdf - s.pdf) < 2e-3f * s.pdf;
      if (light < seen->view.first_triangle)
        agrees &= std::abs(h.radiance.y - radiance) < 2e-3f * radiance + 1e-5f;
    }
    return chi_square::Draw::at(seen->charts.place(light, s.wi), agrees);
  };
  return c;
}

}  // namespace wavecomb::light_testing
