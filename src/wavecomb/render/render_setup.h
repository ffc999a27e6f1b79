// SPDX-License-Identifier: Apache-2.0
/// What settings and the scene say of how a render is run: threads, waves, passes, policies.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "wavecomb/film/film.h"
#include "wavecomb/render/cost_profile.h"
#include "wavecomb/render/learned.h"
#include "wavecomb/render/pass_plan.h"
#include "wavecomb/render/pick.h"
#include "wavecomb/render/render_statistics.h"
#include "wavecomb/render/renderer.h"
#include "wavecomb/render/snapshot.h"
#include "wavecomb/scene/scene.h"
#include "wavecomb/schedule/ray_order.h"

namespace wavecomb {

/// Threads of a render.
uint32_t thread_count(const Settings& settings);

/// Paths of a wave of a render of so many pixels. A wave is no larger than what keeps every worker
/// busy a few times over.
uint32_t wave_size_for(const Settings& settings, uint64_t pixels);

/// Samples of a pass that is not adaptive: at least enough for a wave to be full when the picture
/// is smaller than a wave.
uint32_t pass_step(const Settings& settings, uint64_t pixels, uint32_t wave_size);

/// The policies that `name` stands for: one, or those that "adaptive" chooses among, "none" first.
std::vector<std::unique_ptr<SchedulingPolicy>> choose_policies(const std::string& name);

/// The grid over the scene for Morton codes.
OrderGrid order_grid(const Bounds& bounds);

/// Names of what the Cryptomatte layers among `layers` hold.
std::vector<CryptoManifest> crypto_manifests(const Scene& scene,
                                             const std::vector<AovLayer>& layers);

}  // namespace wavecomb
