// SPDX-License-Identifier: Apache-2.0
/// The guiding field: incident light by region of space and by direction, estimated from training
/// bounces.
///
/// The cells form an octree over the bounds of the scene. A cell with more than kCellRecords
/// contributing bounces is divided. A region is the part of a cell whose surfaces face one axis
/// direction. The distribution of a region is the mean value of its bounces as a function of
/// direction. If a region has few bounces, its distribution is blended with the distribution q of
/// the parent cell:
///   p = (n p_own + kPrior q) / (n + kPrior)   for n bounces.
///
/// In each region, the BSDF samples a fraction a of the bounces. The field chooses the fraction
/// that minimises the second moment of the mixture, as estimated from the training bounces. For
/// values x sampled with density p, and the densities p_b of the BSDF and p_g of the guiding field:
///   S(a) = sum of x^2 p / (a p_b + (1 - a) p_g).
/// The candidates for a are the values in kBsdfShares; a = 1 is chosen where guiding does not help.
///
/// Equal training records give bit-identical fields, on any number of threads (field_builder.h).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/core/vec3.h"
#include "wavecomb/guiding/field/field_arrays.h"
#include "wavecomb/guiding/field/field_statistics.h"
#include "wavecomb/guiding/field/field_view.h"
#include "wavecomb/guiding/field/grid.h"
#include "wavecomb/guiding/roulette.h"
#include "wavecomb/guiding/training_sample.h"

namespace wavecomb {

/// Packs the position and surface axis of a bounce: the Morton code of the grid position of p, and
/// in the lowest three bits the guiding_axis of the surface.
uint64_t bounce_position_key(const GuidingGrid& grid, const Vec3<float>& p, uint32_t axis);

/// A guiding field and the arrays that kernels read. The field is immutable except for
/// compute_survival().
class GuidingField {
 public:
  /// Creates an empty field. An empty field does not guide bounces, but defines the grid of
  /// bounce_position_key().
  explicit GuidingField(const GuidingGrid& grid) : grid_(grid) {}
  /// Builds a field from training records. `materials` is the number of materials. If `first` is
  /// true, the records contain no densities of an earlier field, so the BSDF and the field each
  /// sample half of the bounces in each region. If `guides` is false, the BSDF samples all bounces.
  /// The cell size doubles until the field takes at most `max_bytes` or cannot shrink further.
  GuidingField(const GuidingGrid& grid, std::span<const TrainingRecord> records, size_t materials,
               bool first, bool guides, size_t max_bytes);
  /// Restores a field that was saved for a scene with `materials` materials. Throws Error if the
  /// arrays in `parts` do not form a valid field.
  GuidingField(const GuidingGrid& grid, GuidingFieldArrays parts,
               const GuidingFieldStatistics& facts, size_t materials);

  /// Computes GuidingView::survival of each region from all training bounces, whether or not they
  /// contribute light (guiding/roulette.h).
  void compute_survival(std::span<const BounceSample> training_samples,
                        const PathStatistics& paths);

  /// Returns pointers to the arrays. They are valid until the field is destroyed or
  /// compute_survival() is called.
  GuidingView view() const;
  /// Returns the memory of the arrays in bytes.
  size_t bytes() const;
  const GuidingFieldStatistics& facts() const { return facts_; }
  const GuidingFieldArrays& parts() const { return parts_; }

 private:
  GuidingGrid grid_;
  GuidingFieldArrays parts_;
  GuidingFieldStatistics facts_;
};

}  // namespace wavecomb
