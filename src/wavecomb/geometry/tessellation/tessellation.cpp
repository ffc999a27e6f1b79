// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/tessellation/tessellation.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "wavecomb/core/error.h"
#include "wavecomb/geometry/tessellation/point.h"
#include "wavecomb/scene/parallel.h"
#include "wavecomb/texture/lookup.h"

namespace wavecomb {
namespace {

/// Elements per task.
constexpr size_t kBand = 16384;

/// Refined surface before its triangulation. Arrays of corner values have the order of the corners
/// of `faces`.
struct Work {
  RefinedFaces faces;
  std::vector<float> positions;   ///< 3 per vertex
  std::vector<uint32_t> sectors;  ///< index of each corner's normal
  std::vector<float> normals;     ///< 3 per normal
  std::vector<float> uvs;         ///< 2 per texture coordinate
  /// Index of each corner's texture coordinate in `uvs`; empty without texture coordinates.
  std::vector<uint32_t> uv_at;
};

/// Determines which normals are computed as sums over faces. Returns, for each normal, its index in
/// the list of sums, or ~0 if it is the limit normal. A vertex with a single normal uses the limit
/// normal in `work.normals` unless this is 0.
std::vector<uint32_t> sum_indices(const Work& work, size_t normal_count, size_t& sum_count) {
  const size_t known = work.normals.size() / 3, points = work.faces.vertex_count;
  std::vector<uint32_t> sum_of_normal(normal_count, ~0u);
  for (size_t c = 0; c < work.sectors.size() && normal_count > points; ++c)
    if (work.sectors[c] >= points) sum_of_normal[work.faces.corners[c]] = 0;
  sum_count = 0;
  for (size_t i = 0; i < normal_count; ++i) {
    const float* n = i < known ? &work.normals[3 * i] : nullptr;
    if (n == nullptr || sum_of_normal[i] == 0 || (n[0] == 0 && n[1] == 0 && n[2] == 0))
      sum_of_normal[i] = static_cast<uint32_t>(sum_count++);
  }
  return sum_of_normal;
}

/// Calls f(corner, first, end) for all corners in order, on each thread. Each thread handles a
/// separate range [first, end) of the `count` accumulators, so sums do not depend on the number of
/// threads.
template <typename F>
void each_corner(size_t corners, size_t count, F&& f) {
  const size_t share = std::max(kBand, (count + loop_threads() - 1) / loop_threads());
  parallel_bands(count, share, [&](size_t first, size_t end) {
    for (size_t c = 0; c < corners; ++c) f(c, first, end);
  });
}

/// Computes normals. A vertex with a single normal keeps the limit normal in `work` unless this is
/// 0. All other normals are normalised sums of area-weighted corner normals over the faces of a
/// sector (subdivision.h).
void set_normals(Work& work, size_t normal_count) {
  size_t sum_count = 0;
  const std::vector<uint32_t> sum_of_normal = sum_indices(work, normal_count, sum_count);
  std::vector<Point> sums(sum_count, Point{0, 0, 0});
  const uint32_t k = work.faces.size;
  each_corner(work.sectors.size(), sum_count, [&](size_t c, size_t first, size_t end) {
    const uint32_t sum_index = sum_of_normal[work.sectors[c]];
    if (sum_index < first || sum_index >= end) return;
    const size_t face = c / k * k, at = c - face;
    const uint32_t* corner = &work.faces.corners[face];
    const Point here = point_at(work.positions, corner[at]);
    const Point to_next = point_at(work.positions, corner[(at + 1) % k]) - here;
    const Point to_last = point_at(work.positions, corner[(at + k - 1) % k]) - here;
    sums[sum_index] = sums[sum_index] + cross_of(to_next, to_last);
  });
  work.normals.resize(3 * normal_count);
  parallel_bands(normal_count, kBand, [&](size_t first, size_t end) {
    for (size_t i = first; i < end; ++i)
      if (sum_of_normal[i] != ~0u) put(work.normals, i, unit(sums[sum_of_normal[i]]));
  });
}

/// Moves vertices along their normals by the mean displacement of the adjacent corners.
void displace(Work& work, const SurfaceDesc& desc) {
  const size_t points = work.faces.vertex_count;
  std::vector<double> moves(points, 0.0), counts(points, 0.0);
  std::vector<Point> directions(points, Point{0, 0, 0});
  const uint32_t k = work.faces.size;
  each_corner(work.faces.corners.size(), points, [&](size_t c, size_t first, size_t end) {
    const uint32_t point = work.faces.corners[c];
    if (point < first || point >= end) return;
    const uint32_t base = work.faces.base[c / k];
    const int32_t which = desc.face_displacement.empty() ? 0 : desc.face_displacement[base];
    counts[point] += 1;
    directions[point] = directions[point] + point_at(work.normals, work.sectors[c]);
    if (which < 0) return;
    const size_t uv = work.uv_at.empty() ? 0 : 2 * size_t{work.uv_at[c]};
    const float u = work.uv_at.empty() ? 0 : work.uvs[uv];
    const float v = work.uv_at.empty() ? 0 : work.uvs[uv + 1];
    moves[point] += desc.displacements[static_cast<size_t>(which)].at(u, v);
  });
  parallel_bands(points, kBand, [&](size_t first, size_t end) {
    for (size_t i = first; i < end; ++i) {
      const Point& to = directions[i];
      if (counts[i] == 0 || !(dot_of(to, to) > 0)) continue;
      put(work.positions, i, point_at(work.positions, i) + unit(to) * (moves[i] / counts[i]));
    }
  });
}

/// Transforms points and normals by desc.matrix, in double precision.
void make_positions(Work& work, const SurfaceDesc& desc, bool& mirrored) {
  const std::array<double, 16>& m = desc.matrix;
  const Point x{m[0], m[1], m[2]}, y{m[4], m[5], m[6]}, z{m[8], m[9], m[10]},
      t{m[12], m[13], m[14]};
  // Rows of the cofactor matrix: det(M) times the inverse transpose.
  const Point cx = cross_of(y, z), cy = cross_of(z, x), cz = cross_of(x, y);
  mirrored = dot_of(x, cx) < 0;
  const double side = (mirrored ? -1 : 1) * (desc.left_handed ? -1 : 1);
  parallel_bands(work.positions.size() / 3, kBand, [&](size_t first, size_t end) {
    for (size_t i = first; i < end; ++i) {
      const Point p = point_at(work.positions, i);
      put(work.positions, i, x * p.x + y * p.y + z * p.z + t);
    }
  });
  parallel_bands(work.normals.size() / 3, kBand, [&](size_t first, size_t end) {
    for (size_t i = first; i < end; ++i) {
      const Point n = point_at(work.normals, i) * side;
      put(work.normals, i, unit(cx * n.x + cy * n.y + cz * n.z));
    }
  });
}

double distance2(const std::vector<float>& positions, uint32_t a, uint32_t b) {
  const Point d = point_at(positions, a) - point_at(positions, b);
  return dot_of(d, d);
}

/// Writes the triangles. Each combination of normal and texture coordinate at a vertex becomes a
/// point. If `origins` is not null, it receives, for each triangle corner, the index of the same
/// corner in `work`.
void emit(const Work& work, bool reversed, SurfaceMesh& mesh, std::vector<uint32_t>* origins) {
  const uint32_t k = work.faces.size;
  const size_t corners = work.faces.corners.size();
  constexpr uint32_t kEnd = ~0u;
  // For each normal, a linked list of the points created so far.
  std::vector<uint32_t> first(work.normals.size() / 3, kEnd), next, point, uv_of, normal_of;
  std::vector<uint32_t> ids(corners);
  for (size_t c = 0; c < corners; ++c) {
    const uint32_t uv = work.uv_at.empty() ? 0 : work.uv_at[c];
    uint32_t* link = &first[work.sectors[c]];
    while (*link != kEnd && uv_of[*link] != uv) link = &next[*link];
    if (*link == kEnd) {
      // Write through `link` before `next` is resized, since `link` may point into `next`.
      const auto id = static_cast<uint32_t>(point.size());
      *link = id;
      next.push_back(kEnd);
      point.push_back(work.faces.corners[c]);
      uv_of.push_back(uv);
      normal_of.push_back(work.sectors[c]);
      ids[c] = id;
    } else {
      ids[c] = *link;
    }
  }
  mesh.positions.resize(3 * point.size());
  mesh.normals.resize(3 * point.size());
  if (!work.uv_at.empty()) mesh.uvs.resize(2 * point.size());
  parallel_bands(point.size(), kBand, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      std::copy_n(&work.positions[3 * size_t{point[i]}], 3, &mesh.positions[3 * i]);
      std::copy_n(&work.normals[3 * size_t{normal_of[i]}], 3, &mesh.normals[3 * i]);
      if (!work.uv_at.empty()) std::copy_n(&work.uvs[2 * size_t{uv_of[i]}], 2, &mesh.uvs[2 * i]);
    }
  });
  const size_t triangles = (k - 2) * work.faces.count();
  mesh.triangles.resize(3 * triangles);
  mesh.faces.resize(triangles);
  if (origins != nullptr) origins->resize(3 * triangles);
  const auto set = [&](size_t triangle, size_t at, std::array<uint32_t, 3> of) {
    if (reversed) std::swap(of[1], of[2]);
    for (size_t i = 0; i < 3; ++i) {
      mesh.triangles[3 * triangle + i] = ids[at + of[i]];
      if (origins != nullptr) (*origins)[3 * triangle + i] = static_cast<uint32_t>(at + of[i]);
    }
    mesh.faces[triangle] = work.faces.base[at / k];
  };
  parallel_bands(work.faces.count(), kBand, [&](size_t begin, size_t end) {
    for (size_t f = begin; f < end; ++f) {
      const size_t at = f * k;
      if (k == 3) {
        set(f, at, {0, 1, 2});
        continue;
      }
      const uint32_t* q = &work.faces.corners[at];
      // Use the shorter diagonal, with a tolerance for rounding.
      const bool is_other =
          distance2(work.positions, q[1], q[3]) < 0.98 * distance2(work.positions, q[0], q[2]);
      set(2 * f, at, {0, 1, is_other ? 3u : 2u});
      set(2 * f + 1, at, {is_other ? 1u : 0u, 2, 3});
    }
  });
}

/// Primvar on the refined faces: a list of values, and the index into this list for each corner.
struct Spread {
  std::vector<float> values;
  std::vector<uint32_t> at;
};

Spread spread(const SurfacePrimvar& primvar, const Subdivision& surface,
              const RefinedFaces& faces) {
  switch (primvar.kind) {
    case PrimvarKind::kVertex:
      return {surface.vertex(primvar.values, primvar.width), faces.corners};
    case PrimvarKind::kVarying:
      return {surface.varying(primvar.values, primvar.width), faces.corners};
    case PrimvarKind::kFaceVarying:
      return {surface.face_varying(primvar.channel, primvar.values, primvar.width),
              surface.face_varying_corners(primvar.channel)};
    case PrimvarKind::kNone:
      break;
  }
  return {};
}

/// Returns the values of a primvar at the corners of a surface that is triangulated but not
/// subdivided.
Spread spread_polygons(const SurfacePrimvar& primvar, const RefinedFaces& faces) {
  Spread out{{primvar.values.begin(), primvar.values.end()}, faces.corners};
  if (primvar.kind == PrimvarKind::kFaceVarying) std::iota(out.at.begin(), out.at.end(), 0u);
  size_t used = 0;
  for (const uint32_t i : out.at) used = std::max(used, (size_t{i} + 1) * primvar.width);
  if (used > out.values.size()) check_count("components of a primvar", out.values.size(), used);
  return out;
}

/// Transfers a primvar from the refined faces to the triangles. `origins` holds, for each triangle
/// corner, the index of the same corner of the refined faces.
SurfaceValues on_triangles(const Spread& spread, uint32_t width,
                           const std::vector<uint32_t>& origins, const SurfaceMesh& mesh) {
  SurfaceValues out;
  const auto value_at = [&](size_t corner) {
    return &spread.values[size_t{spread.at[origins[corner]]} * width];
  };
  constexpr uint32_t kNone = ~0u;
  std::vector<uint32_t> first(mesh.positions.size() / 3, kNone);
  out.values.resize(first.size() * width);
  for (size_t c = 0; c < origins.size(); ++c) {
    const uint32_t point = mesh.triangles[c];
    const float* const here = value_at(c);
    float* const target = &out.values[size_t{point} * width];
    if (first[point] == kNone) {
      first[point] = static_cast<uint32_t>(c);
      std::copy_n(here, width, target);
    } else if (!std::equal(here, here + width, target)) {
      out.per_corner = true;
      break;
    }
  }
  if (!out.per_corner) return out;
  out.values.resize(origins.size() * width);
  for (size_t c = 0; c < origins.size(); ++c)
    std::copy_n(value_at(c), width, &out.values[c * width]);
  return out;
}

void check_displacement(const SurfaceDesc& desc) {
  if (desc.displacements.empty()) return;
  if (!desc.face_displacement.empty())
    check_count("displacements of faces", desc.face_displacement.size(),
                desc.cage.face_sizes.size());
  for (const int32_t which : desc.face_displacement)
    if (which >= static_cast<int32_t>(desc.displacements.size()))
      throw Error("a face refers to a displacement that does not exist");
}

/// Prepares polygons that are displaced but not subdivided.
Work polygons(const SurfaceDesc& desc) {
  Work work;
  work.faces.size = 3;
  work.faces.vertex_count = desc.cage.vertex_count;
  work.faces.corners.assign(desc.triangles.begin(), desc.triangles.end());
  work.faces.base.assign(desc.triangle_faces.begin(), desc.triangle_faces.end());
  for (const uint32_t p : work.faces.corners)
    if (p >= desc.cage.vertex_count) throw Error("a face refers to a point that does not exist");
  for (const uint32_t f : work.faces.base)
    if (f >= desc.cage.face_sizes.size())
      throw Error("a triangle refers to a face that does not exist");
  if (work.faces.corners.size() != 3 * work.faces.base.size())
    throw Error("its triangles and their face indices differ in number");
  work.positions.assign(desc.points.begin(), desc.points.end());
  work.sectors = work.faces.corners;
  work.uvs.assign(desc.uvs.values.begin(), desc.uvs.values.end());
  if (desc.uvs.kind == PrimvarKind::kFaceVarying)
    work.uv_at.assign(desc.triangle_corners.begin(), desc.triangle_corners.end());
  else if (desc.uvs.kind != PrimvarKind::kNone)
    work.uv_at = work.faces.corners;
  if (!work.uv_at.empty())
    check_count("indices of a face-varying primvar", work.uv_at.size(), work.faces.corners.size());
  for (const uint32_t i : work.uv_at)
    if (i >= work.uvs.size() / 2)
      throw Error("a corner refers to a texture coordinate that does not exist");
  set_normals(work, work.faces.vertex_count);
  return work;
}

}  // namespace

float Displacement::at(float u, float v) const {
  if (texture == nullptr) return constant;
  const float s = use.uv[0] * u + use.uv[1] * v + use.uv[2];
  const float t = use.uv[3] * u + use.uv[4] * v + use.uv[5];
  const Texel<float> texel = lookup<float>(*texture, s, t, 0.f, true);
  const float channels[] = {texel.r, texel.g, texel.b, texel.a};
  const uint32_t c = use.channel < 4 ? use.channel : 0;
  const float value = channels[c] * use.scale[c] + use.bias[c];
  return std::isfinite(value) ? value : 0.f;
}

SurfaceMesh make_surface(const SurfaceDesc& desc) {
  if (desc.points.size() != size_t{3} * desc.cage.vertex_count)
    throw Error("its points do not have three coordinates each");
  check_displacement(desc);
  SurfaceMesh mesh;
  Work work;
  std::vector<Spread> primvars(desc.primvars.size());
  size_t normal_count = desc.cage.vertex_count;
  if (desc.level == 0) {
    work = polygons(desc);
    for (size_t i = 0; i < primvars.size(); ++i)
      primvars[i] = spread_polygons(desc.primvars[i], work.faces);
  } else {
    const Subdivision surface(desc.cage, desc.level);
    mesh.is_manifold = surface.is_manifold();
    work.faces = surface.faces();
    if (work.faces.count() == 0) throw Error("no faces");
    uint32_t count = 0;
    work.sectors = surface.normal_sectors(work.faces, count);
    normal_count = count;
    // One thread evaluates the texture coordinates, while the other threads evaluate the points.
    parallel_bands(2, 1, [&](size_t task, size_t) {
      if (task == 0) {
        Spread uvs = spread(desc.uvs, surface, work.faces);
        work.uvs = std::move(uvs.values);
        work.uv_at = std::move(uvs.at);
        return;
      }
      // A bilinear limit surface has no derivatives at vertices.
      const bool has_normals = desc.cage.scheme != Scheme::kBilinear;
      work.positions = surface.vertex(desc.points, 3, has_normals ? &work.normals : nullptr);
    });
    parallel_bands(primvars.size(), 1, [&](size_t i, size_t) {
      primvars[i] = spread(desc.primvars[i], surface, work.faces);
    });
  }
  // Compute normals only after OpenSubdiv's tables have been released, to limit peak memory.
  if (desc.level > 0) set_normals(work, normal_count);
  if (!desc.displacements.empty()) {
    displace(work, desc);
    work.normals.clear();
    set_normals(work, normal_count);
  }
  bool mirrored = false;
  make_positions(work, desc, mirrored);
  std::vector<uint32_t> origins;
  emit(work, mirrored != desc.left_handed, mesh, primvars.empty() ? nullptr : &origins);
  mesh.primvars.resize(primvars.size());
  parallel_bands(primvars.size(), 1, [&](size_t i, size_t) {
    mesh.primvars[i] = on_triangles(primvars[i], desc.primvars[i].width, origins, mesh);
  });
  return mesh;
}

}  // namespace wavecomb
