// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/tessellation/subdivision.h"

#include <opensubdiv/far/error.h>
#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/topologyDescriptor.h>
#include <opensubdiv/far/topologyRefinerFactory.h>

#include <algorithm>
#include <mutex>
#include <numeric>

#include "wavecomb/core/error.h"
#include "wavecomb/geometry/tessellation/limit_masks.h"
#include "wavecomb/geometry/tessellation/point.h"

namespace wavecomb {
namespace {

namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;

/// First error message of OpenSubdiv on this thread. OpenSubdiv's callbacks are global to the
/// process.
thread_local std::string last_message;

void catch_messages() {
  static std::once_flag once;
  std::call_once(once, [] {
    const auto keep = [](const char* text) {
      if (last_message.empty()) last_message = text;
    };
    static const auto keep_text = keep;
    Far::SetErrorCallback([](Far::ErrorType, const char* text) { keep_text(text); });
    Far::SetWarningCallback([](const char* text) { keep_text(text); });
  });
}

using masks::Values;

/// Calls f with `width` as a std::integral_constant. Throws Error for widths other than 1 to 4.
template <typename F>
auto with_width(uint32_t width, F&& f) {
  switch (width) {
    case 1:
      return f(std::integral_constant<int, 1>());
    case 2:
      return f(std::integral_constant<int, 2>());
    case 3:
      return f(std::integral_constant<int, 3>());
    case 4:
      return f(std::integral_constant<int, 4>());
    default:
      throw Error("only primvars of 1 to 4 components can be refined");
  }
}

Sdc::SchemeType scheme_of(Scheme scheme) {
  switch (scheme) {
    case Scheme::kLoop:
      return Sdc::SCHEME_LOOP;
    case Scheme::kBilinear:
      return Sdc::SCHEME_BILINEAR;
    case Scheme::kCatmullClark:
      break;
  }
  return Sdc::SCHEME_CATMARK;
}

Sdc::Options options_of(const Cage& cage) {
  static constexpr Sdc::Options::VtxBoundaryInterpolation kBoundaries[] = {
      Sdc::Options::VTX_BOUNDARY_NONE, Sdc::Options::VTX_BOUNDARY_EDGE_ONLY,
      Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER};
  static constexpr Sdc::Options::FVarLinearInterpolation kLinear[] = {
      Sdc::Options::FVAR_LINEAR_NONE,          Sdc::Options::FVAR_LINEAR_CORNERS_ONLY,
      Sdc::Options::FVAR_LINEAR_CORNERS_PLUS1, Sdc::Options::FVAR_LINEAR_CORNERS_PLUS2,
      Sdc::Options::FVAR_LINEAR_BOUNDARIES,    Sdc::Options::FVAR_LINEAR_ALL};
  Sdc::Options options;
  options.SetVtxBoundaryInterpolation(kBoundaries[static_cast<size_t>(cage.boundary)]);
  options.SetFVarLinearInterpolation(kLinear[static_cast<size_t>(cage.face_varying)]);
  options.SetTriangleSubdivision(cage.smooth_triangles ? Sdc::Options::TRI_SUB_SMOOTH
                                                       : Sdc::Options::TRI_SUB_CATMARK);
  return options;
}

}  // namespace

struct Subdivision::Refiner {
  std::unique_ptr<Far::TopologyRefiner> far;
  Scheme scheme;
  Sdc::Options options;
  bool manifold = true;
  bool has_holes = false;
  /// Visible faces of the last level, in ascending order; empty if all faces are visible.
  std::vector<int> drawn;

  int level() const { return far->GetMaxLevel(); }
  const Far::TopologyLevel& last() const { return far->GetLevel(level()); }
  size_t vertices_of(int l) const { return static_cast<size_t>(far->GetLevel(l).GetNumVertices()); }

  /// Returns the cage face from which a face of the last level was refined.
  int base_of(int face) const {
    for (int l = level(); l > 0; --l) face = far->GetLevel(l).GetFaceParentFace(face);
    return face;
  }

  /// Collects the visible faces of the last level.
  void find_visible_faces() {
    const Far::TopologyLevel& cage = far->GetLevel(0);
    for (int f = 0; f < cage.GetNumFaces() && !has_holes; ++f) has_holes = cage.IsFaceHole(f);
    if (!has_holes) return;
    for (int f = 0; f < last().GetNumFaces(); ++f)
      if (!cage.IsFaceHole(base_of(f))) drawn.push_back(f);
  }
  size_t visible_face_count() const {
    return has_holes ? drawn.size() : static_cast<size_t>(last().GetNumFaces());
  }

  /// Calls f(index, face) for each visible face, in parallel bands.
  template <typename F>
  void for_each_visible_face(F&& f) const {
    parallel_bands(visible_face_count(), masks::kBand, [&](size_t first, size_t end) {
      for (size_t i = first; i < end; ++i) f(i, has_holes ? drawn[i] : static_cast<int>(i));
    });
  }

  /// Refines values of the cage level by level by calls of `step(level, from, to)`; size(level) is
  /// the number of values on a level.
  template <typename V, typename Size, typename Step>
  std::vector<V> refine(std::span<const float> values, Size&& size, Step&& step) const {
    const size_t width = sizeof(V) / sizeof(float);
    std::vector<V> here(size(0));
    check_count("components of a primvar", values.size(), here.size() * width);
    std::copy(values.begin(), values.end(), reinterpret_cast<float*>(here.data()));
    for (int l = 1; l <= level(); ++l) {
      std::vector<V> next(size(l));
      const V* from = here.data();
      V* to = next.data();
      step(l, from, to);
      here = std::move(next);
    }
    return here;
  }

  /// Calls f with the subdivision scheme as a std::integral_constant.
  template <typename F>
  auto with_scheme(F&& f) const {
    switch (scheme) {
      case Scheme::kLoop:
        return f(std::integral_constant<Sdc::SchemeType, Sdc::SCHEME_LOOP>());
      case Scheme::kBilinear:
        return f(std::integral_constant<Sdc::SchemeType, Sdc::SCHEME_BILINEAR>());
      case Scheme::kCatmullClark:
        break;
    }
    return f(std::integral_constant<Sdc::SchemeType, Sdc::SCHEME_CATMARK>());
  }
};

namespace {

template <typename V>
std::vector<float> flat(const std::vector<V>& values) {
  const float* first = reinterpret_cast<const float*>(values.data());
  return {first, first + values.size() * (sizeof(V) / sizeof(float))};
}

/// Reinterprets an array of floats as primvar values.
template <typename V>
V* values_in(float* floats) {
  return reinterpret_cast<V*>(floats);
}

/// Returns the unit normal of two surface derivatives, or 0 if they are nearly parallel.
Point normal_of(const Values<3>& by_u, const Values<3>& by_v) {
  const Point u{by_u.v[0], by_u.v[1], by_u.v[2]}, v{by_v.v[0], by_v.v[1], by_v.v[2]};
  const Point normal = cross_of(u, v);
  const bool is_plane = dot_of(normal, normal) > 1e-8 * dot_of(u, u) * dot_of(v, v);
  return is_plane ? unit(normal) : Point{0, 0, 0};
}

}  // namespace

Subdivision::Subdivision(const Cage& cage, uint32_t level) {
  if (level < 1 || level > kMaxLevel) throw Error("the level of subdivision must be 1 to 10");
  check_cage(cage);
  // OpenSubdiv's counts have 32 bits, and each level multiplies the number of corners by four.
  if ((cage.corners.size() >> (31 - 2 * level)) > 0)
    throw Error("too many faces for level " + std::to_string(level));
  catch_messages();
  last_message.clear();
  const auto count = [](size_t n) { return static_cast<int>(n); };
  Far::TopologyDescriptor desc;
  desc.numVertices = count(cage.vertex_count);
  desc.numFaces = count(cage.face_sizes.size());
  desc.numVertsPerFace = cage.face_sizes.data();
  desc.vertIndicesPerFace = cage.corners.data();
  desc.numCreases = count(cage.crease_sharpness.size());
  desc.creaseVertexIndexPairs = cage.crease_edges.data();
  desc.creaseWeights = cage.crease_sharpness.data();
  desc.numCorners = count(cage.corner_vertices.size());
  desc.cornerVertexIndices = cage.corner_vertices.data();
  desc.cornerWeights = cage.corner_sharpness.data();
  std::vector<int32_t> holes;
  for (const int32_t hole : cage.holes)
    if (hole >= 0 && hole < desc.numFaces) holes.push_back(hole);
  desc.numHoles = count(holes.size());
  desc.holeIndices = holes.data();
  std::vector<Far::TopologyDescriptor::FVarChannel> channels(cage.channels.size());
  for (size_t c = 0; c < channels.size(); ++c) {
    channels[c].numValues = count(cage.channels[c].value_count);
    channels[c].valueIndices = cage.channels[c].indices.data();
  }
  desc.numFVarChannels = count(channels.size());
  desc.fvarChannels = channels.data();
  using Factory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
  Factory::Options options(scheme_of(cage.scheme), options_of(cage));
  options.validateFullTopology = true;
  refiner_ = std::make_unique<Refiner>();
  refiner_->scheme = cage.scheme;
  refiner_->options = options_of(cage);
  refiner_->far.reset(Factory::Create(desc, options));
  if (refiner_->far == nullptr)
    throw Error(last_message.empty() ? "OpenSubdiv cannot refine its topology" : last_message);
  const Far::TopologyLevel base = refiner_->far->GetLevel(0);
  for (int e = 0; e < base.GetNumEdges() && refiner_->manifold; ++e)
    refiner_->manifold = !base.IsEdgeNonManifold(e);
  for (int v = 0; v < base.GetNumVertices() && refiner_->manifold; ++v)
    refiner_->manifold = !base.IsVertexNonManifold(v);
  Far::TopologyRefiner::UniformOptions uniform(static_cast<int>(level));
  uniform.fullTopologyInLastLevel = true;
  refiner_->far->RefineUniform(uniform);
  refiner_->find_visible_faces();
}

Subdivision::~Subdivision() = default;
Subdivision::Subdivision(Subdivision&&) noexcept = default;

bool Subdivision::is_manifold() const {
  return refiner_->manifold;
}

uint32_t Subdivision::vertex_count() const {
  return static_cast<uint32_t>(refiner_->last().GetNumVertices());
}

RefinedFaces Subdivision::faces() const {
  const Far::TopologyLevel& last = refiner_->last();
  RefinedFaces faces;
  faces.size = refiner_->scheme == Scheme::kLoop ? 3 : 4;
  faces.vertex_count = vertex_count();
  faces.corners.resize(refiner_->visible_face_count() * faces.size);
  faces.base.resize(refiner_->visible_face_count());
  refiner_->for_each_visible_face([&](size_t index, int f) {
    std::copy_n(last.GetFaceVertices(f).begin(), faces.size, &faces.corners[index * faces.size]);
    faces.base[index] = static_cast<uint32_t>(refiner_->base_of(f));
  });
  if (last.GetNumFVarChannels() > 0) faces.first_values = face_varying_corners(0);
  return faces;
}

std::vector<uint32_t> Subdivision::face_varying_corners(uint32_t channel) const {
  const Far::TopologyLevel& last = refiner_->last();
  const size_t size = refiner_->scheme == Scheme::kLoop ? 3 : 4;
  std::vector<uint32_t> out(refiner_->visible_face_count() * size);
  refiner_->for_each_visible_face([&](size_t index, int f) {
    const Far::ConstIndexArray values = last.GetFaceFVarValues(f, static_cast<int>(channel));
    std::copy_n(values.begin(), size, &out[index * size]);
  });
  return out;
}

std::vector<uint32_t> Subdivision::normal_sectors(const RefinedFaces& faces,
                                                  uint32_t& count) const {
  const Far::TopologyLevel& last = refiner_->last();
  count = vertex_count();
  const auto sharp = [&](int e) {
    const Far::ConstIndexArray around = last.GetEdgeFaces(e);
    if (around.size() != 2 || last.GetEdgeSharpness(e) > 0) return true;
    // On a bilinear surface, all edges of the cage are sharp.
    return refiner_->scheme == Scheme::kBilinear &&
           refiner_->base_of(around[0]) != refiner_->base_of(around[1]);
  };
  // Find the vertices whose faces may be separated by sharp edges. There are few such vertices: all
  // threads search for them, and one thread then numbers them in order.
  const size_t points = refiner_->vertices_of(refiner_->level());
  std::vector<std::vector<int>> cut((points + masks::kBand - 1) / masks::kBand);
  parallel_bands(points, masks::kBand, [&](size_t first, size_t end) {
    for (size_t i = first; i < end; ++i) {
      const int v = static_cast<int>(i);
      int cuts = 0;
      for (const int e : last.GetVertexEdges(v)) cuts += sharp(e);
      if (cuts >= 2 && last.GetVertexFaces(v).size() >= 2) cut[first / masks::kBand].push_back(v);
    }
  });
  // Index in `faces` of each face of the last level.
  std::vector<uint32_t> index;
  if (refiner_->has_holes) {
    index.assign(static_cast<size_t>(last.GetNumFaces()), ~0u);
    refiner_->for_each_visible_face(
        [&](size_t at, int f) { index[static_cast<size_t>(f)] = static_cast<uint32_t>(at); });
  }
  std::vector<uint32_t> normals = faces.corners;
  std::vector<int> sector;
  const auto number = [&](int v) {
    const Far::ConstIndexArray around = last.GetVertexFaces(v), edges = last.GetVertexEdges(v);
    // Faces connected by smooth edges form a sector. Its number is the lowest index of its faces.
    sector.resize(static_cast<size_t>(around.size()));
    std::iota(sector.begin(), sector.end(), 0);
    for (const int e : edges) {
      if (sharp(e)) continue;
      const Far::ConstIndexArray pair = last.GetEdgeFaces(e);
      const int a = sector[static_cast<size_t>(around.FindIndex(pair[0]))];
      const int b = sector[static_cast<size_t>(around.FindIndex(pair[1]))];
      std::replace(sector.begin(), sector.end(), std::max(a, b), std::min(a, b));
    }
    const Far::ConstLocalIndexArray local = last.GetVertexFaceLocalIndices(v);
    if (std::count(sector.begin(), sector.end(), 0) == around.size()) return;
    for (int s = 0; s < around.size(); ++s) {
      bool used = false;
      for (int f = s; f < around.size(); ++f) {
        const auto face = static_cast<size_t>(around[f]);
        const uint32_t at = index.empty() ? static_cast<uint32_t>(face) : index[face];
        if (sector[static_cast<size_t>(f)] != s || at == ~0u) continue;
        normals[static_cast<size_t>(at) * faces.size + local[f]] = count;
        used = true;
      }
      count += used;
    }
  };
  for (const std::vector<int>& band : cut)
    for (const int v : band) number(v);
  return normals;
}

std::vector<float> Subdivision::vertex(std::span<const float> values, uint32_t width,
                                       std::vector<float>* normals) const {
  if (normals != nullptr && width != 3) throw Error("normals need values of 3 components");
  return with_width(width, [&](auto n) {
    using V = Values<decltype(n)::value>;
    return refiner_->with_scheme([&](auto scheme) {
      constexpr Sdc::SchemeType kScheme = decltype(scheme)::value;
      const Far::TopologyRefiner& far = *refiner_->far;
      const std::vector<V> here = refiner_->refine<V>(
          values, [&](int l) { return refiner_->vertices_of(l); },
          [&](int l, const V* from, V* to) {
            masks::refine<kScheme>(refiner_->options, far.GetLevel(l - 1), far.GetLevel(l), from,
                                   to);
          });
      std::vector<float> limit(here.size() * width);
      V* to = values_in<V>(limit.data());
      if constexpr (sizeof(V) == 3 * sizeof(float)) {
        if (normals != nullptr) {
          normals->assign(limit.size(), 0.f);
          masks::limit<kScheme, true>(refiner_->options, refiner_->last(), here.data(),
                                      [&](int i, const V& value, const V* u, const V* v) {
                                        to[i] = value;
                                        if (u != nullptr)
                                          put(*normals, static_cast<size_t>(i), normal_of(*u, *v));
                                      });
          return limit;
        }
      }
      masks::limit<kScheme, false>(
          refiner_->options, refiner_->last(), here.data(),
          [&](int i, const V& value, const V*, const V*) { to[i] = value; });
      return limit;
    });
  });
}

std::vector<float> Subdivision::varying(std::span<const float> values, uint32_t width) const {
  return with_width(width, [&](auto n) {
    using V = Values<decltype(n)::value>;
    const Far::PrimvarRefiner refine(*refiner_->far);
    return flat(refiner_->refine<V>(
        values, [&](int l) { return refiner_->vertices_of(l); },
        [&](int l, const V* from, V* to) { refine.InterpolateVarying(l, from, to); }));
  });
}

std::vector<float> Subdivision::face_varying(uint32_t channel, std::span<const float> values,
                                             uint32_t width) const {
  return with_width(width, [&](auto n) {
    using V = Values<decltype(n)::value>;
    const Far::PrimvarRefiner refine(*refiner_->far);
    const int c = static_cast<int>(channel);
    const std::vector<V> here = refiner_->refine<V>(
        values,
        [&](int l) { return static_cast<size_t>(refiner_->far->GetLevel(l).GetNumFVarValues(c)); },
        [&](int l, const V* from, V* to) { refine.InterpolateFaceVarying(l, from, to, c); });
    std::vector<float> limit(here.size() * width);
    const V* from = here.data();
    V* to = values_in<V>(limit.data());
    refine.LimitFaceVarying(from, to, c);
    return limit;
  });
}

}  // namespace wavecomb
