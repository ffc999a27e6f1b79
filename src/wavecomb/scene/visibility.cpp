// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/visibility.h"

#include <algorithm>
#include <map>
#include <string_view>

#include "wavecomb/light/description/linking.h"
#include "wavecomb/scene/names.h"
#include "wavecomb/scene/scene.h"

namespace wavecomb {
namespace {

using Rules = std::map<std::string, VisibilityRule, std::less<>>;

/// Returns the path of the parent prim; empty at the top.
std::string_view above(std::string_view path) {
  const size_t slash = path.rfind('/');
  return slash == std::string_view::npos ? std::string_view() : path.substr(0, slash);
}

/// Returns the visibility of the object with the path `object_path`. The object is an instance of
/// the mesh `group_path` in a group with the root path `root`. Each visibility bit comes from the
/// rule of the nearest prim, among the object and its ancestors, that sets the bit.
uint32_t visibility_of(const Rules& rules, std::string_view object_path,
                       std::string_view group_path, std::string_view root) {
  uint32_t specified = 0, bits = 0;
  const auto apply_rule = [&](std::string_view path) {
    const auto rule = rules.find(path);
    if (rule == rules.end()) return;
    bits |= rule->second.bits & rule->second.specified & ~specified;
    specified |= rule->second.specified;
  };
  for (; !object_path.empty(); object_path = above(object_path), group_path = above(group_path)) {
    apply_rule(object_path);
    if (group_path.size() > root.size() && group_path != object_path) apply_rule(group_path);
  }
  return bits | (kVisibleToAll & ~specified);
}

}  // namespace

std::vector<uint32_t> object_visibility(const Scene& scene, const ObjectNames& names) {
  const SceneGeometry& geometry = *scene.geometry();
  if (geometry.visibility.empty()) return {};
  Rules by_path;
  for (const VisibilityRule& rule : geometry.visibility) {
    VisibilityRule& whole = by_path[rule.path];
    whole.bits = (whole.bits & ~rule.specified) | (rule.bits & rule.specified);
    whole.specified |= rule.specified;
  }
  std::vector<uint32_t> all;
  for (size_t i = 0; i < geometry.instance_records.size(); ++i) {
    const Group& group = geometry.groups[i == 0 ? 0 : geometry.instances[i - 1].group];
    for (const uint32_t mesh : group.meshes) {
      const std::string object_path =
          without_numbers(names.object(static_cast<uint32_t>(all.size())));
      all.push_back(visibility_of(by_path, object_path, geometry.meshes[mesh].name, group.root));
    }
  }
  if (std::all_of(all.begin(), all.end(), [](uint32_t v) { return v == kVisibleToAll; })) return {};
  return all;
}

}  // namespace wavecomb
