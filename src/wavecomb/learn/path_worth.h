// SPDX-License-Identifier: Apache-2.0
/// What a path without roulette says of the paths with roulette that it stands for.
///
/// Survivors of a roulette are noise that hides what is to be learned. So paths that teach have
/// none, and what it would do to cost and variance is worked out along each, from its end: with q_j
/// the probability of going on after vertex j, r_j what a bounce leaves of the throughput, and l_j
/// what it brings of a throughput of 1, the bounce has in the mean the cost and second moment
///   c_j = ray + vertex_{j+1} + q_{j+1} c_{j+1},
///   m_j = l_j^2 + r_j^2 (m_{j+1} / q_{j+1} - l_{j+1}^2).
#pragma once

#include <span>

namespace wavecomb {

/// A vertex of a path and the bounce with which the path left it.
struct PathStep {
  double arrived;      ///< luminance of the throughput before the vertex
  double left;         ///< and after the bounce; 0: there is none
  double brought;      ///< of the path's light, by the bounce and all that follows
  double survival;     ///< q
  double vertex_cost;  ///< of the vertex, its light sample included

  /// l
  double value() const { return left > 0 ? brought / arrived : 0; }
};

/// Of a bounce, of a throughput of 1 at its vertex.
struct BounceWorth {
  double squared, cost;
};

/// Works out `worth` of each step's bounce; `tail`: what follows the last costs, beyond its ray.
void weigh_path(std::span<const PathStep> path, double ray_cost, double tail,
                std::span<BounceWorth> worth);

}  // namespace wavecomb
