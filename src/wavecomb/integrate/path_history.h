// SPDX-License-Identifier: Apache-2.0
/// The vertices of paths, kept until a path ends: what learns from whole paths reads them, such as
/// how much light came back along a bounce,
///   L_j = (R_end - R_j) / T_j
/// where R_j is what the path had brought when it left vertex j, and T_j its throughput then.
///
/// Both integrators own one and tell it what happens to a path. Where nobody asks for vertices it
/// is empty, and no path pays for it.
#pragma once

#include <algorithm>
#include <cstring>

#include "wavecomb/core/fields.h"
#include "wavecomb/core/soa.h"
#include "wavecomb/integrate/integrator.h"
#include "wavecomb/integrate/path_pool.h"
#include "wavecomb/integrate/path_state.h"

namespace wavecomb {

/// A vertex, and the bounce with which the path left it.
template <typename F>
struct HistoryRow {
  Vec3<F> p;
  Vec3<F> wi;           ///< direction of the bounce
  Color<F> throughput;  ///< T_j; 0 where the path ended here
  F pdf;                ///< of wi over solid angle; 0: delta
  Color<F> radiance;    ///< R_j: with the light sample of this vertex
  UInt<F> material;
  // Where bounces are guided, or to be (Vertex::guide):
  UInt<F> axis;  ///< guide_axis of the surface
  F bsdf_pdf;    ///< of wi by the BSDF alone
  WAVECOMB_FIELDS(p, wi, throughput, pdf, radiance, material, axis, bsdf_pdf)
};

/// Contract: owned by one wave, or one reference integrator; slots below the capacity.
class PathHistory {
 public:
  PathHistory() = default;
  /// Room for the first `most` vertices of each path.
  PathHistory(size_t capacity, uint32_t most)
      : most_(most),
        rows_(most ? SoaBlock(1, capacity * most * kRowWords<HistoryRow>) : SoaBlock()),
        counts_(most ? SoaBlock(1, capacity) : SoaBlock()) {}

  explicit operator bool() const { return most_ > 0; }
  uint32_t most() const { return most_; }
  size_t bytes() const { return rows_.bytes() + counts_.bytes(); }

  /// Forgets the paths in slots below `slots`.
  void clear(size_t slots) {
    if (most_ > 0) std::memset(counts_.uints(0), 0, slots * sizeof(uint32_t));
  }

  /// A vertex was shaded: the path in each active lane's slot came as `path` over a length of `t`,
  /// has brought what `radiance` (of the PathPool) says, and leaves as `v` says.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void vertex(uint32_t depth, const UInt<F>& slot,
                                           const PathState<F>& path, const F& t,
                                           const UInt<F>& material, const VertexResult<F>& v,
                                           const float* radiance, const Mask<F>& active) {
    if (depth >= most_) return;
    const Color<F> brought = load_row<RadianceRow, F>(radiance, slot, active).sum;
    const Vec3<F> none(F(0.f));
    store_row<HistoryRow, F>(
        rows_.floats(0), slot * most_ + depth,
        {fma(path.dir, t, path.o), select<F>(v.alive, v.next.dir, none),
         select<F>(v.alive, v.next.throughput, none), select(v.alive, v.next.pdf, F(0.f)), brought,
         material, v.axis, select(v.alive, v.bsdf_pdf, F(0.f))},
        active);
    scatter<UInt<F>>(counts_.uints(0), UInt<F>(depth + 1), slot, Mask<UInt<F>>(active));
  }

  /// The light sample of the vertex of `depth` has brought `c`.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void light(uint32_t depth, const UInt<F>& slot, const Color<F>& c,
                                          const Mask<F>& active) {
    if (depth >= most_) return;
    const UInt<F> row = slot * most_ + depth;
    HistoryRow<F> r = load_row<HistoryRow, F>(rows_.floats(0), row, active);
    r.radiance += c;
    store_row<HistoryRow, F>(rows_.floats(0), row, r, active);
  }

  /// Vertices kept of a path, at most `most`.
  uint32_t count(uint32_t slot) const { return counts_.uints(0)[slot]; }
  /// Its vertex of `depth`, below count(slot).
  HistoryRow<float> vertex(uint32_t slot, uint32_t depth) const {
    return load_row<HistoryRow, float>(rows_.floats(0), slot * most_ + depth, true);
  }

 private:
  uint32_t most_ = 0;
  SoaBlock rows_, counts_;
};

/// Gets the vertices of paths that have ended.
///
/// Contract: called by all workers at once, once a wave (by the reference integrator once a path);
/// what is handed over holds only during the call. Sums that are the same for every schedule are
/// sums of integers (core/fixed_point.h).
class HistoryReader {
 public:
  virtual ~HistoryReader() = default;
  /// Vertices wanted of each path.
  virtual uint32_t most() const = 0;
  /// The paths of `task`: slot i is sample first_sample + i % samples of pixel i / samples of it.
  /// `radiance`: RadianceRow of each, before the camera's exposure.
  virtual void ended(const PathHistory& history, const float* radiance, const WaveTask& task) = 0;
};

}  // namespace wavecomb
