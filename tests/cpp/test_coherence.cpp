// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/schedule/coherence.h"

#include <gtest/gtest.h>

namespace wavecomb {
namespace {

using Ids = std::vector<uint32_t>;

/// Materials 0 and 1 read texture 0, material 2 reads texture 1, and material 3 reads none.
const std::vector<MaterialTraits> kTraits = {
    {0, 0, 10}, {0, 0, 10}, {0, 1, 20}, {1, MaterialTraits::kNone, 0}};

CoherenceCounts measure(const Ids& material, const Ids& key, const Ids& order = {}) {
  CoherenceCounts counts;
  measure_coherence(material, key, order, kTraits, counts);
  return counts;
}

TEST(Coherence, RunLength) {
  const auto run_length = [](const Ids& material) {
    return measure(material, Ids(material.size())).run_length();
  };
  EXPECT_EQ(run_length({}), 0);
  EXPECT_EQ(run_length({3}), 1);
  EXPECT_EQ(run_length({3, 3, 3, 3}), 4);
  EXPECT_EQ(run_length({0, 1, 0, 1}), 1);
  EXPECT_EQ(run_length({0, 0, 0, 1, 2, 2}), 2);
  EXPECT_EQ(run_length({0, 0, 1, 0, 0}), 5. / 3);
}

TEST(Coherence, MaterialHomogeneity) {
  const auto share = [](const Ids& material) {
    return measure(material, Ids(material.size())).material_homogeneity();
  };
  EXPECT_EQ(share({}), 0);
  EXPECT_EQ(share({1}), 0) << "no neighbours";
  EXPECT_EQ(share({1, 1}), 1);
  EXPECT_EQ(share({1, 2, 1}), 0);
  EXPECT_EQ(share({0, 0, 1, 1, 1}), 0.75);
}

TEST(Coherence, TextureHomogeneity) {
  // Materials 0 and 1 read the same texture, so only the texel positions of their records can
  // differ.
  EXPECT_EQ(measure({0, 1, 0}, {5, 5, 5}).texture_homogeneity(), 1);
  EXPECT_EQ(measure({0, 1, 0}, {5, 5, 6}).texture_homogeneity(), 0.5);
  EXPECT_EQ(measure({0, 2}, {5, 5}).texture_homogeneity(), 0) << "another texture";
  const CoherenceCounts counts = measure({0, 3, 3, 2, 2, 2}, {1, 1, 1, 1, 1, 2});
  EXPECT_EQ(counts.pairs, 5u);
  EXPECT_EQ(counts.texture_pairs, 2u) << "neighbours without a texture do not count";
  EXPECT_EQ(counts.same_texels, 1u);
  EXPECT_EQ(measure({3, 3}, {0, 0}).texture_homogeneity(), 0);
}

TEST(Coherence, FollowsTheOrder) {
  const Ids material = {0, 1, 0, 1}, key = {7, 8, 9, 8};
  EXPECT_EQ(measure(material, key).run_length(), 1);
  const CoherenceCounts counts = measure(material, key, {0, 2, 1, 3});
  EXPECT_EQ(counts.run_length(), 2);
  EXPECT_EQ(counts.same_material, 2u);
  EXPECT_EQ(counts.same_texels, 1u);
}

TEST(Coherence, SumsOverQueues) {
  CoherenceCounts sum;
  measure_coherence(Ids{0, 0}, Ids{1, 1}, {}, kTraits, sum);
  measure_coherence(Ids{0, 0, 2}, Ids{1, 1, 1}, {}, kTraits, sum);
  CoherenceCounts parts = measure({0, 0}, {1, 1});
  parts.add(measure({0, 0, 2}, {1, 1, 1}));
  for (const CoherenceCounts& c : {sum, parts}) {
    EXPECT_EQ(c.records, 5u);
    EXPECT_EQ(c.runs, 3u) << "runs end with their queue";
    EXPECT_EQ(c.pairs, 3u);
    EXPECT_EQ(c.same_material, 2u);
    EXPECT_EQ(c.texture_pairs, 3u);
    EXPECT_EQ(c.same_texels, 2u);
  }
}

}  // namespace
}  // namespace wavecomb
