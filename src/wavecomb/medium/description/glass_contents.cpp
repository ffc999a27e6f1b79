// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/medium/description/glass_contents.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <unordered_map>
#include <vector>

#include "wavecomb/geometry/mesh/triangle_columns.h"
#include "wavecomb/light/description/kind_info.h"
#include "wavecomb/light/description/light.h"
#include "wavecomb/material/description/material.h"
#include "wavecomb/medium/description/wide_map.h"
#include "wavecomb/scene/object_bounds.h"

namespace wavecomb {
namespace {

using Point = Vec3<float>;

/// Bounds of glass are shrunk by this fraction of their size, so that a table that touches a
/// drinking glass does not count as inside the glass.
constexpr float kMargin = 1e-3f;
/// Maximum number of tests of bounds and triangles before the search gives up, which is after about
/// half a second.
constexpr size_t kMaxTests = size_t{1} << 28;

bool overlap(const Bounds& a, const Bounds& b) {
  return a.lo.x < b.hi.x && b.lo.x < a.hi.x && a.lo.y < b.hi.y && b.lo.y < a.hi.y &&
         a.lo.z < b.hi.z && b.lo.z < a.hi.z;
}

float along(const Point& p, int axis) {
  return axis == 0 ? p.x : (axis == 1 ? p.y : p.z);
}

Point vertex(const Mesh& mesh, size_t i) {
  const auto p = mesh.positions.subspan(3 * i, 3);
  return {p[0], p[1], p[2]};
}

/// Returns whether the faces of a mesh are oriented inwards, as on the wall of a cavity in glass.
bool is_hollow(const Mesh& mesh) {
  double volume = 0;
  for (size_t t = 0; t + 2 < mesh.indices.size(); t += 3)
    volume += double{dot(vertex(mesh, mesh.indices[t]), cross(vertex(mesh, mesh.indices[t + 1]),
                                                              vertex(mesh, mesh.indices[t + 2])))};
  return volume < 0;
}

/// Convex polygon that is the intersection of a triangle with a box, clipped by the algorithm of
/// Sutherland and Hodgman (1974).
class Clipped {
 public:
  Clipped(const std::array<Point, 3>& triangle, const Bounds& bounds) {
    std::copy(triangle.begin(), triangle.end(), points_.begin());
    count_ = 3;
    for (int axis = 0; axis < 3; ++axis) {
      cut([&](const Point& p) { return along(p, axis) - along(bounds.lo, axis); });
      cut([&](const Point& p) { return along(bounds.hi, axis) - along(p, axis); });
    }
  }
  /// Returns whether `test` is true for at least one sample point of the polygon: the centre, the
  /// corners and, if the polygon is large relative to `bounds`, points between them.
  template <typename Test>
  bool any(const Bounds& bounds, const Test& test) const {
    if (count_ == 0) return false;
    Point centre{0, 0, 0};
    Bounds own;
    for (size_t i = 0; i < count_; ++i) {
      centre = centre + points_[i];
      own.add(points_[i]);
    }
    centre = centre * (1.f / static_cast<float>(count_));
    const Point size = own.hi - own.lo, whole = bounds.hi - bounds.lo;
    const bool large = std::max({size.x / whole.x, size.y / whole.y, size.z / whole.z}) > 0.1f;
    if (test(centre)) return true;
    // Sample the triangle fan around the centre, including the lines from the centre to the
    // corners.
    const int steps = large ? 6 : 1;
    const float step = 1.f / static_cast<float>(steps);
    for (size_t i = 0; i < count_; ++i) {
      const Point a = (points_[i] - centre) * step, b = (points_[(i + 1) % count_] - centre) * step;
      for (int u = 1; u <= steps; ++u)
        for (int v = 0; u + v <= steps; ++v)
          if (test(centre + a * static_cast<float>(u) + b * static_cast<float>(v))) return true;
    }
    return false;
  }

 private:
  /// Keeps the part of the polygon where `distance` is not negative.
  template <typename Distance>
  void cut(const Distance& distance) {
    std::array<Point, 9> clipped;
    size_t n = 0;
    for (size_t i = 0; i < count_; ++i) {
      const Point &a = points_[i], &b = points_[(i + 1) % count_];
      const float da = distance(a), db = distance(b);
      if (da >= 0) clipped[n++] = a;
      if ((da >= 0) != (db >= 0)) clipped[n++] = a + (b - a) * (da / (da - db));
    }
    points_ = clipped;
    count_ = n;
  }

  std::array<Point, 9> points_;
  size_t count_ = 0;
};

/// An instance of a glass solid.
struct Glass {
  Bounds bounds;  ///< in world space
  uint32_t mesh;
  const Instance* instance;
  WideMap to_mesh;  ///< transform from world space
};

/// Binary tree of bounding boxes, split at the median of their centres.
class GlassTree {
 public:
  explicit GlassTree(std::vector<Glass> all) : all_(std::move(all)) {
    nodes_.reserve(2 * all_.size() / kLeaf + 2);
    if (!all_.empty()) build(0, all_.size());
  }
  /// Calls `visit` for each glass solid whose bounds overlap `bounds`, until a call of `visit`
  /// returns true. Returns whether a call returned true. Adds the number of tests to `tests`.
  template <typename Visit>
  bool any(const Bounds& bounds, size_t& tests, const Visit& visit) const {
    return !all_.empty() && visit_node(0, bounds, tests, visit);
  }

 private:
  static constexpr size_t kLeaf = 4;
  struct Node {
    Bounds bounds;
    size_t first, last;  ///< range of the solids in a leaf node
    size_t second = 0;   ///< index of the second child (the first is the next node); 0 for a leaf
  };

  size_t build(size_t first, size_t last) {
    const size_t number = nodes_.size();
    Bounds bounds, centres;
    for (size_t i = first; i < last; ++i) {
      bounds.add(all_[i].bounds);
      centres.add(centre(all_[i]));
    }
    nodes_.push_back({bounds, first, last});
    if (last - first <= kLeaf) return number;
    const Point size = centres.hi - centres.lo;
    const int axis = size.x >= std::max(size.y, size.z) ? 0 : (size.y >= size.z ? 1 : 2);
    const size_t middle = first + (last - first) / 2;
    const auto at = [&](size_t i) { return all_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(first), at(middle), at(last), [axis](const Glass& a, const Glass& b) {
      return along(centre(a), axis) < along(centre(b), axis);
    });
    build(first, middle);
    const size_t second = build(middle, last);
    nodes_[number].second = second;
    return number;
  }
  static Point centre(const Glass& g) { return (g.bounds.lo + g.bounds.hi) * 0.5f; }

  template <typename Visit>
  bool visit_node(size_t number, const Bounds& bounds, size_t& tests, const Visit& visit) const {
    const Node& node = nodes_[number];
    ++tests;
    if (!overlap(node.bounds, bounds)) return false;
    if (node.second != 0)
      return visit_node(number + 1, bounds, tests, visit) ||
             visit_node(node.second, bounds, tests, visit);
    for (size_t i = node.first; i < node.last; ++i, ++tests)
      if (overlap(all_[i].bounds, bounds) && visit(all_[i])) return true;
    return false;
  }

  std::vector<Glass> all_;
  std::vector<Node> nodes_;
};

class Search {
 public:
  Search(const Glasses& glasses, const PlacedObjects& objects)
      : meshes_(objects.meshes),
        groups_(objects.groups),
        instances_(objects.instances),
        steps_(objects.steps),
        glasses_(glasses) {
    std::vector<Glass> all;
    for_each_instance([&](uint32_t mesh, const Instance& instance) {
      if (!uses_glass(mesh, instance)) return false;
      const Bounds bounds = instance_bounds(mesh, instance);
      if (!bounds.empty())
        all.push_back({bounds, mesh, &instance, WideMap(instance.to_world).inverse()});
      return false;
    });
    glass_.emplace(std::move(all));
  }

  bool finds_objects() {
    return for_each_instance([&](uint32_t mesh, const Instance& i) { return is_inside(mesh, i); });
  }
  bool finds_lights(std::span<const Light> lights) {
    return std::ranges::any_of(lights, [&](const Light& light) {
      return !info_of(light.kind).has(light_trait::kInfinite) &&
             is_in_glass(light.to_world.t, 0, nullptr);
    });
  }

 private:
  struct Shape {
    Bounds bounds;
    std::optional<bool> hollow;
    std::optional<TriangleColumns> columns;
  };

  /// Calls `visit` for all meshes of all instances, until a call of `visit` returns true. Returns
  /// whether a call returned true.
  template <typename Visit>
  bool for_each_instance(const Visit& visit) {
    for (const uint32_t mesh : groups_[0].meshes)
      if (visit(mesh, world_)) return true;
    for (const Instance& instance : instances_)
      for (const uint32_t mesh : groups_[instance.group].meshes)
        if (visit(mesh, instance)) return true;
    return false;
  }
  Shape& shape(uint32_t mesh) {
    const auto [at, is_new] = shapes_.try_emplace(mesh);
    if (is_new) at->second.bounds = mesh_bounds(meshes_[mesh]);
    return at->second;
  }
  Bounds instance_bounds(uint32_t mesh, const Instance& instance) {
    Bounds bounds;
    add_instance_bounds(bounds, shape(mesh).bounds, instance, steps_);
    return bounds;
  }
  bool uses_glass(uint32_t mesh, const Instance& instance) {
    const Mesh& m = meshes_[mesh];
    if (m.is_curved()) return false;
    const auto is_glass = [&](uint32_t material) {
      const uint32_t bound_material = material == kInheritMaterial ? instance.material : material;
      return bound_material < glasses_.size() && glasses_[bound_material];
    };
    if (m.face_materials.empty()) return is_glass(m.material);
    tests_ += m.face_materials.size();
    return std::ranges::any_of(m.face_materials, is_glass);
  }
  bool is_hollow_glass(uint32_t mesh) {
    std::optional<bool>& hollow = shape(mesh).hollow;
    if (!hollow) hollow = is_hollow(meshes_[mesh]);
    return *hollow;
  }
  /// Returns whether a point is inside glass. The test follows a line from the point to infinity in
  /// both directions, and compares the number of times that the line leaves glass and enters glass.
  /// An open surface, such as a single pane, has points behind it, but lies on one side of them
  /// only. Faces of the mesh instance that contains the point are ignored.
  bool is_in_glass(const Point& p, uint32_t mesh, const Instance* instance) {
    FacesLeft left;
    glass_->any(grown({p, p}), tests_, [&](const Glass& g) {
      if (g.mesh == mesh && g.instance == instance) return false;
      std::optional<TriangleColumns>& columns = shape(g.mesh).columns;
      if (!columns) {
        columns.emplace(meshes_[g.mesh]);
        tests_ += meshes_[g.mesh].triangle_count();
      }
      const FacesLeft own = columns->faces_left(g.to_mesh.point(p), tests_);
      left.ahead += own.ahead;
      left.behind += own.behind;
      return false;
    });
    return left.ahead > 0 && left.behind > 0;
  }
  /// Returns whether a part of a mesh instance is inside the glass of another mesh instance.
  bool is_inside(uint32_t mesh, const Instance& instance) {
    const auto is_other = [&](const Glass& g) { return g.mesh != mesh || g.instance != &instance; };
    const Bounds bounds = grown(instance_bounds(mesh, instance));
    if (bounds.empty() || !glass_->any(bounds, tests_, is_other)) return false;
    if (uses_glass(mesh, instance) && is_hollow_glass(mesh)) return false;
    const Mesh& m = meshes_[mesh];
    const auto at = [&](size_t i) { return instance.to_world.point(vertex(m, i)); };
    const auto in_glass = [&](const Point& p) { return is_in_glass(p, mesh, &instance); };
    if (m.is_curved()) {
      for (size_t i = 0; i < m.vertex_count(); ++i)
        if (in_glass(at(i)) || tests_ > kMaxTests) return true;
      return false;
    }
    for (size_t t = 0; t + 2 < m.indices.size(); t += 3) {
      const std::array<Point, 3> triangle{at(m.indices[t]), at(m.indices[t + 1]),
                                          at(m.indices[t + 2])};
      Bounds object_bounds;
      for (const Point& p : triangle) object_bounds.add(p);
      const bool found = glass_->any(grown(object_bounds), tests_, [&](const Glass& g) {
        return is_other(g) && Clipped(triangle, shrunk(g.bounds)).any(g.bounds, in_glass);
      });
      if (found || tests_ > kMaxTests) return true;
    }
    return false;
  }
  /// Grows bounds slightly, because flat bounds would not overlap anything.
  static Bounds grown(Bounds b) {
    const auto by = [](float x, float y) { return 1e-6f * std::max(std::abs(x), std::abs(y)); };
    const Point d{by(b.lo.x, b.hi.x), by(b.lo.y, b.hi.y), by(b.lo.z, b.hi.z)};
    return {b.lo - d, b.hi + d};
  }
  static Bounds shrunk(Bounds b) {
    const Point by = (b.hi - b.lo) * kMargin;
    return {b.lo + by, b.hi - by};
  }

  std::span<const Mesh> meshes_;
  std::span<const Group> groups_;
  std::span<const Instance> instances_;
  std::span<const MatrixStep> steps_;
  const Instance world_;
  const Glasses& glasses_;
  std::unordered_map<uint32_t, Shape> shapes_;
  std::optional<GlassTree> glass_;
  size_t tests_ = 0;
};

}  // namespace

Glasses glasses_of(std::span<const Material> materials,
                   const std::function<bool(const Material&)>& test) {
  Glasses glasses;
  for (const Material& m : materials) glasses.push_back(test(m));
  return glasses;
}

bool glass_holds_objects(const Glasses& glasses, const PlacedObjects& objects) {
  return std::ranges::count(glasses, true) > 0 && Search(glasses, objects).finds_objects();
}

bool glass_holds_lights(const Glasses& glasses, const PlacedObjects& objects,
                        std::span<const Light> lights) {
  return std::ranges::count(glasses, true) > 0 && Search(glasses, objects).finds_lights(lights);
}

}  // namespace wavecomb
