// SPDX-License-Identifier: Apache-2.0
/// Rays against a few triangles, tried one after the other.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/accel/light_shapes.h"

namespace wavecomb {

/// All that rays of a small still scene can meet, as one list in world space.
///
/// Below some hundred triangles a hierarchy costs more than it saves: here each lane has a ray of
/// its own, and all lanes test the same triangle. A ray is tested in a frame of its own, z along
/// it, where an edge function is exactly the negative of its neighbour's (Woop, Benthin and Wald,
/// "Watertight Ray/Triangle Intersection", JCGT 2(1) 2013; their shear is a rotation here, so that
/// no lane chooses an axis of its own), and its distance is that to the triangle's plane. No
/// operation knows of the other rays, and of equally close hits the first of the list wins, so
/// hits are canonical without a filter.
///
/// Contract: immutable; reads the scene's materials through the view that it is given.
class TriangleList {
 public:
  /// Of more triangles than this a hierarchy is quicker (docs/decisions/small-scene-traversal.md).
  static constexpr uint32_t kMostTriangles = 96;
  static constexpr uint32_t kMostVertices = 128;  ///< at different places
  static constexpr uint32_t kMostShapes = 4;      ///< of lights that are not parallelograms

  /// Null where there is more, where something moves, or where there are curves or points.
  static std::unique_ptr<const TriangleList> make(const Scene& scene);

  /// As EmbreeAccelerator's of the same names; `width` is 1, 4, 8 or 16.
  void intersect(const SceneView& scene, const RaySpan& rays, const HitSpan& hits, uint32_t width,
                 const PresenceKeys& keys) const;
  void occluded(const SceneView& scene, const RaySpan& rays, uint32_t* occluded, uint32_t width,
                const PresenceKeys& keys) const;

  /// One triangle: its plane through `p` with unit normal `n`, and its vertices' numbers.
  struct Triangle {
    float n[3], p[3];
    uint16_t vertex[3];
    bool filtered;       ///< asks whether it is met
    bool in_same_plane;  ///< as the one before, to the bit
    uint32_t mesh;
  };
  struct Vertex {
    float p[3];
  };
  /// A light's own shape within a ball.
  struct Shape {
    PlacedShape placed;
    float centre[3], radius;
  };
  /// What a hit of entry i is, triangles first, then shapes, then "none".
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
