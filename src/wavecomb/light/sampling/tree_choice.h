// SPDX-License-Identifier: Apache-2.0
/// Selection of a light for an illuminated point by a light tree.
///
/// A. Conty Estevez and C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree
/// Splitting", 2018, section 5: the traversal starts at the root and selects a child by its
/// importance
///
///   I = intensity max(cos t_l, 0) max(cos t_r, 0) / max(d^2, r^2 / 2)
///
/// where d is the distance from the point to the centre of the child's bounding sphere of radius r,
/// and t_l and t_r are the least angles that the normals of its lights and the receiver's normal
/// can make with the line between the point and any position in the sphere. The importance I is 0
/// only if none of the child's lights can contribute. The probability of a light is the product of
/// the probabilities of all choices on the path from the root to the light; the light's trail
/// (LightTreeView::trails) stores this path. Light samples and bounces that hit a light compute
/// this probability with the same code, as MIS requires.
#pragma once

#include "wavecomb/core/encoding/hash.h"
#include "wavecomb/core/math.h"
#include "wavecomb/core/rows/rows.h"
#include "wavecomb/core/vec.h"
#include "wavecomb/light/description/light_records.h"
#include "wavecomb/light/sampling/receiver.h"

namespace wavecomb {

/// Selected light and its selection probability. A pdf of 0 means that no light was selected.
template <typename F>
struct LightChoice {
  UInt<F> light;
  F pdf;
};

namespace detail {

/// Tolerance of cosines for rounding errors and for the quantisation of packed normals.
inline constexpr float kCosineSlack = 4e-3f;
/// Lower bound of the squared distance to a cluster, in units of its squared radius. In the paper,
/// the bound is 1, which treats all lights around a point as distant. On the street of
/// benchmarks/light_selection.py, a bound of 0.5 gives a quarter less error than a bound of 1 with
/// 1,000 lights, a third less with 10,000 lights, and the same error with 100 lights. Bounds below
/// 0.25 increase the error.
inline constexpr float kMinDistanceRatio = 0.5f;

/// Cosine and sine of an angle from 0 to pi.
template <typename F>
struct Angle {
  F cos, sin;
};
template <typename F>
inline Angle<F> less(const Angle<F>& a, const Angle<F>& b) {
  const Mask<F> within = a.cos > b.cos;
  return {select(within, F(1.f), fma(a.cos, b.cos, F(a.sin * b.sin))),
          select(within, F(0.f), fma(a.sin, b.cos, F(-(a.cos * b.sin))))};
}
template <typename F>
inline Angle<F> angle_of_cosine(const F& cosine) {
  const F c = clamp(cosine, F(-1.f), F(1.f));
  return {c, safe_sqrt(fma(F(-c), c, F(1.f)))};
}

/// Returns the importance I of a child of a light tree node. The child's 8 packed 32-bit words
/// start at r.
template <typename F>
inline F light_importance(const F* r, const Vec3<F>& p, const Vec3<F>& normal,
                          const Mask<F>& any_side) {
  using U = UInt<F>;
  const Vec3<F> d = Vec3<F>(r[0], r[1], r[2]) - p;
  const F d2 = length_squared(d), r2 = r[3] * r[3];
  const Mask<F> outside = (d2 > r2) & is_finite(d2);
  const F inverse = 1.f / sqrt(select(outside, d2, F(1.f)));
  const Vec3<F> w = d * inverse;
  const F sin_bound = select(outside, min(F(r[3] * inverse), F(1.f)), F(0.f));
  const Angle<F> bound{select(outside, safe_sqrt(fma(F(-sin_bound), sin_bound, F(1.f))), F(-1.f)),
                       sin_bound};

  const U xy = float_bits<F>(r[5]), zc = float_bits<F>(r[6]);
  const auto part = [](const U& bits) { return F(Int<F>(bits)); };
  const auto component = [&](const U& steps) {
    return fma(part(steps & 0xffffu), F(2.f / 65535.f), F(-1.f));
  };
  const F half_o = part((zc >> 16) & 0xffu) * (1.f / 255.f);
  const F half_e = part((zc >> 24) & 0x7fu) * (1.f / 127.f);
  const F cos_o = fma(F(-2.f * half_o), half_o, F(1.f));
  const Angle<F> cone{cos_o, F(2.f * half_o * safe_sqrt(fma(F(-half_o), half_o, F(1.f))))};
  const F cos_e = fma(F(-2.f * half_e), half_e, F(1.f));
  const F along = -dot(Vec3<F>(component(xy), component(U(xy >> 16)), component(zc)), w);
  const Mask<F> two_sided = Mask<F>((zc & 0x80000000u) != U(0u));
  const Angle<F> off = angle_of_cosine<F>(select(two_sided, abs(along), along));
  const F cos_light = less<F>(less<F>(off, cone), bound).cos;

  const Angle<F> off_receiver = angle_of_cosine<F>(dot(normal, w));
  const F cos_receiver = select(any_side, F(1.f), less<F>(off_receiver, bound).cos);
  const Mask<F> can_contribute =
      (cos_light > cos_e - kCosineSlack) & (cos_receiver > -kCosineSlack);
  const F importance = r[4] * max(cos_light, F(kCosineSlack)) * max(cos_receiver, F(kCosineSlack)) /
                       max(max(d2, F(r2 * kMinDistanceRatio)), F(1e-30f));
  return select(can_contribute, max(importance, F(1e-37f)), F(0.f));
}

/// Traversal of the light tree from its root to a light. `goes_right(probability of the left child,
/// lanes)` selects the children.
template <typename F, typename Choose>
inline LightChoice<F> descend(const LightTreeView& tree, const LightReceiver<F>& to,
                              const Mask<F>& active, const Choose& goes_right) {
  using U = UInt<F>;
  const Vec3<F> normal = unpack_normal<F>(to.normal);
  const Mask<F> any_side = Mask<F>(to.normal == U(0u));
  U at(tree.root);
  F pdf(1.f);
  Mask<F> descending = active & Mask<F>(at < U(kTreeLeaf));
  while (any(descending)) {
    const auto r = load_rows<16, F>(tree.nodes, at * 16u, descending);
    const F left = light_importance<F>(r.data(), to.p, normal, any_side);
    const F right = light_importance<F>(r.data() + 8, to.p, normal, any_side);
    const F sum = left + right;
    F p_left = left / select(sum > 0.f, sum, F(1.f));
    // If a child can contribute, its probability has a lower limit.
    const Mask<F> both = (left > 0.f) & (right > 0.f);
    p_left = select(both, clamp(p_left, F(0x1p-12f), F(1.f - 0x1p-12f)), p_left);
    const Mask<F> take_right = goes_right(p_left, descending);
    const F p = select(take_right, F(1.f - p_left), p_left);
    pdf = select(descending, select(sum > 0.f, F(pdf * p), F(0.f)), pdf);
    const U next = select(Mask<U>(take_right), float_bits<F>(r[15]), float_bits<F>(r[7]));
    at = select(Mask<U>(descending), next, at);
    descending = descending & (pdf > 0.f) & Mask<F>(at < U(kTreeLeaf));
  }
  const Mask<F> found = active & (pdf > 0.f);
  return {select(Mask<U>(found), U(at & ~kTreeLeaf), U(kNoLight)), select(found, pdf, F(0.f))};
}

/// Returns the light that u_light (a multiple of 2^-24 in [0, 1)) selects for `to`. Infinite lights
/// have fixed intervals of u_light. If u_light is in the interval of the tree, its position there,
/// rescaled to [0, 1), selects a child of the root. The position within the interval of the
/// selected child is rescaled in the same way for the next node. The bits of u_light that are
/// missing after many choices are generated from `to.seed`.
template <typename F>
[[gnu::noinline]] LightChoice<F> choose_by_tree(const LightView& view, const LightReceiver<F>& to,
                                                const F& u_light, const Mask<F>& active) {
  using U = UInt<F>;
  const LightTreeView& tree = view.tree;
  const U number = U(to_int<F>(F(u_light * 0x1p24f)));
  const Mask<F> in_tree = active & Mask<F>(number < U(tree.numbers));
  U bits = to.seed;
  const auto next_random = [&] {
    bits = bits * 747796405u + 2891336453u;
    return unit_float<F>(UInt<F>(bits ^ (bits >> 15)));
  };
  const auto below_one = [](const F& x) { return min(x, F(kOneMinusEpsilon)); };
  F u = below_one(F((F(Int<F>(number)) + next_random()) / F(static_cast<float>(tree.numbers))));
  LightChoice<F> choice =
      descend<F>(tree, to, in_tree, [&](const F& p_left, const Mask<F>& descending) {
        const Mask<F> right = descending & not_(u < p_left);
        const F p = select(right, F(1.f - p_left), p_left);
        const F rest = select(right, F(u - p_left), u);
        u = below_one(F((rest + next_random() * 0x1p-24f) / select(p > 0.f, p, F(1.f))));
        return right;
      });
  for (uint32_t i = 0; i < view.infinite_count; ++i) {
    const uint32_t begin = i == 0 ? tree.numbers : tree.infinite_ends[i - 1];
    const Mask<F> here =
        active & Mask<F>(number >= U(begin)) & Mask<F>(number < U(tree.infinite_ends[i]));
    choice.light = select(Mask<U>(here), U(i), choice.light);
    choice.pdf = select(here, F(tree.infinite_pdf[i]), choice.pdf);
  }
  const float share = static_cast<float>(tree.numbers) * 0x1p-24f;
  choice.pdf = select(in_tree, F(choice.pdf * share), choice.pdf);
  return choice;
}

/// Returns the probability with which choose_by_tree() selects finite light `light` for `to`.
template <typename F>
[[gnu::noinline]] F tree_pdf(const LightView& view, const UInt<F>& light,
                             const LightReceiver<F>& to, const Mask<F>& active) {
  using U = UInt<F>;
  const U trail = gather<U>(view.tree.trails, light, Mask<U>(active));
  const Mask<F> is_listed = active & Mask<F>(trail != U(kNoLight));
  U turns = trail;
  const LightChoice<F> choice =
      descend<F>(view.tree, to, is_listed, [&](const F&, const Mask<F>& descending) {
        const Mask<F> right = descending & Mask<F>((turns & 1u) != U(0u));
        turns = turns >> 1;
        return right;
      });
  const float share = static_cast<float>(view.tree.numbers) * 0x1p-24f;
  return select(is_listed, F(choice.pdf * share), F(0.f));
}

}  // namespace detail

}  // namespace wavecomb
