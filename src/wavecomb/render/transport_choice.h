// SPDX-License-Identifier: Apache-2.0
/// Whether paths start at the lights, too, of Transport::kAuto, and how many.
///
/// Not where they do not go with the settings or the scene, nor where no surface is clear or glossy
/// or no light sends paths. Elsewhere a small picture of the whole view is rendered before the
/// first pass, twice with each share of light paths that there may be: how noisy the two kinds of
/// paths are depends on the weights that they have, and these on the share. How noisy it would be
/// without light paths is not looked at, since what camera paths hardly find they may not meet in
/// so few samples: light paths tell (integrate/light_vertex.h). With e_camera the squared error of
/// the part that camera paths find beside light paths, e_left that of the other one were it left to
/// camera paths, and c the cost without light paths, by rays and vertices at fixed costs, the
/// efficiency of a share with the error e_s and the cost c_s is
///   (e_camera + e_left) c / (e_s c_s).
/// Nothing of it depends on seed, region, threads, waves or lanes; so parts of a picture, a resumed
/// one and merged ones are rendered alike. Its samples are not in the picture.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "wavecomb/core/settings.h"
#include "wavecomb/render/light_paths.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {

/// What was chosen, and why.
struct TransportChoice {
  Transport transport = Transport::kPath;
  LightPathShare share;  ///< of Transport::kLight
  std::string why;       ///< the rest of a sentence about what was chosen
  double gain = 0;       ///< expected efficiency to that without light paths; 0: not looked at
  double seconds = 0;
};

/// A small picture.
struct TransportTrial {
  std::vector<float> beauty;          ///< rgb
  std::vector<float> by_light_paths;  ///< the part of it that light paths found; empty: none
  uint64_t rays = 0, records = 0;     ///< that it took
};
/// With a share of light paths. With true, by_light_paths is RenderOptions::wants_camera_squares,
/// over that brightness.
using RenderTrial = std::function<TransportTrial(const Settings&, LightPathShare, bool)>;

/// The shares that are tried. Around the better one efficiency is flat on stages with caustics,
/// merged or not.
inline constexpr std::array<LightPathShare, 2> kTriedShares = {{{-3}, {0}}};

/// Whether anything in the scene reflects or passes light sharply enough for caustics.
bool focuses_light(const Scene& scene);

/// Chooses for `settings`, rendering by `render`. `stopped`: give up; what comes back is then of no
/// use.
TransportChoice choose_transport(const Scene& scene, const Settings& settings,
                                 const RenderTrial& render, const std::function<bool()>& stopped);

// ---- for tests ----

/// Trials of `width` columns.
struct TransportTrials {
  std::array<TransportTrial, 2> with[kTriedShares.size()];  ///< by share, of two seeds
  std::vector<double> variance;  ///< of a sample, of what is left to camera paths, by pixel
  uint32_t width = 0;
  bool merges = false;
};
struct TransportGain {
  double gain = 0;  ///< the best efficiency to that without
  LightPathShare share;
};
/// What trials tell of a render of `longer` as many samples.
TransportGain transport_gain(const TransportTrials& trials, double longer);

}  // namespace wavecomb
