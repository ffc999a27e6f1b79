// SPDX-License-Identifier: Apache-2.0
/// Curves and points as Embree's user geometries.
#pragma once

#include <embree4/rtcore.h>

#include <memory>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/curve/clumps.h"

namespace wavecomb {

/// What such a geometry's user pointer points at; must outlive it.
struct CurveGeometry {
  const Mesh* mesh;
  uint32_t id;       ///< of the mesh
  bool is_filtered;  ///< some of it may be partly present
  bool is_fibre;     ///< rays meet it from outside alone
  /// What the hierarchy is made over; points, and curves that deform, are alone in it.
  std::unique_ptr<const CurveClumps> clumps;
};

/// A committed geometry of a mesh of curves or points, to be released by the caller.
RTCGeometry make_curve_geometry(RTCDevice device, const CurveGeometry& user, HitRule rule);

}  // namespace wavecomb
