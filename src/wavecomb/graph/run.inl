// SPDX-License-Identifier: Apache-2.0
/// Definitions of the function templates in run.h; include this file only where they are
/// instantiated.
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
/// Converts hue, saturation and value to RGB: the inverse of rgb_to_hsv(). Hues outside [0, 1) wrap
/// around.
template <typename F>
inline Vec3<F> hsv_to_rgb(const Vec3<F>& c) {
  const F turns = noise::bounded<F>(c.x), hue = (turns - floor(turns)) * 6.f;
  const auto channel = [&](float shift) {
    // As a function of hue, `ramp` is 1 on one third of the hue circle, 0 on the opposite third,
    // and linear in between.
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

/// Returns a / b; 0 for b = 0.
template <typename F>
inline F quotient(const F& a, const F& b) {
  const Mask<F> none = b == 0.f;
  return select(none, F(0.f), F(a / select(none, F(1.f), b)));
}
/// Returns a - b floor(a / b); 0 for b = 0.
template <typename F>
inline F modulo(const F& a, const F& b) {
  const Mask<F> none = b == 0.f;
  const F whole = floor(F(a / select(none, F(1.f), b)));
  return select(none, F(0.f), F(a - F(b * whole)));
}
/// Returns the cubic smoothstep of x, which rises from 0 at `low` to 1 at `high`, or a step
/// function if `low` and `high` are equal.
template <typename F>
inline F smoothstep(const F& x, const F& low, const F& high) {
  const F range = high - low;
  const Mask<F> none = range == 0.f;
  const F step = select(x < low, F(0.f), F(1.f));
  const F t = wavecomb::clamp(F(F(x - low) / select(none, F(1.f), range)), F(0.f), F(1.f));
  return select(none, step, F(F(t * t) * fma(t, F(-2.f), F(3.f))));
}
template <typename F>
inline F sign_of(const F& a) {
  return select(a > 0.f, F(1.f), F(select(a < 0.f, F(-1.f), F(0.f))));
}
/// Returns the logarithm of a number clamped to the positive normal range.
template <typename F>
inline F bounded_log(const F& a) {
  return wavecomb::log(wavecomb::clamp(a, F(1.17549435e-38f), F(3.4e38f)));
}

/// Returns x^y. The result is 1 if y is 0, and 0 if x < 0 and y is not 0.
template <typename F>
inline F power(const F& x, const F& y) {
  return select(y == 0.f, F(1.f), wavecomb::pow(x, y));
}

/// Computes `width` noise values. Up to three values share one hash; a fourth is evaluated at an
/// offset position.
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

/// Sums `count` octaves of gradient noise, where each octave is `lacunarity` times finer than the
/// previous octave and scaled by a further factor `diminish`.
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

/// Operation of a graph with its operands and results. An operation may write results before it has
/// read all operands, so check_graph() requires that the registers of results and operands do not
/// overlap.
template <typename F>
struct GraphStep {
  const GraphOp& code;
  const float* constants;  ///< of the program
  const F* registers;
  F* to;           ///< first result
  uint32_t width;  ///< number of results

  /// Returns component `i` of operand `k`.
  WAVECOMB_INLINE F in(uint32_t k, uint32_t i) const {
    const uint32_t from = code.from[k] + ((code.steps >> k & 1u) != 0 ? i : 0u);
    return (from & kGraphConstant) != 0 ? F(constants[from & (kGraphConstant - 1u)])
                                        : registers[from];
  }
  WAVECOMB_INLINE Vec3<F> vec3(uint32_t k) const { return {in(k, 0), in(k, 1), in(k, 2)}; }
  // Apply a function of one, two or three operands to each component.
  template <typename Function>
  WAVECOMB_INLINE void one(const Function& f) const {
    for (uint32_t i = 0; i < width; ++i) to[i] = f(in(0, i));
  }
  template <typename Function>
  WAVECOMB_INLINE void two(const Function& f) const {
    for (uint32_t i = 0; i < width; ++i) to[i] = f(in(0, i), in(1, i));
  }
  template <typename Function>
  WAVECOMB_INLINE void three(const Function& f) const {
    for (uint32_t i = 0; i < width; ++i) to[i] = f(in(0, i), in(1, i), in(2, i));
  }
  WAVECOMB_INLINE void put(const Vec3<F>& v) const {
    const F c[3] = {v.x, v.y, v.z};
    for (uint32_t i = 0; i < width && i < 3; ++i) to[i] = c[i];
  }
};

/// Runs an arithmetic operation on each component. Returns false for operations that are not
/// arithmetic.
template <typename F>
WAVECOMB_INLINE bool run_arithmetic(const GraphStep<F>& op) {
  switch (static_cast<GraphCode>(op.code.code)) {
    case GraphCode::kAdd:
      op.two([](const F& a, const F& b) { return F(a + b); });
      return true;
    case GraphCode::kSubtract:
      op.two([](const F& a, const F& b) { return F(a - b); });
      return true;
    case GraphCode::kMultiply:
      op.two([](const F& a, const F& b) { return F(a * b); });
      return true;
    case GraphCode::kDivide:
      op.two([](const F& a, const F& b) { return quotient<F>(a, b); });
      return true;
    case GraphCode::kModulo:
      op.two([](const F& a, const F& b) { return modulo<F>(a, b); });
      return true;
    case GraphCode::kPower:
      op.two([](const F& a, const F& b) { return power<F>(a, b); });
      return true;
    case GraphCode::kMin:
      op.two([](const F& a, const F& b) { return wavecomb::min(a, b); });
      return true;
    case GraphCode::kMax:
      op.two([](const F& a, const F& b) { return wavecomb::max(a, b); });
      return true;
    case GraphCode::kAtan2:
      op.two([](const F& a, const F& b) { return wavecomb::atan2(a, b); });
      return true;
    case GraphCode::kLess:
      op.two([](const F& a, const F& b) { return truth<F>(a < b); });
      return true;
    case GraphCode::kEqual:
      op.two([](const F& a, const F& b) { return truth<F>(a == b); });
      return true;
    case GraphCode::kMix:
      op.three([](const F& a, const F& b, const F& c) { return fma(F(b - a), c, a); });
      return true;
    case GraphCode::kClamp:
      op.three([](const F& a, const F& b, const F& c) { return wavecomb::clamp(a, b, c); });
      return true;
    case GraphCode::kSelect:
      op.three([](const F& a, const F& b, const F& c) { return F(select(a != 0.f, b, c)); });
      return true;
    case GraphCode::kSmoothstep:
      op.three([](const F& x, const F& a, const F& b) { return smoothstep<F>(x, a, b); });
      return true;
    case GraphCode::kAbs:
      op.one([](const F& a) { return wavecomb::abs(a); });
      return true;
    case GraphCode::kFloor:
      op.one([](const F& a) { return wavecomb::floor(a); });
      return true;
    case GraphCode::kSign:
      op.one([](const F& a) { return sign_of<F>(a); });
      return true;
    case GraphCode::kSqrt:
      op.one([](const F& a) { return safe_sqrt(a); });
      return true;
    case GraphCode::kExp:
      op.one([](const F& a) { return wavecomb::exp(a); });
      return true;
    case GraphCode::kLog:
      op.one([](const F& a) { return bounded_log<F>(a); });
      return true;
    case GraphCode::kSin:
      op.one([](const F& a) { return sincos_radians<F>(a).sin; });
      return true;
    case GraphCode::kCos:
      op.one([](const F& a) { return sincos_radians<F>(a).cos; });
      return true;
    case GraphCode::kAcos:
      op.one([](const F& a) { return wavecomb::acos(a); });
      return true;
    default:
      return false;
  }
}

/// Runs procedural patterns. Returns false if the operation is not a procedural pattern.
template <typename F>
WAVECOMB_INLINE bool run_pattern(const GraphStep<F>& op) {
  switch (static_cast<GraphCode>(op.code.code)) {
    case GraphCode::kNoise2: {
      const F p[2] = {op.in(0, 0), op.in(0, 1)};
      noise_values<F>(p, op.width, op.to);
      return true;
    }
    case GraphCode::kNoise3: {
      const F p[3] = {op.in(0, 0), op.in(0, 1), op.in(0, 2)};
      noise_values<F>(p, op.width, op.to);
      return true;
    }
    case GraphCode::kFractal3: {
      const F p[3] = {op.in(0, 0), op.in(0, 1), op.in(0, 2)};
      const F lacunarity = op.in(1, 0), diminish = op.in(2, 0);
      fractal_values<F>(p, op.width, op.code.number, lacunarity, diminish, op.to);
      return true;
    }
    case GraphCode::kCell2: {
      const F p[2] = {op.in(0, 0), op.in(0, 1)};
      for (uint32_t i = 0; i < op.width; ++i)
        op.to[i] = op.width == 1 ? noise::cell<F>(p) : noise::cell<F>(p, i);
      return true;
    }
    case GraphCode::kCell3: {
      const F p[3] = {op.in(0, 0), op.in(0, 1), op.in(0, 2)};
      for (uint32_t i = 0; i < op.width; ++i)
        op.to[i] = op.width == 1 ? noise::cell<F>(p) : noise::cell<F>(p, i);
      return true;
    }
    case GraphCode::kWorley2: {
      const F p[2] = {op.in(0, 0), op.in(0, 1)};
      const noise::Worley<F> w = noise::worley<F>(p, op.in(1, 0));
      for (uint32_t i = 0; i < op.width; ++i)
        op.to[i] = op.code.number == 1 ? w.cell : w.nearest[i];
      return true;
    }
    case GraphCode::kWorley3: {
      const F p[3] = {op.in(0, 0), op.in(0, 1), op.in(0, 2)};
      const noise::Worley<F> w = noise::worley<F>(p, op.in(1, 0));
      for (uint32_t i = 0; i < op.width; ++i)
        op.to[i] = op.code.number == 1 ? w.cell : w.nearest[i];
      return true;
    }
    default:
      return false;
  }
}

}  // namespace detail

template <typename F>
[[gnu::noinline]] void run_graph(const GraphView& view, const GraphProgram& program,
                                 const TextureView* textures, const GraphPoint<F>& at,
                                 const Mask<F>& active, F* registers) {
  const GraphOp* const end = view.ops + program.first_op + program.op_count;
  for (const GraphOp* next = view.ops + program.first_op; next != end; ++next) {
    const detail::GraphStep<F> op{*next, view.constants + program.first_constant, registers,
                                  registers + next->to, next->width};
    if (detail::run_arithmetic<F>(op) || detail::run_pattern<F>(op)) continue;
    switch (static_cast<GraphCode>(next->code)) {
      case GraphCode::kCopy:
        for (uint32_t i = 0; i < op.width; ++i) op.to[i] = op.in(i, 0);
        break;
      case GraphCode::kInput:
        op.put(detail::input_value<F>(at, static_cast<GraphInput>(op.code.number)));
        break;
      case GraphCode::kImage: {
        const GraphImage& image = view.images[program.first_image + op.code.number];
        const Texel<F> texel = lookup<F>(textures[image.texture], op.in(0, 0), op.in(0, 1),
                                         at.footprint.scaled(F(image.stretch)), active);
        const F c[4] = {texel.r, texel.g, texel.b, texel.a};
        for (uint32_t i = 0; i < op.width; ++i) op.to[i] = c[i];
        break;
      }
      case GraphCode::kDot: {
        F sum = op.in(0, 0) * op.in(1, 0);
        for (uint32_t i = 1; i < op.width; ++i) sum = fma(op.in(0, i), op.in(1, i), sum);
        op.to[0] = sum;
        break;
      }
      case GraphCode::kCross:
        op.put(cross(op.vec3(0), op.vec3(1)));
        break;
      case GraphCode::kRgbToHsv:
        op.put(detail::rgb_to_hsv<F>(op.vec3(0)));
        break;
      case GraphCode::kHsvToRgb:
        op.put(detail::hsv_to_rgb<F>(op.vec3(0)));
        break;
      case GraphCode::kAttribute:
        op.one([](const F& a) { return a; });
        read_attribute<F>(view.attributes, op.code.number, op.width, at.mesh_position, active,
                          op.to);
        break;
      default:
        break;
    }
  }
}

}  // namespace wavecomb
