// SPDX-License-Identifier: Apache-2.0
/// Affine maps in double precision, for volume grids.
#pragma once

#include <algorithm>

#include "wavecomb/core/affine.h"

namespace wavecomb {

/// An affine map: the rows of A, each followed by its component of the translation.
struct WideMap {
  double m[3][4];

  explicit WideMap(const Affine& a) {
    for (int i = 0; i < 3; ++i) {
      const double translation = i == 0 ? a.t.x : (i == 1 ? a.t.y : a.t.z);
      const double row[4] = {a.row[i].x, a.row[i].y, a.row[i].z, translation};
      std::copy(row, row + 4, m[i]);
    }
  }
  /// Makes the map x -> origin + scale x.
  WideMap(const double (&origin)[3], double scale) : WideMap(Affine{}) {
    for (int i = 0; i < 3; ++i) {
      m[i][i] = scale;
      m[i][3] = origin[i];
    }
  }
  /// Returns the map that applies `b` first, then `*this`.
  WideMap after(const WideMap& b) const {
    WideMap r = *this;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 4; ++j)
        r.m[i][j] = m[i][0] * b.m[0][j] + m[i][1] * b.m[1][j] + m[i][2] * b.m[2][j] +
                    (j == 3 ? m[i][3] : 0);
    return r;
  }
  double cofactor(int i, int j) const {
    const int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
    return m[a][c] * m[b][d] - m[a][d] * m[b][c];
  }
  double determinant() const {
    return m[0][0] * cofactor(0, 0) + m[0][1] * cofactor(0, 1) + m[0][2] * cofactor(0, 2);
  }
  WideMap inverse() const {
    WideMap r = *this;
    const double det = determinant();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) r.m[i][j] = cofactor(j, i) / det;
      r.m[i][3] = -(r.m[i][0] * m[0][3] + r.m[i][1] * m[1][3] + r.m[i][2] * m[2][3]);
    }
    return r;
  }
  /// Maps a point.
  Vec3<float> point(const Vec3<float>& p) const {
    const auto row = [&](const double (&r)[4]) {
      return static_cast<float>(r[0] * p.x + r[1] * p.y + r[2] * p.z + r[3]);
    };
    return {row(m[0]), row(m[1]), row(m[2])};
  }
  /// Writes the map as single-precision rows for kernels.
  void put(float (&to)[12]) const {
    for (int i = 0; i < 12; ++i) to[i] = static_cast<float>(m[i / 4][i % 4]);
  }
};

}  // namespace wavecomb
