// SPDX-License-Identifier: Apache-2.0
/// Embree user geometries for meshes of curves and points.
#pragma once

#include <embree4/rtcore.h>

#include <memory>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/geometry/curve/bvh_nodes.h"

namespace wavecomb {

/// User data of an Embree geometry of curves, which must exist as long as the geometry.
struct CurveGeometry {
  const Mesh* mesh;
  uint32_t id;       ///< mesh index
  bool is_filtered;  ///< whether presence, visibility or light linking may reject hits
  bool is_fibre;     ///< whether rays hit the curves from outside only
  /// BVH nodes of the curves, each of which is one primitive for Embree. Null for points and
  /// deforming curves, whose primitives are the points or curve segments.
  std::unique_ptr<const CurveBvhNodes> nodes;
};

/// Creates and commits a geometry for a mesh of curves or points. The caller releases the geometry.
RTCGeometry make_curve_geometry(RTCDevice device, const CurveGeometry& user, HitRule rule);

}  // namespace wavecomb
