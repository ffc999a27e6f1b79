// SPDX-License-Identifier: Apache-2.0
/// Affine transforms.
#pragma once

#include "wavecomb/core/vec3.h"

namespace wavecomb {

/// Affine transform x -> A x + t for column vectors. The struct stores the rows of A, followed by
/// t.
struct Affine {
  Vec3<float> row[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  Vec3<float> t{0, 0, 0};

  Vec3<float> point(const Vec3<float>& p) const {
    const Vec3<float> v = vector(p);
    return {v.x + t.x, v.y + t.y, v.z + t.z};
  }
  Vec3<float> vector(const Vec3<float>& v) const {
    return {row[0].x * v.x + row[0].y * v.y + row[0].z * v.z,
            row[1].x * v.x + row[1].y * v.y + row[1].z * v.z,
            row[2].x * v.x + row[2].y * v.y + row[2].z * v.z};
  }
  /// Returns column j of the matrix A, which is the image of unit vector j.
  Vec3<float> axis(int j) const {
    const auto component = [j](const Vec3<float>& r) {
      return j == 0 ? r.x : (j == 1 ? r.y : r.z);
    };
    return {component(row[0]), component(row[1]), component(row[2])};
  }
  float determinant() const {
    const Affine& m = *this;
    return m.row[0].x * (m.row[1].y * m.row[2].z - m.row[1].z * m.row[2].y) +
           m.row[0].y * (m.row[1].z * m.row[2].x - m.row[1].x * m.row[2].z) +
           m.row[0].z * (m.row[1].x * m.row[2].y - m.row[1].y * m.row[2].x);
  }
  bool is_identity() const {
    return row[0].x == 1 && row[0].y == 0 && row[0].z == 0 && row[1].x == 0 && row[1].y == 1 &&
           row[1].z == 0 && row[2].x == 0 && row[2].y == 0 && row[2].z == 1 && t.x == 0 &&
           t.y == 0 && t.z == 0;
  }
  /// Returns the transform that applies `b` first, then `a`.
  friend Affine operator*(const Affine& a, const Affine& b) {
    const Vec3<float> x = a.vector(b.axis(0)), y = a.vector(b.axis(1)), z = a.vector(b.axis(2));
    return {{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}, a.point(b.t)};
  }
};

}  // namespace wavecomb
