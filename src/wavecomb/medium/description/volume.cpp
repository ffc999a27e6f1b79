// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/medium/description/volume.h"

#include <algorithm>
#include <cmath>

#include "wavecomb/core/error.h"
#include "wavecomb/medium/description/volume_motion.h"
#include "wavecomb/medium/description/wide_map.h"
#include "wavecomb/scene/scene_checks.h"

namespace wavecomb {
namespace {

/// Returns the map to world space from the bricks of a grid or, for a homogeneous volume, from the
/// unit cube.
WideMap bricks_to_world(const Volume& v, const VolumeField& field) {
  if (field.grid) return WideMap(v.to_world).after(bricks_to_object(field));
  const Vec3<float> size = v.box[1] - v.box[0];
  Affine box;
  box.row[0].x = size.x;
  box.row[1].y = size.y;
  box.row[2].z = size.z;
  box.t = v.box[0];
  return WideMap(v.to_world).after(WideMap(box));
}

TransformedGrid transform_grid(const Volume& v, const VolumeField& field) {
  TransformedGrid transformed;
  if (field.grid) {
    transformed.grid = field.grid->view();
  } else {
    std::fill_n(transformed.grid.size, 3, 1u);
  }
  bricks_to_world(v, field).inverse().put(transformed.to_bricks);
  return transformed;
}

/// Packs the bounding cells of a moving field, with the transform from world space to these cells.
TransformedGrid transform_cells(const Volume& v, const VolumeField& field,
                                const MovedCells& cells) {
  TransformedGrid transformed;
  transformed.grid.most = cells.most.data();
  std::copy_n(cells.size.begin(), 3, transformed.grid.size);
  bricks_to_world(v, field).after(cells.to_bricks()).inverse().put(transformed.to_bricks);
  return transformed;
}

/// Returns the transforms for lookups of a moving field at points of a space. `to_bricks` maps the
/// space to bricks of the field.
FieldDrift drift_of(const Volume& v, const VolumeField& field, const WideMap& to_bricks) {
  const WideMap object = bricks_to_object(field);
  FieldDrift drift{};
  to_bricks.put(drift.to_bricks);
  bricks_to_object(v.velocity).inverse().after(object).after(to_bricks).put(drift.to_velocity);
  WideMap moves = object.inverse();
  for (auto& row : moves.m) row[3] = 0;
  moves.put(drift.per_second);
  return drift;
}

void pack_motion(const Volume& v, VolumeRecord& r) {
  r.moves = v.motion != nullptr;
  if (!r.moves) return;
  r.velocity = v.velocity.grid->view();
  const VolumeField& emission_field = v.glow.grid ? v.glow : v.density;
  r.density_cells = transform_cells(v, v.density, v.motion->density());
  r.emission_cells = transform_cells(v, emission_field, v.motion->emission());
  r.density_drift = drift_of(v, v.density, v.motion->density().to_bricks());
  r.emission_drift = drift_of(v, emission_field, v.motion->emission().to_bricks());
  if (v.color.grid) r.color_drift = drift_of(v, v.color, bricks_to_world(v, v.color).inverse());
  r.seconds_open = v.seconds[0];
  r.seconds_span = v.seconds[1] - v.seconds[0];
}

void check_velocity(const std::string& name, const Volume& v) {
  if (!v.velocity.grid) return;
  const GridView grid = v.velocity.grid->view();
  if (grid.components != 3 || grid.background != 0)
    throw Error(name + " has a velocity grid of " + std::to_string(grid.components) +
                " components and background " + std::to_string(grid.background) +
                "; give one of three, and 0");
  if (!v.density.grid) throw Error(name + " has a velocity, but no density grid; give one");
  if (!std::isfinite(v.seconds[0]) || !std::isfinite(v.seconds[1]))
    throw Error(name + " moves over seconds that are not finite; give finite ones");
}

void check_field(const std::string& name, const char* what, const VolumeField& field,
                 const Volume& v) {
  if (!field.grid) return;
  const double det = bricks_to_world(v, field).determinant();
  if (!std::isfinite(det) || std::abs(det) < 1e-30)
    throw Error(name + ": its " + what +
                " grid has a transform that is singular or not finite; give an invertible one");
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
      throw Error(name + " has a transform that is singular or not finite; give an invertible one");
  }
  check_field(name, "density", v.density, v);
  check_field(name, "color", v.color, v);
  check_field(name, "emission", v.glow, v);
  check_velocity(name, v);
  check_field(name, "velocity", v.velocity, v);
}

VolumeRecord make_volume_record(const Volume& v) {
  VolumeRecord r{};
  r.density = transform_grid(v, v.density);
  if (v.color.grid) r.color = transform_grid(v, v.color);
  r.emission_field = v.glow.grid ? transform_grid(v, v.glow) : r.density;
  const auto put = [](float* to, const Vec3<float>& c) {
    to[0] = c.x;
    to[1] = c.y;
    to[2] = c.z;
  };
  put(r.extinction, v.extinction);
  put(r.albedo, v.albedo);
  put(r.emission, v.emission);
  r.max_extinction = std::max({v.extinction.x, v.extinction.y, v.extinction.z});
  r.is_grey = v.extinction.x == v.extinction.y && v.extinction.y == v.extinction.z;
  r.anisotropy = v.anisotropy;
  r.emits = v.emits();
  pack_motion(v, r);
  return r;
}

std::array<Vec3<float>, 8> volume_corners(const Volume& v) {
  std::array<Vec3<float>, 8> corners;
  const VolumeField& field = v.density.grid || !v.glow.grid ? v.density : v.glow;
  WideMap map = bricks_to_world(v, field);
  uint32_t size[3] = {1, 1, 1};
  if (field.grid) std::copy_n(field.grid->view().size, 3, size);
  if (v.motion) {
    map = map.after(v.motion->density().to_bricks());
    std::copy_n(v.motion->density().size.begin(), 3, size);
  }
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
