// SPDX-License-Identifier: Apache-2.0
/// The field that guides bounces, made of what bounces have taught.
///
/// Cells are an octree over the bounds of the scene, divided where more than kCellRecords bounces
/// brought light. A region's distribution is the mean of what came back by direction, over the
/// bounces in its cell whose surfaces face its way; where those are few, it leans on the cells
/// around: with n bounces and the distribution q of the cell above,
///   p = (n p_own + kPrior q) / (n + kPrior).
///
/// How many bounces of a region the BSDF samples follows from the second moment that mixtures
/// would have had, estimated from the same bounces: with x what one brought (its pdf p, p_b by the
/// BSDF, p_g by the field then),
///   S(a) = sum of x^2 p / (a p_b + (1 - a) p_g)
/// and a the share, of a few, whose S is least: 1 where guiding gains nothing.
///
/// All sums are in the order of the records, so that equal records make equal fields.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "wavecomb/core/vec3.h"
#include "wavecomb/learn/guide_parts.h"
#include "wavecomb/learn/guide_view.h"
#include "wavecomb/learn/training_record.h"
#include "wavecomb/learn/worth.h"

namespace wavecomb {

/// The grid that cells lie in: over the scene's bounds.
struct GuideGrid {
  float lo[3] = {}, scale[3] = {};

  /// Corners of the bounds, lo <= hi.
  GuideGrid(const float (&low)[3], const float (&high)[3]);
};

/// Where a bounce begins: at p, on a surface that faces `axis`.
uint64_t bounce_place(const GuideGrid& grid, const Vec3<float>& p, uint32_t axis);

/// What a field is, in numbers.
struct GuideFacts {
  uint64_t records = 0;  ///< bounces that brought light
  uint32_t cells = 0, regions = 0, guided_regions = 0;
  /// Mean share of guided bounces, and what mixtures leave of the second moment of what bounces
  /// bring; both weighted by what they bring to the picture.
  double guided_share = 0, moment_ratio = 1;
};

class GuideField {
 public:
  /// A field that guides nothing, but tells which way surfaces face.
  explicit GuideField(const GuideGrid& grid) : grid_(grid) {}
  /// The field that the records teach. `materials`: how many there are; `first`: records hold no
  /// density of a field yet, so that each region is guided half the time. `most_bytes`: cells
  /// stay larger where it would else take more.
  GuideField(const GuideGrid& grid, std::span<const TrainingRecord> records, size_t materials,
             bool first, bool guides, size_t most_bytes);
  /// A field of before, of a scene with so many materials. Throws Error where `parts` are none.
  GuideField(const GuideGrid& grid, GuideParts parts, const GuideFacts& facts, size_t materials);

  /// Tells the regions what their bounces are worth, by bounces with and without light.
  void weigh_bounces(std::span<const BounceLesson> lessons, const PathLesson& paths);

  GuideView view() const;
  size_t bytes() const;
  const GuideFacts& facts() const { return facts_; }
  const GuideParts& parts() const { return parts_; }

 private:
  friend class GuideFieldBuilder;

  GuideGrid grid_;
  GuideParts parts_;
  GuideFacts facts_;
};

}  // namespace wavecomb
