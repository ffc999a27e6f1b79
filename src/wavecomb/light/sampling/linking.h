// SPDX-License-Identifier: Apache-2.0
/// Light linking: the surfaces that a light illuminates, and the objects that cast its shadows.
#pragma once

#include "wavecomb/light/records/record_reader.h"

namespace wavecomb {

/// Returns the lanes in which surfaces of link class `link` (0 if there is no surface, for example
/// at the camera) belong to geometry set `set`; the set kNoSet contains all geometry.
template <typename F>
inline Mask<F> is_linked(const LinkView& links, const UInt<F>& link, const UInt<F>& set,
                         const Mask<F>& active) {
  using U = UInt<F>;
  const Mask<F> restricted = active & Mask<F>(set != U(kNoSet)) & Mask<F>(link != U(0u));
  if (none(restricted)) return Mask<F>(true);
  const U word =
      gather<U>(links.members, (link - 1u) * links.words + (set >> 5), Mask<U>(restricted));
  return not_(restricted) | Mask<F>(((word >> (set & 31u)) & 1u) != U(0u));
}

/// Returns the lanes in which light `light` illuminates surfaces of link class `link`. Emissive
/// triangles without a light record illuminate all surfaces.
template <typename F>
inline Mask<F> illuminates(const LightView& view, const UInt<F>& link, const UInt<F>& light,
                           const Mask<F>& active) {
  const UInt<F> record = detail::record_of<F>(view, light, active);
  const Mask<F> known = active & Mask<F>(record != UInt<F>(kNoLight));
  if (none(known)) return Mask<F>(true);
  const detail::LightReader<F> reader(view.lights, record, known);
  const UInt<F> set = reader[&LightRecord::light_link];
  return not_(known) | is_linked<F>(view.links, link, set, known);
}

/// Returns, for shadow rays to light `light`, 1 + the index of the set of geometry that blocks
/// them, or 0 if all geometry blocks them.
template <typename F>
inline UInt<F> shadow_set(const LightView& view, const UInt<F>& light, const Mask<F>& active) {
  using U = UInt<F>;
  const U record = detail::record_of<F>(view, light, active);
  const Mask<F> known = active & Mask<F>(record != U(kNoLight));
  if (none(known)) return U(0u);
  const detail::LightReader<F> reader(view.lights, record, known);
  return select(Mask<U>(known), reader[&LightRecord::shadow_link] + 1u, U(0u));
}

}  // namespace wavecomb
