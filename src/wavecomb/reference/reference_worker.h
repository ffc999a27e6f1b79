// SPDX-License-Identifier: Apache-2.0
/// Buffers of a worker of the reference integrator.
#pragma once

#include <array>

#include "wavecomb/reference/reference.h"

namespace wavecomb {

/// Radiance of one path, with the padding that rows have in memory.
struct StoredRadiance {
  RadianceRow<float> row{};
  std::array<float, kRadianceWords - sizeof(RadianceRow<float>) / sizeof(float)> padding{};
};
static_assert(sizeof(StoredRadiance) == kRadianceWords * sizeof(float));

/// Buffers of a worker of the reference integrator.
///
/// Contract: used by one thread at a time.
struct ReferenceWorker {
  explicit ReferenceWorker(const WaveContext& context)
      : aovs(1, context.film->aovs().layout(), context.aovs),
        history(1, context.stored_vertices()),
        joint(1, context.joint, context.film->aovs().layout(), context.aovs),
        walks(context.scene.subsurface.media ? SoaBlock(Wave::kWalkColumns, 1) : SoaBlock()),
        nested_media(context.has_medium_stack() ? 1 : 0) {}
  /// Returns the object that records the events of the traced path.
  PathEvents events(const WaveContext& context) {
    return {context.scene, *context.camera, aovs, history, &radiance.row.sum.x};
  }

  PhaseClock clock;
  Counts counts;
  // State of the traced path, in slot 0.
  StoredRadiance radiance;
  PathAovs aovs;
  PathHistory history;
  JointTransport::Buffers joint;
  SoaBlock walks;  ///< states of subsurface random walks
  NestedMediaBuffers nested_media;
};

}  // namespace wavecomb
