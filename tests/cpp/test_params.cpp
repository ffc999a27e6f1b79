// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "lane_testing.h"
#include "wavecomb/material/params.h"

namespace wavecomb {
namespace {

using Vec = Vec3<float>;
constexpr uint32_t kAllInputs = (1u << kInputCount) - 1;

/// Three materials and two textures: constants only, textures for all inputs, and a mixture.
class ParamsTest : public ::testing::Test {
 protected:
  ParamsTest() {
    std::mt19937 rng(9);
    std::uniform_real_distribution<float> unit(0, 1);
    for (uint32_t size : {8u, 5u}) {
      std::vector<float> pixels(size * size * 4);
      for (float& p : pixels) p = unit(rng);
      TextureDesc desc;
      desc.name = "noise";
      desc.data = pixels.data();
      desc.width = desc.height = size;
      desc.channels = 4;
      desc.format = TexelFormat::kF32;
      textures_.push_back(std::make_unique<Texture>(desc));
      views_.push_back(textures_.back()->view());
    }
    for (uint32_t m = 0; m < 3; ++m) {
      MaterialRecord& r = records_[m];
      r = MaterialRecord{};
      for (int k = 0; k < 3; ++k) {
        r.base_color[k] = unit(rng);
        r.specular_color[k] = unit(rng);
        r.emission[k] = 5 * unit(rng);
        r.normal[k] = k == 2 ? 1.f : 0.f;
        r.conductor_eta[k] = unit(rng);
        r.conductor_k[k] = unit(rng);
      }
      r.roughness = unit(rng);
      r.metallic = unit(rng);
      r.clearcoat = unit(rng);
      r.clearcoat_roughness = unit(rng);
      r.opacity = unit(rng);
      r.ior = 1 + unit(rng);
      r.flags = m;
      r.textured_inputs =
          m == 0
              ? 0
              : (m == 1 ? kAllInputs : input_bit(Input::kRoughness) | input_bit(Input::kBaseColor));
      for (uint32_t s = 0; s < kInputCount; ++s) {
        TextureUseRecord& u = uses_[m * kInputCount + s];
        u = TextureUseRecord{};
        u.texture = (m + s) % 2;
        u.channel = s % 5;
        for (int k = 0; k < 4; ++k) {
          u.scale[k] = unit(rng) + 0.5f;
          u.bias[k] = 0.1f * unit(rng);
        }
        for (int k = 0; k < 6; ++k) u.uv[k] = 3 * unit(rng) - 1;
      }
    }
    view_.materials = records_.data();
    view_.uses = uses_.data();
    view_.textures = views_.data();
  }

  std::vector<std::unique_ptr<Texture>> textures_;
  std::vector<TextureView> views_;
  std::array<MaterialRecord, 3> records_;
  std::array<TextureUseRecord, 3 * kInputCount> uses_;
  MaterialView view_;
};

constexpr size_t kValues = 29;

template <typename F>
void record(const MaterialView& view, const UInt<F>& material, const Vec2<F>& uv, const F& width,
            const Mask<F>& active, float* out) {
  const auto p = fetch_params<kAllInputs, F>(view, material, uv, width, active);
  const Color<F> emission = fetch_emission<F>(view, material, uv, width, active);
  const F values[kValues] = {p.base_color.x,
                             p.base_color.y,
                             p.base_color.z,
                             p.specular_color.x,
                             p.specular_color.y,
                             p.specular_color.z,
                             p.emission.x,
                             p.emission.y,
                             p.emission.z,
                             p.roughness,
                             p.metallic,
                             p.clearcoat,
                             p.clearcoat_roughness,
                             p.opacity,
                             p.normal.x,
                             p.normal.y,
                             p.normal.z,
                             p.ior,
                             p.conductor_eta.x,
                             p.conductor_eta.y,
                             p.conductor_eta.z,
                             p.conductor_k.x,
                             p.conductor_k.y,
                             p.conductor_k.z,
                             emission.x,
                             emission.y,
                             emission.z,
                             fetch_opacity<F>(view, material, uv, width, active),
                             bits_float<F>(p.flags)};
  for (const F& value : values) {
    wavecomb::store(out, value);
    out += kWidth<F>;
  }
}

template <size_t W>
void expect_lanes_equal_scalar(const MaterialView& view) {
  using F = FloatP<W>;
  std::mt19937 rng(W);
  std::uniform_real_distribution<float> unit(-2, 2);
  for (int round = 0; round < 300; ++round) {
    uint32_t material[W];
    float u[W], v[W], width[W], wide[kValues * W], narrow[kValues];
    const uint32_t one = rng() % 3;
    for (size_t i = 0; i < W; ++i) {
      material[i] = round % 2 ? one : rng() % 3;
      u[i] = unit(rng);
      v[i] = unit(rng);
      width[i] = rng() % 3 ? std::abs(unit(rng)) * 0.2f : 0.f;
    }
    const uint32_t off = rng();
    Mask<F> active = Mask<F>((lane_index<F>() & UInt<F>(off)) == UInt<F>(0u));
    if (round % 5 == 0) active = Mask<F>(true);
    record<F>(view, wavecomb::load<UInt<F>>(material), {wavecomb::load<F>(u), wavecomb::load<F>(v)},
              wavecomb::load<F>(width), active, wide);
    for (size_t i = 0; i < W; ++i) {
      if (!(lane_bits<F>(active) >> i & 1)) continue;
      record<float>(view, material[i], {u[i], v[i]}, width[i], true, narrow);
      for (size_t k = 0; k < kValues; ++k)
        ASSERT_EQ(std::bit_cast<uint32_t>(narrow[k]), std::bit_cast<uint32_t>(wide[k * W + i]))
            << "width " << W << " value " << k << " material " << material[i] << ": " << narrow[k]
            << " and " << wide[k * W + i];
    }
  }
}

TEST_F(ParamsTest, UniformAndMixedLanesEqualScalar) {
  lane_testing::for_each_packet([&]<typename F>() { expect_lanes_equal_scalar<kWidth<F>>(view_); });
}

template <size_t W>
void expect_own_by_material(const MaterialView& view) {
  using F = FloatP<W>;
  std::mt19937 rng(W);
  for (int round = 0; round < 100; ++round) {
    uint32_t material[W];
    const uint32_t one = rng() % 3;
    for (uint32_t& m : material) m = round % 2 ? one : rng() % 3;
    const uint32_t off = rng();
    const Mask<F> active = Mask<F>((lane_index<F>() & UInt<F>(off)) == UInt<F>(0u));
    const auto own = detail::specific_values<3, F>(view, wavecomb::load<UInt<F>>(material), active);
    for (size_t k = 0; k < own.size(); ++k) {
      float value[W];
      wavecomb::store(value, own[k]);
      for (size_t i = 0; i < W; ++i)
        if (lane_bits<F>(active) >> i & 1) {
          ASSERT_EQ(value[i], k < 3 ? view.own[material[i]].value[k] : 0.f) << W << " " << k;
        }
    }
  }
}

TEST_F(ParamsTest, WhatAProgramHasToItselfIsItsMaterials) {
  const ProgramParameterRecord own[3] = {{{1, 2, 3, 4}}, {{5, 6, 7, 8}}, {{9, 10, 11, 12}}};
  view_.own = own;
  lane_testing::for_each_packet([&]<typename F>() { expect_own_by_material<kWidth<F>>(view_); });
  const auto scalar = detail::specific_values<4, float>(view_, 1u, true);
  EXPECT_EQ(scalar[3], 8.f);
}

TEST_F(ParamsTest, ConstantsComeThrough) {
  const auto p = fetch_params<kAllInputs, float>(view_, 0u, {0.3f, 0.4f}, 0.f, true);
  EXPECT_EQ(p.base_color.y, records_[0].base_color[1]);
  EXPECT_EQ(p.emission.z, records_[0].emission[2]);
  EXPECT_EQ(p.roughness, records_[0].roughness);
  EXPECT_EQ(p.opacity, records_[0].opacity);
  EXPECT_EQ(p.normal.z, 1.f);
  EXPECT_EQ((fetch_opacity<float>(view_, 0u, {0.3f, 0.4f}, 0.f, true)), 1.f);
}

TEST_F(ParamsTest, InputsThatAProgramDoesNotUseReadNoTexture) {
  const auto p =
      fetch_params<input_bit(Input::kRoughness), float>(view_, 1u, {0.3f, 0.4f}, 0.f, true);
  EXPECT_EQ(p.base_color.x, records_[1].base_color[0]);
  EXPECT_NE(p.roughness, records_[1].roughness);
}

TEST_F(ParamsTest, TextureValueIsScaledBiasedAndPicked) {
  TextureUseRecord& use = uses_[1 * kInputCount + static_cast<uint32_t>(Input::kMetallic)];
  const float s = use.uv[0] * 0.2f + use.uv[1] * 0.7f + use.uv[2];
  const float t = use.uv[3] * 0.2f + use.uv[4] * 0.7f + use.uv[5];
  const Texel<float> texel = lookup<float>(views_[use.texture], s, t, 0.f, true);
  const float channels[] = {texel.r, texel.g, texel.b, texel.a};
  for (uint32_t c = 0; c < 4; ++c) {
    use.channel = c;
    use.scale[c] = 0.5f;
    use.bias[c] = 0.125f;
    const auto p = fetch_params<kAllInputs, float>(view_, 1u, {0.2f, 0.7f}, 0.f, true);
    EXPECT_NEAR(p.metallic, channels[c] * 0.5f + 0.125f, 1e-5f);
  }
}

TEST_F(ParamsTest, ValuesAreBroughtIntoRange) {
  MaterialRecord& r = records_[0];
  const float nan = std::numeric_limits<float>::quiet_NaN();
  r.roughness = -1;
  r.metallic = 7;
  r.clearcoat = nan;
  r.base_color[0] = 3;
  r.base_color[1] = nan;
  r.emission[0] = std::numeric_limits<float>::infinity();
  r.emission[1] = -2;
  r.ior = 0;
  r.normal[0] = r.normal[1] = r.normal[2] = 0;
  auto p = fetch_params<kAllInputs, float>(view_, 0u, {0, 0}, 0.f, true);
  EXPECT_EQ(p.roughness, 0.f);
  EXPECT_EQ(p.metallic, 1.f);
  EXPECT_EQ(p.clearcoat, 0.f);
  EXPECT_EQ(p.base_color.x, 1.f);
  EXPECT_EQ(p.base_color.y, 0.f);
  EXPECT_EQ(p.emission.x, kMaxEmission);
  EXPECT_EQ(p.emission.y, 0.f);
  EXPECT_EQ(p.ior, 1 / kMaxIor);
  EXPECT_EQ(p.normal.z, 1.f);
  r.normal[0] = 2;
  r.normal[2] = -1;
  r.ior = nan;
  p = fetch_params<kAllInputs, float>(view_, 0u, {0, 0}, 0.f, true);
  EXPECT_GT(p.normal.z, 0.f);
  EXPECT_NEAR(length(p.normal), 1.f, 1e-6f);
  EXPECT_TRUE(std::isfinite(p.ior));
}

TEST_F(ParamsTest, OpacityIsPresenceOrTransparency) {
  MaterialRecord& r = records_[0];
  const auto both = [&] {
    return std::pair{fetch_opacity<float>(view_, 0u, {0, 0}, 0.f, true),
                     fetch_params<kAllInputs, float>(view_, 0u, {0, 0}, 0.f, true).opacity};
  };
  r.opacity = 0.4f;
  r.flags = 0;
  EXPECT_EQ(both(), std::pair(1.f, 0.4f));
  r.flags = kPresence;
  EXPECT_EQ(both(), std::pair(0.4f, 1.f));
  r.opacity_threshold = 0.5f;
  EXPECT_EQ(both(), std::pair(0.f, 1.f));
  r.flags = 0;
  r.opacity = 0.5f;
  EXPECT_EQ(both(), std::pair(1.f, 1.f));
}

}  // namespace
}  // namespace wavecomb
