// SPDX-License-Identifier: Apache-2.0
/// Expected cost and second moment of the bounces of a training path.
///
/// Training paths are traced without Russian roulette, because its noise would make training
/// samples unreliable. Instead, the effect of roulette on cost and variance is computed along each
/// path, starting at its end. With q_j the survival probability after vertex j, r_j the ratio of
/// throughputs after and before the bounce, and l_j the contribution of the bounce and the rest of
/// the path for a throughput of 1, the expected cost and second moment are
///   c_j = ray + vertex_{j+1} + q_{j+1} c_{j+1},
///   m_j = l_j^2 + r_j^2 (m_{j+1} / q_{j+1} - l_{j+1}^2).
#pragma once

#include <span>

namespace wavecomb {

/// A path vertex and the bounce that leaves it.
struct PathStep {
  double arrived;       ///< luminance of the throughput before the vertex
  double left;          ///< luminance of the throughput after the bounce; 0 without a bounce
  double contribution;  ///< contribution of the bounce and the rest of the path
  double survival;      ///< survival probability q
  double vertex_cost;   ///< cost of shading the vertex, including the light sample

  /// Returns the contribution l for a throughput of 1.
  double value() const { return left > 0 ? contribution / arrived : 0; }
};

/// Second moment and cost of a bounce for a throughput of 1 at its vertex.
struct BounceMoments {
  double squared, cost;
};

/// Computes `moments` for each step of `path`. `ray_cost` is the cost of tracing a ray, `tail` the
/// cost of the rest of the path after the ray from the last vertex. All costs are in the same unit.
void compute_path_moments(std::span<const PathStep> path, double ray_cost, double tail,
                          std::span<BounceMoments> moments);

}  // namespace wavecomb
