// SPDX-License-Identifier: Apache-2.0
/// Tables that map scene indices to the objects, groups and expressions of AOVs.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "wavecomb/core/lanes/lanes.h"
#include "wavecomb/core/path_expressions/backward_automaton.h"
#include "wavecomb/core/path_expressions/path_expression.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/film/aov_film.h"

namespace wavecomb {

class Scene;

/// Index that means that a light group has no layer.
inline constexpr uint32_t kNoGroup = 0xffffffffu;

/// AOV tables of a render. The tables are built once and read by all waves.
struct AovTables {
  AovLayout layout;
  CryptoTables crypto;
  /// Index of each light's group among the film's groups, or kNoGroup.
  std::vector<uint32_t> film_group;
  /// Index of the light group for emission that belongs to no light.
  uint32_t group_of_rest = kNoGroup;
  /// Names of the film's light groups, followed by the names of its expressions.
  std::vector<std::string> layer_names;
  PathAutomaton automaton;  ///< automaton of the light path expressions
  /// Automaton for light paths, if the render traces light paths.
  BackwardAutomaton backward;
  /// Argument `end_of_light` of PathExpressions; empty without expressions.
  std::vector<uint32_t> end_of_light;
  /// Argument `multipliers` of PathExpressions; empty if unused.
  std::vector<float> multipliers;
  /// Whether the cost AOV holds modelled costs, which are reproducible, instead of measured time.
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

  /// Throws Error for unknown light groups, and for AOVs that the scene does not support.
  AovTables(const Scene& scene, const Settings& settings);

 private:
  void add_groups(const Scene& scene, const Settings& settings);
  void add_expressions(const Scene& scene, const Settings& settings);
};

}  // namespace wavecomb
