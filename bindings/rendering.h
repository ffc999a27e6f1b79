// SPDX-License-Identifier: Apache-2.0
/// Functions that run a render which was started from Python.
#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <functional>
#include <vector>

#include "wavecomb/render/inspection/ray_recording.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/render/statistics/cost_profile.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/scene/scene.h"

/// Image and statistics of a render.
struct Result {
  wavecomb::RenderedImage image;
  wavecomb::RenderStatistics statistics;
  wavecomb::CostProfile profile;
  nanobind::dict settings;
  /// Training data that `wavecomb::packed_training` returned. Empty if the render had no training.
  std::vector<std::byte> learned;
};

/// Arguments of the Python function render(). A missing argument is None.
struct RenderArguments {
  nanobind::handle settings;
  nanobind::object progress, policy, costs;
  wavecomb::RayRecording* recorder;
  nanobind::object watcher, state;
  double interval;
  bool wants_picture = true;
  nanobind::object learned = nanobind::none();
};

/// Renders `scene` with the renderer that `renderer` returns. `renderer` is called without the GIL
/// after the arguments have been checked.
Result run_render(
    const std::function<wavecomb::WavefrontRenderer&(const wavecomb::Settings&)>& renderer,
    const wavecomb::Scene& scene, const RenderArguments& arguments);
