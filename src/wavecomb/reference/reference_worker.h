// SPDX-License-Identifier: Apache-2.0
/// Buffers of a worker of the reference integrator.
#pragma once

#include "wavecomb/reference/reference.h"

namespace wavecomb {

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
    return {context.scene, *context.camera, aovs, history, &radiance.sum.x};
  }

  PhaseClock clock;
  Counts counts;
  // State of the traced path, in slot 0.
  RadianceRow<float> radiance{};
  PathAovs aovs;
  PathHistory history;
  JointTransport::Buffers joint;
  SoaBlock walks;  ///< states of subsurface random walks
  NestedMediaBuffers nested_media;
};

}  // namespace wavecomb
