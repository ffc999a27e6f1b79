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
        splats(context.joins_light() ? Wave::kLightSplats : 0),
        light_vertices(context.connects() ? 1 : 0),
        visible(context.merges() ? 1 : 0),
        light_aovs(context.joins_light() ? LightPathAovs(1, context.film->aovs().layout(),
                                                         context.aovs, context.connects())
                                         : LightPathAovs()),
        walks(context.scene.subsurface.media ? SoaBlock(Wave::kWalkColumns, 1) : SoaBlock()),
        nested_media(context.has_medium_stack() ? 1 : 0) {}
  PhaseClock clock;
  Counts counts;
  // State of the traced path, in slot 0.
  PathAovs aovs;
  PathHistory history;
  LightSplatList splats;  ///< of light paths
  LightVertices light_vertices;
  MergePointRows visible;
  LightPathAovs light_aovs;
  SoaBlock walks;  ///< states of subsurface random walks
  NestedMediaBuffers nested_media;
};

}  // namespace wavecomb
