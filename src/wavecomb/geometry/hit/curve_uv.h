// SPDX-License-Identifier: Apache-2.0
/// Texture coordinates on curves and points. `geometry/hit/uv.h` includes this file.
#pragma once

#include "wavecomb/geometry/hit/surface_reader.h"

namespace wavecomb::detail {

/// Texture coordinates on curves and points. In lanes where the coordinates are `authored`, `d` is
/// the difference between the coordinates at the two ends of the curve segment.
template <typename F>
struct CurveUv {
  Vec2<F> uv, d;
  Mask<F> authored;
};

/// Returns texture coordinates at hits. Authored coordinates are interpolated between the ends of a
/// segment, and constant on points. Without authored coordinates, the texture coordinates are the
/// hit's (u, v). `strands`: lanes with curves.
template <typename F>
inline CurveUv<F> curve_uv(const MeshReader<F>& mesh, const UInt<F>& prim, const F& u, const F& v,
                           const Mask<F>& active, const Mask<F>& strands) {
  using U = UInt<F>;
  const Mask<F> authored = active & Mask<F>((mesh.flags & uint32_t{kUvsPerCorner}) != U(0u));
  CurveUv<F> out{{clamp(u, F(0.f), F(1.f)), v}, {F(0.f), F(0.f)}, authored};
  if (none(authored)) return out;
  const U corner = select(Mask<U>(strands), U(prim * 2u), prim);
  const Vec2<F> a = mesh.vec2(&MeshRecord::uvs, corner, authored);
  const Vec2<F> b = mesh.vec2(&MeshRecord::uvs, corner + 1u, authored & strands);
  const F t = select(strands, out.uv.x, F(0.f));
  out.d = {b.x - a.x, b.y - a.y};
  out.uv = {select(authored, fma(out.d.x, t, a.x), out.uv.x),
            select(authored, fma(out.d.y, t, a.y), out.uv.y)};
  return out;
}

}  // namespace wavecomb::detail
