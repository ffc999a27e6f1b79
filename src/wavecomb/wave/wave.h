// SPDX-License-Identifier: Apache-2.0
/// Wave: a batch of paths that are traced together, for a number of pixels and samples. One worker
/// traces the paths of a wave to their end, using only its own buffers.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/aov/aov_tables.h"
#include "wavecomb/aov/path_events.h"
#include "wavecomb/film/film.h"
#include "wavecomb/medium/nested/buffers.h"
#include "wavecomb/path/camera/camera_ray.h"
#include "wavecomb/path/integrator.h"
#include "wavecomb/path/path_history.h"
#include "wavecomb/path/path_pool.h"
#include "wavecomb/path/phase_clock.h"
#include "wavecomb/path/shading_record.h"
#include "wavecomb/path/statistics.h"
#include "wavecomb/schedule/chooser.h"
#include "wavecomb/schedule/coherence.h"
#include "wavecomb/schedule/cost_tracker.h"
#include "wavecomb/schedule/policy.h"
#include "wavecomb/schedule/radix_sort.h"
#include "wavecomb/schedule/ray_order.h"
#include "wavecomb/schedule/ray_queue.h"
#include "wavecomb/schedule/shading_queue.h"
#include "wavecomb/wave/cost_calibration.h"
#include "wavecomb/wave/joint_transport.h"
#include "wavecomb/wave/ray_recorder.h"

namespace wavecomb {

struct Settings;

/// Data that all waves of a render read.
struct WaveContext {
  SceneView scene;
  const EmbreeAccelerator* accel;
  const Settings* settings;
  const CameraSetup* camera;
  /// Scheduling policies. If there are several policies, each worker chooses one for each shading
  /// queue.
  std::span<const SchedulingPolicy* const> policies;
  std::span<const MaterialTraits> traits;
  const CostSnapshot* costs;           ///< for scheduling policies
  const CostSnapshot* roulette_costs;  ///< costs for cost-aware roulette
  OrderGrid grid;                      ///< grid for ray orders and hit positions
  /// Film that waves write; only light paths of different waves may write the same pixel.
  Film* film;
  uint32_t traversal_width;
  bool wants_position;                 ///< whether some policy reads position keys
  bool measures_costs;                 ///< whether to measure the time of shading batches
  RayRecorder* recorder;               ///< receives all rays in benchmarks, otherwise null
  const AovTables* aovs = nullptr;     ///< object names and groups for AOVs; null if unused
  HistoryReader* histories = nullptr;  ///< receives vertices of finished paths; null if unused
  /// guiding field that this pass uses or trains; null without guiding
  const GuidingView* guide = nullptr;
  /// Whether paths are only passed to `histories` and not added to the film.
  bool discards = false;
  JointTransport::Context joint{};  ///< transport that is combined with camera paths, if any

  /// Returns whether the scene has volumes, nested dielectrics or subsurface scattering.
  bool has_media() const {
    return scene.volumes.count > 0 || scene.subsurface.media != nullptr || has_medium_stack();
  }
  /// Returns whether paths keep a medium stack.
  bool has_medium_stack() const { return scene.nested_media.media != nullptr; }
  /// Returns whether paths need a shutter time.
  bool moves() const { return scene.has_motion || camera->moves(); }
  /// Returns whether each path stores the light link class of the surface from which its ray
  /// starts.
  bool links() const { return scene.lights.links.members != nullptr; }
  /// Returns whether paths keep the importance of their pixel.
  bool uses_pixel_importance() const { return guide && guide->tiles; }
  /// Returns the number of path vertices to store for each path.
  uint32_t stored_vertices() const { return histories ? histories->most() : 0; }
  bool orders_rays() const;
};

/// Buffers of one worker.
///
/// Contract: used by one thread at a time. The constructor allocates all memory; a running wave
/// allocates none.
struct Wave {
  Wave(uint32_t capacity, const WaveContext& context)
      : pool(capacity, context.moves() || context.links() || context.uses_pixel_importance(),
             context.has_medium_stack(), context.scene.lights.shadows != nullptr,
             context.scene.lights.has_multipliers, context.scene.has_presence),
        aovs(capacity, context.film->aovs().layout(), context.aovs),
        history(capacity, context.stored_vertices()),
        rays(capacity),
        hits(capacity),
        shading(capacity, kRowWords<ShadingRecord>),
        shadows(capacity),
        columns(3, capacity),
        times(context.scene.has_motion ? SoaBlock(1, capacity) : SoaBlock()),
        walks(context.scene.subsurface.media ? SoaBlock(kWalkColumns, capacity) : SoaBlock()),
        segments(context.has_media() ? SoaBlock(kSegmentColumns, capacity) : SoaBlock()),
        nested_media(context.has_medium_stack() ? capacity : 0),
        sorter(capacity),
        ray_sorter(context.orders_rays() ? capacity : 0),
        ray_indices(context.orders_rays() ? capacity + SoaBlock::kPad : 0),
        scratch(context.traits.size()),
        costs(context.traits.size()),
        policy_chooser(context.policies.size()),
        ray_chooser(kRayOrders),
        shadow_chooser(kRayOrders),
        joint(capacity, context.joint, context.film->aovs().layout(), context.aovs) {}
  static constexpr size_t kSegmentColumns = 14, kWalkColumns = 36;
  /// the ray orders slot, morton, morton-octant and direction
  static constexpr size_t kRayOrders = 4;

  PathPool pool;
  PathAovs aovs;
  PathHistory history;  ///< empty if unused
  RayQueue rays;
  HitBuffer hits;
  ShadingQueue shading;
  ShadowQueue shadows;
  SoaBlock columns;   ///< columns of ShadingQueueView: throughput, position key and texture key
  SoaBlock times;     ///< shutter times of the traced rays, if the scene has motion
  SoaBlock walks;     ///< subsurface random walks (medium/subsurface/walk_queue.h)
  SoaBlock segments;  ///< free flights in volumes (medium/wave/volumes.h)
  /// Buffers for nested dielectrics (medium/nested/nested_media.h).
  NestedMediaBuffers nested_media;
  RadixSorter sorter, ray_sorter;
  std::vector<uint32_t> ray_indices;  ///< padded by one packet
  std::vector<float> scratch;  ///< one value for each material, which scheduling policies may use
  CostTracker costs;
  Chooser policy_chooser, ray_chooser, shadow_chooser;
  CoherenceCounts coherence;
  /// Number of shading queues so far. Coherence is measured for every seventeenth queue.
  uint32_t queues = 0;
  PhaseClock clock;
  Counts counts;
  JointTransport::Buffers joint;

  /// Returns the object that records the events of the wave's camera paths.
  PathEvents events(const WaveContext& context) {
    return {context.scene, *context.camera, aovs, history, pool.radiance};
  }

  size_t bytes() const {
    return pool.bytes() + aovs.bytes() + history.bytes() + rays.bytes() + hits.bytes() +
           shading.bytes() + shadows.bytes() + columns.bytes() + times.bytes() + walks.bytes() +
           segments.bytes() + nested_media.bytes() + joint.bytes();
  }
};

/// Runs a wave with kernels of `W` lanes: generate -> (trace -> collect -> order -> shade ->
/// shadow)* -> resolve. If task.joint is set, the wave traces paths of the joint transport.
template <size_t W>
void run_wave(Wave& wave, const WaveContext& context, const WaveTask& task);

/// Runs a wave through the volumes of the scene (medium/).
template <size_t W>
void run_wave_in_volumes(Wave& wave, const WaveContext& context, const WaveTask& task);

/// Shades synthetic hits of one material with kernels of `W` lanes. Returns the time in
/// nanoseconds.
template <size_t W>
double time_material(Wave& wave, const WaveContext& context, const CalibrationHits& hits);

}  // namespace wavecomb
