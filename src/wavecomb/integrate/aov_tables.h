// SPDX-License-Identifier: Apache-2.0
/// What the scene's indices mean to AOVs.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "wavecomb/core/backward_automaton.h"
#include "wavecomb/core/lanes.h"
#include "wavecomb/core/path_expression.h"
#include "wavecomb/core/settings.h"
#include "wavecomb/film/aov_film.h"

namespace wavecomb {

class Scene;

/// A light group that is not kept.
inline constexpr uint32_t kNoGroup = 0xffffffffu;

/// Made once a render; read by all waves.
struct AovTables {
  AovLayout layout;
  CryptoTables crypto;
  /// By light: where its group is kept among the film's, or kNoGroup.
  std::vector<uint32_t> kept_group;
  uint32_t group_of_rest = kNoGroup;  ///< where that of what is no light is kept
  /// Of the film's groups, then of its expressions.
  std::vector<std::string> kept_names;
  PathAutomaton automaton;             ///< of the expressions
  BackwardAutomaton backward;          ///< the same for paths from lights, where there are any
  std::vector<uint32_t> end_of_light;  ///< PathExpressions'; empty where there are none
  std::vector<float> multipliers;      ///< likewise
  /// The cost AOV is what the model says, which is reproducible, instead of time.
  bool models_cost = false;
  bool connects = false;  ///< vertices of camera paths connect to those of paths from lights

  /// What AovHit calls geometry `geom` of instance `inst`; kNothingHit where nobody wants to know.
  template <typename F>
  UInt<F> object(const UInt<F>& inst, const UInt<F>& geom, const Mask<F>& active) const {
    using U = UInt<F>;
    if (crypto.first_object.empty()) return U(kNothingHit);
    return gather<U>(crypto.first_object.data(), inst, Mask<U>(active)) + geom;
  }
  /// And light record `light`.
  template <typename U>
  U light_object(const U& light) const {
    return crypto.first_object.empty() ? U(kNothingHit) : U(light + crypto.first_light);
  }

  /// And volume `volume`.
  template <typename U>
  U volume_object(const U& volume) const {
    return crypto.first_object.empty() ? U(kNothingHit) : U(volume + crypto.first_volume);
  }

  /// Throws Error for a light group that the scene does not have.
  AovTables(const Scene& scene, const Settings& settings);

 private:
  void keep_groups(const Scene& scene, const Settings& settings);
  void keep_expressions(const Scene& scene, const Settings& settings);
};

}  // namespace wavecomb
