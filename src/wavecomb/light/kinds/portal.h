// SPDX-License-Identifier: Apache-2.0
/// Portals: rectangles, such as the windows of a room, that guide the sampling of a dome.
///
/// Directions to the dome are sampled through the portals with probability a, uniformly in their
/// total solid angle, and otherwise by the dome's image. For both techniques, the density of a
/// direction is the density of the mixture,
///     p = a (number of portals it passes) / (sum of solid angles) + (1 - a) p_image,
/// so that light from outside the portals is also sampled. Let w be the solid angle of the portals,
/// and i the effective solid angle of the image (PortalGroup::image_solid_angle). Then a = i / (i +
/// w), clamped to a range, since the technique with the smaller solid angle samples the light
/// better. Only the image is sampled at points that see no portal from the room's side, or only
/// portals smaller than kMinRectSolidAngle.
#pragma once

#include "wavecomb/light/kinds/rect.h"

namespace wavecomb::detail {

inline constexpr float kMinPortalShare = 0.2f, kMaxPortalShare = 0.9f;

/// Portals of a dome light, as seen from the points `from`.
template <typename F>
class Portals {
 public:
  Portals(const LightView& view, uint32_t group, const Vec3<F>& from, const Mask<F>& active)
      : first_(view.portals + view.portal_groups[group].first),
        count_(view.portal_groups[group].count),
        from_(from),
        active_(active),
        image_(view.portal_groups[group].image_solid_angle),
        total_(0.f) {
    for_each([&](const SphericalRect<F>& r, const LightReader<F>&) {
      total_ += select(r.usable, r.solid_angle, F(0.f));
    });
  }

  /// Returns the probability of sampling a direction through the portals.
  F share() const {
    const F a = clamp(F(image_ / F(total_ + image_)), F(kMinPortalShare), F(kMaxPortalShare));
    return select(total_ > 0.f, a, F(0.f));
  }

  /// Samples directions through the portals, uniformly in solid angle. The result is undefined if
  /// no portal is visible.
  Vec3<F> sample(const F& u, const F& v) const {
    Vec3<F> wi(F(0.f), F(0.f), F(1.f));
    const F u_scaled = u * total_;
    F before(0.f);
    for_each([&](const SphericalRect<F>& r, const LightReader<F>& portal) {
      const Mask<F> here = r.usable & (u_scaled >= before);
      const F size = select(r.usable, r.solid_angle, F(1.f));
      const F inside = clamp(F((u_scaled - before) / size), F(0.f), F(kOneMinusEpsilon));
      const Vec2<F> at = sample_spherical_rect<F>(r, inside, v);
      const Vec3<F> q = fma(portal.u(), at.x, fma(portal.v(), at.y, portal.p()));
      wi = select<F>(here, make_direction<F>(q - from_).wi, wi);
      before += select(r.usable, size, F(0.f));
    });
    return wi;
  }

  /// Returns the density of the mixture of portal and image sampling. `through` marks the lanes in
  /// which `sample()` sampled the direction.
  F pdf(const Vec3<F>& wi, const F& image_pdf, const Mask<F>& through) const {
    F hits(0.f);
    for_each([&](const SphericalRect<F>& r, const LightReader<F>&) {
      const F dz = -dot(wi, r.n);
      const F scale = r.z / select(dz > 0.f, dz, F(1.f));
      const F x = dot(wi, r.x) * scale, y = dot(wi, r.y) * scale;
      const Mask<F> inside =
          r.usable & (dz > 0.f) & (x >= r.x0) & (x <= r.x1) & (y >= r.y0) & (y <= r.y1);
      hits += select(inside, F(1.f), F(0.f));
    });
    // A direction from `sample()` passes at least one portal. Rounding errors at a portal's edge
    // may give a count of 0.
    hits = select(through, max(hits, F(1.f)), hits);
    const F share_ = share();
    const F by_portals = hits / select(total_ > 0.f, total_, F(1.f));
    return fma(share_, by_portals, F((1.f - share_) * image_pdf));
  }

 private:
  template <typename Function>
  void for_each(const Function& one) const {
    for (uint32_t i = 0; i < count_; ++i) {
      const LightReader<F> portal(first_[i], active_);
      one(make_spherical_rect<F>(portal, from_), portal);
    }
  }

  const LightRecord* first_;
  uint32_t count_;
  Vec3<F> from_;
  Mask<F> active_;
  F image_;  ///< effective solid angle of the image (PortalGroup::image_solid_angle)
  F total_;  ///< total solid angle of the portals
};

}  // namespace wavecomb::detail
