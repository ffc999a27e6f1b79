// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/accel/triangle_list.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "wavecomb/accel/presence.h"
#include "wavecomb/core/frame.h"
#include "wavecomb/core/lanes/lanes.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

constexpr float kUnbounded = std::numeric_limits<float>::infinity();

/// Stores the first `n` lanes of `value` at `p`, or all lanes if `value` has fewer than `n` lanes.
template <typename T>
void store_first(void* p, const T& value, size_t n) {
  if (n >= kWidth<T>) {
    store(p, value);
  } else {
    std::array<uint32_t, kWidth<T>> lanes;
    store(lanes.data(), value);
    std::memcpy(p, lanes.data(), 4 * n);
  }
}

}  // namespace

/// Functions that intersect packets of rays with a triangle list.
struct ListTracer {
  const TriangleList& list;
  const SceneView& scene;
  const RaySpan& rays;
  const PresenceKeys& keys;

  /// Intersection of rays with a plane at the distance `height / slope`. `slope` is at least 0.
  template <typename F>
  struct Plane {
    F height, slope;
  };
  /// Position of the rays relative to the edges of a triangle.
  template <typename F>
  struct Crossing {
    F b, c;      ///< barycentric coordinates of the second and third vertex, times `sum`
    F sum;       ///< twice the signed area of the triangle projected along the ray
    Mask<F> in;  ///< inside the triangle
  };

  /// Rays with the indices `base` to `base` + lane width - 1, and the vertex coordinates that the
  /// tests of these rays against all triangles share.
  template <typename F>
  struct Packet {
    Vec3<F> o, d;
    /// Coordinates of all vertices in the frame of each ray, whose z axis is along the ray.
    std::array<F, TriangleList::kMaxVertices> x, y;

    Packet(const TriangleList& list, const RaySpan& rays, size_t base)
        : o(load<F>(rays.ox + base), load<F>(rays.oy + base), load<F>(rays.oz + base)),
          d(load<F>(rays.dx + base), load<F>(rays.dy + base), load<F>(rays.dz + base)) {
      const Frame<F> frame = make_frame(d);
      for (size_t v = 0; v < list.vertices_.size(); ++v) {
        const float (&at)[3] = list.vertices_[v].p;
        const Vec3<F> p{F(at[0]) - o.x, F(at[1]) - o.y, F(at[2]) - o.z};
        x[v] = dot(p, frame.s);
        y[v] = dot(p, frame.t);
      }
    }

    WAVECOMB_INLINE Plane<F> plane(const TriangleList::Triangle& t) const {
      const Vec3<F> n(Vec3<float>{t.n[0], t.n[1], t.n[2]});
      const Vec3<F> p{F(t.p[0]) - o.x, F(t.p[1]) - o.y, F(t.p[2]) - o.z};
      const F slope = dot(n, d);
      const UInt<F> sign = float_bits<F>(slope) & 0x80000000u;
      return {bits_float<F>(float_bits<F>(dot(n, p)) ^ sign), abs(slope)};
    }

    WAVECOMB_INLINE Crossing<F> cross(const TriangleList::Triangle& t) const {
      const auto [i, j, k] = t.vertex;
      // Do not use fused multiply-add, so that the two triangles of a shared edge compute the same
      // products.
      const F a = x[k] * y[j] - y[k] * x[j], b = x[i] * y[k] - y[i] * x[k],
              c = x[j] * y[i] - y[j] * x[i];
      const F sum = a + b + c;
      const Mask<F> in(((min(a, min(b, c)) >= 0.f) | (max(a, max(b, c)) <= 0.f)) & (sum != 0.f));
      return {b, c, sum, in};
    }
  };

  /// Returns a mask of the lanes whose hits on the triangle `entry` are accepted by `accepts_hit`.
  template <typename F>
  Mask<F> accepted(const Mask<F>& in, uint32_t entry, const F& b, const F& c, const F& sum,
                   size_t base) const {
    const TriangleList::Triangle& t = list.triangles_[entry];
    const F u = b / sum, v = c / sum;
    std::array<uint32_t, kWidth<F>> keep{};
    for (uint32_t bits = lane_bits<F>(in); bits != 0; bits &= bits - 1) {
      const auto i = static_cast<size_t>(std::countr_zero(bits));
      const uint32_t slot = rays.slot ? rays.slot[base + i] : static_cast<uint32_t>(base + i);
      keep[i] = accepts_hit(scene,
                            {.instance = list.ids_.inst[entry],
                             .geom = list.ids_.geom[entry],
                             .mesh = t.mesh,
                             .prim = list.ids_.prim[entry],
                             .u = lane(u, i),
                             .v = lane(v, i),
                             .slot = slot,
                             .dir = {rays.dx[base + i], rays.dy[base + i], rays.dz[base + i]},
                             .time = rays.time ? rays.time[base + i] : 0.f},
                            keys);
    }
    return in & Mask<F>(load<UInt<F>>(keep.data()) != UInt<F>(0u));
  }

  /// Returns the distance of each ray to a light shape, or 0 if the ray misses the shape. Tests
  /// only rays that pass near the shape's bounding sphere.
  template <typename F>
  F intersect_shape(const TriangleList::Shape& shape, const Packet<F>& packet, const F& limit,
                    const Mask<F>& active, size_t base) const {
    const Vec3<F> to(Vec3<float>{shape.centre[0], shape.centre[1], shape.centre[2]});
    const Vec3<F> p = to - packet.o;
    const F along = dot(p, packet.d), distance2 = length_squared(p);
    // Enlarge the bounding sphere by an upper bound of the rounding error.
    const F reach = fma(F(abs(along) + shape.radius), F(1e-3f), F(shape.radius));
    const Mask<F> near =
        active & (distance2 - along * along <= reach * reach) & (along + reach >= 0.f);
    std::array<float, kWidth<F>> t{};
    for (uint32_t bits = lane_bits<F>(near); bits != 0; bits &= bits - 1) {
      const auto i = static_cast<size_t>(std::countr_zero(bits));
      const auto ray = static_cast<uint32_t>(base + i);
      if (!is_hit_by(shape.light_geometry, keys, rays.slot ? rays.slot[ray] : ray)) continue;
      const float o[3] = {lane(packet.o.x, i), lane(packet.o.y, i), lane(packet.o.z, i)};
      const float d[3] = {lane(packet.d.x, i), lane(packet.d.y, i), lane(packet.d.z, i)};
      t[i] = intersect_custom_shape(shape.light_geometry, o, d, 0.f);
    }
    const F found = load<F>(t.data());
    return select(found < limit, found, F(0.f));
  }

  template <typename F>
  F limits(size_t base) const {
    return rays.tfar ? load<F>(rays.tfar + base) : F(kUnbounded);
  }

  template <typename F>
  void intersect(const HitSpan& hits) const {
    using U = UInt<F>;
    const auto count = static_cast<uint32_t>(list.triangles_.size());
    const auto shapes = static_cast<uint32_t>(list.shapes_.size());
    for (size_t base = 0; base < rays.size; base += kWidth<F>) {
      const Mask<F> active = first_lanes<F>(rays.size - base);
      const Packet<F> packet(list, rays, base);
      F t = limits<F>(base), b(0.f), c(0.f), sum(1.f);
      U entry(count + shapes);
      Plane<F> plane{};
      for (uint32_t i = 0; i < count; ++i) {
        const TriangleList::Triangle& triangle = list.triangles_[i];
        if (!triangle.in_same_plane) plane = packet.plane(triangle);
        const Crossing<F> at = packet.cross(triangle);
        Mask<F> take = at.in & (plane.height >= 0.f) & (plane.height < t * plane.slope) & active;
        if (none(take)) continue;
        const F distance = plane.height / plane.slope;
        take = take & (distance < t);
        if (triangle.filtered || keys.object) take = accepted<F>(take, i, at.b, at.c, at.sum, base);
        t = select(take, distance, t);
        b = select(take, at.b, b);
        c = select(take, at.c, c);
        sum = select(take, at.sum, sum);
        entry = select(Mask<U>(take), U(i), entry);
      }
      for (uint32_t i = 0; i < shapes && !keys.object; ++i) {
        const F distance = intersect_shape(list.shapes_[i], packet, t, active, base);
        const Mask<F> take = distance > 0.f;
        t = select(take, distance, t);
        b = select(take, F(0.f), b);
        c = select(take, F(0.f), c);
        entry = select(Mask<U>(take), U(count + i), entry);
      }
      const Mask<F> missed = Mask<F>(entry == U(count + shapes));
      store_first(hits.t + base, F(select(missed, F(kUnbounded), t)), rays.size - base);
      store_first(hits.u + base, F(b / sum), rays.size - base);
      store_first(hits.v + base, F(c / sum), rays.size - base);
      const Mask<U> all(true);
      store_first(hits.prim + base, gather<U>(list.ids_.prim.data(), entry, all), rays.size - base);
      store_first(hits.geom + base, gather<U>(list.ids_.geom.data(), entry, all), rays.size - base);
      store_first(hits.inst + base, gather<U>(list.ids_.inst.data(), entry, all), rays.size - base);
    }
  }

  template <typename F>
  void occluded(uint32_t* out) const {
    using U = UInt<F>;
    for (size_t base = 0; base < rays.size; base += kWidth<F>) {
      Mask<F> open = first_lanes<F>(rays.size - base);
      const Packet<F> packet(list, rays, base);
      const F tfar = limits<F>(base);
      Plane<F> plane{};
      for (uint32_t i = 0; i < list.triangles_.size(); ++i) {
        const TriangleList::Triangle& triangle = list.triangles_[i];
        if (!triangle.in_same_plane) {
          if (none(open)) break;
          plane = packet.plane(triangle);
        }
        const Crossing<F> at = packet.cross(triangle);
        Mask<F> take = at.in & (plane.height >= 0.f) & (plane.height < tfar * plane.slope) & open;
        if (triangle.filtered && any(take)) take = accepted<F>(take, i, at.b, at.c, at.sum, base);
        open = open & not_(take);
      }
      for (const TriangleList::Shape& shape : list.shapes_)
        open = open & not_(intersect_shape(shape, packet, tfar, open, base) > 0.f);
      store_first(out + base, U(select(Mask<U>(open), U(0u), U(1u))), rays.size - base);
    }
  }
};

namespace {

/// Calls `trace` with a null pointer to the lane type of the given width. `trace` uses only the
/// type of this argument.
template <typename Trace>
void in_lanes(uint32_t width, const Trace& trace) {
  switch (width) {
    case 16:
      return trace(static_cast<Lanes<16>*>(nullptr));
    case 8:
      return trace(static_cast<Lanes<8>*>(nullptr));
    case 4:
      return trace(static_cast<Lanes<4>*>(nullptr));
    default:
      return trace(static_cast<float*>(nullptr));
  }
}

/// Returns a light's geometry together with its bounding sphere.
TriangleList::Shape in_sphere(const LightGeometry& light_geometry) {
  const Bounds box = custom_shape_bounds(light_geometry);
  const Vec3<float> centre = (box.lo + box.hi) * 0.5f, half = (box.hi - box.lo) * 0.5f;
  return {light_geometry, {centre.x, centre.y, centre.z}, std::sqrt(length_squared(half))};
}

}  // namespace

std::unique_ptr<const TriangleList> TriangleList::make(const Scene& scene) {
  const SceneGeometry& geometry = *scene.geometry();
  uint64_t triangles = scene.instanced_triangles();
  if (scene.view().has_motion || scene.view().has_curves || triangles > kMaxTriangles)
    return nullptr;
  const std::vector<LightGeometry> shapes = light_shapes(scene);
  uint32_t own = 0;
  for (const LightGeometry& light_geometry : shapes) {
    if (light_geometry.shape == LightShape::kParallelogram)
      triangles += 2;
    else if (light_geometry.shape != LightShape::kNone)
      ++own;
  }
  if (triangles > kMaxTriangles || own > kMaxShapes) return nullptr;

  auto list = std::make_unique<TriangleList>();
  const std::vector<uint8_t> filtered = filtered_meshes(scene);
  const auto add_group = [&](uint32_t group, uint32_t inst, const Affine& to_world) {
    uint32_t geom = 0;
    for (const uint32_t m : geometry.groups[group].meshes) {
      const Mesh& mesh = geometry.meshes[m];
      for (uint32_t prim = 0; prim < mesh.triangle_count(); ++prim) {
        Vec3<float> corners[3];
        for (int k = 0; k < 3; ++k) {
          const float* p = &mesh.positions[3 * size_t{mesh.indices[3 * size_t{prim} + size_t(k)]}];
          corners[k] = to_world.point({p[0], p[1], p[2]});
        }
        list->add(corners, inst, geom, prim, m, filtered[m] != 0);
      }
      ++geom;
    }
  };
  // Add instances first, then the objects in world space, and then the lights. With this order, the
  // choice among hits at equal distance is the same as that of `closest_filter`, which compares
  // Embree's ids.
  for (uint32_t i = 0; i < geometry.instances.size(); ++i)
    add_group(geometry.instances[i].group, i + 1, geometry.instances[i].to_world);
  add_group(0, 0, Affine{});
  for (uint32_t l = 0; l < shapes.size(); ++l) {
    const LightRecord& light = shapes[l].light;
    if (shapes[l].shape != LightShape::kParallelogram) continue;
    const Vec3<float> p{light.p[0], light.p[1], light.p[2]}, u{light.u[0], light.u[1], light.u[2]},
        v{light.v[0], light.v[1], light.v[2]};
    list->add({p, p + u, p + u + v}, kLightShape, l, 0, 0, false);
    list->add({p, p + u + v, p + v}, kLightShape, l, 1, 0, false);
  }
  for (uint32_t l = 0; l < shapes.size(); ++l)
    if (shapes[l].shape != LightShape::kNone && shapes[l].shape != LightShape::kParallelogram) {
      list->shapes_.push_back(in_sphere(shapes[l]));
      list->ids_.prim.push_back(0);
      list->ids_.geom.push_back(l);
      list->ids_.inst.push_back(kLightShape);
    }
  for (auto* ids : {&list->ids_.prim, &list->ids_.geom, &list->ids_.inst}) ids->push_back(kNoHit);
  if (list->vertices_.size() > kMaxVertices) return nullptr;
  return list;
}

void TriangleList::add(const Vec3<float> (&corners)[3], uint32_t inst, uint32_t geom, uint32_t prim,
                       uint32_t mesh, bool filtered) {
  double e[2][3];
  for (int k = 0; k < 2; ++k) {
    e[k][0] = double{corners[k + 1].x} - corners[0].x;
    e[k][1] = double{corners[k + 1].y} - corners[0].y;
    e[k][2] = double{corners[k + 1].z} - corners[0].z;
  }
  const double n[3] = {e[0][1] * e[1][2] - e[0][2] * e[1][1], e[0][2] * e[1][0] - e[0][0] * e[1][2],
                       e[0][0] * e[1][1] - e[0][1] * e[1][0]};
  const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  if (!(length > 0) || !std::isfinite(length)) return;  // degenerate triangles are never hit
  Triangle& t = triangles_.emplace_back();
  for (int k = 0; k < 3; ++k) {
    t.n[k] = static_cast<float>(n[k] / length);
    t.vertex[k] = vertex(corners[k]);
  }
  t.p[0] = corners[0].x, t.p[1] = corners[0].y, t.p[2] = corners[0].z;
  if (triangles_.size() > 1) {
    const Triangle& before = *(triangles_.end() - 2);
    t.in_same_plane = std::ranges::equal(t.n, before.n) && std::ranges::equal(t.p, before.p);
  }
  t.filtered = filtered;
  t.mesh = mesh;
  ids_.prim.push_back(prim);
  ids_.geom.push_back(geom);
  ids_.inst.push_back(inst);
}

uint16_t TriangleList::vertex(const Vec3<float>& p) {
  const auto same = [&](const Vertex& v) {
    return v.p[0] == p.x && v.p[1] == p.y && v.p[2] == p.z;
  };
  const auto number = std::ranges::find_if(vertices_, same) - vertices_.begin();
  if (number == std::ssize(vertices_)) vertices_.push_back({{p.x, p.y, p.z}});
  return static_cast<uint16_t>(number);
}

void TriangleList::intersect(const SceneView& scene, const RaySpan& rays, const HitSpan& hits,
                             uint32_t width, const PresenceKeys& keys) const {
  const ListTracer tracer{*this, scene, rays, keys};
  in_lanes(width, [&]<typename F>(F*) { tracer.intersect<F>(hits); });
}

void TriangleList::occluded(const SceneView& scene, const RaySpan& rays, uint32_t* occluded,
                            uint32_t width, const PresenceKeys& keys) const {
  const ListTracer tracer{*this, scene, rays, keys};
  in_lanes(width, [&]<typename F>(F*) { tracer.occluded<F>(occluded); });
}

}  // namespace wavecomb
