// SPDX-License-Identifier: Apache-2.0
// Tests of AOVs: layer names, Cryptomatte ids and ranks, object names, and film memory.
#include <bit>
#include <map>

#include "scene_testing.h"
#include "wavecomb/film/film.h"

namespace wavecomb {
namespace {

using namespace scene_testing;

std::string numbered(std::string name, uint32_t i) {
  name += std::to_string(i);
  return name;
}

TEST(AovSet, NamesThereAndBack) {
  uint32_t bits = 0;
  for (const std::string& name : AovSet{AovSet::kAll}.names())
    bits |= static_cast<uint32_t>(AovSet::parse(name));
  EXPECT_EQ(bits, AovSet::kAll);
  EXPECT_EQ(AovSet{}.names(), (std::vector<std::string>{"albedo", "normal", "depth"}));
  EXPECT_THROW(AovSet::parse("albdo"), Error);
}

// Verification values of MurmurHash3_x86_32, as published with SMHasher and in common use.
TEST(Cryptomatte, MurmurHash3) {
  EXPECT_EQ(murmur3_32("", 0), 0u);
  EXPECT_EQ(murmur3_32("", 1), 0x514e28b7u);
  EXPECT_EQ(murmur3_32("", 0xffffffffu), 0x81f16f39u);
  EXPECT_EQ(murmur3_32("test", 0), 0xba6bd213u);
  EXPECT_EQ(murmur3_32("test", 0x9747b28cu), 0x704b81dcu);
  EXPECT_EQ(murmur3_32("Hello, world!", 0), 0xc0363e43u);
  EXPECT_EQ(murmur3_32("Hello, world!", 0x9747b28cu), 0x24884cbau);
  EXPECT_EQ(murmur3_32("The quick brown fox jumps over the lazy dog", 0), 0x2e4ff723u);
}

TEST(Cryptomatte, IdsAreUsualFloats) {
  // Search for names whose hashes have exponents 0 and 255, which are rare.
  uint32_t zero = 0, full = 0;
  for (uint32_t i = 0; i < 4000; ++i) {
    const std::string name = numbered("n", i);
    const uint32_t hash = murmur3_32(name, 0), id = crypto_id(name);
    EXPECT_TRUE(std::isnormal(std::bit_cast<float>(id))) << name;
    const uint32_t exponent = hash >> 23 & 0xff;
    zero += exponent == 0;
    full += exponent == 0xff;
    EXPECT_EQ(hash ^ id, exponent == 0 || exponent == 0xff ? 1u << 23 : 0u) << name;
  }
  EXPECT_GT(zero, 0u);
  EXPECT_GT(full, 0u);
}

TEST(Cryptomatte, FewIdsAreCountedExactly) {
  CryptoPixel p;
  for (uint32_t i = 0; i < 3600; ++i) p.add(100 + i % 8 * (i % 8 + 1) / 2);
  std::map<uint32_t, uint32_t> expected;
  for (uint32_t i = 0; i < 3600; ++i) ++expected[100 + i % 8 * (i % 8 + 1) / 2];
  ASSERT_EQ(expected.size(), 8u);
  for (uint32_t k = 0; k < CryptoPixel::kIds; ++k) EXPECT_EQ(p.count[k], expected[p.id[k]]);
}

TEST(Cryptomatte, ManyIdsKeepTheirBounds) {
  std::mt19937 rng(5);
  for (int round = 0; round < 20; ++round) {
    CryptoPixel p;
    std::map<uint32_t, uint32_t> exact;
    constexpr uint32_t kSamples = 4096;
    for (uint32_t i = 0; i < kSamples; ++i) {
      // Random Cryptomatte ids: a few frequent ids and many rare ids.
      const double u = std::uniform_real_distribution<double>(0, 1)(rng);
      const auto id = static_cast<uint32_t>(300 * u * u * u * u * u) + 1;
      p.add(id);
      ++exact[id];
    }
    ASSERT_GT(exact.size(), 50u);
    uint32_t sum = 0;
    for (uint32_t k = 0; k < CryptoPixel::kIds; ++k) {
      sum += p.count[k];
      EXPECT_GE(p.count[k], exact[p.id[k]]);
      EXPECT_LE(p.count[k], exact[p.id[k]] + kSamples / CryptoPixel::kIds);
    }
    EXPECT_EQ(sum, kSamples);
    for (const auto& [id, count] : exact)
      if (count > kSamples / CryptoPixel::kIds) {
        EXPECT_NE(std::find(p.id, p.id + CryptoPixel::kIds, id), p.id + CryptoPixel::kIds);
      }
  }
}

// The expected numbers are those stated in docs/aovs.md.
TEST(AovFilm, MemoryOfEveryAov) {
  const AovLayout all{AovSet{AovSet::kAll}, 4};
  const Film film(16, 9, all);
  EXPECT_EQ(film.bytes(), 16u * 9 *
                              (32 + 2 * 24 + 12 + 4 + 28 + 3 * 64 + 3 * 24 + 4 * 24 + 8 + 5 * 24 +
                               8 + 2 * 8 + 16 + 24 + 88));
  const auto bytes = [](uint32_t bits) { return Film(8, 8, {AovSet{bits}}).bytes() / 64; };
  EXPECT_EQ(bytes(0), 32u);
  EXPECT_EQ(bytes(AovSet::kStoredByDefault), 92u);
  EXPECT_EQ(bytes(static_cast<uint32_t>(Aov::kGuideNormal)), 56u);
  EXPECT_EQ(bytes(static_cast<uint32_t>(Aov::kUv)), 44u);
  EXPECT_EQ(bytes(static_cast<uint32_t>(Aov::kCryptoAsset)), 96u);
}

TEST(AovFilm, NearestSampleWinsAndTheFirstOfEquals) {
  Film film(1, 1, {AovSet{aov_bits(AovKind::kNearest)}});
  AovFilm& aovs = film.aovs();
  const auto add = [&](float centre2, uint32_t material, float x) {
    if (!aovs.is_nearest(0, centre2)) return;
    const float position[3] = {x, 0, 0}, uv[2] = {0.25f, 0.5f};
    const float id = id_value(material), none = id_value(kNoHitId);
    aovs.put(Aov::kPosition, 0, position);
    aovs.put(Aov::kUv, 0, uv);
    aovs.put(Aov::kMaterialId, 0, &id);
    aovs.put(Aov::kInstanceId, 0, &none);
  };
  add(0.5f, kNoHitId, 0);
  add(0.2f, 4, 7);
  add(0.2f, 5, 8);
  add(0.3f, 6, 9);
  const std::vector<AovLayer> layers = std::move(film).finish({}).aovs;
  ASSERT_EQ(layers.size(), 7u);
  EXPECT_EQ(layers[0].values, (std::vector<float>{7, 0, 0}));
  EXPECT_EQ(layers[1].values, (std::vector<float>{0.25f, 0.5f}));
  EXPECT_EQ(layers[2].values, (std::vector<float>{5}));  // ids count from 1
  EXPECT_EQ(layers[3].values, (std::vector<float>{0}));
}

// The film stores the values that each row of the AOV table declares, and layers are in the order
// of the rows.
TEST(AovFilm, EveryRowHasItsLayer) {
  const AovLayout layout{AovSet{AovSet::kAll}, 2};
  const std::vector<std::string> groups{"key", "sky"};
  Film film(2, 1, layout);
  film.pixel(1, 0).samples = 4;
  for (const AovRow& row : kAovs)
    if (row.kind == AovKind::kMean || row.kind == AovKind::kSum) {
      const float twice[3] = {2, 4, 6};
      film.aovs().add(row.aov, 1, twice);
      film.aovs().add(row.aov, 1, twice);
    }
  const Film before = film;
  const Film::Layers layers = std::move(film).finish(groups);
  std::vector<std::string> names{"albedo", "normal", "depth"};
  for (const AovLayer& layer : layers.aovs) names.push_back(layer.name);
  std::vector<std::string> expected;
  for (const AovRow& row : kAovs) {
    if (row.kind == AovKind::kGroups)
      for (const std::string& group : groups) expected.push_back("light_" + group);
    else if (row.kind != AovKind::kExpressions && row.kind != AovKind::kDeep)
      expected.emplace_back(row.name);
  }
  EXPECT_EQ(names, expected);
  for (const AovLayer& layer : layers.aovs) {
    EXPECT_EQ(layer.values, before.aovs().layer(layer.name, layers.samples, groups).values)
        << layer.name;
    if (layer.name.starts_with("light_")) continue;
    const AovRow& row = row_of(AovSet::parse(layer.name));
    if (row.kind == AovKind::kMean) {
      std::vector<float> mean(2 * size_t{row.channels}, 0.f);
      for (uint32_t c = 0; c < row.channels; ++c)
        mean[row.channels + c] = static_cast<float>(c + 1);
      EXPECT_EQ(layer.values, mean) << row.name;
    }
    if (row.kind == AovKind::kSum) {
      EXPECT_EQ(layer.values, (std::vector<float>{0, 4})) << row.name;
    }
  }
}

TEST(ObjectNames, SeenThroughInstances) {
  SceneBuilder b;
  const auto mesh = [&](const char* name, uint32_t asset_length = 0) {
    Mesh m = make_mesh(quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}));
    m.name = name;
    m.asset_length = asset_length;
    return b.add_mesh(std::move(m));
  };
  b.add_to_group(0, mesh("/World/Set/Floor"));
  b.add_to_group(0, mesh("/World/Chairs/Red/Seat", 17));
  // The scene has two instances of a tree, and inside the tree there is a model, a nest.
  const uint32_t tree = b.add_group("tree", "/World/Tree_1");
  b.add_to_group(tree, mesh("/World/Tree_1/Leaves"));
  b.add_to_group(tree, mesh("/World/Tree_1/Top/Nest/Egg", 22));
  const uint32_t first = b.add_placement_name("/World/Tree_1", 13);
  const uint32_t second = b.add_placement_name("/World/Tree_2", 0);
  b.add_instance(0, tree, translate(1, 0, 0), kInheritMaterial, first);
  b.add_instance(0, tree, translate(2, 0, 0), kInheritMaterial, second);
  // A point instancer inside a prototype: instance numbers follow the instancer's name.
  const uint32_t leaf = b.add_group("leaf", "/Protos/Leaf");
  b.add_to_group(leaf, mesh("/Protos/Leaf"));
  const uint32_t bush = b.add_group("bush", "/World/Bush_1");
  const uint32_t points = b.add_placement_name("/World/Bush_1/Points", 0);
  b.add_instance(bush, leaf, translate(0, 1, 0), kInheritMaterial, points, 7);
  b.add_instance(0, bush, translate(3, 0, 0), kInheritMaterial,
                 b.add_placement_name("/World/Bush_9", 0));
  Light light = make_light(LightKind::kRect, {1, 1, 1});
  light.name = "/World/Lights/Key";
  b.add_light(light);
  b.set_camera(make_camera({0, 0, 5}, {0, 0, 0}));
  const ScenePtr scene = b.build();
  const ObjectNames names(*scene);
  const std::vector<std::pair<std::string, std::string>> expected{
      {"/World/Set/Floor", "/World/Set"},
      {"/World/Chairs/Red/Seat", "/World/Chairs/Red"},
      {"/World/Tree_1/Leaves", "/World/Tree_1"},
      {"/World/Tree_1/Top/Nest/Egg", "/World/Tree_1/Top/Nest"},
      {"/World/Tree_2/Leaves", "/World/Tree_2"},
      {"/World/Tree_2/Top/Nest/Egg", "/World/Tree_2/Top/Nest"},
      {"/World/Bush_9/Points[7]", "/World/Bush_9"},
      {"/World/Lights/Key", "/World/Lights"}};
  ASSERT_EQ(names.count(), expected.size());
  for (uint32_t i = 0; i < names.count(); ++i) {
    EXPECT_EQ(names.object(i), expected[i].first);
    EXPECT_EQ(names.asset(i), expected[i].second);
  }
  EXPECT_EQ(names.first_object(), (std::vector<uint32_t>{0, 2, 4, 6}));
  // The manifest contains only names that occur in the image.
  const std::vector<uint32_t> there{crypto_id("/World/Tree_2/Leaves")};
  const auto manifest = crypto_manifest(*scene, Aov::kCryptoObject, there);
  ASSERT_EQ(manifest.size(), 1u);
  EXPECT_EQ(manifest[0].first, "/World/Tree_2/Leaves");
}

TEST(LightGroups, AreBounded) {
  SceneBuilder b;
  EXPECT_EQ(b.light_group(""), 0u);
  EXPECT_EQ(b.light_group("key"), 1u);
  EXPECT_EQ(b.light_group("key"), 1u);
  for (uint32_t i = 2; i < kMaxLightGroups; ++i) b.light_group(numbered("g", i));
  EXPECT_THROW(b.light_group("one too many"), Error);
}

}  // namespace
}  // namespace wavecomb
