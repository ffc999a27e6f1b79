// SPDX-License-Identifier: Apache-2.0
/// The plan of a render: lanes, waves, policies, camera and film.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/film/film.h"
#include "wavecomb/film/filter.h"
#include "wavecomb/film/splat_filter.h"
#include "wavecomb/integrate/aov_tables.h"
#include "wavecomb/integrate/camera_ray.h"
#include "wavecomb/render/lane_kernels.h"
#include "wavecomb/render/light_paths.h"
#include "wavecomb/render/render_costs.h"
#include "wavecomb/render/wave_setup.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/schedule/policy.h"

namespace wavecomb {

/// Number of threads of a render: that of the settings, else that of the machine.
uint32_t thread_count(const Settings& settings);

/// Number of paths in a wave of a render of `pixels` pixels: that of the settings, else 4096, but
/// small enough that every thread gets several waves.
uint32_t wave_size_for(const Settings& settings, uint64_t pixels);

/// Samples that a pass adds to each pixel, unless the render is adaptive. In images smaller than a
/// wave, enough to fill one.
uint32_t samples_of_pass(const Settings& settings, uint64_t pixels, uint32_t wave_size);

/// Everything about a render that follows from the scene and the settings. Nothing is traced to
/// make a plan, and it does not change while the render runs.
///
/// Contract: scene, accelerator, settings and policy outlive the plan, and the plan outlives the
/// films and contexts made of it.
struct RenderPlan {
  /// `policy`: replaces the one that the settings name, unless null. Throws Error where the scene
  /// or this build cannot do what the settings ask for.
  RenderPlan(const Scene& scene, const EmbreeAccelerator& accelerator, const Settings& settings,
             LightPathShare light_share, const SchedulingPolicy* policy);
  RenderPlan(const RenderPlan&) = delete;
  RenderPlan& operator=(const RenderPlan&) = delete;

  const Scene& scene;
  const EmbreeAccelerator& accelerator;
  const Settings& settings;
  LightPathShare light_share;  ///< of paths from lights, where there are any
  WaveSetup waves;
  LaneKernels kernels;
  uint32_t pass_samples;  ///< samples_of_pass()
  /// The policy of the render; of `adaptive` all among which each thread chooses.
  std::vector<const SchedulingPolicy*> policies;
  std::vector<MaterialTraits> traits;  ///< by material
  FilterTable filter;
  CameraSetup camera;
  AovTables aovs;
  Region window;             ///< pixels of the film
  SplatFilter splat_filter;  ///< of light that paths from lights bring to the camera
  SceneView view;            ///< with the light tree, where lights are chosen by it

  /// An empty film with all that the settings ask for.
  Film make_film() const;
  /// The data that the waves of the render read. `film`: of make_film(). `costs`: of this render.
  /// `visible`: with whose points paths from lights are merged, or null.
  WaveContext make_context(Film& film, RenderCosts& costs, RayRecorder* recorder,
                           const VisibleGrid* visible) const;

 private:
  std::vector<std::unique_ptr<SchedulingPolicy>> owned_policies_;
};

}  // namespace wavecomb
