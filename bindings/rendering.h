// SPDX-License-Identifier: Apache-2.0
/// Renders that Python asked for.
#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <functional>
#include <vector>

#include "wavecomb/render/cost_profile.h"
#include "wavecomb/render/ray_recording.h"
#include "wavecomb/render/render_statistics.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/scene/scene.h"

/// A picture with the figures of its render.
struct Result {
  wavecomb::Picture picture;
  wavecomb::RenderStatistics statistics;
  wavecomb::CostProfile profile;
  nanobind::dict settings;
  std::vector<std::byte> learned;  ///< wavecomb::packed_training(); empty: nothing
};

/// What render() is called with; None where nothing is given.
struct RenderArguments {
  nanobind::handle settings;
  nanobind::object progress, policy, costs;
  wavecomb::RayRecording* recorder;
  nanobind::object watcher, state;
  double interval;
  bool wants_picture = true;
  nanobind::object learned = nanobind::none();
};

/// Renders `scene` by what `renderer` gives, which is called without the GIL once the arguments are
/// known to be good.
Result run_render(
    const std::function<wavecomb::WavefrontRenderer&(const wavecomb::Settings&)>& renderer,
    const wavecomb::Scene& scene, const RenderArguments& arguments);
