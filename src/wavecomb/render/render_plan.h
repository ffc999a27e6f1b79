// SPDX-License-Identifier: Apache-2.0
/// The plan of a render: lanes, waves, policies, camera and film.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/aov/aov_tables.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/film/film.h"
#include "wavecomb/film/filter.h"
#include "wavecomb/path/camera/camera_ray.h"
#include "wavecomb/render/joint_transport.h"
#include "wavecomb/render/lane_kernels.h"
#include "wavecomb/render/statistics/render_costs.h"
#include "wavecomb/render/wave_setup.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/schedule/policy.h"
#include "wavecomb/schedule/ray_order.h"

namespace wavecomb {

/// Returns the number of threads of a render: Settings::threads, or the number of hardware threads
/// if this setting is 0.
uint32_t thread_count(const Settings& settings);

/// Returns the number of paths in a wave of a render of `pixels` pixels: the value in the settings
/// or 4096, reduced so that every thread gets several waves.
uint32_t wave_size_for(const Settings& settings, uint64_t pixels);

/// Returns the grid over the scene in which Morton codes are computed.
OrderGrid order_grid(const Bounds& bounds);

/// Returns the samples per pixel that a pass adds in a render that is not adaptive. For images
/// smaller than a wave, returns enough to fill a wave.
uint32_t samples_of_pass(const Settings& settings, uint64_t pixels, uint32_t wave_size);

/// Data of a render that follow from the scene and the settings. Making a plan traces no rays, and
/// the plan does not change while the render runs.
///
/// Contract: scene, accelerator, settings and policy outlive the plan, and the plan outlives the
/// films and contexts made from it.
struct RenderPlan {
  /// If `policy` is not null, it replaces the policy of the settings. Throws Error if the scene or
  /// this build does not support the settings.
  RenderPlan(const Scene& scene, const EmbreeAccelerator& accelerator, const Settings& settings,
             JointShare joint_share, const SchedulingPolicy* policy);
  RenderPlan(const RenderPlan&) = delete;
  RenderPlan& operator=(const RenderPlan&) = delete;

  const Scene& scene;
  const EmbreeAccelerator& accelerator;
  const Settings& settings;
  WaveSetup waves;
  LaneKernels kernels;
  uint32_t pass_samples;  ///< samples_of_pass()
  /// Scheduling policy of the render or, for `adaptive`, all policies among which each thread
  /// chooses.
  std::vector<const SchedulingPolicy*> policies;
  std::vector<MaterialTraits> traits;  ///< by material
  FilterTable filter;
  CameraSetup camera;
  AovTables aovs;
  Region window;  ///< pixels of the film
  JointPlan joint;
  SceneView view;  ///< includes the light tree if lights are selected by the tree

  /// Creates an empty film with all layers that the settings ask for.
  Film make_film() const;
  /// Creates the data that the waves of the render read. `film` is from make_film(), and `costs`
  /// and `passes` belong to the render.
  WaveContext make_context(Film& film, RenderCosts& costs, RayRecorder* recorder,
                           const JointPasses& passes) const;

 private:
  std::vector<std::unique_ptr<SchedulingPolicy>> owned_policies_;
};

}  // namespace wavecomb
