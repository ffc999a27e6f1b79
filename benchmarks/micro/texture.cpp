// SPDX-License-Identifier: Apache-2.0
// Cost of a trilinear texture lookup by lane width, by size of the texture, and by whether
// neighbouring lanes read neighbouring texels.
#include <memory>
#include <random>
#include <vector>

#include "wavecomb/texture/lookup.h"
#include "widths.h"

namespace wavecomb::micro {
namespace {

constexpr size_t kLookups = 1 << 16;

/// Texture coordinates of the lookups, and a filter width between two mip levels, so that each
/// lookup reads two levels.
struct Queries {
  std::vector<float> s, t;
  float width;
};

/// Makes an 8-bit sRGB texture of edge x edge texels. Its finest level takes edge^2 * 4 bytes.
/// Returns the texture of the previous call if that has the same size.
const Texture& texture_of(uint32_t edge) {
  static std::unique_ptr<Texture> made;
  if (made && made->view().levels[0].width == edge) return *made;
  std::mt19937 random(1);
  std::vector<uint8_t> texels(size_t{edge} * edge * 3);
  for (uint8_t& x : texels) x = static_cast<uint8_t>(random());
  made = std::make_unique<Texture>(
      TextureDesc{"bench", texels.data(), edge, edge, 3, TexelFormat::kU8, true});
  return *made;
}

/// Makes lookups at consecutive texels along rows if `coherent` is true, as camera rays on a plane
/// would, and at random positions otherwise.
Queries make_queries(uint32_t edge, bool coherent) {
  Queries q;
  q.width = 1.4f / static_cast<float>(edge);
  q.s.resize(kLookups);
  q.t.resize(kLookups);
  std::mt19937 random(2);
  std::uniform_real_distribution<float> uniform(0, 1);
  const uint32_t row = edge;
  for (uint32_t i = 0; i < kLookups; ++i) {
    q.s[i] = coherent ? (static_cast<float>(i % row) + 0.3f) / static_cast<float>(edge)
                      : uniform(random);
    q.t[i] = coherent ? (static_cast<float>(i / row % edge) + 0.3f) / static_cast<float>(edge)
                      : uniform(random);
  }
  return q;
}

template <size_t W>
void texture(benchmark::State& state, uint32_t edge, bool coherent) {
  using F = Lanes<W>;
  const Texture& texture = texture_of(edge);
  const Queries q = make_queries(edge, coherent);
  for (auto _ : state) {
    F sum(0.f);
    for (size_t i = 0; i < kLookups; i += W) {
      const Texel<F> texel = lookup<F>(texture.view(), load<F>(q.s.data() + i),
                                       load<F>(q.t.data() + i), F(q.width), Mask<F>(true));
      sum = sum + (texel.r + texel.g + texel.b);
    }
    keep<F>(sum);
  }
  count_items(state, "lookup", kLookups);
  state.counters["texture_bytes"] = static_cast<double>(texture.bytes());
}

const bool registered = [] {
  // With 4 bytes per texel, the finest levels of these textures take 16 KiB, 256 KiB, 4 MiB, 64 MiB
  // and 256 MiB.
  for (const uint32_t edge : {64u, 256u, 1024u, 4096u, 8192u})
    for (const bool coherent : {true, false})
      for_each_width([&]<size_t W>() {
        benchmark::RegisterBenchmark(("texture/edge:" + std::to_string(edge) +
                                      (coherent ? "/coherent" : "/random") + lanes_label(W))
                                         .c_str(),
                                     texture<W>, edge, coherent);
      });
  return true;
}();

}  // namespace
}  // namespace wavecomb::micro
