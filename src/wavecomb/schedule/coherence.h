// SPDX-License-Identifier: Apache-2.0
/// Statistics of the coherence of a shading order. They are measured for a sample of the queues,
/// outside the timed phases.
#pragma once

#include <cstdint>
#include <span>

#include "wavecomb/schedule/policy.h"

namespace wavecomb {

/// Coherence counts of one worker. Ratios are computed after the counts of all workers are added.
struct CoherenceCounts {
  uint64_t records = 0;        ///< records in the measured queues
  uint64_t runs = 0;           ///< maximal runs of consecutive records of one material
  uint64_t pairs = 0;          ///< pairs of consecutive records in shading order
  uint64_t same_material = 0;  ///< pairs that read the same material record
  uint64_t texture_pairs = 0;  ///< pairs in which both records read a texture
  /// Texture pairs with the same texture, tile, mip level and cell of the 128 x 128 uv grid.
  uint64_t same_texels = 0;

  void add(const CoherenceCounts& o) {
    records += o.records;
    runs += o.runs;
    pairs += o.pairs;
    same_material += o.same_material;
    texture_pairs += o.texture_pairs;
    same_texels += o.same_texels;
  }
  /// Returns the mean number of consecutive records with the same material.
  double run_length() const {
    return runs ? static_cast<double>(records) / static_cast<double>(runs) : 0;
  }
  double material_homogeneity() const { return ratio(same_material, pairs); }
  double texture_homogeneity() const { return ratio(same_texels, texture_pairs); }

 private:
  static double ratio(uint64_t a, uint64_t b) {
    return b ? static_cast<double>(a) / static_cast<double>(b) : 0;
  }
};

/// Adds a queue to `counts` in shading order; an empty `order` stands for arrival order.
void measure_coherence(std::span<const uint32_t> material, std::span<const uint32_t> texture_key,
                       std::span<const uint32_t> order, std::span<const MaterialTraits> materials,
                       CoherenceCounts& counts);

}  // namespace wavecomb
