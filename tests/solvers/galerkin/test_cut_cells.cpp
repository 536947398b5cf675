// Voronoi cells of a sprinkled body with a cut: what lies between nodes that do not see each other is lip.
#include "solvers/nodes/nodes.hpp"
#include "tests/support/cut_sheets.hpp"
#include "topology/cells/voronoi_cells.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

using namespace spherecut;
using namespace spherecut::solvers;
using namespace spherecut::tests;

namespace {

struct CutCells {
  NodeCloud nodes;
  std::shared_ptr<const topology::Incision> incision;
  topology::CellComplex cells;
};

CutCells cut_cells(const std::shared_ptr<const topology::Domain>& domain, topology::SurfaceMesh sheet, double h,
                   double coarse = 0) {
  SprinkleOptions options;
  options.spacing.fine = h;
  options.spacing.coarse = coarse > 0 ? coarse : h;
  options.ring_ahead = true;
  options.incision = std::make_shared<topology::Incision>(std::vector{std::move(sheet)}, domain);
  if (coarse > 0)
    options.spacing.segments = front_segments(*options.incision, 2 * h);
  CutCells cut{sprinkle(*domain, options).nodes, options.incision, {}};
  cut.cells = topology::voronoi_cells(cut.nodes.positions, cut.nodes.spacings, *domain, cut.incision.get());
  return cut;
}

double total(const std::vector<double>& values) {
  double sum = 0;
  for (double v : values)
    sum += v;
  return sum;
}

/// Cells close, partners share a lip, open faces are between nodes that see each other or, past the front, between two
/// that both see the face; lips are between others.
void check_cells(const CutCells& cut, double volume, double tolerance, bool flat = true) {
  const auto& [nodes, incision, cells] = cut;
  CHECK(cells.empty_cells == 0);
  CHECK(total(cells.volumes) == Approx(volume).epsilon(tolerance));
  std::vector<Vector3> sum(nodes.size(), Vector3::Zero());
  for (const topology::CellFace& face : cells.faces) {
    sum[face.first] += face.area;
    sum[face.second] -= face.area;
  }
  for (const topology::BoundaryFace& face : cells.boundary)
    sum[face.node] += face.area;
  for (const topology::LipFace& face : cells.lips)
    sum[face.node] += face.area;
  double worst = 0;
  for (int i = 0; i < nodes.size(); ++i)
    worst = std::max(worst, sum[i].norm() / (nodes.spacings[i] * nodes.spacings[i]));
  CHECK(worst < 1e-10);

  int wrong = 0, unshared = 0;
  for (const topology::CellFace& face : cells.faces)
    wrong += flat && incision->blocks(nodes.positions[face.first], nodes.positions[face.second]) &&
             (incision->blocks(nodes.positions[face.first], face.centroid) ||
              incision->blocks(nodes.positions[face.second], face.centroid));
  const std::vector<int> partners = lip_partners(nodes);
  std::vector<bool> shared(nodes.size(), false);
  REQUIRE(cells.lip_start.size() == cells.lips.size() / 2 + 1);
  for (std::size_t k = 0; k < cells.lips.size(); k += 2) {
    const topology::LipFace &one = cells.lips[k], &other = cells.lips[k + 1];
    wrong += !incision->blocks(nodes.positions[one.node], nodes.positions[one.beyond]);
    wrong += one.node != other.beyond || one.beyond != other.node || one.area != -other.area ||
             one.centroid != other.centroid;
    wrong += one.area.dot(nodes.positions[one.beyond] - nodes.positions[one.node]) <= 0;
    wrong += cells.lip_start[k / 2 + 1] - cells.lip_start[k / 2] < 3;
    if (partners[one.node] == one.beyond)
      shared[one.node] = shared[one.beyond] = true;
  }
  for (int i = 0; i < nodes.size(); ++i)
    unshared += nodes.kinds[i] == NodeKind::lip && !shared[i];
  CHECK(wrong == 0);
  CHECK(unshared == 0);
}

/// Area of the lips between partners and between others, on one side, m2; largest distance of the former's corners
/// from the plane of the sheet, in h.
struct LipArea {
  double partners = 0, others = 0, off_plane = 0;
};
LipArea lip_area(const CutCells& cut, const Vector3& on_sheet, const Vector3& normal) {
  LipArea area;
  const std::vector<int> partners = lip_partners(cut.nodes);
  for (std::size_t k = 0; k < cut.cells.lips.size(); k += 2) {
    const topology::LipFace& face = cut.cells.lips[k];
    const bool pair = partners[face.node] == face.beyond;
    (pair ? area.partners : area.others) += std::abs(face.area.dot(normal));
    for (int c = cut.cells.lip_start[k / 2]; pair && c < cut.cells.lip_start[k / 2 + 1]; ++c)
      area.off_plane = std::max(area.off_plane, std::abs((cut.cells.lip_corners[c] - on_sheet).dot(normal)) /
                                                    cut.nodes.spacings[face.node]);
  }
  return area;
}

} // namespace

TEST_CASE("Cells along an edge cut close, and their lips cover the sheet up to its front") {
  const auto domain = topology::make_box_domain({0, 0, 0}, {0.1, 0.08, 0.06}, 0.02);
  const Vector3 corner(-0.01, -0.01, 0.025), u(0.06, 0, 0.012), v(0, 0.1, 0.004);
  for (double h : {0.012, 0.008, 0.006}) {
    INFO("h " << h);
    const CutCells cut = cut_cells(domain, flat_sheet(corner, u, v, 5, 8), h);
    check_cells(cut, 0.1 * 0.08 * 0.06, 1e-10);
    const LipArea area = lip_area(cut, corner, u.cross(v).normalized());
    CHECK(area.off_plane < 1e-8);
    CHECK((area.partners + area.others) / cut.incision->area() == Approx(1).margin(0.002));
    CHECK(area.others < 0.02 * cut.incision->area());
  }
}

TEST_CASE("Cells about a tilted buried disc close, and their lips have its area") {
  const auto domain = topology::make_box_domain({0, 0, 0}, {0.1, 0.08, 0.06}, 0.02);
  const Vector3 centre(0.05, 0.04, 0.03), normal = Vector3(0.3, 0.2, 1).normalized();
  for (double h : {0.006, 0.004, 0.003}) {
    INFO("h " << h);
    const CutCells cut = cut_cells(domain, disc_sheet(centre, normal, 0.02, 4, 48), h, 3 * h);
    check_cells(cut, 0.1 * 0.08 * 0.06, 1e-10);
    const LipArea area = lip_area(cut, centre, normal);
    CHECK(area.off_plane < 1e-8);
    CHECK((area.partners + area.others) / cut.incision->area() == Approx(1).margin(h < 0.005 ? 0.005 : 0.015));
    CHECK(area.others < 0.02 * cut.incision->area());
  }
}

TEST_CASE("Cells of a severed block touch across the cut through lips alone") {
  const auto domain = topology::make_box_domain({0, 0, 0}, {0.1, 0.08, 0.06}, 0.02);
  const Vector3 corner(0.047, -0.01, -0.01), u(0.01, 0.1, 0), v(0.003, 0, 0.08);
  const CutCells cut = cut_cells(domain, flat_sheet(corner, u, v, 3, 3), 0.01);
  check_cells(cut, 0.1 * 0.08 * 0.06, 1e-10);
  const Vector3 normal = u.cross(v).normalized();
  const auto side = [&](int i) { return (cut.nodes.positions[i] - corner).dot(normal) > 0; };
  int across = 0, same = 0;
  for (const topology::CellFace& face : cut.cells.faces)
    across += side(face.first) != side(face.second);
  for (const topology::LipFace& face : cut.cells.lips)
    same += side(face.node) == side(face.beyond);
  CHECK(across == 0);
  CHECK(same == 0);
  const LipArea area = lip_area(cut, corner, normal);
  CHECK(area.partners + area.others == Approx(cut.incision->area()).epsilon(0.003));
  // The halves have the volumes on the two sides of the plane.
  double above = 0;
  for (int i = 0; i < cut.nodes.size(); ++i)
    above += side(i) ? cut.cells.volumes[i] : 0;
  const double middle_x = corner.x() + 0.1 * (0.05) + 0.0375 * 0.04; // of the cut, at the centre of the block
  const double right = 0.08 * 0.06 * (0.1 - middle_x);
  CHECK(above == Approx(normal.x() > 0 ? right : 0.1 * 0.08 * 0.06 - right).epsilon(3e-4));
}

TEST_CASE("Cells along a curved cut in a half ball close") {
  const auto domain = topology::make_hemisphere_domain(0.1, 0.01);
  const CutCells cut =
      cut_cells(domain,
                mapped_sheet(24, 12,
                             [](double s, double t) {
                               return Vector3(0.02 * std::sin(3 * t), -0.12 + 0.24 * s, 0.11 - 0.07 * t);
                             }),
                0.013);
  check_cells(cut, 2 * 3.14159265358979 / 3 * 1e-3, 0.01, false);
  double area = 0;
  for (const topology::LipFace& face : cut.cells.lips)
    area += 0.5 * face.area.norm();
  CHECK(area == Approx(cut.incision->area()).epsilon(0.08));
}
