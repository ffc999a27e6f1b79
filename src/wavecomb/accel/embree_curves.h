// SPDX-License-Identifier: Apache-2.0
/// Curves and points as Embree user geometries.
#pragma once

#include <embree4/rtcore.h>

#include <memory>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/geometry/curve/bvh_nodes.h"

namespace wavecomb {

/// User data of a curve geometry; must outlive the geometry.
struct CurveGeometry {
  const Mesh* mesh;
  uint32_t id;       ///< mesh index
  bool is_filtered;  ///< whether presence, visibility or light linking may reject hits
  bool is_fibre;     ///< whether rays hit the curves from outside only
  /// Curve BVH nodes, each of which is a primitive for Embree. Null for points and deforming
  /// curves: each point or curve segment is then a primitive.
  std::unique_ptr<const CurveBvhNodes> nodes;
};

/// Creates and commits a geometry for a mesh of curves or points. The caller releases the geometry.
RTCGeometry make_curve_geometry(RTCDevice device, const CurveGeometry& user, HitRule rule);

}  // namespace wavecomb
