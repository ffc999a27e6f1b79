// SPDX-License-Identifier: Apache-2.0
/// Directional shaping of a light's radiance: UsdLuxShapingAPI.
///
/// Let e be the direction of emission and a the light's axis, both unit vectors, and let
/// angle = acos(e . a). The radiance is multiplied by the factors
///   focus   lerp(focusTint, 1, |e . a|^focus)
///   cone    1 - smoothstep(lerp(coneAngle, 0, softness), coneAngle, angle)
///   IES     candela at (theta, phi) of e in the light's space, with theta scaled by angleScale;
///           scaled angles above 180 degrees use the value at 180, and angles below 0 are dark
#pragma once

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/light/records/record_reader.h"

namespace wavecomb::detail {

/// Returns the index of the last of n ascending numbers that is not greater than x, but at most n -
/// 2. `first` is the index of the first number in `numbers`.
template <typename F>
inline UInt<F> interval_below(const float* numbers, const UInt<F>& first, const UInt<F>& n,
                              const F& x, const Mask<F>& active) {
  using U = UInt<F>;
  U low(0u), high = n - 1u;
  for (;;) {
    const Mask<F> open = active & Mask<F>(high - low > U(1u));
    if (none(open)) return low;
    const U middle = (low + high) >> 1;
    const Mask<U> below(gather<F>(numbers, first + middle, open) <= x);
    low = select(Mask<U>(open) & below, middle, low);
    high = select(Mask<U>(open) & not_(below), middle, high);
  }
}

/// Position of x between two adjacent ascending numbers.
template <typename F>
struct Between {
  UInt<F> index;
  F part;  ///< in [0, 1]
};
template <typename F>
inline Between<F> find_between(const float* numbers, const UInt<F>& first, const UInt<F>& n,
                               const F& x, const Mask<F>& active) {
  const UInt<F> i = interval_below<F>(numbers, first, n, x, active);
  const F a = gather<F>(numbers, first + i, active), b = gather<F>(numbers, first + i + 1u, active);
  const F width = b - a;
  const F part = (x - a) / select(width > 0.f, width, F(1.f));
  return {i, clamp(part, F(0.f), F(1.f))};
}

/// Returns the candela of profiles `ies` at angles in degrees: theta from the axis, and phi around
/// it in [0, 360].
template <typename F>
inline F ies_candela(const LightView& view, const UInt<F>& ies, const F& theta, const F& phi,
                     const Mask<F>& active) {
  using U = UInt<F>;
  const auto field = [&](uint32_t IesRecord::* member) {
    return gather_member<F>(view.ies, member, ies, active);
  };
  const float* const numbers = view.ies_numbers;
  const U vertical = field(&IesRecord::vertical), rows = field(&IesRecord::vertical_count),
          horizontal = field(&IesRecord::horizontal), columns = field(&IesRecord::horizontal_count);
  const Mask<F> inside = active & (theta >= gather<F>(numbers, vertical, active)) &
                         (theta <= gather<F>(numbers, vertical + rows - 1u, active));
  if (none(inside)) return F(0.f);
  const Between<F> v = find_between<F>(numbers, vertical, rows, theta, inside);
  const U first = horizontal + columns;
  const auto at = [&](const U& column, const Mask<F>& lanes) {
    const U index = first + column * rows + v.index;
    const F a = gather<F>(numbers, index, lanes), b = gather<F>(numbers, index + 1u, lanes);
    return F(fma(v.part, F(b - a), a));
  };
  const Mask<F> around = inside & Mask<F>(columns > U(1u));
  if (none(around)) return select(inside, at(U(0u), inside), F(0.f));
  const Between<F> h = find_between<F>(numbers, horizontal, columns, phi, around);
  const U column = select(Mask<U>(around), h.index, U(0u));
  const F a = at(column, inside), b = select(around, at(column + 1u, around), a);
  return select(inside, F(fma(h.part, F(b - a), a)), F(0.f));
}

/// Returns the radiance in direction `emitted` after applying shaping record `shaping`. kNoShaping
/// leaves the radiance unchanged.
template <typename F>
inline Color<F> shaped(const LightView& view, const UInt<F>& shaping, const Vec3<F>& emitted,
                       const Color<F>& radiance, const Mask<F>& lanes) {
  using U = UInt<F>;
  const Mask<F> active = lanes & Mask<F>(shaping != U(kNoShaping));
  if (none(active)) return radiance;
  using R = ShapingRecord;
  const auto read = [&](auto R::* member) {
    return gather_member<F>(view.shapings, member, shaping, active);
  };
  Color<F> result = radiance;

  const Vec3<F> axis = read(&R::axis);
  const F cosine = clamp(dot(emitted, axis), F(-1.f), F(1.f));
  const F focus = read(&R::focus);
  const Mask<F> focused = active & (focus > 0.f);
  if (any(focused)) {
    const F power = pow(max(abs(cosine), F(1e-30f)), focus);
    const Color<F> tint = lerp(Color<F>(read(&R::tint)), Color<F>(F(1.f)), power);
    result = select<F>(focused, result * tint, result);
  }

  const F cone = read(&R::cone), start = read(&R::cone_start);
  const Mask<F> coned = active & (cone < kPi);
  if (any(coned)) {
    const Vec3<F> across = cross(emitted, axis);  // the sine is accurate for small angles
    const F angle = atan2(F(sqrt(length_squared(across))), cosine);
    const F width = cone - start;
    const F x = clamp(F((angle - start) / select(width > 0.f, width, F(1.f))), F(0.f), F(1.f));
    const F soft = 1.f - F(x * x) * fnma(F(2.f), x, F(3.f));
    const F hard = select(angle <= cone, F(1.f), F(0.f));
    result = select<F>(coned, result * select(width > 0.f, soft, hard), result);
  }

  const U ies = read(&R::ies);
  const Mask<F> profiled = active & Mask<F>(ies != U(kNoIes));
  if (any(profiled)) {
    const Vec3<F> e(dot(emitted, read(&R::to_light_x)), dot(emitted, read(&R::to_light_y)),
                    dot(emitted, read(&R::to_light_z)));
    constexpr float kDegrees = 57.29577951308232f;
    const F flat = sqrt(fma(e.x, e.x, F(e.y * e.y)));
    F theta = atan2(flat, F(-e.z)) * kDegrees;  // from -z
    const F scale = read(&R::angle_scale);
    const F safe = select(scale == 0.f, F(1.f), abs(scale));
    theta = select(scale < 0.f, F(F(theta - 180.f) / safe + 180.f), F(theta / safe));
    theta = select(scale == 0.f, theta, min(theta, F(180.f)));
    const F turn = atan2(F(-e.y), F(-e.x)) * kDegrees;
    const F phi = select(turn < 0.f, F(turn + 360.f), turn);
    const F candela = ies_candela<F>(view, ies, theta, phi, profiled);
    result = select<F>(profiled, result * F(candela * read(&R::ies_scale)), result);
  }
  return result;
}

}  // namespace wavecomb::detail
