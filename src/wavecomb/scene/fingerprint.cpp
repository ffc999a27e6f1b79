// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/scene/fingerprint.h"

#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

#include "wavecomb/light/description/light_table.h"
#include "wavecomb/material/description/material_table.h"
#include "wavecomb/scene/camera/camera_table.h"

namespace wavecomb {
namespace {

/// FNV-1a over 64-bit words, finished by the 64-bit mixer of MurmurHash3. The hash does not prevent
/// deliberate collisions.
class Hash {
 public:
  void add_bytes(const void* data, size_t size) {
    add_word(size);
    const auto* p = static_cast<const char*>(data);
    for (; size >= 8; p += 8, size -= 8) {
      uint64_t word;
      std::memcpy(&word, p, 8);
      add_word(word);
    }
    uint64_t rest = 0;
    std::memcpy(&rest, p, size);
    add_word(rest);
  }
  template <typename T>
  void add_array(std::span<const T> values) {
    static_assert(std::is_arithmetic_v<T>);
    add_bytes(values.data(), values.size_bytes());
  }
  template <typename... T>
  void add(const T&... values) {
    (add_one(values), ...);
  }
  uint64_t value() const {
    uint64_t h = state_;
    h = (h ^ (h >> 33)) * 0xff51afd7ed558ccdull;
    h = (h ^ (h >> 33)) * 0xc4ceb9fe1a85ec53ull;
    return h ^ (h >> 33);
  }

 private:
  template <typename T>
  void add_one(const T& value) {
    if constexpr (std::is_enum_v<T>)
      add_word(static_cast<uint64_t>(value));
    else if constexpr (std::is_arithmetic_v<T>)
      add_bytes(&value, sizeof(T));
    else
      add_array(std::span<const float>(&value.x, 3));
  }
  void add_one(const Affine& m) { add(m.row[0], m.row[1], m.row[2], m.t); }
  void add_word(uint64_t word) {
    state_ = (state_ ^ word) * 0x100000001b3ull;
    state_ ^= state_ >> 32;  // feeds high bits back into low bits
  }

  uint64_t state_ = 0xcbf29ce484222325ull;
};

template <typename... F>
struct Overloaded : F... {
  using F::operator()...;
};

uint64_t hash_geometry(const Scene& scene) {
  Hash h;
  for (const Mesh& m : scene.meshes()) {
    h.add_array(m.positions);
    h.add_array(m.indices);
    h.add_array(m.normals);
    h.add_array(m.uvs);
    h.add_array(m.face_materials);
    h.add_array(m.radii);
    h.add(m.primitive, m.normals_at, m.uvs_at, m.material);
    if (m.deforms()) h.add(m.steps);
    if (!m.splats.empty()) {
      h.add_array(std::span<const float>(reinterpret_cast<const float*>(m.splats.data()),
                                         16 * m.splats.size()));
      h.add_array(m.harmonics);
    }
    for (const MeshAttribute& a : m.attributes) {
      h.add(a.id, a.rate, a.width);
      h.add_array(a.values);
    }
  }
  for (const Group& group : scene.groups()) h.add_array(std::span<const uint32_t>(group.meshes));
  for (const Instance& i : scene.instances()) {
    h.add(i.group, i.to_world, i.material);
    for (uint32_t k = 0; i.motion.moves() && k <= i.motion.segments; ++k)
      h.add(scene.geometry()->steps[i.motion.first + k].affine());
  }
  for (const Volume& v : scene.volumes()) {
    h.add(v.box[0], v.box[1], v.to_world, v.extinction, v.albedo, v.emission, v.anisotropy);
    if (v.velocity.grid) h.add(v.seconds[0], v.seconds[1]);
    for (const VolumeField* field : {&v.density, &v.color, &v.glow, &v.velocity}) {
      if (!field->grid) continue;
      const GridView grid = field->grid->view();
      h.add(field->index_to_object, grid.components, grid.background, grid.is_half ? 1u : 0u);
      for (const int32_t x : field->grid->first_voxel()) h.add(x);
      h.add_array(std::span<const uint32_t>(field->grid->table()));
      h.add_array(std::span<const uint32_t>(field->grid->voxel_words()));
    }
  }
  return h.value();
}

void add_named(Hash& h, const char* name, float value) {
  h.add_bytes(name, std::strlen(name));
  h.add(value);
}

uint64_t hash_materials(const Scene& scene) {
  Hash h;
  for (const Material& m : scene.materials()) {
    h.add(m.program);
    for (const MaterialParameter& p : material_table())
      std::visit(
          [&](const auto& accessor) {
            if constexpr (!std::is_same_v<decltype(accessor), const SpecificParameter&>)
              h.add(m.*accessor);
            else if (accessor.is_of(m) &&
                     m.specific_value(accessor.index) != accessor.info().standard)
              add_named(h, p.name, m.specific_value(accessor.index));
          },
          p.accessor);
    if (has_trait(m.program, program_trait::kLayered)) {
      const OpenPbr& o = m.openpbr;
#define WAVECOMB_ADD(kind, name, standard, least, most) h.add(o.name);
      WAVECOMB_OPENPBR_INPUTS(WAVECOMB_ADD)
#undef WAVECOMB_ADD
      h.add(o.transmission_color, o.transmission_depth, o.subsurface_radius, o.thin_walled);
      // Material inputs that later versions of Wavecomb added are hashed only if they are set, so
      // that older scenes keep their fingerprints.
      if (o.nested_priority != 0) add_named(h, "nested_priority", o.nested_priority);
      const Vec3<float>& scatter = o.transmission_scatter;
      if (scatter.x != 0 || scatter.y != 0 || scatter.z != 0)
        h.add(scatter, o.transmission_scatter_anisotropy);
    }
    for (const TextureUse& use : m.textures) {
      h.add(use.texture, use.channel);
      h.add_array(std::span<const float>(use.scale));
      h.add_array(std::span<const float>(use.bias));
      h.add_array(std::span<const float>(use.uv));
    }
    if (m.graph != kNoGraph) h.add(m.graph, m.opacity_graph, m.emission_graph);
  }
  const GraphSet& graphs = *scene.material_part()->graphs;
  if (graphs.programs.empty()) return h.value();
  const auto add = [&](const auto& array) {
    h.add_bytes(array.data(), array.size() * sizeof(array[0]));
  };
  add(graphs.programs);
  add(graphs.ops);
  add(graphs.constants);
  add(graphs.images);
  add(graphs.outputs);
  return h.value();
}

uint64_t hash_textures(const Scene& scene) {
  Hash h;
  for (const auto& texture : scene.textures()) {
    const TextureView& v = texture->view();
    h.add(v.format, v.channels, v.srgb, v.has_alpha, v.wrap_s, v.wrap_t, v.level_count);
    for (uint32_t l = 0; l < v.level_count; ++l) h.add(v.levels[l].width, v.levels[l].height);
    h.add_bytes(v.texels, texture->bytes());
    // Each tile is also a texture of the scene, so its texture index identifies the tile.
    for (const auto& [number, tile] : texture->tiles())
      for (uint32_t at = 0; at < scene.textures().size(); ++at)
        if (scene.textures()[at] == tile) h.add(number, at);
  }
  return h.value();
}

void add_value(Hash& h, const LightParameter& p, const LightValue& value) {
  if (p.kind == LightValueKind::kChoice) return h.add(MaterialSync{std::get<uint32_t>(value)});
  if (p.kind == LightValueKind::kId && std::holds_alternative<std::monostate>(value))
    return h.add(kNoLight);
  std::visit(
      [&](const auto& v) {
        using T = std::decay_t<decltype(v)>;
        if constexpr (std::is_same_v<T, std::vector<Affine>>)
          for (const Affine& map : v) h.add(map);
        else if constexpr (!std::is_same_v<T, std::monostate>)
          h.add(v);
      },
      value);
}

/// Hashes all parameters of a light in light_table() except parameters specific to other kinds of
/// lights. Shared parameters are hashed even if this kind of light does not use them.
void add_light(Hash& h, const Light& l) {
  h.add(l.kind, l.to_world);
  for (const LightParameter& p : light_table())
    if (!p.is_specific || p.is_of(l.kind)) add_value(h, p, p.read(l));
}

uint64_t hash_lights(const Scene& scene) {
  Hash h;
  for (const Light& l : scene.lights()) add_light(h, l);
  for (const Light& l : scene.geometry()->mesh_lights) add_light(h, l);
  for (const GeometrySet& set : scene.geometry()->sets)
    for (const GeometrySet::Entry& entry : set.entries) {
      h.add_bytes(entry.path.data(), entry.path.size());
      h.add(entry.rule);
    }
  for (const VisibilityRule& rule : scene.geometry()->visibility) {
    h.add_bytes(rule.path.data(), rule.path.size());
    h.add(rule.specified, rule.bits);
  }
  for (const IesProfile& p : scene.geometry()->profiles) {
    h.add_array(std::span<const float>(p.vertical));
    h.add_array(std::span<const float>(p.horizontal));
    h.add_array(std::span<const float>(p.candela));
  }
  for (const LightFilter& f : scene.geometry()->filters) {
    h.add(f.to_world, f.picture_u, f.picture_v);
    for (const Vec3<float>& side : f.sides) h.add(side);
    h.add(f.distance, f.texture, f.near_start, f.near_end, f.far_start, f.far_end, f.density,
          f.next);
  }
  for (const Mesh& m : scene.meshes()) {
    h.add(m.light_group);
    if (m.mesh_light != kNoLight) h.add(m.mesh_light, m.light_group);
  }
  return h.value();
}

/// Hashes the names that AOVs use: meshes, placements of instances, materials, lights, light
/// groups.
uint64_t hash_names(const Scene& scene) {
  Hash h;
  const auto add = [&](std::string_view text) { h.add_bytes(text.data(), text.size()); };
  for (const Mesh& m : scene.meshes()) {
    add(m.name);
    h.add(m.asset_length);
  }
  for (const Group& group : scene.groups()) add(group.root);
  for (const Placement& p : scene.placements()) {
    h.add(p.parent, p.group, p.number);
    if (p.name == kNoName) continue;
    const PlacementName name = scene.names()[p.name];
    add(name.text);
    h.add(name.asset_length);
  }
  for (const Material& m : scene.materials()) add(m.name);
  for (const Light& l : scene.lights()) add(l.name);
  for (const std::string& group : scene.light_groups()) add(group);
  return h.value();
}

/// Hashes the camera. Parameters that later versions added are hashed only if they differ from
/// their default, so that older scenes keep their fingerprints.
uint64_t hash_camera(const Scene& scene) {
  Hash h;
  const Camera& c = scene.camera();
  h.add(c.to_world);
  for (const Affine& step : c.steps) h.add(step);
  for (const CameraParameter& p : camera_table()) {
    const CameraValue value = p.read(c);
    if (!p.counts_always) {
      if (value == p.standard()) continue;
      h.add_bytes(p.name, std::strlen(p.name));
    }
    std::visit(
        Overloaded{[&](const auto& one) { h.add(one); },
                   [&](const FourNumbers& four) { h.add_array(std::span<const float>(four)); },
                   [&](const std::vector<FourNumbers>& planes) {
                     for (const FourNumbers& plane : planes)
                       h.add_array(std::span<const float>(plane));
                   }},
        value);
  }
  return h.value();
}

}  // namespace

std::vector<std::pair<std::string, uint64_t>> fingerprint(const Scene& scene, bool arrays) {
  std::vector<std::pair<std::string, uint64_t>> parts;
  if (arrays) parts.emplace_back("geometry", hash_geometry(scene));
  parts.emplace_back("materials", hash_materials(scene));
  if (arrays) parts.emplace_back("textures", hash_textures(scene));
  parts.emplace_back("lights", hash_lights(scene));
  parts.emplace_back("camera", hash_camera(scene));
  parts.emplace_back("names", hash_names(scene));
  return parts;
}

}  // namespace wavecomb
