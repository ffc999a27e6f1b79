// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/volume.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/core/error.h"
#include "wavecomb/scene/scene_checks.h"

namespace wavecomb {
namespace {

/// A map in double precision: rows of A, each followed by the translation.
struct WideMap {
  double m[3][4];

  explicit WideMap(const Affine& a) {
    for (int i = 0; i < 3; ++i) {
      const double translation = i == 0 ? a.t.x : (i == 1 ? a.t.y : a.t.z);
      const double row[4] = {a.row[i].x, a.row[i].y, a.row[i].z, translation};
      std::copy(row, row + 4, m[i]);
    }
  }
  /// The map that first applies `b`.
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
};

/// Bricks of a grid to voxel indices, or the unit cube to the box.
Affine bricks_to_space(const VolumeField& field, const std::array<Vec3<float>, 2>& box) {
  Affine a;
  if (!field.grid) {
    const Vec3<float> size = box[1] - box[0];
    a.row[0].x = size.x;
    a.row[1].y = size.y;
    a.row[2].z = size.z;
    a.t = box[0];
    return a;
  }
  a.row[0].x = a.row[1].y = a.row[2].z = kBrickEdge;
  const auto& first = field.grid->first_voxel();
  a.t = {static_cast<float>(first[0]), static_cast<float>(first[1]), static_cast<float>(first[2])};
  return a;
}

WideMap bricks_to_world(const Volume& v, const VolumeField& field) {
  const WideMap own(bricks_to_space(field, v.box));
  const WideMap object = field.grid ? WideMap(field.index_to_object).after(own) : own;
  return WideMap(v.to_world).after(object);
}

PlacedGrid placed_grid(const Volume& v, const VolumeField& field) {
  PlacedGrid placed;
  if (field.grid) {
    placed.grid = field.grid->view();
  } else {
    std::fill_n(placed.grid.size, 3, 1u);
  }
  const WideMap inverse = bricks_to_world(v, field).inverse();
  for (int i = 0; i < 12; ++i) placed.to_bricks[i] = static_cast<float>(inverse.m[i / 4][i % 4]);
  return placed;
}

void check_field(const std::string& name, const char* what, const VolumeField& field,
                 const Volume& v) {
  if (!field.grid) return;
  const double det = bricks_to_world(v, field).determinant();
  if (!std::isfinite(det) || std::abs(det) < 1e-30)
    throw Error(name + ": its " + what +
                " grid is placed by a transform that is singular or not finite; mend it");
}

}  // namespace

void check_volume(const Volume& v) {
  const std::string name = quoted("volume", v.name);
  const auto check_color = [&](const char* what, const Vec3<float>& c, float most) {
    for (const float x : {c.x, c.y, c.z})
      if (!std::isfinite(x) || x < 0 || x > most)
        throw Error(name + " has " + what + " that is negative, too large or not finite; give " +
                    (most == 1 ? "numbers from 0 to 1" : "finite numbers of at least 0"));
  };
  check_color("an extinction", v.extinction, 1e30f);
  check_color("an albedo", v.albedo, 1);
  check_color("an emission", v.emission, 1e30f);
  if (!(std::abs(v.anisotropy) < 1))
    throw Error(name + " has an anisotropy that is not between -1 and 1; give one that is");
  if (!v.density.grid) {
    const Vec3<float> size = v.box[1] - v.box[0];
    const bool fills = size.x > 0 && size.y > 0 && size.z > 0;
    if (!fills || !std::isfinite(size.x + size.y + size.z))
      throw Error(name + " has neither a density grid nor bounds that enclose something; give one");
  } else {
    const GridView grid = v.density.grid->view();
    if (grid.components != 1)
      throw Error(name + " has a density grid of " + std::to_string(grid.components) +
                  " components; give one of single numbers");
    if (grid.background != 0)
      throw Error(name + " has a density grid whose background is not 0; make it 0");
  }
  if (v.color.grid && v.color.grid->most() > 1)
    throw Error(name + " has a color grid with values above 1; scale it");
  const VolumeField box{nullptr, {}};
  if (!v.density.grid) {
    const double det = bricks_to_world(v, box).determinant();
    if (!std::isfinite(det) || std::abs(det) < 1e-30)
      throw Error(name + " is placed by a transform that is singular or not finite; mend it");
  }
  check_field(name, "density", v.density, v);
  check_field(name, "color", v.color, v);
  check_field(name, "emission", v.glow, v);
}

VolumeRecord make_volume_record(const Volume& v) {
  VolumeRecord r{};
  r.density = placed_grid(v, v.density);
  if (v.color.grid) r.color = placed_grid(v, v.color);
  r.glow = v.glow.grid ? placed_grid(v, v.glow) : r.density;
  const auto put = [](float* to, const Vec3<float>& c) {
    to[0] = c.x;
    to[1] = c.y;
    to[2] = c.z;
  };
  put(r.extinction, v.extinction);
  put(r.albedo, v.albedo);
  put(r.emission, v.emission);
  r.most_extinction = std::max({v.extinction.x, v.extinction.y, v.extinction.z});
  r.is_grey = v.extinction.x == v.extinction.y && v.extinction.y == v.extinction.z;
  r.anisotropy = v.anisotropy;
  r.emits = v.emits();
  return r;
}

std::array<Vec3<float>, 8> volume_corners(const Volume& v) {
  std::array<Vec3<float>, 8> corners;
  const VolumeField& field = v.density.grid || !v.glow.grid ? v.density : v.glow;
  const WideMap map = bricks_to_world(v, field);
  uint32_t size[3] = {1, 1, 1};
  if (field.grid) std::copy_n(field.grid->view().size, 3, size);
  for (int i = 0; i < 8; ++i) {
    const double at[3] = {i & 1 ? size[0] : 0.0, i & 2 ? size[1] : 0.0, i & 4 ? size[2] : 0.0};
    float p[3];
    for (int k = 0; k < 3; ++k)
      p[k] = static_cast<float>(map.m[k][0] * at[0] + map.m[k][1] * at[1] + map.m[k][2] * at[2] +
                                map.m[k][3]);
    corners[static_cast<size_t>(i)] = {p[0], p[1], p[2]};
  }
  return corners;
}

}  // namespace wavecomb
