// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/render/snapshot.h"

#include "wavecomb/film/error/error_map.h"
#include "wavecomb/film/film.h"

namespace wavecomb {

std::optional<AovLayer> Snapshot::layer(const std::string& name) const {
  AovLayer layer{name, 3, {}};
  if (name == "beauty") layer.values = film.beauty();
  if (name == "albedo") layer.values = film.albedo();
  if (name == "normal") layer.values = film.normal();
  if (name == "variance") layer.values = film.variance();
  if (name == "depth") layer = {name, 1, film.depth()};
  if (name == "error" && film.has_error()) layer = {name, 1, measure_error(film).error};
  if (layer.values.empty()) layer = film.aovs().layer(name, film.samples(), light_groups);
  if (layer.values.empty()) return std::nullopt;
  return layer;
}

}  // namespace wavecomb
