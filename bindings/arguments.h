// SPDX-License-Identifier: Apache-2.0
/// Conversion of arguments from Python to types of the core.
#pragma once

#include <nanobind/ndarray.h>

#include <initializer_list>
#include <string>
#include <tuple>
#include <utility>

#include "wavecomb/core/error.h"
#include "wavecomb/core/vec3.h"

using Color3 = std::tuple<float, float, float>;
template <typename T>
using Array = nanobind::ndarray<const T, nanobind::c_contig, nanobind::device::cpu>;

inline wavecomb::Vec3<float> vec3(const Color3& c) {
  return {std::get<0>(c), std::get<1>(c), std::get<2>(c)};
}

/// Returns the enum value that belongs to a name in `choices`. Throws an `Error` whose message
/// begins with `what` if the name is unknown.
template <typename Enum>
Enum choose(const std::string& what, const std::string& value,
            std::initializer_list<std::pair<const char*, Enum>> choices) {
  std::string list;
  for (const auto& [name, e] : choices) {
    if (value == name) return e;
    list += (list.empty() ? "" : ", ") + std::string(name);
  }
  throw wavecomb::Error(what + " is '" + value + "'; it must be one of " + list);
}
