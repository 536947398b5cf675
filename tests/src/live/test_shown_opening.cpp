// The opening that is told is that of the picture.
#include "src/live/shown_opening.hpp"
#include "topology/incision/cut_sheets.hpp"
#include "topology/organ/organs.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <utility>

using namespace spherecut;
using namespace spherecut::app;

TEST_CASE("The opening of a picture is how far its faces are apart along their normal, and the volume between them") {
  const Vector3 normal = Vector3(1, 0.2, -0.1).normalized();
  const topology::SurfaceMesh sheet =
      topology::make_rectangle_sheet({0.003, 0, 0.015}, normal, Vector3::UnitZ(), 0.2, 0.2, 0.01);
  const topology::Wound wound = topology::cut_surface(topology::make_block({0.06, 0.06, 0.03}, 0.006), {sheet});
  REQUIRE(wound.pieces.size() == 2);
  ViewerTopology surface;
  for (const Vector3& x : wound.surface.vertices)
    surface.vertices.emplace_back(x.cast<float>());
  surface.triangles = wound.surface.triangles;
  surface.parts = wound.part;
  for (const topology::LipPair& pair : topology::lip_pairs(wound))
    surface.lip_pairs.push_back({pair.plus, pair.minus});
  double area = 0;
  int plus = -1; // piece on the + side
  for (std::size_t t = 0; t < wound.part.size(); ++t)
    if (wound.part[t] == topology::WoundPart::wall_plus) {
      const Triangle& corners = wound.surface.triangles[t];
      const std::vector<Vector3>& x = wound.surface.vertices;
      area += 0.5 * (x[corners[1]] - x[corners[0]]).cross(x[corners[2]] - x[corners[0]]).norm();
      plus = wound.piece_of(static_cast<int>(t));
    }
  REQUIRE(area > 1.7e-3);
  const Vector3 along = normal.cross(Vector3::UnitY()).normalized();
  const double gap = GENERATE(0.0, 0.002, -0.001); // m; negative: the faces have gone through each other
  CAPTURE(gap);
  std::vector<Eigen::Vector3f> deformed = surface.vertices;
  std::vector<char> moved(deformed.size(), 0);
  for (std::size_t t = 0; t < surface.triangles.size(); ++t)
    if (wound.piece_of(static_cast<int>(t)) == plus)
      for (const int vertex : surface.triangles[t])
        if (std::exchange(moved[static_cast<std::size_t>(vertex)], 1) == 0)
          deformed[static_cast<std::size_t>(vertex)] += (gap * normal + 0.003 * along).cast<float>();
  const ShownOpening open = shown_opening(surface, deformed);
  CHECK(open.largest == Approx(std::max(gap, 0.0)).margin(1e-6));
  CHECK(open.volume == Approx(gap * area).margin(1e-9));
}
