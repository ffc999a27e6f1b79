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
  uint32_t size = 4;  ///< 4, or 3 with Loop
  /// Number of vertices of the finest level, including vertices of holes.
  uint32_t vertex_count = 0;
  std::vector<uint32_t> corners;  ///< vertex index of each corner
  std::vector<uint32_t> base;     ///< index of the cage face of each face
  /// Index of each corner's value in face-varying channel 0; empty without channels.
  std::vector<uint32_t> first_values;

  size_t count() const { return base.size(); }
};

/// A uniformly refined cage. The member functions evaluate values on the limit surface.
///
/// Contract: objects are immutable and safe for concurrent use. Loops over faces and vertices use
/// the threads of with_threads(), and the results do not depend on the number of threads. In the
/// constructor and face_varying(), OpenSubdiv's functions run on one thread.
class Subdivision {
 public:
  static constexpr uint32_t kMaxLevel = 10;

  /// Refines `cage` to `level`, from 1 to kMaxLevel. Throws Error with a one-line description of
  /// what is wrong with the cage.
  Subdivision(const Cage& cage, uint32_t level);
  ~Subdivision();
  Subdivision(Subdivision&&) noexcept;

  /// Returns whether each edge belongs to at most two faces, and the faces at each vertex form a
  /// single fan. Non-manifold edges and vertices are kept sharp.
  bool is_manifold() const;
  /// Returns the number of vertices of the finest level.
  uint32_t vertex_count() const;

  /// Returns the visible faces, that is, all faces except holes and faces without a limit surface
  /// (BoundaryRule::kNone).
  RefinedFaces faces() const;
  /// Returns, for each corner of faces(), the index of its value among the refined values of a
  /// face-varying channel.
  std::vector<uint32_t> face_varying_corners(uint32_t channel) const;

  /// Returns the index of the normal for each corner of `faces`. At smooth vertices, the normal has
  /// the index of the vertex. If sharp edges divide the faces of a vertex into sectors, each sector
  /// except the first has an additional normal, whose index is vertex_count() or more. Sets `count`
  /// to the number of normals.
  std::vector<uint32_t> normal_sectors(const RefinedFaces& faces, uint32_t& count) const;

  /// Evaluates a vertex primvar of the cage on the limit surface; returns an array of shape
  /// (vertex_count, width). `width` is 1 to 4. `normals`, which must be null unless `width` is 3,
  /// receives the unit normals of the limit surface, of shape (vertex_count, 3), or 0 where the
  /// derivatives of the surface are degenerate.
  std::vector<float> vertex(std::span<const float> values, uint32_t width,
                            std::vector<float>* normals = nullptr) const;
  /// Refines a varying primvar, which is linear within each face of the cage; returns an array of
  /// shape (vertex_count, width).
  std::vector<float> varying(std::span<const float> values, uint32_t width) const;
  /// Evaluates the values of a face-varying channel on the limit surface;
  /// face_varying_corners(channel) returns the value index of each corner.
  std::vector<float> face_varying(uint32_t channel, std::span<const float> values,
                                  uint32_t width) const;

 private:
  struct Refiner;
  std::unique_ptr<Refiner> refiner_;
};

}  // namespace wavecomb
