// SPDX-License-Identifier: Apache-2.0
/// Subdivision surfaces: topology refined by OpenSubdiv, and limit values.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "wavecomb/geometry/tessellation/cage.h"

namespace wavecomb {

/// Visible faces of the finest level, with `size` corners each.
struct RefinedFaces {
  uint32_t size = 4;                   ///< 4, or 3 with Loop
  uint32_t vertex_count = 0;           ///< vertices of the level, including those of holes
  std::vector<uint32_t> corners;       ///< vertex of each corner
  std::vector<uint32_t> base;          ///< cage face that each face came from
  std::vector<uint32_t> first_values;  ///< index into channel 0 of each corner; empty without
                                       ///< channels

  size_t count() const { return base.size(); }
};

/// A uniformly refined cage. Values are evaluated on the limit surface.
///
/// Contract: immutable; safe for concurrent use. Loops over faces and vertices use the threads of
/// with_threads, and the results do not depend on their number. The constructor and face_varying
/// spend OpenSubdiv's share of the work on one thread.
class Subdivision {
 public:
  static constexpr uint32_t kMaxLevel = 10;

  /// Refines `cage` to `level`, from 1 to kMaxLevel. Throws Error with a one-line description of
  /// what is wrong with the cage.
  Subdivision(const Cage& cage, uint32_t level);
  ~Subdivision();
  Subdivision(Subdivision&&) noexcept;

  /// Whether at most two faces meet at each edge and one fan of faces at each vertex. Non-manifold
  /// edges and vertices are kept sharp.
  bool is_manifold() const;
  /// Number of vertices of the finest level.
  uint32_t vertex_count() const;

  /// Returns the visible faces: without holes and without faces that have no limit
  /// (BoundaryRule::kNone).
  RefinedFaces faces() const;
  /// Returns, for each corner of faces(), the index into the refined values of a channel.
  std::vector<uint32_t> face_varying_corners(uint32_t channel) const;

  /// Returns the index of the normal for each corner of `faces`. It is the vertex index where the
  /// surface is smooth; where sharp edges divide a vertex into sectors, they get indices from
  /// vertex_count() on. Sets `count` to the number of normals.
  std::vector<uint32_t> normal_sectors(const RefinedFaces& faces, uint32_t& count) const;

  /// Evaluates vertex primvars of the cage at the limit; returns (vertex_count, width). `width` is
  /// 1 to 4. `normals`, allowed for width 3 only, receives unit normals of the limit surface,
  /// (vertex_count, 3), with 0 where its derivatives are degenerate.
  std::vector<float> vertex(std::span<const float> values, uint32_t width,
                            std::vector<float>* normals = nullptr) const;
  /// Refines varying primvars, which are linear within each face of the cage; returns
  /// (vertex_count, width).
  std::vector<float> varying(std::span<const float> values, uint32_t width) const;
  /// Evaluates face-varying values of a channel at the limit; indices are
  /// face_varying_corners(channel).
  std::vector<float> face_varying(uint32_t channel, std::span<const float> values,
                                  uint32_t width) const;

 private:
  struct Refiner;
  std::unique_ptr<Refiner> refiner_;
};

}  // namespace wavecomb
