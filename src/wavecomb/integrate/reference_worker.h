// SPDX-License-Identifier: Apache-2.0
/// What a worker of the reference integrator has of its own.
#pragma once

#include "wavecomb/integrate/reference.h"

namespace wavecomb {

/// Buffers of a worker of the reference integrator.
///
/// Contract: one thread at a time.
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
  // Of the path that is traced, in slot 0.
  PathAovs aovs;
  PathHistory history;
  SplatList splats;  ///< of paths from lights
  LightVertices light_vertices;
  VisibleRows visible;
  LightPathAovs light_aovs;
  SoaBlock walks;  ///< below surfaces
  InteriorBuffers interiors;
};

}  // namespace wavecomb
