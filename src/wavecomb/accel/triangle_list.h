// SPDX-License-Identifier: Apache-2.0
/// Intersection of rays with a short list of triangles.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/accel/light_shapes.h"

namespace wavecomb {

/// Geometry of a small static scene as a flat list in world space.
///
/// In scenes of fewer than about a hundred triangles, testing all triangles is faster than
/// traversing a BVH. A packet holds one ray in each lane, and all lanes test the same triangle.
/// Triangles are transformed to a frame with z along the ray, in which the two triangles of a
/// shared edge compute edge functions that are exact negatives of each other (Woop, Benthin and
/// Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1) 2013; TriangleList replaces the paper's
/// shear by a rotation, so that no lane has to choose an axis). The hit distance is the distance to
/// the triangle's plane. Results for a ray do not depend on other rays, and among hits at equal
/// distance the first triangle of the list is chosen. Hits therefore depend neither on packets nor
/// on the order of rays.
///
/// Contract: the object is immutable. It reads materials from the `SceneView` that is passed to
/// each call.
class TriangleList {
 public:
  /// Maximum number of triangles; with more triangles, a BVH is faster
  /// (docs/decisions/small-scene-traversal.md).
  static constexpr uint32_t kMaxTriangles = 96;
  static constexpr uint32_t kMaxVertices = 128;  ///< maximum number of distinct vertex positions
  /// Maximum number of lights that are not parallelograms.
  static constexpr uint32_t kMaxShapes = 4;

  /// Builds the triangle list of a scene. Returns null if the scene exceeds the limits above or has
  /// motion, curves or points.
  static std::unique_ptr<const TriangleList> make(const Scene& scene);

  /// Find the same hits as the functions of `EmbreeAccelerator` with the same names. `width` is 1,
  /// 4, 8 or 16.
  void intersect(const SceneView& scene, const RaySpan& rays, const HitSpan& hits, uint32_t width,
                 const PresenceKeys& keys) const;
  void occluded(const SceneView& scene, const RaySpan& rays, uint32_t* occluded, uint32_t width,
                const PresenceKeys& keys) const;

  /// Triangle, described by its vertex indices and by the plane through `p` with the unit normal
  /// `n`.
  struct Triangle {
    float n[3], p[3];
    uint16_t vertex[3];
    bool filtered;       ///< whether hits must pass accepts_hit()
    bool in_same_plane;  ///< whether `n` and `p` are the same as in the previous triangle
    uint32_t mesh;
  };
  struct Vertex {
    float p[3];
  };
  /// Light shape with its bounding sphere.
  struct Shape {
    LightGeometry light_geometry;
    float centre[3], radius;
  };
  /// For each entry of the list, the ids of a hit on the entry. The entries are the triangles, then
  /// the light shapes, then one entry for a miss.
  struct Ids {
    std::vector<uint32_t> prim, geom, inst;
  };

 private:
  friend struct ListTracer;

  void add(const Vec3<float> (&corners)[3], uint32_t inst, uint32_t geom, uint32_t prim,
           uint32_t mesh, bool filtered);
  uint16_t vertex(const Vec3<float>& p);

  std::vector<Vertex> vertices_;
  std::vector<Triangle> triangles_;
  std::vector<Shape> shapes_;
  Ids ids_;
};

}  // namespace wavecomb
