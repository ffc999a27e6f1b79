// SPDX-License-Identifier: Apache-2.0
/// Embree user geometries for meshes of curves and points.
#pragma once

#include <embree4/rtcore.h>

#include <memory>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/geometry/curve/bvh_nodes.h"

namespace wavecomb {

/// User data of an Embree geometry of curves. The data must exist as long as the geometry.
struct CurveGeometry {
  const Mesh* mesh;
  uint32_t id;       ///< mesh index
  bool is_filtered;  ///< whether presence, visibility or light linking may reject hits
  bool is_fibre;     ///< whether rays hit the curves from outside only
  /// BVH nodes of the curves; Embree treats each node as one primitive. Null for points and for
  /// deforming curves, where each point or curve segment is an Embree primitive.
  std::unique_ptr<const CurveBvhNodes> nodes;
};

/// Creates and commits a geometry for a mesh of curves or points. The caller releases the geometry.
RTCGeometry make_curve_geometry(RTCDevice device, const CurveGeometry& user, HitRule rule);

}  // namespace wavecomb
