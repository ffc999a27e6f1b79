// SPDX-License-Identifier: Apache-2.0
/// Tables that AOVs use to map the scene's indices to object ids, light groups and light path
/// expressions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "wavecomb/core/lanes/lanes.h"
#include "wavecomb/core/path_expressions/backward_automaton.h"
#include "wavecomb/core/path_expressions/path_expression.h"
#include "wavecomb/core/settings_choices.h"
#include "wavecomb/film/aov_film.h"

namespace wavecomb {

struct Settings;

class Scene;

/// Layer index of a light group that has no layer.
inline constexpr uint32_t kNoGroup = 0xffffffffu;

/// AOV tables of a render. The tables are built once and read by all waves.
struct AovTables {
  AovLayout layout;
  CryptoTables crypto;
  /// For each light, the index of its light group among the film's light groups, or `kNoGroup`.
  std::vector<uint32_t> film_group;
  /// Index of the light group that contains the emission of surfaces and volumes that are not
  /// lights, or `kNoGroup`.
  uint32_t group_of_rest = kNoGroup;
  /// Names of the film's light groups, followed by the names of its light path expressions.
  std::vector<std::string> layer_names;
  PathAutomaton automaton;  ///< automaton of the light path expressions
  /// Automaton that matches expressions along light paths, for renders that trace light paths.
  BackwardAutomaton backward;
  /// Argument `end_of_light` of `PathExpressions`. Empty if the render has no light path
  /// expressions.
  std::vector<uint32_t> end_of_light;
  /// Argument `multipliers` of `PathExpressions`. Empty if no expression needs multipliers.
  std::vector<float> multipliers;
  /// Whether the cost AOV contains modelled costs, which are reproducible, instead of measured
  /// times.
  bool models_cost = false;
  bool connects = false;  ///< whether camera paths connect to light paths

  /// Returns the object id (AovHit) of geometry `geom` of instance `inst`, or kNoHitId if
  /// unused.
  template <typename F>
  UInt<F> object(const UInt<F>& inst, const UInt<F>& geom, const Mask<F>& active) const {
    using U = UInt<F>;
    if (crypto.first_object.empty()) return U(kNoHitId);
    return gather<U>(crypto.first_object.data(), inst, Mask<U>(active)) + geom;
  }
  /// Returns the object id of light record `light`.
  template <typename U>
  U light_object(const U& light) const {
    return crypto.first_object.empty() ? U(kNoHitId) : U(light + crypto.first_light);
  }

  /// Returns the object id of volume `volume`.
  template <typename U>
  U volume_object(const U& volume) const {
    return crypto.first_object.empty() ? U(kNoHitId) : U(volume + crypto.first_volume);
  }

  /// Builds the tables. Throws `Error` if a light group is unknown or the scene does not support a
  /// requested AOV.
  AovTables(const Scene& scene, const Settings& settings);

 private:
  void add_groups(const Scene& scene, const Settings& settings);
  void add_expressions(const Scene& scene, const Settings& settings);
};

}  // namespace wavecomb
