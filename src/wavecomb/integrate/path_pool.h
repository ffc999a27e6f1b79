// SPDX-License-Identifier: Apache-2.0
/// The path slots of a wave.
#pragma once

#include <array>
#include <cstring>

#include "wavecomb/core/aov.h"
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
  /// Words of a row: 16 for a path, 12 for its shadow ray, 3 for its radiance.
  static constexpr uint32_t kPathWords = 16, kShadowWords = 16, kRadianceWords = 4;
  /// And 8 for what was hit first: albedo, normal, uv.
  static constexpr uint32_t kFirstWords = 8;
  static constexpr uint32_t kHitWords = 8;      ///< of AovHit
  static constexpr uint32_t kGuideWords = 8;    ///< 7: albedo, normal, 1 once they are final
  static constexpr uint32_t kShadowGroup = 10;  ///< word of a shadow ray's row
  static constexpr uint32_t kShadowSet = 11;    ///< VertexResult::shadow_set, likewise

  PathPool() = default;
  /// `moves`: something moves while the shutter is open. `linked`: lights are linked to geometry.
  PathPool(size_t capacity, const AovLayout& aovs, bool moves, bool linked = false)
      : light_groups(aovs.light_groups),
        rows_(1, capacity * (kPathWords + kShadowWords + kRadianceWords)) {
    paths = rows_.floats(0);
    shadows = paths + capacity * kPathWords;
    radiance = shadows + capacity * kShadowWords;
    const AovSet& set = aovs.set;
    const auto block = [&](SoaBlock& owner, float*& rows, bool wanted, size_t words) {
      if (!wanted) return;
      owner = SoaBlock(1, capacity * words);
      rows = owner.floats(0);
    };
    block(aov_blocks_[0], first, set.first() || set.has(Aov::kUv), kFirstWords);
    block(aov_blocks_[1], depth, set.has(Aov::kDepth), 1);
    block(aov_blocks_[2], hits, set.nearest() || set.crypto(), kHitWords);
    block(aov_blocks_[3], centre, set.nearest(), 1);
    block(aov_blocks_[4], parts[0], set.parts(), kRadianceWords);
    block(aov_blocks_[5], parts[1], set.parts(), kRadianceWords);
    block(aov_blocks_[6], groups, light_groups > 0, kRadianceWords * light_groups);
    block(aov_blocks_[7], cost_ns, set.has(Aov::kCost), 1);
    block(aov_blocks_[8], guides, set.guides(), kGuideWords);
    block(times_, time, moves, 1);
    float* words = nullptr;
    block(links_, words, linked, 1);
    link = reinterpret_cast<uint32_t*>(words);
    wants_uv = set.has(Aov::kUv);
  }

  float* paths = nullptr;     ///< rows of load_path
  float* shadows = nullptr;   ///< origin, direction, tfar, r, g, b, light group, shadow set
  float* radiance = nullptr;  ///< r, g, b so far
  float* time = nullptr;      ///< of the shutter, in [0, 1); null where nothing moves
  uint32_t* link = nullptr;   ///< PathState::link; null where no light is linked
  // Null where not asked for.
  float* first = nullptr;   ///< albedo, normal, uv
  float* depth = nullptr;   ///< along the camera's axis; infinite where nothing was hit
  float* hits = nullptr;    ///< AovHit
  float* centre = nullptr;  ///< squared distance of the sample from the pixel's centre, pixels
  float* parts[2] = {nullptr, nullptr};  ///< radiance as it was before scattering 0 and 1
  float* groups = nullptr;               ///< radiance by light group: rows of r, g, b, a slot's
                                         ///< groups side by side
  float* cost_ns = nullptr;              ///< time spent on the path
  float* guides = nullptr;  ///< albedo and normal of the last vertex that is seen, see store_guides
  uint32_t light_groups = 0;
  bool wants_uv = false;
  size_t bytes() const {
    size_t n = rows_.bytes() + times_.bytes() + links_.bytes();
    for (const SoaBlock& block : aov_blocks_) n += block.bytes();
    return n;
  }

 private:
  SoaBlock rows_, times_, links_;
  std::array<SoaBlock, 9> aov_blocks_;
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
  UInt<F> receiver;  ///< LightReceiver::normal of the vertex that made the ray
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
          {float_bits<F>(r[13]), float_bits<F>(r[14])},
          float_bits<F>(r[15])};
}

template <typename F>
WAVECOMB_INLINE void store_path(const PathPool& pool, const UInt<F>& slot, const PathLanes<F>& p,
                                const Mask<F>& active) {
  store_rows<PathPool::kPathWords, F>(
      pool.paths, slot * PathPool::kPathWords,
      {p.o.x, p.o.y, p.o.z, p.d.x, p.d.y, p.d.z, p.throughput.x, p.throughput.y, p.throughput.z,
       p.pdf, p.eta_scale, p.cone_width, p.cone_spread, bits_float<F>(p.key.pixel_hash),
       bits_float<F>(p.key.sample), bits_float<F>(p.receiver)},
      active);
}

/// Keeps all radiance as it is once the light that scattering `depth` (0, 1) has met is in it, and
/// none that it gathers.
inline void keep_part(const PathPool& pool, uint32_t depth, uint32_t paths) {
  if (pool.parts[depth])
    std::memcpy(pool.parts[depth], pool.radiance, size_t{paths} * PathPool::kRadianceWords * 4);
}

namespace detail {

/// Adds c to the active lanes' rows, which are distinct.
template <typename F>
WAVECOMB_INLINE void add_to_rows(float* rows, const UInt<F>& row, const Color<F>& c,
                                 const Mask<F>& active) {
  const UInt<F> word = row * PathPool::kRadianceWords;
  auto r = load_rows<PathPool::kRadianceWords, F>(rows, word, active);
  r[0] += c.x;
  r[1] += c.y;
  r[2] += c.z;
  store_rows<PathPool::kRadianceWords, F>(rows, word, r, active);
}

}  // namespace detail

/// Adds c to the radiance of the active lanes' slots, which are distinct.
template <typename F>
WAVECOMB_INLINE void add_radiance(const PathPool& pool, const UInt<F>& slot, const Color<F>& c,
                                  const Mask<F>& active) {
  detail::add_to_rows<F>(pool.radiance, slot, c, active);
}

/// A light group that is not kept.
inline constexpr uint32_t kNoGroup = 0xffffffffu;

/// Adds c to light group `group` (kNoGroup: to none) of the active lanes' slots, which are
/// distinct.
template <typename F>
inline void add_group_radiance(const PathPool& pool, const UInt<F>& slot, const UInt<F>& group,
                               const Color<F>& c, const Mask<F>& active) {
  const Mask<F> kept = active & Mask<F>(group != UInt<F>(kNoGroup));
  if (any(kept)) detail::add_to_rows<F>(pool.groups, slot * pool.light_groups + group, c, kept);
}

}  // namespace wavecomb
