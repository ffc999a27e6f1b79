// SPDX-License-Identifier: Apache-2.0
/// Callbacks to Python during a render: status, snapshots, and state for resuming.
#pragma once

#include <nanobind/nanobind.h>

#include "wavecomb/render/renderer.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/render/statistics/render_statistics.h"
#include "wavecomb/scene/scene.h"

/// Returns options with callbacks to Python's `progress(done, total)` and `watcher`, either of
/// which may be None. The statistics of snapshots include `settings`. The callbacks acquire the
/// GIL; all three arguments must outlive the render.
wavecomb::RenderOptions watched_by(const nanobind::object& progress,
                                   const nanobind::object& watcher, const nanobind::dict& settings);
/// Returns the training data (RenderOptions::learned) of the render that produced the checkpoint
/// `state`, or an empty vector.
std::vector<std::byte> learned_in(const nanobind::dict& state);
/// Returns RenderOptions::resume for `state`, the result of an earlier Snapshot.state().
std::function<std::vector<std::byte>(wavecomb::Film&, wavecomb::PassState&)> resumed_from(
    const nanobind::dict& state);
