// SPDX-License-Identifier: Apache-2.0
/// A wave: the paths of one batch of pixels and samples, run to the end by one worker on its own buffers.
#pragma once

#include <memory>

#include "wavecomb/accel/embree_accelerator.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/film/film.h"
#include "wavecomb/integrate/camera_ray.h"
#include "wavecomb/integrate/path_pool.h"
#include "wavecomb/integrate/phase_clock.h"
#include "wavecomb/integrate/statistics.h"
#include "wavecomb/schedule/policy.h"
#include "wavecomb/schedule/radix_sort.h"
#include "wavecomb/schedule/ray_queue.h"
#include "wavecomb/schedule/shading_queue.h"

namespace wavecomb {

/// What all waves of a render read.
struct WaveContext {
  SceneView scene;
  const EmbreeAccelerator* accel;
  const Settings* settings;
  const CameraSetup* camera;
  const SchedulingPolicy* policy;
  const CostSnapshot* costs;
  Film* film;  ///< each wave writes its own pixels only
  uint32_t traversal_width;
};

/// Pixels (x | y << 16) and their samples [first_sample, first_sample + samples).
struct WaveTask {
  const uint32_t* pixels;
  uint32_t pixel_count;
  uint32_t first_sample;
  uint32_t samples;
  uint32_t path_count() const { return pixel_count * samples; }
};

/// A worker's buffers.
///
/// Contract: one thread at a time; everything is allocated here, nothing while a wave runs.
struct Wave {
  Wave(uint32_t capacity, bool with_aovs)
      : pool(capacity, with_aovs),
        rays(capacity),
        hits(capacity),
        shading(capacity),
        shadows(capacity),
        sorter(capacity) {}

  PathPool pool;
  RayQueue rays;
  HitBuffer hits;
  ShadingQueue shading;
  ShadowQueue shadows;
  RadixSorter sorter;
  PhaseClock clock;
  Counts counts;

  size_t bytes() const {
    return pool.bytes() + rays.bytes() + hits.bytes() + shading.bytes() + shadows.bytes();
  }
};

/// Runs a wave with kernels of `W` lanes: generate -> (trace -> policy -> shade -> shadow)* -> resolve.
template <size_t W>
void run_wave(Wave& wave, const WaveContext& context, const WaveTask& task);

}  // namespace wavecomb
