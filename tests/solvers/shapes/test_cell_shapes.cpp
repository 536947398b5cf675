#include "solvers/shapes/cell_shapes.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

double uniform(std::mt19937_64& random, double from, double to) {
  return std::uniform_real_distribution<double>(from, to)(random);
}

/// A cube of edge 1 m with a curved sheet that ends inside it, and jittered nodes with pairs on the faces.
struct CurvedCut {
  std::shared_ptr<const topology::Incision> incision;
  std::vector<Vector3> centres;
  std::vector<double> spacings;

  explicit CurvedCut(std::mt19937_64& random) {
    constexpr int divisions = 7, pieces = 18;
    constexpr double h = 1.0 / divisions;
    const double bend = uniform(random, -0.5, 0.5), twist = uniform(random, -0.5, 0.5), end = uniform(random, 0, 0.2);
    const double level = uniform(random, -0.05, 0.05), wave = uniform(random, 0, 0.03);
    const auto height = [&](double x, double y) {
      return level + bend * x * x + twist * x * y + wave * std::sin(9 * y);
    };
    topology::SurfaceMesh sheet;
    for (int i = 0; i <= pieces; ++i)
      for (int k = 0; k <= pieces; ++k) {
        const double y = 1.3 * k / pieces - 0.65, x = -0.65 + (end + 0.05 * std::sin(5 * y) + 0.65) * i / pieces;
        sheet.vertices.emplace_back(x, y, height(x, y));
      }
    for (int i = 0; i < pieces; ++i)
      for (int k = 0; k < pieces; ++k) {
        const int a = i * (pieces + 1) + k, b = a + pieces + 1;
        sheet.triangles.push_back({a, b, a + 1});
        sheet.triangles.push_back({a + 1, b, b + 1});
      }
    incision = std::make_shared<topology::Incision>(
        std::vector<topology::SurfaceMesh>{sheet},
        topology::make_box_domain(Vector3::Constant(-0.5), Vector3::Constant(0.5), h));
    const auto add = [&](const Vector3& x) {
      centres.push_back(x);
      spacings.push_back(h * uniform(random, 0.9, 1.1));
    };
    for (int a = 0; a <= divisions; ++a)
      for (int b = 0; b <= divisions; ++b)
        for (int c = 0; c <= divisions; ++c) {
          Vector3 x = h * Vector3(a, b, c) - Vector3::Constant(0.5);
          for (int axis = 0; axis < 3; ++axis)
            if (std::abs(x[axis]) < 0.49)
              x[axis] += uniform(random, -0.2 * h, 0.2 * h);
          const auto face = incision->closest(x, 0.3 * h);
          if (!face) {
            add(x);
          } else if (!face->on_border && face->point.cwiseAbs().maxCoeff() < 0.5) {
            add(face->point + lip_offset * h * face->normal);
            add(face->point - lip_offset * h * face->normal);
          }
        }
  }
};

} // namespace

TEST_CASE("Cells about curved cuts have the nodes and gradients that their points have one by one", "[cell_shapes]") {
  const SightRule rule = GENERATE(SightRule::visibility, SightRule::diffraction, SightRule::enriched);
  std::mt19937_64 random(17);
  int cells = 0, mixed = 0;
  double worst = 0;
  for (int body = 0; body < 4; ++body) {
    const CurvedCut cut(random);
    const Spheres spheres(cut.centres, cut.spacings, 2.0, Basis::linear, 1e9, {cut.incision, rule});
    CellEvaluator evaluator(spheres);
    CellShapes cell;
    ShapeFunctions shape;
    CellView view;
    for (int trial = 0; trial < 300; ++trial) {
      // Gauss points of a box, in some cells not all of them, on one side of the sheet or on both.
      const Vector3 centre(uniform(random, -0.4, 0.4), uniform(random, -0.4, 0.4), uniform(random, -0.35, 0.35));
      const double half = uniform(random, 0.005, 0.05);
      std::vector<QuadraturePoint> points;
      const bool all = uniform(random, 0, 1) < 0.7;
      for (int corner = 0; corner < 8; ++corner)
        if (all || corner == 0 || uniform(random, 0, 1) < 0.6) {
          const Vector3 x = centre + half * Vector3((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                                                    (corner & 4) != 0 ? 1 : -1);
          points.push_back({x, uniform(random, 0.5, 2)});
        }
      // Now and then a point on the sheet itself.
      if (trial % 10 == 0)
        if (const auto face = cut.incision->closest(centre, 0.2))
          points.push_back({face->point, 1});
      evaluator.evaluate(points, cell);
      REQUIRE(cell.points == std::ssize(points));
      REQUIRE(std::is_sorted(cell.nodes.begin(), cell.nodes.end()));
      std::size_t supports = 0, reached = 0;
      for (int q = 0; q < cell.points; ++q) {
        REQUIRE(evaluate(spheres, points[q].position, shape));
        double largest = 0;
        for (int k = 0; k < shape.size(); ++k)
          largest = std::max(largest, shape.gradient(k).norm());
        for (int k = 0; k < shape.size(); ++k) {
          const auto found = std::lower_bound(cell.nodes.begin(), cell.nodes.end(), shape.nodes[k]);
          REQUIRE((found != cell.nodes.end() && *found == shape.nodes[k]));
          const auto place = static_cast<std::size_t>(found - cell.nodes.begin());
          REQUIRE((cell.reached[place] >> q & 1) != 0);
          const Vector3 expected = std::sqrt(points[q].weight) * shape.gradient(k);
          worst = std::max(worst, (cell.gradient(place, q) - expected).norm() / largest);
        }
        supports += static_cast<std::size_t>(shape.size());
      }
      for (std::size_t k = 0; k < cell.nodes.size(); ++k) {
        CHECK(cell.reached[k] != 0);
        for (int q = 0; q < cell.points; ++q)
          if ((cell.reached[k] >> q & 1) != 0)
            ++reached;
          else
            REQUIRE(cell.gradient(k, q).isZero(0));
      }
      REQUIRE(reached == supports);

      // Sight itself: nodes hidden from some points of the cell and not from others.
      std::vector<int> nodes;
      std::vector<std::uint32_t> holds;
      for (int j = 0; j < spheres.size(); ++j) {
        std::uint32_t bits = 0;
        for (int q = 0; q < cell.points; ++q)
          if ((spheres.centres()[j] - points[q].position).norm() < spheres.radii()[j])
            bits |= std::uint32_t{1} << q;
        if (bits != 0) {
          nodes.push_back(j);
          holds.push_back(bits);
        }
      }
      spheres.cut()->look(points, nodes, holds, view);
      bool some = false;
      for (std::size_t k = 0; k < nodes.size(); ++k)
        some = some || (view.hidden[k] != 0 && view.hidden[k] != holds[k]);
      mixed += some ? 1 : 0;
      ++cells;
    }
  }
  INFO(mixed << " of " << cells << " cells have nodes that some of their points see");
  CHECK(mixed > cells / 10);
  CHECK(worst < 1e-9);
}
