// SPDX-License-Identifier: Apache-2.0
/// The vertices of paths from lights that camera paths connect to (docs/light-paths.md).
///
/// With each camera path goes the path from a light that has the number of its pixel, and the same
/// sample. Of that path's vertices one is kept, each as likely as the others, and every vertex of
/// the camera path connects to it: what is connected depends on pixel and sample, and on no wave.
#pragma once

#include "wavecomb/core/fields.h"
#include "wavecomb/core/hash.h"
#include "wavecomb/core/sampler.h"
#include "wavecomb/integrate/path_pool.h"
#include "wavecomb/integrate/shading_record.h"

namespace wavecomb {

/// The vertex that is kept, beside the PathRow that has led there and its ShadingRecord.
template <typename F>
struct LightVertexRow {
  Vec3<F> p;
  UInt<F> vertices;  ///< that the path had to choose from so far; 0: there is none
  UInt<F> depth, material;
  WAVECOMB_FIELDS(p, vertices, depth, material)
};

/// What a vertex of a camera path offers to the vertex from the light: a row of its slot.
template <typename F>
struct ConnectionRow {
  Vec3<F> from;    ///< where its ray to that vertex begins
  F pdf;           ///< density of its own bounce there, over solid angle
  Color<F> light;  ///< what light of unit radiance from there would bring, times the number of
                   ///< vertices to choose from; black: it is not connected
  F ratio;         ///< JointVertex::towards
  WAVECOMB_FIELDS(from, pdf, light, ratio)
};

/// Contract: owned by one wave or one reference integrator, a row of each kind a slot.
class LightVertices {
 public:
  LightVertices() = default;
  /// `capacity` 0: nothing is connected.
  explicit LightVertices(size_t capacity)
      : rows_(capacity > 0 ? SoaBlock(1, capacity * kWords) : SoaBlock()) {
    if (capacity == 0) return;
    paths = rows_.floats(0);
    records = paths + capacity * kRowWords<PathRow>;
    chosen = records + capacity * kRowWords<ShadingRecord>;
    connections = chosen + capacity * kRowWords<LightVertexRow>;
  }

  explicit operator bool() const { return paths != nullptr; }
  size_t bytes() const { return rows_.bytes(); }
  /// Forgets the vertices of slots below `slots`.
  void clear(size_t slots) const {
    std::memset(chosen, 0, slots * kRowWords<LightVertexRow> * sizeof(float));
  }

  float* paths = nullptr;        ///< PathRow that arrived at the vertex
  float* records = nullptr;      ///< ShadingRecord
  float* chosen = nullptr;       ///< LightVertexRow
  float* connections = nullptr;  ///< ConnectionRow

 private:
  static constexpr size_t kWords = kRowWords<PathRow> + kRowWords<ShadingRecord> +
                                   kRowWords<LightVertexRow> + kRowWords<ConnectionRow>;
  SoaBlock rows_;
};

/// Keeps, of the lanes in `offered`, the vertex at `p` where the path's number says so: with n
/// vertices so far, the last one with probability 1 / n. Those whose vertex it now is.
template <typename F>
inline Mask<F> keep_light_vertex(const LightVertices& to, uint32_t depth, const PathRow<F>& path,
                                 const ShadingRecord<F>& record, const UInt<F>& material,
                                 const Vec3<F>& p, const Mask<F>& offered) {
  using U = UInt<F>;
  if (none(offered)) return Mask<F>(false);
  LightVertexRow<F> row = load_row<LightVertexRow, F>(to.chosen, record.slot, offered);
  row.vertices = row.vertices + 1u;
  const U number = hash_u32<U>(path.key.pixel_hash, path.key.sample);
  const F u = unit_float<F>(hash_u32<U>(number, U(0x7f4a7c15u + depth)));
  const Mask<F> taken = offered & (F(u * F(Int<F>(row.vertices))) < 1.f);
  row.p = select<F>(taken, p, row.p);
  row.depth = select(Mask<U>(taken), U(depth), row.depth);
  row.material = select(Mask<U>(taken), material, row.material);
  store_row<LightVertexRow, F>(to.chosen, record.slot, row, offered);
  if (none(taken)) return taken;
  store_row<PathRow, F>(to.paths, record.slot, path, taken);
  store_row<ShadingRecord, F>(to.records, record.slot, record, taken);
  return taken;
}

}  // namespace wavecomb
