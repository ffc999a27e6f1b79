// SPDX-License-Identifier: Apache-2.0
/// Vertices of light paths to which camera paths connect (docs/light-paths.md).
///
/// Each camera path is paired with the light path of the same pixel number and sample. One vertex
/// of the light path, chosen uniformly, is stored, and every vertex of the camera path connects to
/// this vertex. The connections depend only on pixel and sample, not on the assignment of paths to
/// waves.
#pragma once

#include <cstring>

#include "wavecomb/core/encoding/hash.h"
#include "wavecomb/core/rows/fields.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/light_paths/light_path_row.h"
#include "wavecomb/path/path_state.h"
#include "wavecomb/path/shading_record.h"

namespace wavecomb {

/// Stored vertex of a light path, in addition to the vertex's ShadingRecord and the LightPathRow of
/// the ray that hit it.
template <typename F>
struct LightVertexRow {
  Vec3<F> p;
  UInt<F> vertices;  ///< number of candidate vertices so far; 0 if there is none
  UInt<F> depth, material;
  WAVECOMB_FIELDS(p, vertices, depth, material)
};

/// Connection from a camera path vertex to the stored light path vertex, one row for each slot.
template <typename F>
struct ConnectionRow {
  Vec3<F> from;  ///< origin of the ray to the light path's vertex
  /// Solid angle density of a bounce of the camera path towards the light path's vertex.
  F pdf;
  /// Contribution to the pixel for unit radiance from the light path's vertex, times the number of
  /// candidate vertices; black if there is no connection.
  Color<F> light;
  F ratio;  ///< JointVertex::towards
  WAVECOMB_FIELDS(from, pdf, light, ratio)
};

/// Stored vertices and connections of the paths of a wave.
///
/// Contract: each object belongs to a single wave or reference integrator. Each slot has one row in
/// each table.
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
  /// Clears the stored vertices of the first `slots` slots.
  void clear(size_t slots) const {
    std::memset(chosen, 0, slots * kRowWords<LightVertexRow> * sizeof(float));
  }

  float* paths = nullptr;        ///< LightPathRow of the ray that hit the vertex, for each slot
  float* records = nullptr;      ///< ShadingRecord of each slot
  float* chosen = nullptr;       ///< LightVertexRow of each slot
  float* connections = nullptr;  ///< ConnectionRow of each slot

 private:
  static constexpr size_t kWords = kRowWords<LightPathRow> + kRowWords<ShadingRecord> +
                                   kRowWords<LightVertexRow> + kRowWords<ConnectionRow>;
  SoaBlock rows_;
};

/// In the lanes of `is_candidate`, stores the vertex at `p` if a hash of the path selects it: the
/// n-th candidate vertex replaces the stored vertex with probability 1 / n (reservoir sampling).
/// Returns the lanes whose vertex was stored.
template <typename F>
inline Mask<F> store_light_vertex(const LightVertices& to, uint32_t depth,
                                  const LightPathRow<F>& path, const ShadingRecord<F>& record,
                                  const UInt<F>& material, const Vec3<F>& p,
                                  const Mask<F>& is_candidate) {
  using U = UInt<F>;
  if (none(is_candidate)) return Mask<F>(false);
  LightVertexRow<F> row = load_row<LightVertexRow, F>(to.chosen, record.slot, is_candidate);
  row.vertices = row.vertices + 1u;
  const U number = path_hash<F>(path.key);
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

/// Connection from a vertex of a camera path to a vertex of a light path.
template <typename F>
struct ConnectionOffer {
  Vec3<F> to;  ///< position of the light path's vertex
  F vertices;  ///< LightVertexRow::vertices
  /// Whether a light path vertex is stored, and the connected path would not exceed the maximum
  /// depth.
  Mask<F> wanted;
  /// Output: the connection; its contribution is black where `wanted` is false.
  ConnectionRow<F> row;
  /// Output: scattering event of the camera path's vertex, if light path expressions are active;
  /// undefined where `wanted` is false.
  ScatteringEvent<F> scattering{};
};

/// For the camera paths in `slot`, prepares the connections from their vertices at `depth` to the
/// light path vertices stored for these slots. The returned contribution is black until
/// `offer_connection()` computes the actual value.
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
