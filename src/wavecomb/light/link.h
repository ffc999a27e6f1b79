// SPDX-License-Identifier: Apache-2.0
/// Which surfaces a light shines on, and which stand in its way.
#pragma once

#include "wavecomb/light/record.h"

namespace wavecomb {

/// Lanes where a surface of class `link` (0: none, as a camera has) is in set `set` of geometry
/// (kNoSet: in all).
template <typename F>
inline Mask<F> is_linked(const LinkView& links, const UInt<F>& link, const UInt<F>& set,
                         const Mask<F>& active) {
  using U = UInt<F>;
  const Mask<F> asked = active & Mask<F>(set != U(kNoSet)) & Mask<F>(link != U(0u));
  if (none(asked)) return Mask<F>(true);
  const U word = gather<U>(links.members, (link - 1u) * links.words + (set >> 5), Mask<U>(asked));
  return not_(asked) | Mask<F>(((word >> (set & 31u)) & 1u) != U(0u));
}

/// Lanes where light `light` shines on surfaces of class `link`; what merely glows shines on all.
template <typename F>
inline Mask<F> shines_on(const LightView& view, const UInt<F>& link, const UInt<F>& light,
                         const Mask<F>& active) {
  const UInt<F> record = detail::record_of<F>(view, light, active);
  const Mask<F> known = active & Mask<F>(record != UInt<F>(kNoLight));
  if (none(known)) return Mask<F>(true);
  const detail::LightReader<F> reader(view.lights, record, known);
  const UInt<F> set = reader[&LightRecord::light_link];
  return not_(known) | is_linked<F>(view.links, link, set, known);
}

/// For shadow rays to light `light`: 1 + the set of what stands in their way, 0: everything.
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
