// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/calibration/partition.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "wavecomb/light/description/light_builder.h"
#include "wavecomb/scene/parallel.h"

namespace wavecomb {
namespace {

constexpr uint32_t kNumbers = 1u << 24;

/// Candidate for a part of the lights (LightParts): a light record, or the triangles of an emissive
/// mesh.
struct Candidate {
  double power;
  std::string name;
  uint32_t record;  ///< light record, or kNoLight for a mesh
  uint32_t mesh;    ///< index into LightParts::of_mesh; kNoLight for a record
};

void add_records(const Scene& scene, size_t count, std::span<const double> powers,
                 std::vector<Candidate>& out) {
  const LightSet& set = scene.light_set();
  std::vector<uint32_t> input(set.record_count, kNoLight);
  for (size_t i = 0; i < set.of_input.size(); ++i)
    input[set.of_input[i]] = static_cast<uint32_t>(i);
  for (uint32_t i = 0; i < count; ++i)
    if (powers[i] > 0) out.push_back({powers[i], scene.lights()[input[i]].name, i, kNoLight});
}

/// Adds the emissive meshes in the order of their triangles, which is the order of the instances.
void add_meshes(const Scene& scene, LightParts& parts, std::vector<Candidate>& out) {
  const LightSet& set = scene.light_set();
  if (set.triangles.empty()) return;
  const std::vector<uint32_t>& first_lights = scene.light_part()->emissive;
  std::vector<const Mesh*> meshes;
  size_t next = 0;
  for (size_t i = 0; i <= scene.instances().size(); ++i) {
    const Group& group = scene.groups()[i == 0 ? 0 : scene.instances()[i - 1].group];
    for (const uint32_t mesh : group.meshes) {
      const uint32_t first = first_lights[next++];
      if (first == kNoLight) continue;
      parts.of_mesh.push_back({first, kNoPart});
      meshes.push_back(&scene.meshes()[mesh]);
    }
  }
  std::vector<double> powers(meshes.size(), 0);
  parallel_for(meshes.size(), [&](size_t m) {
    const size_t begin = parts.of_mesh[m].first;
    const size_t end = m + 1 < meshes.size() ? parts.of_mesh[m + 1].first : set.size();
    for (size_t light = begin; light < end; ++light) powers[m] += double{set.selection_pdf(light)};
  });
  for (uint32_t m = 0; m < meshes.size(); ++m)
    if (powers[m] > 0) out.push_back({powers[m], meshes[m]->name, kNoLight, m});
}

/// Makes one part of each candidate, in the order of the candidates. If there are more candidates
/// than `most`, the candidates of lowest power together form the last part.
void make_parts(const std::vector<Candidate>& candidates, size_t most, LightParts& parts) {
  std::vector<size_t> by_power(candidates.size());
  std::iota(by_power.begin(), by_power.end(), size_t{0});
  std::stable_sort(by_power.begin(), by_power.end(),
                   [&](size_t a, size_t b) { return candidates[a].power > candidates[b].power; });
  std::vector<bool> alone(candidates.size(), candidates.size() <= most);
  if (candidates.size() > most)
    for (size_t i = 0; i + 1 < most; ++i) alone[by_power[i]] = true;
  const auto put = [&](const Candidate& c, uint32_t part) {
    if (c.record != kNoLight) parts.of_record[c.record] = part;
    if (c.mesh != kNoLight) parts.of_mesh[c.mesh].second = part;
    parts.power[part] += c.power;
  };
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (!alone[i]) continue;
    parts.power.push_back(0);
    parts.names.push_back(candidates[i].name);
    put(candidates[i], static_cast<uint32_t>(parts.size() - 1));
  }
  if (candidates.size() <= most) return;
  parts.power.push_back(0);
  parts.names.push_back(std::to_string(candidates.size() - most + 1) + " others");
  for (size_t i = 0; i < candidates.size(); ++i)
    if (!alone[i]) put(candidates[i], static_cast<uint32_t>(parts.size() - 1));
}

void build_tree_tables(const LightSet& set, const LightTree& tree, const LightParts& parts,
                       std::span<const double> shares, std::span<const NodeTilt> tilts,
                       CalibratedLights& out) {
  out.infinite_ends.resize(set.infinite_count);
  out.infinite_pdf.resize(set.infinite_count);
  std::vector<uint32_t> numbers(set.infinite_count, 0);
  uint32_t left = kNumbers;
  auto remaining_lights = static_cast<uint32_t>(std::count_if(
      tree.infinite_pdf.begin(), tree.infinite_pdf.end(), [](float pdf) { return pdf > 0; }));
  for (uint32_t i = 0; i < set.infinite_count; ++i) {
    const uint32_t part = parts.of_record[i];
    if (part == kNoPart) continue;
    const double share = shares[part] * double{tree.infinite_pdf[i]} / parts.power[part];
    // Leave at least a thousandth of all random values to the light tree, and at least one value to
    // each infinite light that follows in this loop.
    const uint32_t reserved =
        std::min(kNumbers / 1000, left - remaining_lights) + remaining_lights - 1;
    --remaining_lights;
    numbers[i] = std::min(left - reserved, 1 + static_cast<uint32_t>(share * (kNumbers - 1)));
    left -= numbers[i];
    out.shares[part] += numbers[i] * 0x1p-24;
  }
  out.tree_numbers = left;
  out.shares.back() = left * 0x1p-24;
  uint32_t end = left;
  for (uint32_t i = 0; i < set.infinite_count; ++i) {
    out.infinite_ends[i] = end += numbers[i];
    out.infinite_pdf[i] = static_cast<float>(numbers[i]) * 0x1p-24f;
  }
  if (tilts.empty()) return;
  out.nodes = tree.nodes;
  for (const NodeTilt& tilt : tilts) {
    const float root = std::sqrt(tilt.odds);
    out.nodes[tilt.node].child[0].intensity /= root;
    out.nodes[tilt.node].child[1].intensity *= root;
  }
}

}  // namespace

uint32_t LightParts::of(uint32_t light) const {
  if (light < of_record.size() && of_record[light] != kNoPart) return of_record[light];
  if (by_tree) return static_cast<uint32_t>(size() - 1);
  const auto next = std::upper_bound(of_mesh.begin(), of_mesh.end(), light,
                                     [](uint32_t l, const auto& m) { return l < m.first; });
  return light == kNoLight || next == of_mesh.begin() ? kNoPart : std::prev(next)->second;
}

LightParts divide_lights(const Scene& scene, bool by_tree) {
  const LightSet& set = scene.light_set();
  LightParts parts;
  parts.by_tree = by_tree;
  parts.of_record.assign(set.record_count, kNoPart);
  if (by_tree ? set.tree.numbers == 0 : set.size() > kMaxCalibratedLights) return {};
  std::vector<Candidate> candidates;
  std::vector<double> powers(set.record_count);
  const size_t records = by_tree ? set.infinite_count : set.record_count;
  for (size_t i = 0; i < records; ++i)
    powers[i] = double{by_tree ? set.tree.infinite_pdf[i] : set.records[i].selection_pdf};
  add_records(scene, records, powers, candidates);
  if (!by_tree) add_meshes(scene, parts, candidates);
  make_parts(candidates, LightParts::kMax - (by_tree ? 1 : 0), parts);
  if (by_tree) {
    parts.power.push_back(set.tree.numbers * 0x1p-24);
    parts.names.push_back("tree");
  }
  if (!by_tree && parts.size() < 2) return {};
  return parts;
}

void CalibratedLights::apply(LightView& view) const {
  if (shares.empty()) return;
  if (!selection_pdf.empty()) {
    view.selection_pdf = selection_pdf.data();
    view.power_table = power_table;
    view.power_table.bins = power_bins.data();
    return;
  }
  view.tree.numbers = tree_numbers;
  view.tree.infinite_ends = infinite_ends.data();
  view.tree.infinite_pdf = infinite_pdf.data();
  if (!nodes.empty()) view.tree.nodes = nodes.data();
}

LightTableBuilder::LightTableBuilder(const LightSet& set, const LightTree& tree,
                                     const LightParts& parts)
    : set_(set), tree_(tree), parts_(parts) {
  if (parts.by_tree) return;
  for (size_t i = 0; i < set.record_count; ++i)
    if (parts.of_record[i] != kNoPart) ranges_.push_back({i, i + 1, parts.of_record[i]});
  for (size_t m = 0; m < parts.of_mesh.size(); ++m) {
    const auto [begin, part] = parts.of_mesh[m];
    const size_t end = m + 1 < parts.of_mesh.size() ? parts.of_mesh[m + 1].first : set.size();
    if (part != kNoPart) ranges_.push_back({begin, end, part});
  }
  by_power_.resize(set.size());
  weights_.assign(set.size(), 0);
  parallel_for(ranges_.size(), [&](size_t r) {
    for (size_t i = ranges_[r].begin; i < ranges_[r].end; ++i) by_power_[i] = set.selection_pdf(i);
  });
}

void LightTableBuilder::build_power_tables(std::span<const double> shares, CalibratedLights& out) {
  parallel_for(ranges_.size(), [&](size_t r) {
    const Range& range = ranges_[r];
    const double factor = shares[range.part] / parts_.power[range.part];
    for (size_t i = range.begin; i < range.end; ++i) weights_[i] = double{by_power_[i]} * factor;
  });
  out.power_table = build_power_table(weights_, set_.first_triangle(), out.power_bins, numbers_);
  out.selection_pdf.resize(numbers_.size());
  std::vector<uint64_t> sums(ranges_.size(), 0);
  parallel_for(ranges_.size(), [&](size_t r) {
    for (size_t i = ranges_[r].begin; i < ranges_[r].end; ++i) {
      sums[r] += numbers_[i];
      out.selection_pdf[i] = static_cast<float>(numbers_[i]) * 0x1p-24f;
    }
  });
  for (size_t r = 0; r < ranges_.size(); ++r)
    out.shares[ranges_[r].part] += static_cast<double>(sums[r]) * 0x1p-24;
}

CalibratedLights LightTableBuilder::build_tables(std::span<const double> shares,
                                                 std::span<const NodeTilt> tilts) {
  CalibratedLights out;
  out.shares.assign(parts_.size(), 0);
  if (parts_.by_tree)
    build_tree_tables(set_, tree_, parts_, shares, tilts, out);
  else
    build_power_tables(shares, out);
  return out;
}

}  // namespace wavecomb
