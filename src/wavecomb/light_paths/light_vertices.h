// SPDX-License-Identifier: Apache-2.0
/// Vertices of light paths that camera paths connect to (docs/light-paths.md).
///
/// Each camera path is paired with the light path of the same pixel number and sample. One vertex
/// of the light path is stored, chosen uniformly, and every vertex of the camera path connects to
/// it. The connections depend only on pixel and sample, not on the wave.
#pragma once

#include <cstring>

#include "wavecomb/core/encoding/hash.h"
#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/light_paths/light_path_row.h"
#include "wavecomb/path/path_state.h"
#include "wavecomb/path/shading_record.h"

namespace wavecomb {

/// Stored vertex of a light path, in addition to the LightPathRow that led there and its
/// ShadingRecord.
template <typename F>
struct LightVertexRow {
  Vec3<F> p;
  UInt<F> vertices;  ///< number of candidate vertices so far; 0 if there is none
  UInt<F> depth, material;
  WAVECOMB_FIELDS(p, vertices, depth, material)
};

/// Connection that a vertex of a camera path offers to the light path's vertex, one row for each
/// slot.
template <typename F>
struct ConnectionRow {
  Vec3<F> from;  ///< origin of the ray to that vertex
  F pdf;         ///< solid angle density of the camera path's bounce in that direction
  /// Contribution for unit radiance from that vertex, times the number of candidate vertices; black
  /// without a connection.
  Color<F> light;
  F ratio;  ///< JointVertex::towards
  WAVECOMB_FIELDS(from, pdf, light, ratio)
};

/// Stored vertices and connections of the paths of a wave.
///
/// Contract: owned by one wave, or one reference integrator. Each slot has a row of each kind.
class LightVertices {
 public:
  LightVertices() = default;
  /// Allocates rows for `capacity` slots; 0 disables connections.
  explicit LightVertices(size_t capacity)
      : rows_(capacity > 0 ? SoaBlock(1, capacity * kWords) : SoaBlock()) {
    if (capacity == 0) return;
    paths = rows_.floats(0);
    records = paths + capacity * kRowWords<LightPathRow>;
    chosen = records + capacity * kRowWords<ShadingRecord>;
    connections = chosen + capacity * kRowWords<LightVertexRow>;
  }

  explicit operator bool() const { return paths != nullptr; }
  size_t bytes() const { return rows_.bytes(); }
  /// Clears the vertices of slots below `slots`.
  void clear(size_t slots) const {
    std::memset(chosen, 0, slots * kRowWords<LightVertexRow> * sizeof(float));
  }

  float* paths = nullptr;        ///< LightPathRow that arrived at the vertex
  float* records = nullptr;      ///< ShadingRecord
  float* chosen = nullptr;       ///< LightVertexRow
  float* connections = nullptr;  ///< ConnectionRow

 private:
  static constexpr size_t kWords = kRowWords<LightPathRow> + kRowWords<ShadingRecord> +
                                   kRowWords<LightVertexRow> + kRowWords<ConnectionRow>;
  SoaBlock rows_;
};

/// Stores the vertex at `p` in the lanes of `is_candidate` that the path's hash selects: of n
/// vertices so far, the last one replaces the stored one with probability 1 / n. Returns the lanes
/// whose vertex was stored.
template <typename F>
inline Mask<F> store_light_vertex(const LightVertices& to, uint32_t depth,
                                  const LightPathRow<F>& path, const ShadingRecord<F>& record,
                                  const UInt<F>& material, const Vec3<F>& p,
                                  const Mask<F>& is_candidate) {
  using U = UInt<F>;
  if (none(is_candidate)) return Mask<F>(false);
  LightVertexRow<F> row = load_row<LightVertexRow, F>(to.chosen, record.slot, is_candidate);
  row.vertices = row.vertices + 1u;
  const U number = hash_u32<U>(path.key.pixel_hash, path.key.sample);
  const F u = unit_float<F>(hash_u32<U>(number, U(0x7f4a7c15u + depth)));
  const Mask<F> replaces = is_candidate & (F(u * F(Int<F>(row.vertices))) < 1.f);
  row.p = select<F>(replaces, p, row.p);
  row.depth = select(Mask<U>(replaces), U(depth), row.depth);
  row.material = select(Mask<U>(replaces), material, row.material);
  store_row<LightVertexRow, F>(to.chosen, record.slot, row, is_candidate);
  if (none(replaces)) return replaces;
  store_row<LightPathRow, F>(to.paths, record.slot, path, replaces);
  store_row<ShadingRecord, F>(to.records, record.slot, record, replaces);
  return replaces;
}

/// Connection that a vertex of a camera path offers to a vertex of a light path.
template <typename F>
struct ConnectionOffer {
  Vec3<F> to;      ///< position of the light path's vertex
  F vertices;      ///< LightVertexRow::vertices
  Mask<F> wanted;  ///< whether such a vertex exists and the path would not exceed the maximum depth
  ConnectionRow<F> row;  ///< output; black where `wanted` is false
  /// Output, if light path expressions are active; undefined where `wanted` is false.
  ScatteringEvent<F> scattering{};
};

/// Returns the offer of camera paths in `slot`, at `depth`, to the light path vertices chosen for
/// these slots. Its contribution is still black.
template <typename F>
inline ConnectionOffer<F> offer_for(const LightVertices& from, const UInt<F>& slot, uint32_t depth,
                                    uint32_t max_depth, const Mask<F>& active) {
  const auto chosen = load_row<LightVertexRow, F>(from.chosen, slot, active);
  const Vec3<F> none(F(0.f));
  return {chosen.p,
          F(Int<F>(chosen.vertices)),
          Mask<F>(active & Mask<F>(chosen.vertices != UInt<F>(0u)) &
                  Mask<F>(chosen.depth + (depth + 2) <= UInt<F>(max_depth))),
          {none, F(0.f), none, F(0.f)}};
}

}  // namespace wavecomb
