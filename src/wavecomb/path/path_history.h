// SPDX-License-Identifier: Apache-2.0
/// History of a path: its vertices, stored until the path ends. Training reads the stored vertices,
/// for example to estimate the incident radiance along a bounce,
///   L_j = (R_end - R_j) / T_j
/// where R_j is the radiance of the path after the light sample of vertex j, and T_j the throughput
/// after the bounce.
///
/// Both integrators own a PathHistory and report vertices to it. The history is empty and costs
/// nothing if no HistoryReader is set.
#pragma once

#include <algorithm>
#include <cstring>

#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/rows/soa.h"
#include "wavecomb/path/integrator.h"
#include "wavecomb/path/path_pool.h"
#include "wavecomb/path/path_state.h"

namespace wavecomb {

/// Path vertex, with the bounce at the vertex.
template <typename F>
struct HistoryRow {
  Vec3<F> p;
  Vec3<F> wi;           ///< direction of the bounce
  Color<F> throughput;  ///< T_j; 0 if the path ended here
  F pdf;                ///< solid angle density of wi; 0 for a delta bounce
  Color<F> radiance;    ///< R_j, including the light sample of this vertex
  UInt<F> material;
  // The following fields are set only if a guiding field is in use or in training (Vertex::guide).
  UInt<F> axis;  ///< guiding_axis() of the surface at the vertex
  F bsdf_pdf;    ///< solid angle density of wi by the BSDF alone
  WAVECOMB_FIELDS(p, wi, throughput, pdf, radiance, material, axis, bsdf_pdf)
};

/// References to the state of a shaded path vertex and to the result of shading it. Contract: the
/// referenced objects outlive the ShadedVertex.
template <typename F>
struct ShadedVertex {
  const PathState<F>& path;  ///< on arrival
  const F& t;                ///< length of the ray that arrived
  const UInt<F>& material;
  const VertexResult<F>& result;
};

/// Stored vertices of the paths of a wave.
///
/// Contract: owned by one wave, or one reference integrator. Slots must be below the capacity.
class PathHistory {
 public:
  PathHistory() = default;
  /// Allocates memory for `capacity` paths with up to `most` vertices each.
  PathHistory(size_t capacity, uint32_t most)
      : most_(most),
        rows_(most ? SoaBlock(1, capacity * most * kRowWords<HistoryRow>) : SoaBlock()),
        counts_(most ? SoaBlock(1, capacity) : SoaBlock()) {}

  explicit operator bool() const { return most_ > 0; }
  uint32_t most() const { return most_; }
  size_t bytes() const { return rows_.bytes() + counts_.bytes(); }

  /// Clears the slots below `slots`.
  void clear(size_t slots) {
    if (most_ > 0) std::memset(counts_.uints(0), 0, slots * sizeof(uint32_t));
  }

  /// Stores a shaded vertex of the path in each active lane's slot. `radiance` holds the
  /// RadianceRow of each slot (PathPool::radiance).
  template <typename F>
  [[gnu::noinline, gnu::cold]] void vertex(uint32_t depth, const UInt<F>& slot,
                                           const ShadedVertex<F>& at, const float* radiance,
                                           const Mask<F>& active) {
    if (depth >= most_) return;
    const PathState<F>& path = at.path;
    const VertexResult<F>& v = at.result;
    const Color<F> contribution = load_row<RadianceRow, F>(radiance, slot, active).sum;
    const Vec3<F> none(F(0.f));
    store_row<HistoryRow, F>(
        rows_.floats(0), slot * most_ + depth,
        {fma(path.dir, at.t, path.o), select<F>(v.alive, v.next.dir, none),
         select<F>(v.alive, v.next.throughput, none),
         select(v.alive & not_(v.next.enters_body), v.next.pdf, F(0.f)), contribution, at.material,
         v.axis, select(v.alive, v.bsdf_pdf, F(0.f))},
        active);
    scatter<UInt<F>>(counts_.uints(0), UInt<F>(depth + 1), slot, Mask<UInt<F>>(active));
  }

  /// Adds the contribution `c` of the light sample to the vertex at `depth`.
  template <typename F>
  [[gnu::noinline, gnu::cold]] void light(uint32_t depth, const UInt<F>& slot, const Color<F>& c,
                                          const Mask<F>& active) {
    if (depth >= most_) return;
    const UInt<F> row = slot * most_ + depth;
    HistoryRow<F> r = load_row<HistoryRow, F>(rows_.floats(0), row, active);
    r.radiance += c;
    store_row<HistoryRow, F>(rows_.floats(0), row, r, active);
  }

  /// Returns the number of stored vertices of a path, at most `most`.
  uint32_t count(uint32_t slot) const { return counts_.uints(0)[slot]; }
  /// Returns the vertex at `depth`, which must be below count(slot).
  HistoryRow<float> vertex(uint32_t slot, uint32_t depth) const {
    return load_row<HistoryRow, float>(rows_.floats(0), slot * most_ + depth, true);
  }

 private:
  uint32_t most_ = 0;
  SoaBlock rows_, counts_;
};

/// Receiver of the vertices of finished paths.
///
/// Contract: all workers call the receiver concurrently. Calls are made once for each wave or, by
/// the reference integrator, once for each path. The arguments are valid only during the call.
/// Since workers call in any order, implementations must add up values as integers to be
/// deterministic (core/encoding/fixed_point.h).
class HistoryReader {
 public:
  virtual ~HistoryReader() = default;
  /// Returns the number of vertices to store for each path.
  virtual uint32_t most() const = 0;
  /// Receives the paths of `task`. Slot i holds sample first_sample + i % samples of the task's
  /// pixel i / samples. `radiance` holds the RadianceRow of each slot, before the camera's
  /// exposure.
  virtual void ended(const PathHistory& history, const float* radiance, const WaveTask& task) = 0;
};

}  // namespace wavecomb
