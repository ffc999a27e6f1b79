// SPDX-License-Identifier: Apache-2.0 Cost of computing one sample set, which consists of four
// sample values, for each path.
#include <vector>

#include "wavecomb/core/sampler.h"
#include "widths.h"

namespace wavecomb::micro {
namespace {

constexpr size_t kPaths = 4096;  // as in a wave

template <size_t W>
void sampler(benchmark::State& state, SamplerKind kind) {
  using F = Lanes<W>;
  using U = UInt<F>;
  std::vector<uint32_t> pixel(kPaths), sample(kPaths);
  for (uint32_t i = 0; i < kPaths; ++i) {
    pixel[i] = hash_u32<uint32_t>(i / 16);
    sample[i] = i % 16;
  }
  uint32_t set = 0;
  for (auto _ : state) {
    F sum(0.f);
    for (size_t i = 0; i < kPaths; i += W) {
      const SampleKey<F> key{load<U>(pixel.data() + i), load<U>(sample.data() + i)};
      const Sample4<F> s = sample_4d<F>(kind, key, set);
      sum = sum + (s.x + s.y + s.z + s.w);
    }
    keep<F>(sum);
    set = (set + 1) % 16;
  }
  count_items(state, "set_of_4", kPaths);
}

const bool registered = [] {
  for (const auto& [name, kind] : {std::pair{"sobol", SamplerKind::kSobol},
                                   std::pair{"independent", SamplerKind::kIndependent}})
    for_each_width([&]<size_t W>() {
      benchmark::RegisterBenchmark(("sampler/" + std::string(name) + lanes_label(W)).c_str(),
                                   sampler<W>, kind);
    });
  return true;
}();

}  // namespace
}  // namespace wavecomb::micro
