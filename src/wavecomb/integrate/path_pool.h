// SPDX-License-Identifier: Apache-2.0
/// The path slots of a wave.
#pragma once

#include "wavecomb/core/rows.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/core/soa.h"
#include "wavecomb/core/vec.h"

namespace wavecomb {

/// A slot is one (pixel, sample) for life. Its state is a row of one cache line, which shading
/// reads, and writes anew for the next ray; its shadow ray is another row. Whatever order hits are
/// shaded in, each touches its own lines and no other's (docs/decisions/path-rows.md).
///
/// Contract: owned by one wave. AOVs are there only where asked for.
class PathPool {
 public:
  /// Words of a row: 15 for a path, 10 for its shadow ray, 3 for its radiance.
  static constexpr uint32_t kPathWords = 16, kShadowWords = 16, kRadianceWords = 4;
  /// And 6 for what was hit first: albedo, normal.
  static constexpr uint32_t kFirstWords = 8;

  PathPool() = default;
  PathPool(size_t capacity, bool with_aovs)
      : rows_(1, capacity * (kPathWords + kShadowWords + kRadianceWords)),
        first_rows_(1, with_aovs ? capacity * kFirstWords : 0),
        depths_(1, with_aovs ? capacity : 0),
        has_aovs(with_aovs) {
    paths = rows_.floats(0);
    shadows = paths + capacity * kPathWords;
    radiance = shadows + capacity * kShadowWords;
    if (!with_aovs) return;
    first = first_rows_.floats(0);
    depth = depths_.floats(0);
  }

  float* paths = nullptr;     ///< rows of load_path
  float* shadows = nullptr;   ///< origin, direction, tfar, r, g, b
  float* radiance = nullptr;  ///< r, g, b so far
  float* first = nullptr;     ///< albedo, normal
  float* depth = nullptr;     ///< along the camera's axis; infinite where nothing was hit
  size_t bytes() const { return rows_.bytes() + first_rows_.bytes() + depths_.bytes(); }

 private:
  SoaBlock rows_, first_rows_, depths_;

 public:
  bool has_aovs = false;
};

/// A path between two vertices, as its row holds it.
template <typename F>
struct PathLanes {
  Vec3<F> o, d;  ///< the ray to be traced
  Color<F> throughput;
  F pdf;                      ///< density of the bounce that made the ray; 0: delta or camera
  F eta_scale;                ///< product of eta^2 of the interfaces crossed, for roulette
  F cone_width, cone_spread;  ///< ray cone at the origin: width in scene units, angle in radians
  SampleKey<F> key;
};

template <typename F>
WAVECOMB_INLINE PathLanes<F> load_path(const PathPool& pool, const UInt<F>& slot,
                                       const Mask<F>& active) {
  const auto r =
      load_rows<PathPool::kPathWords, F>(pool.paths, slot * PathPool::kPathWords, active);
  return {{r[0], r[1], r[2]},
          {r[3], r[4], r[5]},
          {r[6], r[7], r[8]},
          r[9],
          r[10],
          r[11],
          r[12],
          {float_bits<F>(r[13]), float_bits<F>(r[14])}};
}

template <typename F>
WAVECOMB_INLINE void store_path(const PathPool& pool, const UInt<F>& slot, const PathLanes<F>& p,
                                const Mask<F>& active) {
  store_rows<PathPool::kPathWords, F>(
      pool.paths, slot * PathPool::kPathWords,
      {p.o.x, p.o.y, p.o.z, p.d.x, p.d.y, p.d.z, p.throughput.x, p.throughput.y, p.throughput.z,
       p.pdf, p.eta_scale, p.cone_width, p.cone_spread, bits_float<F>(p.key.pixel_hash),
       bits_float<F>(p.key.sample), F(0.f)},
      active);
}

/// Adds c to the radiance of the active lanes' slots, which are distinct.
template <typename F>
WAVECOMB_INLINE void add_radiance(const PathPool& pool, const UInt<F>& slot, const Color<F>& c,
                                  const Mask<F>& active) {
  const UInt<F> word = slot * PathPool::kRadianceWords;
  auto r = load_rows<PathPool::kRadianceWords, F>(pool.radiance, word, active);
  r[0] += c.x;
  r[1] += c.y;
  r[2] += c.z;
  store_rows<PathPool::kRadianceWords, F>(pool.radiance, word, r, active);
}

}  // namespace wavecomb
