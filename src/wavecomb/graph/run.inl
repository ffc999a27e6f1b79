// SPDX-License-Identifier: Apache-2.0
/// Definitions for run.h; include only where the templates are instantiated.
#pragma once

#include "wavecomb/graph/noise.h"
#include "wavecomb/graph/run.h"

namespace wavecomb {

namespace detail {

template <typename F>
inline Vec3<F> input_value(const GraphPoint<F>& at, GraphInput input) {
  switch (input) {
    case GraphInput::kUv:
      return {at.uv.x, at.uv.y, F(0.f)};
    case GraphInput::kPosition:
      return at.position;
    case GraphInput::kLocalPosition:
      return at.local_position;
    case GraphInput::kNormal:
      return at.normal;
    case GraphInput::kLocalNormal:
      return at.local_normal;
    case GraphInput::kTangent:
      return at.tangent;
    case GraphInput::kBitangent:
      return cross(at.normal, at.tangent) * at.handedness;
    case GraphInput::kView:
      return at.view;
    case GraphInput::kNormalX:
      return at.normal_x;
    case GraphInput::kNormalY:
      return at.normal_y;
    case GraphInput::kNormalZ:
      return at.normal_z;
  }
  return Vec3<F>(F(0.f));
}

/// Returns hue in turns, saturation and value (Smith, "Color Gamut Transform Pairs", 1978).
template <typename F>
inline Vec3<F> rgb_to_hsv(const Vec3<F>& c) {
  const F top = max(max(c.x, c.y), c.z), low = min(min(c.x, c.y), c.z), range = top - low;
  const Mask<F> grey = not_(range > 0.f);
  const F inv = 1.f / select(grey, F(1.f), range);
  const F r = (c.y - c.z) * inv, g = fma(F(c.z - c.x), inv, F(2.f)),
          b = fma(F(c.x - c.y), inv, F(4.f));
  F hue = select(c.x >= top, r, select(c.y >= top, g, b)) * (1.f / 6.f);
  hue = select(hue < 0.f, F(hue + 1.f), hue);
  const F saturation = select(top > 0.f, F(range / select(top > 0.f, top, F(1.f))), F(0.f));
  return {select(grey, F(0.f), hue), saturation, top};
}
/// Inverse of rgb_to_hsv; hue wraps around.
template <typename F>
inline Vec3<F> hsv_to_rgb(const Vec3<F>& c) {
  const F turns = noise::bounded<F>(c.x), hue = (turns - floor(turns)) * 6.f;
  const auto channel = [&](float shift) {
    // The ramp is 1 over two sixths of the hue circle, 0 over two sixths, and linear in between.
    const F k = hue + shift, wrapped = select(k >= 6.f, F(k - 6.f), k);
    const F ramp = clamp(min(wrapped, F(4.f - wrapped)), F(0.f), F(1.f));
    return F(c.z * fma(-c.y, ramp, F(1.f)));
  };
  return {channel(5.f), channel(3.f), channel(1.f)};
}

/// Returns sin and cos of an angle in radians, which may be large or NaN.
template <typename F>
inline SinCos<F> sincos_radians(const F& x) {
  const F turns = x * kInv2Pi;
  return sincos_2pi(F(clamp(select(turns == turns, turns, F(0.f)), F(-1e6f), F(1e6f))));
}

template <typename F>
inline F truth(const Mask<F>& m) {
  return select(m, F(1.f), F(0.f));
}

/// Returns x^y; 1 for y = 0, and 0 for x < 0 otherwise.
template <typename F>
inline F power(const F& x, const F& y) {
  return select(y == 0.f, F(1.f), wavecomb::pow(x, y));
}

/// Computes `width` noise values: three from one hash, and a fourth at an offset position.
template <typename F, size_t N>
inline void noise_values(const F (&p)[N], uint32_t width, F* out) {
  if (width == 1) {
    noise::perlin<1, F>(p, out);
    return;
  }
  F value[3];
  noise::perlin<3, F>(p, value);
  for (uint32_t i = 0; i < width && i < 3; ++i) out[i] = value[i];
  if (width < 4) return;
  constexpr float kNoiseOffset[3] = {19.f, 73.f, 29.f};
  F q[N];
  for (size_t i = 0; i < N; ++i) q[i] = p[i] + kNoiseOffset[i];
  noise::perlin<1, F>(q, out + 3);
}

/// Sums `count` octaves of gradient noise, each `lacunarity` times finer and scaled by `diminish`.
template <size_t K, typename F>
inline void octaves(const F (&p)[3], uint32_t count, const F& lacunarity, const F& diminish,
                    F* out) {
  F at[3] = {p[0], p[1], p[2]};
  F strength(1.f);
  for (size_t k = 0; k < K; ++k) out[k] = F(0.f);
  for (uint32_t i = 0; i < count; ++i) {
    F value[K];
    noise::perlin<K, F>(at, value);
    for (size_t k = 0; k < K; ++k) out[k] = fma(strength, value[k], out[k]);
    strength = strength * diminish;
    for (F& x : at) x = x * lacunarity;
  }
}
template <typename F>
inline void fractal_values(const F (&p)[3], uint32_t width, uint32_t count, const F& lacunarity,
                           const F& diminish, F* out) {
  const F offset_point[3] = {p[0] + 19.f, p[1] + 193.f, p[2] + 17.f};
  if (width < 3) {
    octaves<1, F>(p, count, lacunarity, diminish, out);
    if (width == 2) octaves<1, F>(offset_point, count, lacunarity, diminish, out + 1);
    return;
  }
  octaves<3, F>(p, count, lacunarity, diminish, out);
  if (width == 4) octaves<1, F>(offset_point, count, lacunarity, diminish, out + 3);
}

}  // namespace detail

template <typename F>
[[gnu::noinline]] void run_graph(const GraphView& view, const GraphProgram& program,
                                 const TextureView* textures, const GraphPoint<F>& at,
                                 const Mask<F>& active, F* registers) {
  const float* const constants = view.constants + program.first_constant;
  const GraphOp* const end = view.ops + program.first_op + program.op_count;
  for (const GraphOp* next = view.ops + program.first_op; next != end; ++next) {
    const GraphOp& op = *next;
    F* const to = registers + op.to;
    const uint32_t width = op.width;
    const auto in = [&](uint32_t k, uint32_t i) {
      const uint32_t from = op.from[k] + ((op.steps >> k & 1u) != 0 ? i : 0u);
      return (from & kGraphConstant) != 0 ? F(constants[from & (kGraphConstant - 1u)])
                                          : registers[from];
    };
    // An operation reads its operands while it writes results, so check_graph forbids overlap.
    const auto one = [&](const auto& f) {
      for (uint32_t i = 0; i < width; ++i) to[i] = f(in(0, i));
    };
    const auto two = [&](const auto& f) {
      for (uint32_t i = 0; i < width; ++i) to[i] = f(in(0, i), in(1, i));
    };
    const auto three = [&](const auto& f) {
      for (uint32_t i = 0; i < width; ++i) to[i] = f(in(0, i), in(1, i), in(2, i));
    };
    const auto put = [&](const Vec3<F>& v) {
      const F c[3] = {v.x, v.y, v.z};
      for (uint32_t i = 0; i < width && i < 3; ++i) to[i] = c[i];
    };
    const auto vec3 = [&](uint32_t k) { return Vec3<F>(in(k, 0), in(k, 1), in(k, 2)); };
    const F zero(0.f);
    switch (static_cast<GraphCode>(op.code)) {
      case GraphCode::kCopy:
        for (uint32_t i = 0; i < width; ++i) to[i] = in(i, 0);
        break;
      case GraphCode::kInput:
        put(detail::input_value<F>(at, static_cast<GraphInput>(op.number)));
        break;
      case GraphCode::kImage: {
        const GraphImage& image = view.images[program.first_image + op.number];
        const Texel<F> texel = lookup<F>(textures[image.texture], in(0, 0), in(0, 1),
                                         at.footprint.scaled(F(image.stretch)), active);
        const F c[4] = {texel.r, texel.g, texel.b, texel.a};
        for (uint32_t i = 0; i < width; ++i) to[i] = c[i];
        break;
      }
      case GraphCode::kAdd:
        two([](const F& a, const F& b) { return F(a + b); });
        break;
      case GraphCode::kSubtract:
        two([](const F& a, const F& b) { return F(a - b); });
        break;
      case GraphCode::kMultiply:
        two([](const F& a, const F& b) { return F(a * b); });
        break;
      case GraphCode::kDivide:
        two([&](const F& a, const F& b) {
          const Mask<F> none = b == 0.f;
          return F(select(none, zero, F(a / select(none, F(1.f), b))));
        });
        break;
      case GraphCode::kModulo:
        two([&](const F& a, const F& b) {
          const Mask<F> none = b == 0.f;
          const F quotient = floor(F(a / select(none, F(1.f), b)));
          return F(select(none, zero, F(a - F(b * quotient))));
        });
        break;
      case GraphCode::kPower:
        two([](const F& a, const F& b) { return detail::power<F>(a, b); });
        break;
      case GraphCode::kMin:
        two([](const F& a, const F& b) { return wavecomb::min(a, b); });
        break;
      case GraphCode::kMax:
        two([](const F& a, const F& b) { return wavecomb::max(a, b); });
        break;
      case GraphCode::kAtan2:
        two([](const F& a, const F& b) { return wavecomb::atan2(a, b); });
        break;
      case GraphCode::kLess:
        two([](const F& a, const F& b) { return detail::truth<F>(a < b); });
        break;
      case GraphCode::kEqual:
        two([](const F& a, const F& b) { return detail::truth<F>(a == b); });
        break;
      case GraphCode::kMix:
        three([](const F& a, const F& b, const F& c) { return fma(F(b - a), c, a); });
        break;
      case GraphCode::kClamp:
        three([](const F& a, const F& b, const F& c) { return wavecomb::clamp(a, b, c); });
        break;
      case GraphCode::kSelect:
        three([](const F& a, const F& b, const F& c) { return F(select(a != 0.f, b, c)); });
        break;
      case GraphCode::kSmoothstep:
        three([](const F& x, const F& low, const F& high) {
          const F range = high - low;
          const Mask<F> none = range == 0.f;
          const F step = select(x < low, F(0.f), F(1.f));
          const F t = wavecomb::clamp(F(F(x - low) / select(none, F(1.f), range)), F(0.f), F(1.f));
          return F(select(none, step, F(F(t * t) * fma(t, F(-2.f), F(3.f)))));
        });
        break;
      case GraphCode::kAbs:
        one([](const F& a) { return wavecomb::abs(a); });
        break;
      case GraphCode::kFloor:
        one([](const F& a) { return wavecomb::floor(a); });
        break;
      case GraphCode::kSign:
        one([](const F& a) {
          return F(select(a > 0.f, F(1.f), F(select(a < 0.f, F(-1.f), F(0.f)))));
        });
        break;
      case GraphCode::kSqrt:
        one([](const F& a) { return safe_sqrt(a); });
        break;
      case GraphCode::kExp:
        one([](const F& a) { return wavecomb::exp(a); });
        break;
      case GraphCode::kLog:
        one([](const F& a) {
          return wavecomb::log(wavecomb::clamp(a, F(1.17549435e-38f), F(3.4e38f)));
        });
        break;
      case GraphCode::kSin:
        one([](const F& a) { return detail::sincos_radians<F>(a).sin; });
        break;
      case GraphCode::kCos:
        one([](const F& a) { return detail::sincos_radians<F>(a).cos; });
        break;
      case GraphCode::kAcos:
        one([](const F& a) { return wavecomb::acos(a); });
        break;
      case GraphCode::kDot: {
        F sum = in(0, 0) * in(1, 0);
        for (uint32_t i = 1; i < width; ++i) sum = fma(in(0, i), in(1, i), sum);
        to[0] = sum;
        break;
      }
      case GraphCode::kCross:
        put(cross(vec3(0), vec3(1)));
        break;
      case GraphCode::kRgbToHsv:
        put(detail::rgb_to_hsv<F>(vec3(0)));
        break;
      case GraphCode::kHsvToRgb:
        put(detail::hsv_to_rgb<F>(vec3(0)));
        break;
      case GraphCode::kNoise2: {
        const F p[2] = {in(0, 0), in(0, 1)};
        detail::noise_values<F>(p, width, to);
        break;
      }
      case GraphCode::kNoise3: {
        const F p[3] = {in(0, 0), in(0, 1), in(0, 2)};
        detail::noise_values<F>(p, width, to);
        break;
      }
      case GraphCode::kFractal3: {
        const F p[3] = {in(0, 0), in(0, 1), in(0, 2)};
        const F lacunarity = in(1, 0), diminish = in(2, 0);
        detail::fractal_values<F>(p, width, op.number, lacunarity, diminish, to);
        break;
      }
      case GraphCode::kCell2: {
        const F p[2] = {in(0, 0), in(0, 1)};
        for (uint32_t i = 0; i < width; ++i)
          to[i] = width == 1 ? noise::cell<F>(p) : noise::cell<F>(p, i);
        break;
      }
      case GraphCode::kCell3: {
        const F p[3] = {in(0, 0), in(0, 1), in(0, 2)};
        for (uint32_t i = 0; i < width; ++i)
          to[i] = width == 1 ? noise::cell<F>(p) : noise::cell<F>(p, i);
        break;
      }
      case GraphCode::kWorley2: {
        const F p[2] = {in(0, 0), in(0, 1)};
        const noise::Worley<F> w = noise::worley<F>(p, in(1, 0));
        for (uint32_t i = 0; i < width; ++i) to[i] = op.number == 1 ? w.cell : w.nearest[i];
        break;
      }
      case GraphCode::kWorley3: {
        const F p[3] = {in(0, 0), in(0, 1), in(0, 2)};
        const noise::Worley<F> w = noise::worley<F>(p, in(1, 0));
        for (uint32_t i = 0; i < width; ++i) to[i] = op.number == 1 ? w.cell : w.nearest[i];
        break;
      }
      case GraphCode::kAttribute:
        one([](const F& a) { return a; });
        read_attribute<F>(view.attributes, op.number, width, at.mesh_position, active, to);
        break;
    }
  }
}

}  // namespace wavecomb
