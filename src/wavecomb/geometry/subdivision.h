// SPDX-License-Identifier: Apache-2.0
/// Subdivision surfaces: topology refined by OpenSubdiv, values on it.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "wavecomb/geometry/cage.h"

namespace wavecomb {

/// The faces of the last level, without ownership of the refiner: `size` corners each.
struct RefinedFaces {
  uint32_t size = 4;                   ///< 3 for Loop
  uint32_t vertex_count = 0;           ///< points of the level, those of holes too
  std::vector<uint32_t> corners;       ///< point of each corner
  std::vector<uint32_t> base;          ///< face of the cage that each face came from
  std::vector<uint32_t> first_values;  ///< of channel 0 at each corner; empty without channels

  size_t count() const { return base.size(); }
};

/// A cage refined uniformly. Values are computed on the limit surface itself.
///
/// Contract: immutable; any number of threads at once. Loops over faces and points have the threads
/// of with_threads, and each bit is the same whatever their number; OpenSubdiv's own work is one
/// thread's: the constructor's, and face_varying's.
class Subdivision {
 public:
  static constexpr uint32_t kMaxLevel = 10;

  /// `level`: 1 to kMaxLevel. Throws Error, one line that says what is wrong with the cage.
  Subdivision(const Cage& cage, uint32_t level);
  ~Subdivision();
  Subdivision(Subdivision&&) noexcept;

  /// Edges or points where more than two faces or two fans of faces meet: they are kept sharp.
  bool is_manifold() const;
  uint32_t vertex_count() const;

  /// The faces that are drawn: not holes, nor those without a limit (BoundaryRule::kNone).
  RefinedFaces faces() const;
  /// Index into a channel's refined values of each corner of faces().
  std::vector<uint32_t> face_varying_corners(uint32_t channel) const;

  /// For each corner of `faces`, which normal it has: the point's number where the surface is
  /// smooth there, and numbers from vertex_count() on where sharp edges cut it into sectors.
  /// `count` becomes the number of normals.
  std::vector<uint32_t> normal_sectors(const RefinedFaces& faces, uint32_t& count) const;

  /// Values (vertex_count, width), of the cage's points, at the limit. `normals`, if given, gets
  /// the unit normals of the limit, (vertex_count, 3), 0 where its derivatives span no plane; width
  /// 3 only. Widths are 1 to 4.
  std::vector<float> vertex(std::span<const float> values, uint32_t width,
                            std::vector<float>* normals = nullptr) const;
  /// The same, linear within each face of the cage.
  std::vector<float> varying(std::span<const float> values, uint32_t width) const;
  /// Values of a channel at the limit, addressed by face_varying_corners(channel).
  std::vector<float> face_varying(uint32_t channel, std::span<const float> values,
                                  uint32_t width) const;

 private:
  struct Refiner;
  std::unique_ptr<Refiner> refiner_;
};

}  // namespace wavecomb
