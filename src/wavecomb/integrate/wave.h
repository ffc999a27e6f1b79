// SPDX-License-Identifier: Apache-2.0
/// A wave: the paths of one batch of pixels and samples, run to the end by one worker on its own
/// buffers.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/film/film.h"
#include "wavecomb/film/splat_filter.h"
#include "wavecomb/integrate/aov_tables.h"
#include "wavecomb/integrate/calibration.h"
#include "wavecomb/integrate/camera_ray.h"
#include "wavecomb/integrate/integrator.h"
#include "wavecomb/integrate/interior_buffers.h"
#include "wavecomb/integrate/light_path_aovs.h"
#include "wavecomb/integrate/light_vertices.h"
#include "wavecomb/integrate/path_aovs.h"
#include "wavecomb/integrate/path_history.h"
#include "wavecomb/integrate/path_pool.h"
#include "wavecomb/integrate/phase_clock.h"
#include "wavecomb/integrate/ray_recorder.h"
#include "wavecomb/integrate/shading_record.h"
#include "wavecomb/integrate/statistics.h"
#include "wavecomb/integrate/visible_points.h"
#include "wavecomb/schedule/chooser.h"
#include "wavecomb/schedule/coherence.h"
#include "wavecomb/schedule/cost_tracker.h"
#include "wavecomb/schedule/policy.h"
#include "wavecomb/schedule/radix_sort.h"
#include "wavecomb/schedule/ray_order.h"
#include "wavecomb/schedule/ray_queue.h"
#include "wavecomb/schedule/shading_queue.h"

namespace wavecomb {

class AimLessons;

/// What all waves of a render read.
struct WaveContext {
  SceneView scene;
  const EmbreeAccelerator* accel;
  const Settings* settings;
  const CameraSetup* camera;
  /// The policy; where there are several, each worker chooses among them, queue by queue.
  std::span<const SchedulingPolicy* const> policies;
  std::span<const MaterialTraits> traits;
  const CostSnapshot* costs;           ///< for the order of shading
  const CostSnapshot* roulette_costs;  ///< for cost-aware roulette
  OrderGrid grid;                      ///< for ray orders and hit positions
  Film* film;                          ///< each wave writes its own pixels only
  uint32_t traversal_width;
  bool wants_position;                 ///< some policy reads position keys
  bool measures_costs;                 ///< batches are timed
  RayRecorder* recorder;               ///< gets the rays; null in any render that is not measured
  const AovTables* aovs = nullptr;     ///< what indices mean to AOVs; null where none asks
  HistoryReader* histories = nullptr;  ///< gets vertices of paths; null where none are kept
  const GuideView* guide = nullptr;    ///< guides bounces, or is to be learned; null: neither
  bool discards = false;               ///< paths are for `histories` alone, and the film gets none
  const SplatFilter* splat_filter = nullptr;  ///< of paths from lights; null: there are none
  AimLessons* lessons = nullptr;  ///< gets what paths from lights bring, in the film's place
  float light_paths = 1;  ///< that start there for each of a pixel's, over the picture's pixels
  /// Brightness over which splats bring, in place of their light, what it would add to the variance
  /// of a pixel's samples were it left to camera paths (light_vertex.h); 0: they bring light.
  float camera_squares = 0;

  const VisibleGrid* visible = nullptr;  ///< whom paths from lights are merged with; null: nobody

  /// Whether they are.
  bool merges() const { return visible != nullptr; }
  /// Whether paths start at lights, too.
  bool joins_light() const { return splat_filter != nullptr; }
  /// Whether vertices of camera paths connect to theirs.
  bool connects() const { return joins_light() && settings->connects(); }
  /// One over how many start there for each of a pixel's.
  float light_path_share() const {
    return 1.f / (static_cast<float>(settings->width) * static_cast<float>(settings->height) *
                  light_paths);
  }

  /// Whether something lies between surfaces, or light walks below them.
  bool has_media() const {
    return scene.volumes.count > 0 || scene.walks.media != nullptr || knows_inside();
  }
  /// Whether paths know which meshes they are inside of.
  bool knows_inside() const { return scene.interiors.media != nullptr; }
  /// Whether paths need a time.
  bool moves() const { return scene.has_motion || camera->moves(); }
  /// Whether paths keep the class of the surface that they left, where lights are linked.
  bool links() const { return scene.lights.links.members != nullptr; }
  /// Whether paths keep how much their pixel needs light.
  bool weighs_pixels() const { return guide && guide->tiles; }
  /// Vertices that each path keeps.
  uint32_t kept_vertices() const { return histories ? histories->most() : 0; }
  bool orders_rays() const {
    return settings->ray_order != RayOrder::kSlot || settings->shadow_order != RayOrder::kSlot;
  }
};

/// A worker's buffers.
///
/// Contract: one thread at a time; everything is allocated here, nothing while a wave runs.
struct Wave {
  Wave(uint32_t capacity, const WaveContext& context)
      : pool(capacity, context.moves() || context.links() || context.weighs_pixels(),
             context.joins_light(), context.knows_inside(), context.scene.lights.shadows != nullptr,
             context.scene.lights.has_multipliers),
        aovs(capacity, context.film->aovs().layout(), context.aovs),
        history(capacity, context.kept_vertices()),
        rays(capacity),
        hits(capacity),
        shading(capacity, kRowWords<ShadingRecord>),
        shadows(capacity),
        columns(3, capacity),
        times(context.scene.has_motion ? SoaBlock(1, capacity) : SoaBlock()),
        walks(context.scene.walks.media ? SoaBlock(kWalkColumns, capacity) : SoaBlock()),
        ways(context.has_media() ? SoaBlock(kWayColumns, capacity) : SoaBlock()),
        interiors(context.knows_inside() ? capacity : 0),
        sorter(capacity),
        ray_sorter(context.orders_rays() ? capacity : 0),
        ray_indices(context.orders_rays() ? capacity + SoaBlock::kPad : 0),
        scratch(context.traits.size()),
        costs(context.traits.size()),
        splats(context.joins_light() ? kSplats : 0),
        policy_chooser(context.policies.size()),
        ray_chooser(kRayOrders),
        shadow_chooser(kRayOrders),
        light_vertices(context.connects() ? capacity : 0),
        visible(context.merges() ? capacity : 0),
        light_aovs(context.joins_light() ? LightPathAovs(capacity, context.film->aovs().layout(),
                                                         context.aovs, context.connects())
                                         : LightPathAovs()) {}
  static constexpr size_t kWayColumns = 14, kWalkColumns = 36;
  static constexpr size_t kSplats = 4096;  ///< that are collected before they are added
  static constexpr size_t kRayOrders = 4;  ///< slot, morton, morton-octant, direction

  PathPool pool;
  PathAovs aovs;
  PathHistory history;  ///< empty where nobody asks for vertices
  RayQueue rays;
  HitBuffer hits;
  ShadingQueue shading;
  ShadowQueue shadows;
  SoaBlock columns;           ///< of ShadingQueueView: throughput, position key, texture key
  SoaBlock times;             ///< of the rays that are traced, where the scene moves
  SoaBlock walks;             ///< paths below surfaces (medium/walkers.h), where there are any
  SoaBlock ways;              ///< what rays find in volumes (medium/volumes.h), where there are any
  InteriorBuffers interiors;  ///< of medium/interiors.h
  RadixSorter sorter, ray_sorter;
  std::vector<uint32_t> ray_indices;  ///< with room for a packet past the end
  std::vector<float> scratch;         ///< one a material, for policies
  CostTracker costs;
  SplatList splats;
  Chooser policy_chooser, ray_chooser, shadow_chooser;
  CoherenceCounts coherence;
  uint32_t queues = 0;  ///< shading queues so far; coherence is measured on some
  PhaseClock clock;
  Counts counts;
  LightVertices light_vertices;
  VisibleRows visible;
  LightPathAovs light_aovs;  ///< of paths from lights
  /// What vertices of paths from lights are shaded for: the camera; that and to be kept; or to be
  /// connected to the vertices of camera paths in their slots.
  enum class LightUse : uint8_t { kShow, kKeep, kConnect } light_use = LightUse::kShow;

  size_t bytes() const {
    return pool.bytes() + aovs.bytes() + history.bytes() + rays.bytes() + hits.bytes() +
           shading.bytes() + shadows.bytes() + columns.bytes() + times.bytes() + walks.bytes() +
           ways.bytes() + interiors.bytes() + splats.bytes() + light_vertices.bytes() +
           visible.bytes() + light_aovs.bytes();
  }
};

/// Runs a wave with kernels of `W` lanes: generate -> (trace -> policy -> shade -> shadow)* ->
/// resolve. Of paths from lights, where the task is of such.
template <size_t W>
void run_wave(Wave& wave, const WaveContext& context, const WaveTask& task);

/// The same through the volumes of the scene, where it has any (medium/).
template <size_t W>
void run_wave_in_volumes(Wave& wave, const WaveContext& context, const WaveTask& task);

/// Shades synthetic hits of one material with kernels of `W` lanes and returns the time, in
/// nanoseconds.
template <size_t W>
double time_material(Wave& wave, const WaveContext& context, const CalibrationHits& hits);

}  // namespace wavecomb
