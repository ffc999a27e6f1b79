// SPDX-License-Identifier: Apache-2.0
/// Data of light paths that one worker needs.
#pragma once

#include "wavecomb/aov/aov_tables.h"
#include "wavecomb/core/rows/soa.h"
#include "wavecomb/film/film.h"
#include "wavecomb/light_paths/context.h"
#include "wavecomb/light_paths/light_path_aovs.h"
#include "wavecomb/light_paths/light_vertices.h"
#include "wavecomb/light_paths/merge_point.h"
#include "wavecomb/path/camera/camera_connection.h"
#include "wavecomb/path/joint_transport.h"

namespace wavecomb {

/// Purpose for which the vertices of light paths are shaded.
enum class LightVertexUse : uint8_t {
  kToCamera,  ///< connect the vertices to the camera
  kStore,     ///< connect the vertices to the camera and store them
  kConnect,   ///< connect the stored vertices to camera paths in the same slots
};

/// Buffers of one worker for light paths and for their connections to camera paths. This class is
/// the `Buffers` type of the joint transport (path/joint_transport.h). All members are empty in
/// renders without light paths.
///
/// Contract: each object belongs to a single wave or reference integrator. Slots must be below
/// `capacity`.
struct LightPathBuffers {
  LightPathBuffers(size_t capacity, const LightPathContext& context, const AovLayout& layout,
                   const AovTables* tables)
      : splats(context.is_active() ? kSplats : 0),
        vertices(context.connects ? capacity : 0),
        merge_points(context.merges() ? capacity : 0),
        aovs(context.is_active() ? LightPathAovs(capacity, layout, tables, context.connects)
                                 : LightPathAovs()),
        ratio_block_(context.is_active() ? SoaBlock(2, capacity) : SoaBlock()) {
    if (!context.is_active()) return;
    ratios = ratio_block_.floats(0);
    awaits_merge = ratio_block_.uints(1);
  }
  static constexpr size_t kSplats = 4096;  ///< capacity of the buffer of light splats

  LightSplatList splats;
  LightVertices vertices;       ///< stored vertices of light paths
  MergePointRows merge_points;  ///< merge points of camera paths
  LightPathAovs aovs;
  LightVertexUse use = LightVertexUse::kToCamera;
  float* ratios = nullptr;  ///< `PathState::ratio` of the camera path in each slot
  /// 1 if the camera path in the slot has had delta bounces only, so that light paths may be merged
  /// at its next vertex with a non-delta lobe; else 0.
  uint32_t* awaits_merge = nullptr;

  /// Initialises `PathState::ratio` of the camera paths in `slot` at their first hits: the number
  /// of light paths per sample of the whole image, divided by the density of camera paths.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void begin_ratios(const LightPathContext& context,
                                                 const CameraSetup& camera, const UInt<F>& slot,
                                                 const FirstHit<F>& hit,
                                                 const Mask<F>& active) const {
    const F ratio =
        inverse_camera_density<F>(camera, hit.time, hit.p, hit.dir, active) * (1.f / context.share);
    scatter<F>(ratios, ratio, slot, active);
    scatter<UInt<F>>(awaits_merge, UInt<F>(0u), slot, active);
  }
  /// Returns `PathState::ratio` of the camera paths in `slot`.
  template <typename F>
  F ratio(const UInt<F>& slot, const Mask<F>& active) const {
    return gather<F>(ratios, slot, active);
  }
  size_t bytes() const {
    return splats.bytes() + vertices.bytes() + merge_points.bytes() + aovs.bytes() +
           ratio_block_.bytes();
  }

 private:
  SoaBlock ratio_block_;
};

}  // namespace wavecomb
