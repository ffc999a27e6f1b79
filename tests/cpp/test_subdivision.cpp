// SPDX-License-Identifier: Apache-2.0
#include "wavecomb/geometry/tessellation/subdivision.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <numeric>
#include <set>

#include "wavecomb/core/error.h"
#include "wavecomb/geometry/tessellation/screen_size.h"
#include "wavecomb/geometry/tessellation/tessellation.h"
#include "wavecomb/scene/parallel.h"

namespace wavecomb {
namespace {

const std::vector<float> kCube = {-1, -1, -1, 1, -1, -1, -1, 1, -1, 1, 1, -1,
                                  -1, -1, 1,  1, -1, 1,  -1, 1, 1,  1, 1, 1};
const std::vector<int32_t> kSizes(6, 4);
const std::vector<int32_t> kCorners = {0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4,
                                       2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5};

SurfaceDesc cube(uint32_t level) {
  SurfaceDesc desc;
  desc.level = level;
  desc.points = kCube;
  desc.cage.vertex_count = 8;
  desc.cage.face_sizes = kSizes;
  desc.cage.corners = kCorners;
  return desc;
}

TEST(Subdivision, CountsOfEveryLevel) {
  for (uint32_t level = 1; level <= 4; ++level) {
    const SurfaceMesh mesh = make_surface(cube(level));
    const size_t quads = size_t{6} << (2 * level);
    EXPECT_EQ(mesh.faces.size(), 2 * quads);
    EXPECT_EQ(mesh.positions.size() / 3, quads + 2);  // Euler's formula
    EXPECT_EQ(mesh.normals.size(), mesh.positions.size());
  }
}

TEST(Subdivision, MovesNoPointOfASurfaceWhenItIsCutBySeams) {
  // Separate texture coordinates per face: points on face edges are duplicated.
  std::vector<int32_t> indices(24);
  std::vector<float> uvs(48);
  for (size_t i = 0; i < 24; ++i) {
    indices[i] = static_cast<int32_t>(i);
    uvs[2 * i] = static_cast<float>(i);
  }
  SurfaceDesc desc = cube(3);
  desc.cage.channels.push_back({indices, 24});
  desc.uvs = {PrimvarKind::kFaceVarying, uvs, 2, 0};
  const auto places = [](const SurfaceMesh& mesh) {
    std::set<std::array<float, 3>> out;
    for (size_t i = 0; i < mesh.positions.size(); i += 3)
      out.insert({mesh.positions[i], mesh.positions[i + 1], mesh.positions[i + 2]});
    return out;
  };
  const SurfaceMesh cut = make_surface(desc), whole = make_surface(cube(3));
  EXPECT_EQ(places(cut), places(whole));
  EXPECT_EQ(cut.positions.size() / 3, size_t{6 * 81});
}

TEST(Subdivision, DisplacementOfOneFaceIsSharedAtItsEdges) {
  SurfaceDesc desc = cube(2);
  const std::vector<int32_t> which = {-1, 0, -1, -1, -1, -1};
  desc.displacements.push_back({.constant = 0.5f, .use = {}, .texture = nullptr});
  desc.face_displacement = which;
  const SurfaceMesh moved = make_surface(desc), still = make_surface(cube(2));
  for (size_t i = 0; i < moved.positions.size(); i += 3) {
    double square = 0;
    for (size_t k = 0; k < 3; ++k)
      square += std::pow(double{moved.positions[i + k]} - still.positions[i + k], 2);
    const double distance = std::sqrt(square);
    // Each point moves by a fraction of the displacement: the fraction of adjacent faces that are
    // displaced, a half at edges and a third at corners, or 0 or 1.
    double nearest = 1;
    for (const double share : {0.0, 1.0 / 3, 0.5, 1.0})
      nearest = std::min(nearest, std::abs(distance - 0.5 * share));
    EXPECT_LT(nearest, 1e-5);
  }
}

std::string complaint(const SurfaceDesc& desc) {
  try {
    make_surface(desc);
  } catch (const Error& error) {
    return error.what();
  }
  return "none";
}

TEST(Subdivision, RefusesWhatCannotBeSubdivided) {
  SurfaceDesc desc = cube(1);
  std::vector<int32_t> corners = kCorners;
  desc.cage.corners = corners;
  corners[3] = 8;
  EXPECT_EQ(complaint(desc), "a face refers to a point that does not exist");
  corners[3] = -1;
  EXPECT_EQ(complaint(desc), "a face refers to a point that does not exist");
  corners[3] = corners[0];
  EXPECT_EQ(complaint(desc), "a face uses a point twice");
  desc = cube(1);
  desc.cage.scheme = Scheme::kLoop;
  EXPECT_EQ(complaint(desc), "Loop subdivision needs triangles, but a face is not a triangle");
  desc = cube(1);
  std::vector<int32_t> sizes = kSizes;
  desc.cage.face_sizes = sizes;
  sizes[0] = 2;
  EXPECT_EQ(complaint(desc), "a face has fewer than three corners");
  sizes[0] = 2000000000;
  EXPECT_EQ(complaint(desc), "the face counts add up to 2000000020, but there are 24 face indices");
  desc = cube(1);
  const std::vector<float> values(30);
  desc.primvars = {{PrimvarKind::kVertex, values, 3, 0}};
  EXPECT_EQ(complaint(desc),
            "the wrong number of components of a primvar, 30 where the mesh needs 24");
  const std::vector<int32_t> edges = {0, 1, 1, 2};
  const std::vector<float> sharpness = {2};
  desc = cube(1);
  desc.cage.crease_edges = edges;
  desc.cage.crease_sharpness = sharpness;
  EXPECT_EQ(complaint(desc),
            "the wrong number of sharpnesses of creased edges, 1 where the mesh needs 2");
  desc = cube(11);
  EXPECT_EQ(complaint(desc), "the level of subdivision must be 1 to 10");
  desc = cube(10);
  std::vector<int32_t> many(2048 / 24 * kCorners.size()), many_sizes(many.size() / 4, 4);
  for (size_t i = 0; i < many.size(); ++i) many[i] = kCorners[i % kCorners.size()];
  many.insert(many.end(), kCorners.begin(), kCorners.end());
  many_sizes.insert(many_sizes.end(), kSizes.begin(), kSizes.end());
  desc.cage.corners = many;
  desc.cage.face_sizes = many_sizes;
  EXPECT_EQ(complaint(desc), "too many faces for level 10");
  desc = cube(0);
  const std::vector<uint32_t> triangle = {0, 1, 9}, face = {0};
  desc.triangles = triangle;
  desc.triangle_faces = face;
  EXPECT_EQ(complaint(desc), "a face refers to a point that does not exist");
}

TEST(Subdivision, ManyFacesOnOneEdgeAreKeptSharp) {
  // Five quads that share an edge, like pages of a book.
  SurfaceDesc desc;
  std::vector<float> points = {0, 0, 0, 0, 0, 1};
  std::vector<int32_t> corners;
  for (int page = 0; page < 5; ++page) {
    const float x = std::cos(static_cast<float>(page)), y = std::sin(static_cast<float>(page));
    points.insert(points.end(), {x, y, 0, x, y, 1});
    corners.insert(corners.end(), {0, 2 * page + 2, 2 * page + 3, 1});
  }
  const std::vector<int32_t> sizes(5, 4);
  desc.level = 3;
  desc.points = points;
  desc.cage.vertex_count = 12;
  desc.cage.face_sizes = sizes;
  desc.cage.corners = corners;
  const SurfaceMesh mesh = make_surface(desc);
  EXPECT_FALSE(mesh.is_manifold);
  EXPECT_EQ(mesh.faces.size(), size_t{5 * 128});
  for (size_t i = 0; i < mesh.normals.size(); i += 3) {
    EXPECT_NEAR(std::hypot(mesh.normals[i], mesh.normals[i + 1], mesh.normals[i + 2]), 1.0, 1e-5);
    EXPECT_NEAR(mesh.normals[i + 2], 0.0, 1e-5);
  }
}

/// Returns the bits of all arrays of a mesh.
std::vector<uint32_t> bits_of(const SurfaceMesh& mesh) {
  std::vector<uint32_t> out;
  const auto add = [&](const auto& values) {
    out.push_back(static_cast<uint32_t>(values.size()));
    for (const auto value : values) out.push_back(std::bit_cast<uint32_t>(value));
  };
  add(mesh.positions), add(mesh.normals), add(mesh.uvs), add(mesh.triangles), add(mesh.faces);
  for (const SurfaceValues& primvar : mesh.primvars) add(primvar.values);
  return out;
}

TEST(Subdivision, ThreadsChangeNoBitOfOneMesh) {
  // 24,576 faces, in several bands of points, faces and corners.
  std::vector<int32_t> seams(24);
  std::iota(seams.begin(), seams.end(), 0);
  std::vector<float> uvs(48);
  for (size_t i = 0; i < uvs.size(); ++i) uvs[i] = static_cast<float>(i * i % 17) / 16;
  const std::vector<int32_t> hole = {2}, crease = {0, 1, 1, 3}, which = {-1, 0, 1, 0, 1, -1};
  const std::vector<float> sharpness = {10.f, 2.5f};
  const std::vector<int32_t> triangles = {0, 2, 1, 0, 3, 2, 0, 1, 3, 1, 2, 3}, sizes(4, 3);
  struct Case {
    const char* name;
    Scheme scheme;
    bool creased, holed, displaced;
  };
  for (const Case& c : {Case{"plain", Scheme::kCatmullClark, false, false, false},
                        Case{"creases and a hole", Scheme::kCatmullClark, true, true, false},
                        Case{"displaced", Scheme::kCatmullClark, false, true, true},
                        Case{"bilinear", Scheme::kBilinear, false, false, false},
                        Case{"Loop", Scheme::kLoop, false, false, false}}) {
    SurfaceDesc desc = cube(6);
    desc.cage.scheme = c.scheme;
    desc.matrix = {0.7, 0.1, 0, 0, -0.1, 0.9, 0.3, 0, 0, 0.2, -1.1, 0, 1, 2, 3, 1};
    if (c.scheme == Scheme::kLoop) {
      desc.cage.face_sizes = sizes;
      desc.cage.corners = triangles;
      desc.level = 7;
    } else {
      desc.cage.channels.push_back({seams, 24});
      desc.uvs = {PrimvarKind::kFaceVarying, uvs, 2, 0};
    }
    if (c.creased) desc.cage.crease_edges = crease, desc.cage.crease_sharpness = sharpness;
    if (c.holed) desc.cage.holes = hole;
    if (c.displaced) {
      desc.displacements.resize(2);
      desc.displacements[0].constant = 0.1f;
      desc.displacements[1].constant = -0.03f;
      desc.face_displacement = which;
    }
    desc.primvars.push_back({PrimvarKind::kVertex, desc.points, 3, 0});
    desc.primvars.push_back({PrimvarKind::kVarying, std::span(uvs).first(8), 1, 0});
    std::vector<uint32_t> first;
    for (const uint32_t threads : {1u, 2u, 5u}) {
      SurfaceMesh mesh;
      with_threads(threads, [&] { mesh = make_surface(desc); });
      const std::vector<uint32_t> bits = bits_of(mesh);
      if (threads == 1) first = bits;
      EXPECT_GT(mesh.faces.size(), 24000u) << c.name;
      EXPECT_TRUE(bits == first) << c.name << " by " << threads << " threads";
    }
  }
}

TEST(EdgePixels, OfASquareBeforeTheCamera) {
  const std::vector<float> square = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0};
  const std::vector<int32_t> sizes = {4}, corners = {0, 1, 2, 3};
  ScreenView view{};
  for (size_t i = 0; i < 16; i += 5) view.to_camera[i] = 1;
  view.half[0] = view.half[1] = 0.5;
  view.pixels = 100;
  std::array<double, 16> placed = view.to_camera;
  placed[14] = -100;
  // Edges of length 2, with midpoints at a distance of sqrt(100^2 + 1).
  const double seen = edge_pixels(square, sizes, corners, placed.data(), view);
  EXPECT_NEAR(seen, 2 * 100 / std::sqrt(10001.0), 1e-9);
  placed[14] = 100;
  EXPECT_NEAR(edge_pixels(square, sizes, corners, placed.data(), view), seen / 8, 1e-9);
  // In an orthographic camera, the size in pixels does not depend on the distance. A camera that
  // sees all directions refines surfaces behind it as well.
  view.is_parallel = true;
  view.half[0] = view.half[1] = 2;
  placed[14] = -1000;
  EXPECT_NEAR(edge_pixels(square, sizes, corners, placed.data(), view), 200, 1e-9);
  view.is_parallel = false;
  view.is_all_round = true;
  placed[14] = 100;
  EXPECT_NEAR(edge_pixels(square, sizes, corners, placed.data(), view), seen, 1e-9);
  view.is_all_round = false;
  // If a quad surrounds the camera, its size stays finite.
  placed[14] = 0;
  EXPECT_LE(edge_pixels(square, sizes, corners, placed.data(), view), 200.0);
}

}  // namespace
}  // namespace wavecomb
