// SPDX-License-Identifier: Apache-2.0
/// AOV values that are known at the first hit of a camera ray, before shading.
#pragma once

#include <limits>

#include "wavecomb/aov/aov_tables.h"
#include "wavecomb/aov/rows.h"
#include "wavecomb/path/camera/camera_ray.h"

namespace wavecomb {

/// Arrays with AOV values of camera rays and of their first hits, indexed by path slot.
///
/// Contract: the class is used only as a base class of `PathAovs`. Path slots must be below the
/// capacity.
class PathFirstHits {
 public:
  PathFirstHits() = default;
  /// Allocates arrays for the AOVs in `set`. `tables` may be null if no AOV in `set` needs tables.
  PathFirstHits(size_t capacity, const AovSet& set, const AovTables* tables)
      : names_(tables), transmits_(set.has(Aov::kTransmittance)) {
    const auto rows = [&](SlotRows& block, bool wanted, size_t words) {
      if (wanted) block = SlotRows(capacity, words);
    };
    rows(depth_, set.has(Aov::kDepth), 1);
    rows(end_, set.any(Aov::kDeep | Aov::kHalfDepth | Aov::kTransmittance), kRowWords<RayEndRow>);
    rows(hits_, set.has(AovKind::kNearest) || set.has(AovKind::kCoverage), kRowWords<FirstHitRow>);
    rows(centre_, set.has(AovKind::kNearest), 1);
    rows(motion_, set.has(Aov::kMotion), 2);
    rows(alpha_, set.has(Aov::kAlpha), 1);
  }

  /// Records the start of camera rays. `r` contains the sample values with which the rays were
  /// generated.
  template <typename F>
  void begin(const CameraSetup& camera, const Sample4<F>& r, const UInt<F>& slot,
             const Mask<F>& active) const {
    if (centre_) scatter<F>(centre_.rows, centre_distance2<F>(camera, r, active), slot, active);
  }

  bool wants_hits() const { return hits_ || depth_ || end_; }
  bool wants_alpha() const { return bool(alpha_); }
  /// Sets alpha to 1 for the paths in the active lanes.
  template <typename F>
  void cover(const UInt<F>& slot, const Mask<F>& active) const {
    wavecomb::scatter<F>(alpha_.rows, F(1.f), slot, active);
  }

  /// Records a camera ray that hits the shape of light `light` at `p`.
  template <typename F>
  void hit_light(const CameraSetup& camera, const UInt<F>& slot, const Vec3<F>& p, const F& time,
                 const UInt<F>& light, const Mask<F>& active) const {
    const F depth = camera_depth<F>(camera, p, time, active);
    store_depth<F>(slot, depth, active);
    if (!hits_) return;
    const UInt<F> none(kNoHitId);
    store_row<FirstHitRow, F>(hits_.rows, slot,
                              {p, names_->light_object(light), none, none, depth,
                               camera_distance<F>(camera, p, time, active)},
                              active);
  }

  /// Records a camera ray that hits `surface` at `p`.
  template <typename F>
  void hit_surface(const CameraSetup& camera, const UInt<F>& slot, const Vec3<F>& p, const F& time,
                   const FirstSurface<F>& surface, const Mask<F>& active) const {
    const F depth = camera_depth<F>(camera, p, time, active);
    store_depth<F>(slot, depth, active);
    if (hits_)
      store_row<FirstHitRow, F>(
          hits_.rows, slot,
          {p, names_->template object<F>(surface.inst, surface.geom, active), surface.material,
           surface.inst, depth, camera_distance<F>(camera, p, time, active)},
          active);
  }

  bool wants_motion() const { return bool(motion_); }
  /// Records the screen motion of the first hit, in pixels (screen_motion.h).
  template <typename F>
  void move(const UInt<F>& slot, const Vec2<F>& pixels, const Mask<F>& active) const {
    scatter_words<F>(motion_.rows, pixels, slot * 2u, active);
  }

  /// Records a camera ray that scatters in a volume at `p`. Hits in volumes do not set the AOVs
  /// position, depth and instance.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void hit_volume(const CameraSetup& camera, const UInt<F>& slot,
                                               const Vec3<F>& p, const F& time,
                                               const VolumeHit<F>& volume_event,
                                               const Mask<F>& active) const {
    if (end_) scatter_ray_end<F>(slot, camera_depth<F>(camera, p, time, active), F(1.f), active);
    if (!hits_) return;
    const F far(std::numeric_limits<float>::infinity());
    const UInt<F> object = select(Mask<UInt<F>>(volume_event.in_mesh), volume_event.object,
                                  names_->volume_object(volume_event.volume));
    store_row<FirstHitRow, F>(
        hits_.rows, slot,
        {Vec3<F>(F(0.f)), object, volume_event.material, UInt<F>(kNoHitId), far, far}, active);
  }
  bool wants_transmittance() const { return transmits_; }
  /// Records `through`, the transmittance of volumes along the camera ray, which is 0 if the path
  /// scattered in a volume.
  template <typename F>
  void pass(const UInt<F>& slot, const Color<F>& through, const Mask<F>& active) const {
    scatter_words<F>(end_.rows, through,
                     slot * uint32_t{kRowWords<RayEndRow>} + word_of(&RayEndRow<float>::through),
                     active);
  }

 protected:
  size_t hit_bytes() const {
    size_t n = 0;
    for (const SlotRows* block : {&depth_, &end_, &hits_, &centre_, &motion_, &alpha_})
      n += block->bytes();
    return n;
  }
  /// Sets the AOV values of the first `slots` path slots to 0.
  void clear_hits(size_t slots) const {
    alpha_.zero(slots);
    motion_.zero(slots);
    constexpr float kFar = std::numeric_limits<float>::infinity();
    if (depth_) std::fill_n(depth_.rows, slots, kFar);
    for (uint32_t i = 0; end_ && i < slots; ++i)
      store_row<RayEndRow, float>(end_.rows, i, {kFar, 0.f, Color<float>(1.f)}, true);
    const FirstHitRow<float> none{Vec3<float>(0.f), kNoHitId, kNoHitId, kNoHitId, kFar, kFar};
    for (uint32_t i = 0; hits_ && i < slots; ++i)
      store_row<FirstHitRow, float>(hits_.rows, i, none, true);
  }

  SlotRows depth_, end_, hits_;
  SlotRows motion_;  ///< in pixels, x and y
  SlotRows centre_;  ///< squared distance of the sample from the pixel's centre, in pixels
  SlotRows alpha_;   ///< 1 if the camera ray hit something opaque, else 0

 private:
  /// Stores the depth at which a camera ray ends, and whether a volume stopped the ray, in the
  /// first two words of RayEndRow.
  template <typename F>
  void scatter_ray_end(const UInt<F>& slot, const F& depth, const F& in_volume,
                       const Mask<F>& active) const {
    const UInt<F> at = slot * uint32_t{kRowWords<RayEndRow>};
    scatter_words<F>(end_.rows, Vec2<F>{depth, in_volume}, at, active);
  }
  /// Stores the depth of a surface along the camera's axis.
  template <typename F>
  void store_depth(const UInt<F>& slot, const F& depth, const Mask<F>& active) const {
    if (depth_) scatter<F>(depth_.rows, depth, slot, active);
    if (end_) scatter_ray_end<F>(slot, depth, F(0.f), active);
  }

  const AovTables* names_ = nullptr;
  bool transmits_ = false;
};

}  // namespace wavecomb
