#include "topology/wound/voxel_pieces.hpp"

#include "topology/base/errors.hpp"
#include "topology/incision/cut_sheets.hpp"
#include "topology/organ/organs.hpp"
#include "topology/wound/piece_audit.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>

using namespace spherecut;
using namespace spherecut::topology;

namespace {

struct Body {
  explicit Body(const SurfaceMesh& surface) : level_set(surface, 0.001), domain(make_organ_domain(surface)) {}
  LevelSet level_set;
  std::shared_ptr<const Domain> domain;

  [[nodiscard]] VoxelPieces cut(std::vector<SurfaceMesh> sheets) const {
    return count_pieces(level_set, Incision(std::move(sheets), domain));
  }
};

/// Half-open boxes of voxel centres tile a block exactly: 50 x 40 x 30 mm with voxels of 1 mm, shifted by 0.4 mm.
const Body& block_body() {
  static const Body body(make_block(Vector3(0.0004, 0.0004, 0.0004), Vector3(0.0504, 0.0404, 0.0304), 0.005));
  return body;
}

} // namespace

TEST_CASE("Whole, slit and severed bodies are counted by flooding voxels", "[voxel_pieces]") {
  const double volume = 0.05 * 0.04 * 0.03;
  const Vector3 normal = Vector3(1, 0.3, 0.2).normalized(), centre(0.0204, 0.0203, 0.0151);
  const VoxelPieces whole = block_body().cut({});
  REQUIRE(whole.volumes.size() == 1);
  CHECK(whole.volumes[0] == Approx(volume));
  // A buried disc and an edge cut leave one piece.
  CHECK(block_body().cut({make_disc_sheet(centre, normal, 0.01, 0.002)}).volumes.size() == 1);
  const Vector3 up(0, 0, 1);
  CHECK(block_body()
            .cut({make_rectangle_sheet(centre + Vector3(0, 0.01, 0), normal, up, 0.08, 0.06, 0.004)})
            .volumes.size() == 2);
  CHECK(block_body()
            .cut({make_rectangle_sheet(centre + Vector3(0, 0.015, 0), normal, up, 0.04, 0.06, 0.004)})
            .volumes.size() == 1);
  // Through: the volume left of the tilted plane through `centre` is that of a prism.
  const VoxelPieces halves = block_body().cut({make_rectangle_sheet(centre, normal, up, 0.08, 0.08, 0.004)});
  REQUIRE(halves.volumes.size() == 2);
  const Vector3 middle(0.0254, 0.0204, 0.0154); // of the block: at mean y and z the plane is at this x
  const double x = centre.x() - ((middle - centre).tail<2>().dot(normal.tail<2>())) / normal.x();
  const double left = (x - 0.0004) * 0.04 * 0.03;
  CHECK(halves.volumes[0] == Approx(volume - left).epsilon(0.01));
  CHECK(halves.volumes[1] == Approx(left).epsilon(0.01));
  CHECK(std::accumulate(halves.volumes.begin(), halves.volumes.end(), halves.crumbs) == Approx(volume));
  // Two crossing cuts leave four pieces.
  const Vector3 across = normal.cross(up).normalized();
  CHECK(block_body()
            .cut({make_rectangle_sheet(centre, normal, up, 0.09, 0.09, 0.004),
                  make_rectangle_sheet(centre, across, up, 0.09, 0.09, 0.004)})
            .volumes.size() == 4);
  // A closed sheet sets its inside free.
  const SurfaceMesh bubble = make_block(Vector3(0.0151, 0.0152, 0.0103), Vector3(0.0252, 0.0254, 0.0207), 0.002);
  const VoxelPieces freed = block_body().cut({bubble});
  REQUIRE(freed.volumes.size() == 2);
  CHECK(freed.volumes[1] == Approx(std::abs(topology::volume(bubble))).epsilon(0.08));
}

TEST_CASE("A bridge of two voxels beside a cut keeps the halves one piece", "[voxel_pieces]") {
  // The sheet ends 2.5 mm before the far side of the block.
  const SurfaceMesh sheet =
      make_rectangle_sheet(Vector3(0.0253, 0.0129, 0.0152), Vector3(1, 0, 0), Vector3(0, 0, 1), 0.05, 0.05, 0.004);
  double far = 0;
  for (const Vector3& x : sheet.vertices)
    far = std::max(far, x.y());
  CHECK(0.0404 - far == Approx(0.0025));
  CHECK(block_body().cut({sheet}).volumes.size() == 1);
}

TEST_CASE("A liver cut across is two pieces whose volumes add up to it", "[voxel_pieces]") {
  const SurfaceMesh surface = make_liver(5000);
  const Body liver(surface);
  const VoxelPieces whole = liver.cut({});
  REQUIRE(whole.volumes.size() == 1);
  CHECK(whole.volumes[0] == Approx(volume(surface)).epsilon(2e-3));
  const VoxelPieces halves =
      liver.cut({make_rectangle_sheet(Vector3(0.01, 0, 0), Vector3(1, 0.4, 0.1), Vector3(0, 0, 1), 0.3, 0.3, 0.005)});
  REQUIRE(halves.volumes.size() == 2);
  CHECK(halves.volumes[0] + halves.volumes[1] + halves.crumbs == Approx(whole.volumes[0]));
  CHECK(halves.volumes[1] > 0.2 * whole.volumes[0]);
}

TEST_CASE("Wound, CGAL and voxels agree on pieces, Euler characteristics and surfaces", "[voxel_pieces]") {
  struct Scene {
    SurfaceMesh organ;
    double voxel;
    std::vector<SurfaceMesh> sheets;
    std::size_t pieces;
  };
  const Vector3 normal = Vector3(1, 0.3, 0.2).normalized(), centre(0.0204, 0.0203, 0.0151), up(0, 0, 1);
  const SurfaceMesh small = make_block(Vector3(0.0004, 0.0004, 0.0004), Vector3(0.0504, 0.0404, 0.0304), 0.005);
  const SurfaceMesh bubble = make_block(Vector3(0.0151, 0.0152, 0.0103), Vector3(0.0252, 0.0254, 0.0207), 0.002);
  const std::vector<Scene> scenes = {
      {small, 0.001, {}, 1},
      {small, 0.001, {make_disc_sheet(centre, normal, 0.01, 0.002)}, 1},
      {small, 0.001, {make_rectangle_sheet(centre, normal, up, 0.08, 0.08, 0.004)}, 2},
      {small,
       0.001,
       {make_rectangle_sheet(centre, normal, up, 0.09, 0.09, 0.004),
        make_rectangle_sheet(centre, normal.cross(up), up, 0.09, 0.09, 0.004)},
       4},
      {small, 0.001, {bubble}, 2},
      {make_liver(5000),
       0.002,
       {make_rectangle_sheet(Vector3(0.01, 0, 0), Vector3(1, 0.4, 0.1), Vector3(0, 0, 1), 0.3, 0.3, 0.005)},
       2}};
  for (std::size_t s = 0; s < scenes.size(); ++s) {
    const Scene& scene = scenes[s];
    INFO("scene " << s);
    const Wound wound = cut_surface(scene.organ, scene.sheets);
    CHECK(wound.pieces.size() == scene.pieces);
    CHECK(component_difference(wound).value_or("") == "");
    const auto domain = make_organ_domain(scene.organ);
    const VoxelPieces pieces =
        count_pieces(LevelSet(scene.organ, scene.voxel), Incision(scene.sheets, domain), 27, true);
    REQUIRE(pieces.volumes.size() == scene.pieces);
    CHECK(hausdorff_distance(wound, pieces, scene.voxel) <= scene.voxel);
  }
}

TEST_CASE("CGAL's count tells a wound whose numbers are wrong", "[voxel_pieces]") {
  const SurfaceMesh organ = make_block(Vector3(0, 0, 0), Vector3(0.05, 0.04, 0.03), 0.01);
  Wound wound = cut_surface(
      organ, {make_rectangle_sheet(Vector3(0.02, 0.02, 0.015), Vector3(1, 0.1, 0), Vector3(0, 0, 1), 0.1, 0.1, 0.01)});
  REQUIRE(wound.components.size() == 2);
  CHECK_FALSE(component_difference(wound));
  wound.components[1].euler += 1;
  CHECK(component_difference(wound)->find("Euler characteristic 3") != std::string::npos);
  wound.components.pop_back();
  CHECK(component_difference(wound)->find("1 components, CGAL tells 2") != std::string::npos);
  SurfaceMesh open = organ;
  open.triangles.pop_back();
  CHECK_THROWS_AS(audit_components(open), InputError);
}
