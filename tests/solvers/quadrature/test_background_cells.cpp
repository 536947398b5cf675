#include "solvers/quadrature/background_cells.hpp"

#include "solvers/quadrature/box_memory.hpp"
#include "topology/base/errors.hpp"
#include "topology/incision/cut_sheets.hpp"
#include "topology/incision/incision.hpp"
#include "topology/organ/organs.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

using namespace spherecut;
using solvers::background_cells;
using solvers::BackgroundCells;
using solvers::BackgroundOptions;
using solvers::NodeCloud;
using solvers::NodeKind;

namespace {

/// Nodes in a box, `h` apart below the height `split`, `h / 3` above it.
NodeCloud graded_grid(const Vector3& lower, const Vector3& upper, double h, double split) {
  NodeCloud nodes;
  for (double step : {h, h / 3})
    for (double x = lower.x(); x < upper.x() + 0.1 * step; x += step)
      for (double y = lower.y(); y < upper.y() + 0.1 * step; y += step)
        for (double z = lower.z(); z < upper.z() + 0.1 * step; z += step)
          if ((z < split) == (step == h))
            nodes.add({x, y, z}, step, NodeKind::interior);
  return nodes;
}

template <typename Function>
double integral(const BackgroundCells& cells, Function&& function) {
  double sum = 0;
  for (const solvers::QuadraturePoint& point : cells.points)
    sum += point.weight * function(point.position);
  return sum;
}

double power_mean(double lower, double upper, int power) {
  return (std::pow(upper, power + 1) - std::pow(lower, power + 1)) / (power + 1);
}

} // namespace

TEST_CASE("Background cells integrate a box exactly, graded or not") {
  const Vector3 lower(-0.2, 0.1, 0), upper(0.8, 0.75, 0.5);
  const auto domain = topology::make_box_domain(lower, upper, 0.1);
  for (double split : {10.0, 0.3})
    for (int rule = 1; rule <= 3; ++rule)
      for (double size : {0.6, 1.0}) {
        const NodeCloud nodes = graded_grid(lower, upper, 0.15, split);
        const BackgroundCells cells = background_cells(*domain, nodes, {size, rule});
        REQUIRE(cells.start.back() == std::ssize(cells.points));
        CHECK(integral(cells, [](const Vector3&) { return 1.0; }) == Approx((upper - lower).prod()).epsilon(1e-11));
        int outside = 0;
        for (const solvers::QuadraturePoint& point : cells.points) {
          outside += !domain->bounds().contains(point.position) || point.weight <= 0;
        }
        CHECK(outside == 0);
        // Degree 2 rule - 1 in all; the one point and the Gauss points also its power in each direction.
        const int degree = 2 * rule - 1;
        for (int a = 0; a <= degree; ++a)
          for (int b = 0; b <= degree; ++b)
            for (int c = 0; c <= degree; ++c) {
              if (rule == 2 && a + b + c > degree)
                continue;
              const double exact = power_mean(lower.x(), upper.x(), a) * power_mean(lower.y(), upper.y(), b) *
                                   power_mean(lower.z(), upper.z(), c);
              CHECK(integral(cells, [&](const Vector3& x) {
                      return std::pow(x.x(), a) * std::pow(x.y(), b) * std::pow(x.z(), c);
                    }) == Approx(exact).epsilon(1e-11));
            }
      }
}

TEST_CASE("Background cells are as small as the local spacing asks") {
  const Vector3 lower(0, 0, 0), upper(0.9, 0.9, 0.9);
  const auto domain = topology::make_box_domain(lower, upper, 0.1);
  const NodeCloud nodes = graded_grid(lower, upper, 0.15, 0.45);
  const BackgroundCells cells = background_cells(*domain, nodes, {1.0, 1});
  for (const solvers::QuadraturePoint& point : cells.points) {
    const double edge = std::cbrt(point.weight);
    if (point.position.z() > 0.5)
      CHECK(edge < 1.61 * 0.05);
    else if (point.position.z() < 0.25)
      CHECK(edge > 0.09); // and no smaller than it need be
  }
}

TEST_CASE("Background cells of a half ball converge in volume and moments") {
  const auto domain = topology::make_hemisphere_domain(1, 0.1);
  std::vector<double> volume, height, inertia;
  for (double h : {0.4, 0.2, 0.1}) {
    NodeCloud nodes;
    nodes.add({0, 0, 0.5}, h, NodeKind::interior);
    const BackgroundCells cells = background_cells(*domain, nodes, {1.0, 2});
    volume.push_back(std::abs(integral(cells, [](const Vector3&) { return 1.0; }) / (2 * std::numbers::pi / 3) - 1));
    height.push_back(std::abs(integral(cells, [](const Vector3& x) { return x.z(); }) / (std::numbers::pi / 4) - 1));
    inertia.push_back(
        std::abs(integral(cells, [](const Vector3& x) { return x.squaredNorm(); }) / (2 * std::numbers::pi / 5) - 1));
    for (const solvers::QuadraturePoint& point : cells.points)
      CHECK(domain->signed_distance(point.position) < 0.05 * h);
  }
  for (const std::vector<double>* error : {&volume, &height, &inertia}) {
    CHECK(error->front() < 0.02);
    CHECK(error->back() < 0.002);
    CHECK(error->back() < 0.15 * error->front());
  }
}

TEST_CASE("Surface quadrature gives the area of the tessellation and closes") {
  for (const auto& [domain, exact] :
       {std::pair{topology::make_box_domain(Vector3::Zero(), Vector3(1, 2, 0.5), 0.3), 7.0},
        std::pair{topology::make_hemisphere_domain(1, 0.1), 3 * std::numbers::pi},
        std::pair{topology::make_cylinder_domain(0.5, 2, 0.1), 2.5 * std::numbers::pi}}) {
    NodeCloud nodes;
    nodes.add({0.2, 0.2, 0.2}, 0.4, NodeKind::surface);
    const std::vector<solvers::SurfacePoint> points = solvers::surface_quadrature(*domain, nodes);
    double area = 0, flux = 0, square = 0;
    Vector3 closure = Vector3::Zero();
    for (const solvers::SurfacePoint& point : points) {
      area += point.weight;
      closure += point.weight * point.normal;
      flux += point.weight * point.position.dot(point.normal) / 3;
      square += point.weight * point.normal.x() * point.position.x() * point.position.z();
    }
    CHECK(area == Approx(topology::area(domain->surface())).epsilon(1e-12));
    CHECK(area == Approx(exact).epsilon(0.004));
    CHECK(closure.norm() < 1e-12 * area);
    // Divergence theorem: x / 3 has divergence 1, (x z, 0, 0) has divergence z; the rule is exact for both.
    CHECK(flux == Approx(topology::volume(domain->surface())).epsilon(1e-12));
    double moment = 0;
    const topology::SurfaceMesh& mesh = domain->surface();
    for (const Triangle& t : mesh.triangles) {
      const Vector3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
      moment += a.dot(b.cross(c)) / 6 * (a.z() + b.z() + c.z()) / 4; // tetrahedra from the origin
    }
    CHECK(square == Approx(moment).epsilon(1e-10));
  }
}

TEST_CASE("Background cells refuse rules and sizes that do not exist") {
  const auto domain = topology::make_box_domain(Vector3::Zero(), Vector3::Ones(), 0.5);
  NodeCloud nodes;
  nodes.add({0.5, 0.5, 0.5}, 0.5, NodeKind::interior);
  for (int rule : {0, 4})
    CHECK_THROWS_AS(background_cells(*domain, nodes, {1.0, rule}), InputError);
  for (double size : {0.0, -1.0, std::nan("")})
    CHECK_THROWS_AS(background_cells(*domain, nodes, {size, 2}), InputError);
  CHECK_THROWS_AS(background_cells(*domain, NodeCloud{}, {1.0, 2}), InputError);
}

namespace {

/// A domain that counts how often it is asked for a distance.
class CountingDomain final : public topology::Domain {
 public:
  explicit CountingDomain(std::shared_ptr<const topology::Domain> domain) : domain_(std::move(domain)) {}
  double signed_distance(const Vector3& x) const override {
    ++asked;
    return domain_->signed_distance(x);
  }
  double curved_distance(const Vector3& x) const override { return domain_->curved_distance(x); }
  Vector3 curved_gradient(const Vector3& x) const override { return domain_->curved_gradient(x); }
  Vector3 normal(const Vector3& x) const override { return domain_->normal(x); }
  Vector3 closest_surface_point(const Vector3& x) const override { return domain_->closest_surface_point(x); }
  const std::vector<Plane>& planes() const override { return domain_->planes(); }
  const topology::SurfaceMesh& surface() const override { return domain_->surface(); }
  BoundingBox bounds() const override { return domain_->bounds(); }

  mutable int asked = 0;

 private:
  std::shared_ptr<const topology::Domain> domain_;
};

bool same(const BackgroundCells& a, const BackgroundCells& b) {
  if (a.start != b.start || a.points.size() != b.points.size() || a.boxes.size() != b.boxes.size())
    return false;
  for (std::size_t k = 0; k < a.points.size(); ++k)
    if (a.points[k].position != b.points[k].position || a.points[k].weight != b.points[k].weight)
      return false;
  return true;
}

} // namespace

TEST_CASE("Remembered boxes are those that would be made, whatever body came before") {
  const auto organ = topology::make_hemisphere_domain(1, 0.1);
  const auto domain = std::make_shared<const CountingDomain>(organ);
  const NodeCloud nodes = graded_grid({-1, -1, 0}, {1, 1, 1}, 0.3, 0.6),
                  others = graded_grid({-1, -1, 0}, {1, 1, 1}, 0.3, 0.5);
  const auto cut_to = [&](double depth) {
    return std::make_shared<const topology::Incision>(
        std::vector{
            topology::make_rectangle_sheet({0.1, 0.03, 1.1 - depth / 2}, {0.1, 1, 0.05}, {0, -0.05, 1}, 1, depth, 0.1)},
        organ, 1);
  };
  const auto shallow = cut_to(0.4), deep = cut_to(0.7);
  solvers::BoxMemory memory;
  const auto made = [&](const NodeCloud& of, const topology::Incision* incision, bool remembers, int& asked) {
    const int before = domain->asked;
    BackgroundCells cells =
        remembers ? background_cells(*domain, of, {}, incision, memory) : background_cells(*domain, of, {}, incision);
    asked = domain->asked - before;
    return cells;
  };
  int with = 0, without = 0;
  // A cut that comes, grows, is taken back, is not there; other nodes between; the same body twice.
  const std::vector<std::pair<const NodeCloud*, const topology::Incision*>> bodies{
      {&nodes, nullptr},       {&nodes, shallow.get()}, {&nodes, deep.get()}, {&others, deep.get()},
      {&nodes, shallow.get()}, {&nodes, nullptr},       {&nodes, nullptr}};
  for (const auto& [of, incision] : bodies) {
    const BackgroundCells expected = made(*of, incision, false, without);
    CHECK(same(made(*of, incision, true, with), expected));
    CHECK(with <= without);
  }
  // All that is asked for again is one distance a box, to know which boxes lie at the surface.
  CHECK(with < 0.2 * without);

  // Options tell nothing of the boxes at the surface.
  CHECK(same(background_cells(*domain, nodes, {1.0, 3}, nullptr, memory),
             background_cells(*domain, nodes, {1.0, 3}, nullptr)));
}

TEST_CASE("A memory of boxes belongs to one domain and goes with it") {
  auto one = topology::make_hemisphere_domain(1, 0.1);
  const auto other = topology::make_hemisphere_domain(1, 0.1);
  const std::shared_ptr<solvers::BoxMemory> of_one = solvers::BoxMemory::of(one);
  CHECK(solvers::BoxMemory::of(one) == of_one);
  CHECK(solvers::BoxMemory::of(other) != of_one);
  one.reset();
  static_cast<void>(solvers::BoxMemory::of(other)); // looks what has gone
  CHECK(of_one.use_count() == 1);
}
