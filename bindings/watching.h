// SPDX-License-Identifier: Apache-2.0
/// Python callbacks during a render, which receive its status, snapshots of the image, and the
/// state from which the render can be resumed.
#pragma once

#include <nanobind/nanobind.h>

#include "wavecomb/render/renderer.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/scene/scene.h"

/// Returns render options that call the Python objects `progress(done, total)` and `watcher`,
/// either of which may be None. The statistics of each snapshot include `settings`. The callbacks
/// acquire the GIL. All three arguments must exist until the render ends.
wavecomb::RenderOptions watched_by(const nanobind::object& progress,
                                   const nanobind::object& watcher, const nanobind::dict& settings);
/// Returns the training data that the checkpoint `state` contains, for `RenderOptions::learned`.
/// Returns an empty vector if the checkpoint has none.
std::vector<std::byte> learned_in(const nanobind::dict& state);
/// Returns a function for `RenderOptions::resume` that restores the checkpoint `state`, which an
/// earlier call of Snapshot.state() returned.
std::function<std::vector<std::byte>(wavecomb::Film&, wavecomb::PassState&)> resumed_from(
    const nanobind::dict& state);
