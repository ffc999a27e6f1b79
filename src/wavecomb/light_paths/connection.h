// SPDX-License-Identifier: Apache-2.0
/// Connection of a vertex to a point, such as a vertex of a light path.
///
/// Bounces and light samples of camera paths leave a surface point p from one of two origins o_s,
/// depending on their side (path/steps/light_connection.h). A light path from a point p' on a light
/// or surface, however, arrives at p instead of o_s. So that a connection matches the bounce of a
/// camera path that hits p', it uses the ray from o_s to p', where rays of light paths start
/// without the terminator offset.
#pragma once

#include "wavecomb/core/vec.h"

namespace wavecomb {

/// Ray from the surface of a vertex to a point.
template <typename F>
struct Connection {
  Vec3<F> o, d;
  F distance2;
  Mask<F> valid;  ///< whether the point lies on the same side of the surface as seen from `o`
};

/// Returns the connection from the vertex `at` to the point `to`.
template <typename F, typename Interaction>
WAVECOMB_INLINE Connection<F> connect_to_point(const Interaction& at, const Vec3<F>& to) {
  const Vec3<F> from_surface = to - at.s.p;
  Connection<F> c;
  c.o = at.origin(from_surface);
  const Vec3<F> offset = to - c.o;
  c.distance2 = length_squared(offset);
  const Mask<F> separated = c.distance2 > 0.f;
  c.d = offset * F(1.f / sqrt(select(separated, c.distance2, F(1.f))));
  const Mask<F> outside = dot(from_surface, at.s.ng) > 0.f, ray_outside = dot(c.d, at.s.ng) > 0.f;
  c.valid = separated & ((outside & ray_outside) | not_(Mask<F>(outside | ray_outside)));
  return c;
}

}  // namespace wavecomb
