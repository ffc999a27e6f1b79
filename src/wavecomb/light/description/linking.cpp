// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/light/description/linking.h"

#include <algorithm>
#include <map>

#include "wavecomb/scene/names.h"
#include "wavecomb/scene/scene_limits.h"

namespace wavecomb {

std::string without_numbers(std::string_view path) {
  std::string out;
  bool inside = false;
  for (const char c : path) {
    inside = inside || c == '[';
    if (!inside) out += c;
    inside = inside && c != ']';
  }
  return out;
}

bool GeometrySet::contains(std::string_view path) const {
  for (std::string_view at = path;;) {
    const auto entry = std::lower_bound(
        entries.begin(), entries.end(), at,
        [](const Entry& e, std::string_view text) { return std::string_view(e.path) < text; });
    if (entry != entries.end() && entry->path == at) {
      if (entry->rule == PathRule::kExclude) return false;
      if (entry->rule == PathRule::kExpand || at.size() == path.size()) return true;
    }
    if (at.size() <= 1) return false;
    const size_t slash = at.rfind('/');
    if (slash == std::string_view::npos) return false;
    at = at.substr(0, std::max<size_t>(slash, 1));
  }
}

SceneLinks::SceneLinks(const ObjectNames& names, std::span<const GeometrySet> sets)
    : words(static_cast<uint32_t>((sets.size() + 31) / 32)) {
  std::map<std::vector<uint32_t>, uint32_t> known;
  classes.resize(names.first_light());
  for (uint32_t object = 0; object < classes.size(); ++object) {
    const std::string path = without_numbers(names.object(object));
    std::vector<uint32_t> bits(words, 0);
    for (size_t s = 0; s < sets.size(); ++s)
      if (sets[s].contains(path)) bits[s / 32] |= 1u << (s % 32);
    const auto [at, is_new] = known.try_emplace(bits, static_cast<uint32_t>(known.size() + 1));
    if (is_new) members.insert(members.end(), bits.begin(), bits.end());
    classes[object] = at->second;
  }
  check_counts({.link_words = members.size()});
}

}  // namespace wavecomb
