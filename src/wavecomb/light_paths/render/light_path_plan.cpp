// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light_paths/render/light_path_plan.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/light_paths/render/light_aiming.h"
#include "wavecomb/render/passes/pixel_order.h"
#include "wavecomb/render/statistics/render_statistics.h"

namespace wavecomb {

LightPathPlan::LightPathPlan(const Scene& scene, const Settings& settings, LightPathShare share,
                             const CameraSetup& camera, const FilterTable& filter)
    : scene_(scene),
      settings_(settings),
      share_(share),
      filter_(make_light_splat_filter(camera, filter, settings.rendered(),
                                      settings.splats_to_one_pixel())) {
  if (!settings.joins_light()) return;
  check_light_paths(scene, settings);
  lights_without_paths_ = wavecomb::lights_without_paths(scene);
}

uint32_t LightPathPlan::pass_samples(const Settings& settings, uint32_t samples) {
  // With merging, a pass has one sample per pixel, since the light paths of a pass merge with the
  // points of only one sample of each pixel.
  return settings.merges() ? 1 : samples;
}

void LightPathPlan::allocate(Film& film) const {
  if (settings_.joins_light())
    film.allocate_light_splats(light_splat_unit(scene_), size_t{settings_.width} * settings_.height,
                               double{share_.paths()});
  if (settings_.merges()) film.allocate_joint_rows(kMergePointWords);
}

LightPathContext LightPathPlan::context(const MergeGrid* grid) const {
  if (!settings_.joins_light()) return {};
  return {settings_, filter_, share_.paths(), grid};
}

void LightPathPlan::measure_squares(LightPathContext& context) const {
  context.camera_squares = scene_brightness(scene_);
}

void LightPathPlan::report(const LightAiming* aiming, RenderStatistics& statistics) const {
  statistics.lights_without_paths = lights_without_paths_;
  if (aiming && aiming->paths > 0)
    statistics.light_aiming = {aiming->aim.count, aiming->paths, aiming->seconds};
}

LightPathPasses::LightPathPasses(const LightPathPlan& plan, const Settings& settings)
    : settings_(settings), share_(plan.share()) {
  if (settings.merges()) grid_ = std::make_unique<MergeGrid>();
  // A render of a region also needs the light paths of the whole image.
  if (settings.joins_light()) order_ = morton_pixel_order({0, 0, settings.width, settings.height});
  // Light paths to which camera paths connect are traced in the waves of these camera paths.
  if (settings.connects())
    std::erase_if(order_, [region = settings.rendered()](uint32_t pixel) {
      return region.contains(pixel & 0xffffu, pixel >> 16);
    });
}

uint32_t light_samples_after(const NoiseParts& noise, uint32_t done, uint32_t before,
                             uint32_t after, uint32_t share, double active_share) {
  if (done < 2) return std::max(done, share);  // the half buffers need at least two samples
  const double own = noise.own * before, splats = noise.splats * done;
  if (!(own > 0)) return splats > 0 ? std::max(done, share) : done;
  const double wanted = std::ceil(after * std::sqrt(splats * active_share / own));
  return std::max(done, wanted < share ? static_cast<uint32_t>(wanted) : share);
}

uint32_t LightPathPasses::adaptive_samples(const Film& film, const PassState& pass, uint32_t done,
                                           uint32_t light_done, uint64_t active) const {
  const uint32_t most = samples(pass.target);
  if (order_.empty()) return most;
  return light_samples_after(measure_noise_parts(film, pass.active), light_done, done, pass.target,
                             most,
                             static_cast<double>(active) / static_cast<double>(order_.size()));
}

PassPlan LightPathPasses::plan(const Film& film, uint32_t target) const {
  if (order_.empty()) return {};
  PassState pass;
  pass.target = target;
  return plan_pass(order_, {0, 0, settings_.width, settings_.height}, film.splats().samples(),
                   pass);
}

void LightPathPasses::begin(const Film& film) {
  if (grid_) grid_->build(film.joint_rows());
}

}  // namespace wavecomb
