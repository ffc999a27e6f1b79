// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/curve/intersect.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "wavecomb/geometry/curve/bezier.h"
#include "wavecomb/geometry/curve/points_at.h"
#include "wavecomb/geometry/curve/segment.h"
#include "wavecomb/geometry/curve/sub_segments.h"
#include "wavecomb/geometry/gaussian_splat/gaussian_splat.h"

namespace wavecomb {
namespace {

using namespace curve_math;

uint32_t first_point(const Mesh& mesh, uint32_t prim) {
  return mesh.indices[prim] & kCurveFirstPoint;
}

/// Intersection of a ray with one curve segment.
class SegmentTest {
 public:
  SegmentTest(const Mesh& mesh, uint32_t prim, const PointsAt& points, const RaySpace& ray,
              float tfar, CurveQuery query, CurveHits& hits)
      : mesh_(mesh),
        prim_(prim),
        first_(first_point(mesh, prim)),
        cubic_(mesh.is_cubic()),
        ray_(ray),
        z_far_(tfar * ray.length),
        query_(query),
        hits_(hits),
        points_(points) {
    const uint32_t n = cubic_ ? 4 : 2;
    for (uint32_t k = 0; k < n; ++k) {
      curve_.p[k] = ray.point(widen(points.position(first_ + k)));
      curve_.r[k] = mesh.radii[first_ + k];
      if (mesh.is_ribbon()) normal_[k] = ray.vector(widen(points.normal(first_ + k)));
    }
    if (cubic_) return;
    Bezier::line(curve_.p);
    Bezier::line(curve_.r);
    Bezier::line(normal_);
  }

  /// Finds hits on the sub-segment with index `node`. Skips hits on the inside of the tube if
  /// `outside` is true.
  void run(bool outside, uint32_t node) {
    side_ = -1;
    // Search for entry points behind the ray origin as well, since the ray may start inside the
    // tube.
    if (mesh_.is_ribbon() || outside) z_near_ = 0;
    // A ray that starts inside the tube may leave the tube in another sub-segment, so search the
    // whole segment.
    if (mesh_.is_ribbon() || outside) return search_node(node);
    if (passes_by(curve_, *std::max_element(curve_.r, curve_.r + 4))) return;
    const int halvings = depth();
    search(curve_, 0, 1, halvings);
    if (query_ == CurveQuery::kAny && !hits_.empty()) return;
    if (!may_be_inside_ && (query_ != CurveQuery::kAll || hits_.empty())) return;
    side_ = 1;
    z_near_ = 0;
    search(curve_, 0, 1, halvings);
  }

 private:
  /// Returns the number of halvings after which sub-segments deviate from straight lines by less
  /// than a fraction of the radius (bound by Wang, 1984). Sets `bulge_` to this deviation.
  int depth() {
    double bend = 0;
    for (int i = 0; i < 2; ++i) {
      const V d = curve_.p[i] - curve_.p[i + 1] * 2.0 + curve_.p[i + 2];
      bend = std::max(bend, dot_d(d, d));
    }
    const double r = *std::max_element(curve_.r, curve_.r + 4);
    bulge_ = 0.75 * std::sqrt(bend);
    const double sub_segments4 = bulge_ / std::max(kStraight * r, 1e-300);  // sub-segments^2
    int halvings = mesh_.is_ribbon() ? kRibbonHalvings : 0;
    while (halvings < kMaxHalvings && sub_segments4 > static_cast<double>(1u << (2 * halvings)))
      ++halvings;
    bulge_ /= static_cast<double>(1u << (2 * halvings));
    return halvings;
  }

  /// Returns whether the whole convex hull of a sub-segment lies on one side of the ray in the
  /// direction perpendicular to the chord, so that the ray misses the hull.
  static bool passes_by(const Bezier& sub_segment, double r) {
    const double x = sub_segment.p[3].x - sub_segment.p[0].x,
                 y = sub_segment.p[3].y - sub_segment.p[0].y;
    const auto cross_z = [&](int k) { return x * sub_segment.p[k].y - y * sub_segment.p[k].x; };
    const double b0 = cross_z(0), b1 = cross_z(1), b2 = cross_z(2);  // cross_z(3) equals cross_z(0)
    const double least = std::min(b0, std::min(b1, b2)), most = std::max(b0, std::max(b1, b2));
    const double reach = r * r * (x * x + y * y) * (1 + 1e-9);
    return (least > 0 && least * least > reach) || (most < 0 && most * most > reach);
  }

  /// Searches for hits in the sub-segment with index `node`, or in a longer sub-segment that
  /// contains it and is straight enough.
  void search_node(uint32_t node) {
    int halvings = depth();
    Bezier sub_segment = curve_;
    double u0 = 0, u1 = 1;
    for (uint32_t bit = std::bit_floor(node) / 2; bit > 0 && halvings > 0; bit /= 2, --halvings) {
      const bool second = (node & bit) != 0;
      Bezier::keep_half(sub_segment.p, second);
      Bezier::keep_half(sub_segment.r, second);
      (second ? u0 : u1) = 0.5 * (u0 + u1);
    }
    search(sub_segment, u0, u1, halvings);
  }

  /// Halves a sub-segment recursively as long as the ray may hit its convex hull.
  void search(const Bezier& sub_segment, double u0, double u1, int halvings) {
    const double r = *std::max_element(sub_segment.r, sub_segment.r + 4);
    if (passes_by(sub_segment, r)) return;
    const auto misses = [&](double V::* axis, double lo, double hi) {
      double least = sub_segment.p[0].*axis, most = least;
      for (int k = 1; k < 4; ++k) {
        least = std::min(least, sub_segment.p[k].*axis);
        most = std::max(most, sub_segment.p[k].*axis);
      }
      return least - r > hi || most + r < lo;
    };
    if (misses(&V::x, 0, 0) || misses(&V::y, 0, 0) || misses(&V::z, z_near_, z_far_)) return;
    if (halvings == 0)
      return mesh_.is_ribbon() ? intersect_ribbon(u0, u1) : intersect_tube(u0, u1, side_);
    if (halvings <= kLaneHalvings && !mesh_.is_ribbon())
      return search_sub_segments(sub_segment, r, u0, u1, halvings);
    Bezier a, b;
    Bezier::split(sub_segment.p, a.p, b.p);
    Bezier::split(sub_segment.r, a.r, b.r);
    const double middle = 0.5 * (u0 + u1);
    search(a, u0, middle, halvings - 1);
    if (query_ == CurveQuery::kAny && !hits_.empty()) return;
    search(b, middle, u1, halvings - 1);
  }

  /// Splits a sub-segment of a tube into nearly straight sub-segments and tests all of them at
  /// once.
  void search_sub_segments(const Bezier& sub_segment, double r, double u0, double u1,
                           int halvings) {
    uint32_t left = sub_segments_near(sub_segment, halvings, r, bulge_, z_near_, z_far_);
    const double step = (u1 - u0) / (1 << halvings);
    for (; left != 0; left &= left - 1) {
      const double from = u0 + std::countr_zero(left) * step;
      intersect_tube(from, from + step, side_);
      if (query_ == CurveQuery::kAny && !hits_.empty()) return;
    }
  }

  /// Returns a step in u towards the entry or exit of a tube. The ray intersects the sphere of
  /// parameter u at z(u) -+ sqrt(h(u)), where h = r^2 - x^2 - y^2. The ray enters the tube where z
  /// - sqrt(h) is minimal (side -1) and leaves the tube where z + sqrt(h) is maximal (side 1). If
  /// the curve and its radius are linear near u, the condition for an extremum at u + w is
  ///   A w + B = -side z' sqrt(h),  A = r'^2 - x'^2 - y'^2,  B = r r' - x x' - y y'.
  /// In this approximation, the tube is a cone with spherical ends. The condition is exact at w =
  /// 0.
  double step(double u, int side) const {
    const V c = curve_.at(u), d = curve_.along(u);
    const double r = curve_.radius(u), dr = curve_.widening(u);
    const double a = dr * dr - d.x * d.x - d.y * d.y, b = r * dr - c.x * d.x - c.y * d.y;
    const double h = r * r - c.x * c.x - c.y * c.y, k = d.z * d.z - a;
    // The spheres are nested, so the tube has no lateral surface here.
    if (!(k > 0)) return dr > 0 ? kFar : -kFar;
    const double discriminant = b * b - a * h;
    if (discriminant < 0) {
      // The ray misses this cone, so step to the parameter where the distance is smallest.
      if (a < 0) return -b / a;
      return side * d.z > 0 ? kFar : -kFar;  // the ray stays inside the cone
    }
    const double q = -side * d.z * std::sqrt(discriminant / k);
    // Choose the formula that computes the root without cancellation.
    double w = 0;
    if (q * b > 0)
      w = (b * b - d.z * d.z * h) / (k * (q + b));
    else if (a != 0)
      w = (q - b) / a;
    // Roots where the radius is negative lie on the other half of the double cone and are not
    // extrema.
    return r + dr * w >= 0 ? w : std::copysign(kFar, dr);
  }

  /// Adds the hit at the entry (`side` -1) or exit (`side` 1) in [u0, u1], if the steps from u0 and
  /// u1 both lead into the interval. The hit may also be on a spherical end of the whole curve.
  void intersect_tube(double u0, double u1, int side) {
    const double s0 = step(u0, side), s1 = step(u1, side);
    if (s0 > 0 && s1 < 0)
      intersect_tube_at(extreme_between(u0, s0, u1, s1, side), side);
    else if (u0 == 0 && s0 <= 0)
      intersect_tube_at(0, side);
    else if (u1 == 1 && s1 >= 0)
      intersect_tube_at(1, side);
  }

  /// Returns the root of step() between u0 and u1, by a bracketed secant method. The value of
  /// step() is s0 > 0 at u0 and s1 < 0 at u1.
  double extreme_between(double u0, double s0, double u1, double s1, int side) const {
    double before = s0 < -s1 ? u0 : u1, step_before = s0 < -s1 ? s0 : s1;
    double u = u0 + (u1 - u0) * (s0 / (s0 - s1));
    for (int i = 0; i < kSteps; ++i) {
      const double s = step(u, side);
      if (s == 0) break;
      (s > 0 ? u0 : u1) = u;
      const double slope = (s - step_before) / (u - before);
      double next = slope < 0 ? u - s / slope : u + s;
      if (!(next > u0 && next < u1)) next = 0.5 * (u0 + u1);
      before = u;
      step_before = s;
      u = next;
      // Stop here: the secant method converges superlinearly, so the next step would be negligible.
      if (std::abs(u - before) < kNear) break;
    }
    return u;
  }

  void intersect_tube_at(double u, int side) {
    const V c = curve_.at(u);
    const double r = curve_.radius(u), h = r * r - c.x * c.x - c.y * c.y;
    if (!(h >= 0 && r > 0)) return;
    const double z = c.z + side * std::sqrt(h);
    const V n = V{-c.x, -c.y, z - c.z} * (1 / r);
    const bool is_inside =
        (u == 0 && continues_at(n, kCurveContinuesBefore, 0, first_ - 1)) ||
        (u == 1 && continues_at(n, kCurveContinuesAfter, 3, first_ + (cubic_ ? 4 : 2)));
    if (!(z > 0) || is_inside)
      may_be_inside_ = true;
    else if (z <= z_far_)
      add_tube(z, u, ray_.back(n));
  }

  /// Returns whether the tube continues at an end and the normal `n` of the spherical end points
  /// into the adjoining segment.
  bool continues_at(const V& n, uint32_t flag, int end, uint32_t next) const {
    if ((mesh_.indices[prim_] & flag) == 0) return false;
    const V d = ray_.point(widen(points_.position(next))) - curve_.p[end];
    const double dr = mesh_.radii[next] - curve_.r[end];
    return dot_d(n, d) + dr > kSeam * std::sqrt(dot_d(d, d));
  }

  /// Adds a hit on a tube, with the coordinates (u, v) from which shading reconstructs the point.
  void add_tube(double z, double u, const V& normal) {
    if (query_ == CurveQuery::kAny) return add(z, 0, 0);
    CurveSegment<float> s;
    s.cubic = cubic_;
    for (uint32_t k = 0; k < 4; ++k) {
      const uint32_t i = first_ + (cubic_ || k < 2 ? k : 1);
      s.p[k] = points_.position(i);
      s.r[k] = mesh_.radii[i];
    }
    auto along = static_cast<float>(u);
    const TubeFrame<float> tube = tube_frame<float>(s, curve_point<float>(s, along));
    const Vec3<float> n = tube.frame.to_local(narrow(normal));
    if (u == 0 || u == 1) {
      const float polar = atan2(std::sqrt(n.x * n.x + n.y * n.y), n.z);
      const float beyond = polar - atan2(tube.sin_side, tube.cos_side);
      along = u == 0 ? -std::max(beyond, 0.f) : 1.f + std::max(-beyond, 0.f);
    }
    add(z, along, atan2(n.y, n.x) * kInv2Pi);
  }

  /// Returns the signed distance of the ray from the ribbon's centre line c = (x, y, z), measured
  /// along the width direction b = c' x n. The ray, which is the z axis, hits the ribbon at the
  /// parameter u where x b_y = y b_x.
  double across(double u) const {
    const V c = curve_.at(u), b = cross_d(curve_.along(u), Bezier::mix(normal_, u));
    return c.x * b.y - c.y * b.x;
  }

  void intersect_ribbon(double u0, double u1) {
    const double f0 = across(u0), f1 = across(u1);
    if ((f0 < 0) != (f1 < 0)) return intersect_ribbon_between(u0, f0, u1, f1);
    // A ray that is nearly parallel to a ribbon may hit it twice. Test whether across() changes
    // sign at the extremum of the parabola through its values at both ends and the midpoint.
    const double slope = f1 - f0, bend = 2 * (f0 + f1) - 4 * across(0.5 * (u0 + u1));
    const double at = bend != 0 ? 0.5 - 0.5 * slope / bend : -1;
    if (!(at > 0 && at < 1)) return;
    const double um = u0 + at * (u1 - u0), fm = across(um);
    if ((fm < 0) == (f0 < 0)) return;
    intersect_ribbon_between(u0, f0, um, fm);
    intersect_ribbon_between(um, fm, u1, f1);
  }

  /// Finds the hit between two parameters at which across() has different signs, by the Illinois
  /// method (regula falsi).
  void intersect_ribbon_between(double u0, double f0, double u1, double f1) {
    double u = u0;
    // end of the bracket that the last step did not change: -1 for the lower, 1 for the upper end
    int kept = 0;
    for (int i = 0; i < kRibbonSteps && u1 - u0 > 1e-15; ++i) {
      u = std::clamp((f1 * u0 - f0 * u1) / (f1 - f0), u0, u1);
      const double f = across(u);
      if (f == 0) break;
      if ((f < 0) == (f0 < 0)) {
        if (kept == 1) f1 *= 0.5;
        u0 = u, f0 = f, kept = 1;
      } else {
        if (kept == -1) f0 *= 0.5;
        u1 = u, f1 = f, kept = -1;
      }
    }
    V b = cross_d(curve_.along(u), Bezier::mix(normal_, u));
    b = b * (1 / std::sqrt(dot_d(b, b)));
    const V c = curve_.at(u);
    const double r = curve_.radius(u), s = -(c.x * b.x + c.y * b.y) / (r * (b.x * b.x + b.y * b.y));
    if (!(std::abs(s) <= 1)) return;
    const double z = c.z + s * r * b.z;
    if (z > 0 && z <= z_far_) add(z, static_cast<float>(u), static_cast<float>(0.5 * s + 0.5));
  }

  void add(double z, float u, float v) {
    const CurveHit hit{static_cast<float>(z / ray_.length), u, v < 0 ? v + 1 : v};
    // Skip a hit that the adjacent sub-segment has already found.
    for (const CurveHit& known : hits_)
      if (std::abs(known.u - u) < 1e-6f && std::abs(known.t - hit.t) <= 1e-6f * hit.t) return;
    if (hit.t > 0) hits_.add(hit);
  }

  /// Maximum deviation of the final sub-segments from straight lines, as a fraction of the radius.
  static constexpr double kStraight = 0.025;
  static constexpr int kMaxHalvings = 9, kRibbonHalvings = 3;
  static constexpr int kSteps = 40, kRibbonSteps = 100;
  /// Step size in u at which the search for an extremum ends.
  static constexpr double kNear = 1e-9;
  static constexpr double kFar = 2;  ///< step in u that leaves the segment from any u
  /// Sine of the angle by which the spherical ends of adjoining segments overlap, to prevent gaps.
  static constexpr double kSeam = 1e-3;

  const Mesh& mesh_;
  const uint32_t prim_, first_;
  const bool cubic_;
  const RaySpace& ray_;
  const double z_far_;
  const CurveQuery query_;
  CurveHits& hits_;
  const PointsAt& points_;
  Bezier curve_;
  V normal_[4];
  double bulge_ = 0;            ///< deviation of the final sub-segments from straight lines
  double z_near_ = -kInfinity;  ///< smallest z of entry points to search for
  int side_ = -1;               ///< -1 to search for entry points, 1 for exit points
  /// Whether the ray may start inside the tube: it entered behind its origin or through the
  /// adjoining segment.
  bool may_be_inside_ = false;
};

void intersect_sphere(const Mesh& mesh, uint32_t prim, const PointsAt& points, const RaySpace& ray,
                      float tfar, bool outside, CurveHits& hits) {
  const V c = ray.point(widen(points.position(prim)));
  const double r = mesh.radii[prim], h = r * r - c.x * c.x - c.y * c.y;
  if (!(h >= 0) || r == 0) return;
  for (const double side : {-1.0, 1.0}) {
    if (outside && side > 0) break;
    const double z = c.z + side * std::sqrt(h), t = z / ray.length;
    if (!(t > 0 && t <= tfar)) continue;
    const Vec3<float> n = narrow(ray.back({-c.x, -c.y, z - c.z}));
    const float phi = atan2(n.y, n.x) * kInv2Pi;
    hits.add({static_cast<float>(t), phi < 0 ? phi + 1 : phi,
              atan2(std::sqrt(n.x * n.x + n.y * n.y), n.z) * kInvPi});
  }
}

}  // namespace

Bounds curve_bounds(const Mesh& mesh, uint32_t prim, uint32_t step) {
  const bool point = mesh.is_dots();
  const size_t first = point ? prim : first_point(mesh, prim);
  const size_t n = point ? 1 : mesh.segment_points();
  Bounds box;
  for (size_t k = first; k < first + n; ++k) {
    const float* p = &mesh.positions[3 * (step * mesh.vertex_count() + k)];
    const Vec3<float> r =
        mesh.splats.empty() ? Vec3<float>(mesh.radii[k]) : gaussian_splat_extent(mesh.splats[k]);
    const auto reach = [](float x, float by) { return 1e-6f * std::abs(x) + 1.00001f * by; };
    const Vec3<float> by(reach(p[0], r.x), reach(p[1], r.y), reach(p[2], r.z));
    box.add({p[0] - by.x, p[1] - by.y, p[2] - by.z});
    box.add({p[0] + by.x, p[1] + by.y, p[2] + by.z});
  }
  return box;
}

CurveHits intersect_curve(const Mesh& mesh, const SubSegment& sub_segment, const CurveRay& of,
                          float tfar, CurveQuery query, float time, bool outside) {
  const RaySpace& ray = of.space;
  const PointsAt points(mesh, time);
  CurveHits hits;
  if (mesh.primitive == Primitive::kSphere)
    intersect_sphere(mesh, sub_segment.prim, points, ray, tfar, outside, hits);
  else if (mesh.primitive == Primitive::kGaussianSplat)
    intersect_gaussian_splat(mesh.splats[sub_segment.prim], points.position(sub_segment.prim), of,
                             tfar, hits);
  else
    SegmentTest(mesh, sub_segment.prim, points, ray, tfar, query, hits)
        .run(outside, sub_segment.node);
  return hits;
}

}  // namespace wavecomb
