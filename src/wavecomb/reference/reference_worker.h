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
        history(1, context.kept_vertices()),
        splats(context.joins_light() ? Wave::kSplats : 0),
        light_vertices(context.connects() ? 1 : 0),
        visible(context.merges() ? 1 : 0),
        light_aovs(context.joins_light() ? LightPathAovs(1, context.film->aovs().layout(),
                                                         context.aovs, context.connects())
                                         : LightPathAovs()),
        walks(context.scene.walks.media ? SoaBlock(Wave::kWalkColumns, 1) : SoaBlock()),
        interiors(context.knows_inside() ? 1 : 0) {}
  PhaseClock clock;
  Counts counts;
  // State of the traced path, in slot 0.
  PathAovs aovs;
  PathHistory history;
  SplatList splats;  ///< of light paths
  LightVertices light_vertices;
  VisibleRows visible;
  LightPathAovs light_aovs;
  SoaBlock walks;  ///< of subsurface random walks
  InteriorBuffers interiors;
};

}  // namespace wavecomb
