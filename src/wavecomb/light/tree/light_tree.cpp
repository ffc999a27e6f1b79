// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/tree/light_tree.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "wavecomb/core/error.h"
#include "wavecomb/light/description/light_builder.h"
#include "wavecomb/light/description/motion.h"
#include "wavecomb/light/tree/light_cluster.h"
#include "wavecomb/light/tree/split_cost.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/scene/scene_limits.h"

namespace wavecomb {
namespace {

using light_tree::Bin;
using light_tree::cost;
using light_tree::Float4;
using light_tree::Int4;
using light_tree::Item;
using light_tree::least_of;
using light_tree::MeasureTable;
using light_tree::most_of;

constexpr uint32_t kNumbers = 1u << 24;
constexpr size_t kBins = 12;
/// Minimum effective number of lights for which a light tree reduces noise
/// (docs/light-selection.md).
constexpr float kMinForTree = 2;
/// Maximum number of subtrees that are built in parallel, and minimum number of lights per subtree.
constexpr size_t kTasks = 64, kParallel = 4096;

/// Range of lights below a tree node, and the path from the root to this node.
struct Range {
  size_t begin, end;
  uint32_t node_index;  ///< index in LightTree::nodes
  uint32_t depth, trail;
  size_t size() const { return end - begin; }
};

class Builder {
 public:
  Builder(const LightSet& set, std::vector<Item> items, double total, LightTree& tree)
      : set_(set), items_(std::move(items)), scale_(1 / total), tree_(tree) {}

  /// Splits the tree from the root until there are enough subtrees, builds the subtrees in
  /// parallel, and joins them.
  void run(std::span<const double> powers) {
    powers_ = powers;
    struct Top {
      Range range;
      /// Index of the first of the range's two children; 0 if the range is built as a task.
      size_t below = 0;
      LightCluster cluster;
    };
    std::vector<Top> tops{{{0, items_.size(), 0, 0, 0}, 0, {}}};
    for (size_t first = 0; tops.size() < 2 * kTasks && first < tops.size();) {
      const size_t last = tops.size();
      std::vector<size_t> cuts(last - first, 0);
      parallel_for(last - first, [&](size_t i) {
        const Range& r = tops[first + i].range;
        if (r.size() >= kParallel) cuts[i] = split(r);
      });
      for (size_t i = first; i < last; ++i) {
        if (cuts[i - first] == 0) continue;
        const auto [left, right] = children(tops[i].range, cuts[i - first]);
        tops[i].below = tops.size();
        tops.push_back({left, 0, {}});
        tops.push_back({right, 0, {}});
      }
      first = last;
    }
    parallel_for(tops.size(), [&](size_t i) {
      if (tops[i].below == 0) tops[i].cluster = build(tops[i].range);
    });
    for (size_t i = tops.size(); i-- > 0;)
      if (const size_t below = tops[i].below; below != 0)
        tops[i].cluster = join(tops[i].range, tops[below].cluster, tops[below + 1].cluster);
    tree_.root = tops[0].cluster.next;
  }

 private:
  /// Splits the light range of a node and returns the ranges of its two children. Nodes are stored
  /// in depth-first order, and a range of n lights has n - 1 nodes.
  static std::pair<Range, Range> children(const Range& r, size_t cut) {
    const auto left_nodes = static_cast<uint32_t>(cut - r.begin - 1);
    return {{r.begin, cut, r.node_index + 1, r.depth + 1, r.trail},
            {cut, r.end, r.node_index + 1 + left_nodes, r.depth + 1, r.trail | 1u << r.depth}};
  }

  LightCluster build(const Range& r) {
    if (r.size() == 1) return leaf(items_[r.begin].light, r.trail);
    const auto [left, right] = children(r, split(r));
    const LightCluster a = build(left), b = build(right);
    return join(r, a, b);
  }

  LightCluster leaf(uint32_t light, uint32_t trail) {
    LightCluster c = cluster_of(set_, light, powers_[light]);
    c.intensity *= scale_;
    c.next = kTreeLeaf | light;
    tree_.trails[light] = trail;
    return c;
  }

  LightCluster join(const Range& r, const LightCluster& a, const LightCluster& b) {
    tree_.nodes[r.node_index].child[0] = encode(a);
    tree_.nodes[r.node_index].child[1] = encode(b);
    LightCluster c = unite(a, b);
    c.next = r.node_index;
    return c;
  }

  /// Moves the lights of the left child to the front and returns the start of the right child's
  /// range.
  size_t split(const Range& r) {
    const std::span<Item> items(items_.data() + r.begin, r.size());
    if (items.size() == 2) return r.begin + 1;
    Float4 lo = {INFINITY, INFINITY, INFINITY, 0}, hi = {-INFINITY, -INFINITY, -INFINITY, 0};
    for (const Item& item : items) {
      const Float4 middle = item.middle();
      lo = least_of(lo, middle);
      hi = most_of(hi, middle);
    }
    const Float4 extents = hi - lo;
    const float longest = std::max({extents[0], extents[1], extents[2]});
    const size_t bins = items.size() < 32 ? 4 : kBins;
    const auto bins_of = [&](const Item& item) {
      const Float4 at = (item.middle() - lo) / extents * static_cast<float>(bins);
      const Float4 zero = {0, 0, 0, 0}, last = zero + static_cast<float>(bins - 1);
      const Float4 up = at > zero ? at : zero;  // maps negative values and NaN to 0
      return __builtin_convertvector(least_of(last, up), Int4);
    };
    const bool has_room = r.depth + std::bit_width(items.size() - 1) < kMaxTreeDepth;
    if (!has_room || !std::isfinite(longest)) return halve(r, items, lo, hi);
    // Fill the bins of all axes in a single pass over the lights.
    std::array<std::array<Bin, kBins>, 3> table;
    for (std::array<Bin, kBins>& of : table) std::fill_n(of.begin(), bins, Bin{});
    for (const Item& item : items) {
      const Int4 at = bins_of(item);
      for (size_t k = 0; k < 3; ++k) table[k][static_cast<size_t>(at[k])].add(item);
    }
    double least = INFINITY;
    size_t axis = 3, last = 0;
    for (size_t k = 0; k < 3; ++k) {
      const float extent = extents[k];
      if (!(extent > 0)) continue;
      const std::array<Bin, kBins>& of = table[k];
      std::array<double, kBins> left{};
      Bin sum;
      for (size_t i = 0; i + 1 < bins; ++i) {
        sum.add(of[i]);
        left[i] = sum.count > 0 ? cost(sum, measure_) : 0;
      }
      sum = {};
      for (size_t i = bins - 1; i > 0; --i) {
        sum.add(of[i]);
        if (sum.count == 0 || sum.count == items.size()) continue;
        // Multiply by the regularity factor of Conty Estevez and Kulla, which penalises thin
        // bounds.
        const double all = (left[i - 1] + cost(sum, measure_)) * double{longest / extent};
        if (!(all < least)) continue;
        least = all;
        axis = k;
        last = i - 1;
      }
    }
    if (axis == 3) return halve(r, items, lo, hi);
    const auto middle = std::partition(items.begin(), items.end(), [&](const Item& item) {
      return static_cast<size_t>(bins_of(item)[axis]) <= last;
    });
    return r.begin + static_cast<size_t>(middle - items.begin());
  }

  /// Splits a range at the median of the longest axis. The median split is used for lights at the
  /// same position, and to limit the depth of the tree.
  static size_t halve(const Range& r, std::span<Item> items, const Float4& lo, const Float4& hi) {
    size_t axis = 0;
    for (size_t k = 1; k < 3; ++k)
      if (hi[k] - lo[k] > hi[axis] - lo[axis]) axis = k;
    const auto middle = items.begin() + static_cast<std::ptrdiff_t>(items.size() / 2);
    std::nth_element(items.begin(), middle, items.end(), [&](const Item& a, const Item& b) {
      const float x = a.centre(axis), y = b.centre(axis);
      return x != y ? x < y : a.light < b.light;
    });
    return r.begin + items.size() / 2;
  }

 public:
  static LightCluster cluster_of(const LightSet& set, uint32_t light, double power) {
    if (light >= set.first_triangle())
      return bound_light(set.triangles[light - set.first_triangle()], power);
    const LightCluster rests = bound_light(set.records[light], power);
    if (set.motions.empty() || set.motions[light].segments == 0) return rests;
    return swept_bounds(set.motions[light], set.motion_steps, rests);
  }

 private:
  const LightSet& set_;
  std::vector<Item> items_;
  double scale_;  ///< factor of intensities
  LightTree& tree_;
  std::span<const double> powers_;
  MeasureTable measure_;
};

Item make_item(const LightCluster& c, uint32_t light, double scale) {
  Item item{};
  std::copy_n(c.lo, 3, item.lo);
  std::copy_n(c.hi, 3, item.hi);
  for (size_t k = 0; k < 3; ++k)
    item.axis[k] = static_cast<float>(c.normals.axis[k] * (1 + std::cos(c.normals.angle)) / 2);
  item.intensity = static_cast<float>(c.intensity * scale);
  item.light = light;
  return item;
}

/// Distributes the 2^24 random numbers among the light tree and the infinite lights that emit.
void share_numbers(const LightSet& set, std::span<const double> powers, size_t emitting_in_tree,
                   LightTree& tree) {
  const size_t infinite = set.infinite_count;
  size_t emitting = emitting_in_tree;
  for (size_t i = 0; i < infinite; ++i) emitting += powers[i] > 0 ? 1 : 0;
  tree.infinite_ends.resize(infinite);
  tree.infinite_pdf.resize(infinite);
  std::vector<uint32_t> numbers(infinite, 0);
  double largest = 0, total = 0;
  for (const double p : powers) largest = std::max(largest, p);
  for (const double p : powers) total += p / largest;
  uint32_t left = kNumbers;
  constexpr double floor_share = 0.01;
  for (size_t i = 0; i < infinite; ++i) {
    if (!(powers[i] > 0)) continue;
    const double share = (1 - floor_share) * (powers[i] / largest / total) +
                         floor_share / static_cast<double>(emitting);
    // Reserve at least one random number in a thousand for the tree, so that finite lights are
    // sampled even under a bright dome.
    const uint32_t most = left - (emitting_in_tree > 0 ? kNumbers / 1000 : 0);
    numbers[i] = std::min(most, 1 + static_cast<uint32_t>(share * (kNumbers - 1)));
    left -= numbers[i];
  }
  if (emitting_in_tree == 0 && left < kNumbers)  // Remainder of rounding
    *std::find_if(numbers.rbegin(), numbers.rend(), [](uint32_t n) { return n > 0; }) += left;
  tree.numbers = emitting_in_tree > 0 ? left : 0;
  uint32_t end = tree.numbers;
  for (size_t i = 0; i < infinite; ++i) {
    tree.infinite_ends[i] = end += numbers[i];
    tree.infinite_pdf[i] = static_cast<float>(numbers[i]) * 0x1p-24f;
  }
}

/// Returns the sum of powers divided by the largest power, and the largest power.
std::pair<double, double> total_power(std::span<const double> powers) {
  double total = 0, largest = 0;
  for (const double power : powers) largest = std::max(largest, power);
  for (const double power : powers)
    if (power > 0) total += power / largest;
  return {total, largest};
}

}  // namespace

LightTreeView LightTree::view() const {
  return {nodes.data(), trails.data(), infinite_ends.data(), infinite_pdf.data(),
          root,         numbers,       effective_lights};
}

bool prefers_tree(float effective_lights) {
  return effective_lights >= kMinForTree;
}

LightTree outline_light_tree(const LightSet& set, std::span<const double> powers) {
  LightTree tree;
  const std::span<const double> finite = powers.subspan(set.infinite_count);
  const auto emitting = static_cast<size_t>(
      std::count_if(finite.begin(), finite.end(), [](double power) { return power > 0; }));
  share_numbers(set, powers, emitting, tree);
  if (emitting == 0) return tree;
  const auto [total, largest] = total_power(finite);
  double squares = 0;
  for (const double power : finite)
    if (power > 0) squares += power / largest * (power / largest);
  tree.effective_lights = static_cast<float>(total * total / squares);
  return tree;
}

LightTree build_light_tree(const LightSet& set, std::span<const double> powers) {
  LightTree tree = outline_light_tree(set, powers);
  tree.trails.assign(powers.size(), kNoLight);
  std::vector<uint32_t> emitting;
  for (size_t i = set.infinite_count; i < powers.size(); ++i)
    if (powers[i] > 0) emitting.push_back(static_cast<uint32_t>(i));
  if (emitting.empty()) return tree;
  const auto [relative, largest] = total_power(powers.subspan(set.infinite_count));
  double total = relative * largest;
  if (!std::isfinite(total)) total = largest;
  std::vector<Item> items(emitting.size());
  constexpr size_t kChunk = 4096;
  parallel_for((emitting.size() + kChunk - 1) / kChunk, [&](size_t chunk) {
    for (size_t i = chunk * kChunk; i < std::min(emitting.size(), (chunk + 1) * kChunk); ++i)
      items[i] = make_item(Builder::cluster_of(set, emitting[i], powers[emitting[i]]), emitting[i],
                           1 / total);
  });
  tree.nodes.resize(emitting.size() - 1);
  Builder(set, std::move(items), total, tree).run(powers);
  return tree;
}

bool chooses_by_tree(LightSelection selection, const LightView& lights) {
  const float effective = lights.tree.effective_lights;
  const bool tree_alone = lights.power_table.bins == nullptr && lights.count > 0;
  if (tree_alone && selection == LightSelection::kPower)
    throw Error("by power one of " + with_commas(kMaxPowerLights) +
                " lights can be chosen; the scene has " + with_commas(lights.count) +
                " lights and emissive triangles; choose --light-selection tree");
  if (tree_alone) return true;
  if (selection == LightSelection::kAuto) return prefers_tree(effective);
  return selection == LightSelection::kTree && effective > 0;
}

}  // namespace wavecomb
