// SPDX-License-Identifier: Apache-2.0
/// Planner: decides the settings that a render leaves open (`auto`), before its first pass.
///
/// 1. Settings that need no measurement are decided first, such as plain quality.
/// 2. Small renders of the whole view compare ratios of light paths (transport_choice.h in
///    light_paths/render).
/// 3. The pilots of the render with the decided settings follow (pilots.h). They decide whether to
///    guide its camera paths, and measure lights, material costs and directions for light paths.
///
/// Decisions depend only on counted samples of the whole image, and never on seed, region, threads
/// or the clock, so that tiles, crops, resumed renders and merged renders make the same decisions.
/// The only exceptions are renders with a time limit, whose pilots stop after a fraction of the
/// limit.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "wavecomb/render/pilots/pilots.h"
#include "wavecomb/render/render_run.h"
#include "wavecomb/render/renderer.h"

namespace wavecomb {

/// Settings of a render in which the transport is decided.
struct PlannedSettings {
  Settings settings;
  LightPathShare share;                   ///< for Transport::kLight
  std::optional<TransportChoice> choice;  ///< if the transport was chosen
};

/// Planner of the renders of one scene.
///
/// Contract: used by one thread at a time. The planner reuses earlier decisions from `cache`, which
/// must outlive the planner.
class Planner {
 public:
  /// `build_s` is the time in seconds that building `accel` took.
  Planner(std::shared_ptr<const Scene> scene, std::shared_ptr<const EmbreeAccelerator> accel,
          double build_s, PilotCache& cache);

  /// Decides the transport for `settings`. If `options` holds the decisions of an earlier render,
  /// they are reused. Gives up if `stopped` returns true; the result then uses Transport::kPath.
  PlannedSettings plan(const Settings& settings, const RenderOptions& options,
                       const std::function<bool()>& stopped);

 private:
  using Stopped = std::function<bool()>;

  TransportChoice choose(const Settings& settings, const RenderOptions& options,
                         const Stopped& stopped);
  /// Renders a small image for choose_transport().
  TransportPilot render_pilot(const Settings& settings, LightPathShare share, bool wants_squares,
                              const PilotShared& shared, const Stopped& stopped);

  std::shared_ptr<const Scene> scene_;
  std::shared_ptr<const EmbreeAccelerator> accel_;
  double build_s_;
  PilotCache& cache_;
};

}  // namespace wavecomb
