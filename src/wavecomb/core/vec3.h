// SPDX-License-Identifier: Apache-2.0
/// Vectors of two and three components that do not depend on Dr.Jit, for public headers.
#pragma once

#include <type_traits>

namespace wavecomb {

template <typename F>
struct Vec2 {
  F x, y;
};

/// Vector, point, normal or linear Rec.709 colour (r, g, b = x, y, z), depending on use.
template <typename F>
struct Vec3 {
  F x{0.f}, y{0.f}, z{0.f};

  Vec3() = default;
  explicit Vec3(const F& s) : x(s), y(s), z(s) {}
  Vec3(const F& x_, const F& y_, const F& z_) : x(x_), y(y_), z(z_) {}
  /// Creates a packet vector with the same vector in all lanes.
  template <typename G = F, typename = std::enable_if_t<!std::is_same_v<G, float>>>
  explicit Vec3(const Vec3<float>& v) : x(v.x), y(v.y), z(v.z) {}

  Vec3 operator-() const { return {-x, -y, -z}; }
  friend Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vec3 operator*(const Vec3& a, const Vec3& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
  friend Vec3 operator*(const Vec3& a, const F& s) { return {a.x * s, a.y * s, a.z * s}; }
  friend Vec3 operator*(const F& s, const Vec3& a) { return a * s; }
  Vec3& operator+=(const Vec3& b) { return *this = *this + b; }
  Vec3& operator*=(const Vec3& b) { return *this = *this * b; }
  Vec3& operator*=(const F& s) { return *this = *this * s; }
};

template <typename F>
using Color = Vec3<F>;

}  // namespace wavecomb
