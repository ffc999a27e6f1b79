// SPDX-License-Identifier: Apache-2.0
/// Python's side of watching a render: status, snapshots, and state to resume from.
#pragma once

#include <nanobind/nanobind.h>

#include "wavecomb/render/render_statistics.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/scene/scene.h"

/// Options whose callbacks ask Python's `progress(done, total)` and `watcher`; either may be None.
/// `settings`: for statistics of snapshots. The callbacks take the GIL; all three must outlive the
/// render.
wavecomb::RenderOptions watched_by(const nanobind::object& progress,
                                   const nanobind::object& watcher, const nanobind::dict& settings);
/// What RenderOptions::resume is to be for `state`, a Snapshot.state() of before.
std::function<std::vector<std::byte>(wavecomb::Film&, wavecomb::PassState&)> resumed_from(
    const nanobind::dict& state);
