// SPDX-License-Identifier: Apache-2.0
/// Costs of splits while a light tree is built, by the surface area orientation heuristic (Conty
/// Estevez and Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", 2018).
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>

namespace wavecomb::light_tree {

/// SIMD vectors of three components; the fourth component is unused.
using Float4 = float __attribute__((vector_size(16)));
using Int4 = int32_t __attribute__((vector_size(16)));

inline Float4 least_of(const Float4& a, const Float4& b) {
  return b < a ? b : a;
}
inline Float4 most_of(const Float4& a, const Float4& b) {
  return a < b ? b : a;
}

/// Properties of a light that the split heuristic uses.
struct alignas(16) Item {
  float lo[3];
  uint32_t light;
  float hi[3];
  float intensity;
  /// Axis of the light's normals times (1 + cos(cone angle)) / 2; the fourth component is 0.
  float axis[4];

  float centre(size_t k) const { return 0.5f * lo[k] + 0.5f * hi[k]; }
  Float4 low() const {
    Int4 bits;
    std::memcpy(&bits, lo, sizeof bits);
    return std::bit_cast<Float4>(bits & Int4{-1, -1, -1, 0});
  }
  Float4 high() const { return load(hi); }
  Float4 normals() const { return load(axis); }
  Float4 middle() const { return 0.5f * low() + 0.5f * high(); }

 private:
  static Float4 load(const float* at) {
    Float4 v;
    std::memcpy(&v, at, sizeof v);
    return v;
  }
};
static_assert(sizeof(Item) == 48);

/// Sums over the lights in a bin, from which the cost of a split is computed.
struct Bin {
  Float4 lo = {INFINITY, INFINITY, INFINITY, 0}, hi = {-INFINITY, -INFINITY, -INFINITY, 0};
  Float4 axis = {0, 0, 0, 0};
  double intensity = 0;
  size_t count = 0;

  void add(const Item& item) {
    // Triangles emit from both sides, so the sign of their normals is irrelevant. Flip each normal
    // to the side of the sum.
    const Float4 other = item.normals(), product = axis * other;
    const int32_t flip = product[0] + product[1] + product[2] < 0 ? INT32_MIN : 0;
    merge(item.low(), item.high(),
          std::bit_cast<Float4>(std::bit_cast<Int4>(other) ^ Int4{flip, flip, flip, flip}));
    intensity += double{item.intensity};
    count += 1;
  }
  void add(const Bin& other) {
    merge(other.lo, other.hi, other.axis);
    intensity += other.intensity;
    count += other.count;
  }

 private:
  void merge(const Float4& low, const Float4& high, const Float4& normals) {
    lo = least_of(lo, low);
    hi = most_of(hi, high);
    axis += normals;
  }
};

/// Returns the cosine-weighted solid angle that lights emit into, for normals in a cone of the
/// given angle and emission up to pi / 2 from each normal (Conty Estevez and Kulla 2018, eq. 1).
inline double emission_measure(double angle) {
  const double reach = std::min(angle + std::numbers::pi / 2, std::numbers::pi);
  return 2 * std::numbers::pi * (1 - std::cos(angle)) +
         std::numbers::pi / 2 *
             (2 * reach * std::sin(angle) - std::cos(angle - 2 * reach) -
              2 * angle * std::sin(angle) + std::cos(angle));
}

/// Table of emission_measure(), indexed by the cosine of the angle from -1 to 1.
class MeasureTable {
 public:
  MeasureTable() {
    for (size_t i = 0; i <= kSteps; ++i)
      values_[i] = emission_measure(std::acos(2.0 * static_cast<double>(i) / kSteps - 1));
  }
  double operator()(double cosine) const {
    const double at = std::clamp(cosine * 0.5 + 0.5, 0.0, 1.0) * kSteps;
    return values_[static_cast<size_t>(std::nearbyint(at))];
  }

 private:
  static constexpr size_t kSteps = 256;
  std::array<double, kSteps + 1> values_;
};

/// Returns the cost of one side of a split: intensity times bound times orientation. The bound is
/// the area of a sphere, which is proportional to the square of the bounding box diagonal. The
/// orientation follows from the mean of the normals, which for normals spread over a cone has the
/// length (1 + cos) / 2.
inline double cost(const Bin& bin, const MeasureTable& measure) {
  double diagonal2 = 0, sum2 = 0;
  for (size_t k = 0; k < 3; ++k) {
    const double extent = double{bin.hi[k]} - double{bin.lo[k]};
    diagonal2 += extent * extent;
    sum2 += double{bin.axis[k]} * double{bin.axis[k]};
  }
  const double cosine = 2 * std::sqrt(sum2) / static_cast<double>(bin.count) - 1;
  return bin.intensity * diagonal2 * measure(cosine);
}

}  // namespace wavecomb::light_tree
