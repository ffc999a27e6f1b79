// SPDX-License-Identifier: Apache-2.0
/// Data of light paths that all waves of a render read.
#pragma once

#include "wavecomb/core/settings_choices.h"
#include "wavecomb/film/splats/light_splat_filter.h"
#include "wavecomb/path/camera/camera_ray.h"

namespace wavecomb {

struct Settings;

class AimSamples;
class MergeGrid;

/// Settings and data of the light paths of a render. This class is the `Context` type of the joint
/// transport (path/joint_transport.h). A default-constructed context means a render without light
/// paths.
struct LightPathContext {
  LightPathContext() = default;
  /// `paths_per_sample` is the number of light paths per camera path, averaged over the image.
  /// `grid` holds the points with which light paths are merged, or is null.
  LightPathContext(const Settings& settings, const LightSplatFilter& filter, float paths_per_sample,
                   const MergeGrid* grid);

  /// Turns connections and merging off, for pilots whose film has no light splats. The weights of
  /// camera paths still take account of light paths that reach the camera.
  void disable_splats() {
    grid = nullptr;
    connects = false;
    merge_scale = 0;
  }

  /// Filter of light splats; null without light paths.
  const LightSplatFilter* filter = nullptr;
  /// Points with which light paths are merged; null without merging.
  const MergeGrid* grid = nullptr;
  /// If not null, `aim_samples` receives the contributions of light paths instead of the film.
  AimSamples* aim_samples = nullptr;
  bool connects = false;  ///< whether vertices of camera paths connect to vertices of light paths
  /// 1 / N, where N is the number of light paths per sample of the whole image.
  float share = 1;
  float merge_scale = 0;  ///< ratio of the merge radius to the width of the path's ray cone
  /// 0 means that light splats hold radiance. In some pilot renders, `camera_squares` is the
  /// brightness of the scene, and light splats hold a variance divided by this brightness: the
  /// variance that a pixel sample would have if only camera paths sampled the light of the splat
  /// (light_vertex.h).
  float camera_squares = 0;

  /// Returns whether the render has light paths.
  bool is_active() const { return filter != nullptr; }
  /// Returns whether light paths are merged with points of camera paths.
  bool merges() const { return grid != nullptr; }
};

}  // namespace wavecomb
