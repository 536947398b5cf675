#include "solvers/shapes/functions.hpp"

#include "solvers/shapes/kernel.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

struct Cloud {
  std::vector<Vector3> centres;
  std::vector<double> spacings;
};

double uniform(std::mt19937_64& random) {
  return std::ldexp(static_cast<double>(random() >> 11), -53);
}

Vector3 random_point(std::mt19937_64& random, double lower, double upper) {
  const double x = uniform(random), y = uniform(random), z = uniform(random);
  return Vector3::Constant(lower) + (upper - lower) * Vector3(x, y, z);
}

// Jittered lattice in a cube of `size` m, offset from the origin so that unshifted moments would lose digits.
const Vector3 corner(3, -2, 5);
Cloud lattice(int n, double size, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const double h = size / n;
  Cloud cloud;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j)
      for (int k = 0; k <= n; ++k) {
        cloud.centres.push_back(corner + h * (Vector3(i, j, k) + random_point(random, -0.2, 0.2)));
        cloud.spacings.push_back(h);
      }
  return cloud;
}

// Cloud whose spacing grows tenfold from one corner: points kept when nothing nearer than their own spacing is there.
Cloud graded(double fine, double coarse, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Cloud cloud;
  for (int trial = 0; trial < 60000; ++trial) {
    const Vector3 x = random_point(random, 0, 1);
    // Nearer the corner more often, as the density there is higher.
    const Vector3 p = trial % 2 == 0 ? x : Vector3(x * std::pow(uniform(random), 2));
    const double h = std::min(coarse, fine + 0.35 * p.norm());
    if (std::all_of(cloud.centres.begin(), cloud.centres.end(),
                    [&](const Vector3& c) { return (c - corner - p).norm() > 0.8 * h; })) {
      cloud.centres.emplace_back(corner + p);
      cloud.spacings.push_back(h);
    }
  }
  return cloud;
}

// A polynomial of degree two (one when `linear`) with its derivatives.
struct Polynomial {
  bool linear;
  [[nodiscard]] double quadratic() const { return linear ? 0.0 : 1.0; }
  [[nodiscard]] double value(const Vector3& p) const {
    const Vector3 x = p - corner;
    return 0.7 + 1.3 * x.x() - 2.1 * x.y() + 0.4 * x.z() +
           quadratic() * (0.9 * x.x() * x.x() - 0.3 * x.y() * x.y() + 1.7 * x.z() * x.z() + 0.6 * x.x() * x.y() -
                          1.1 * x.x() * x.z() + 0.8 * x.y() * x.z());
  }
  [[nodiscard]] Vector3 gradient(const Vector3& p) const {
    const Vector3 x = p - corner;
    return Vector3(1.3, -2.1, 0.4) + quadratic() * Vector3(1.8 * x.x() + 0.6 * x.y() - 1.1 * x.z(),
                                                           -0.6 * x.y() + 0.6 * x.x() + 0.8 * x.z(),
                                                           3.4 * x.z() - 1.1 * x.x() + 0.8 * x.y());
  }
  [[nodiscard]] std::array<double, 6> second() const {
    const double q = quadratic();
    return {1.8 * q, -0.6 * q, 3.4 * q, 0.6 * q, -1.1 * q, 0.8 * q};
  }
};

struct Reproduced {
  double value = 0;
  Vector3 gradient = Vector3::Zero();
  std::array<double, 6> second{};
};

template <class Function>
Reproduced combine(const Cloud& cloud, const ShapeFunctions& shape, const Function& function) {
  Reproduced sum;
  for (int k = 0; k < shape.size(); ++k) {
    const double f = function(cloud.centres[shape.nodes[k]]);
    sum.value += f * shape.value[k];
    sum.gradient += f * shape.gradient(k);
    if (!shape.dxx.empty()) {
      const std::array<double, 6> h{shape.dxx[k], shape.dyy[k], shape.dzz[k], shape.dxy[k], shape.dxz[k], shape.dyz[k]};
      for (int m = 0; m < 6; ++m)
        sum.second[m] += f * h[m];
    }
  }
  return sum;
}

double value_of_node(const ShapeFunctions& shape, const std::vector<double>& array, int node) {
  const auto found = std::find(shape.nodes.begin(), shape.nodes.end(), node);
  return found == shape.nodes.end() ? 0 : array[found - shape.nodes.begin()];
}

} // namespace

TEST_CASE("The quartic spline is one at the centre and meets zero with two derivatives", "[shape_functions]") {
  CHECK(quartic_spline(0) == 1);
  CHECK(quartic_spline(1) == 0);
  CHECK(quartic_spline(2) == 0);
  for (double s : {0.1, 0.35, 0.8})
    CHECK(quartic_spline(s) == Approx(1 - 6 * s * s + 8 * s * s * s - 3 * s * s * s * s).epsilon(1e-13));
  const double e = 1e-4;
  CHECK(quartic_spline(1 - e) < 5 * e * e * e);
}

TEST_CASE("Shape functions reproduce the polynomials of their basis", "[shape_functions]") {
  const bool is_linear = GENERATE(true, false);
  const bool is_graded = GENERATE(true, false);
  const Cloud cloud = is_graded ? graded(0.04, 0.4, 3) : lattice(8, 1, 5);
  const Spheres spheres(cloud.centres, cloud.spacings, is_linear ? 1.8 : 2.4,
                        is_linear ? Basis::linear : Basis::quadratic);
  const Polynomial polynomial{is_linear};
  const double finest = is_graded ? 0.04 : 0.125;
  std::mt19937_64 random(11);
  ShapeFunctions shape;
  for (int trial = 0; trial < 200; ++trial) {
    const Vector3 x = corner + random_point(random, 0, 1);
    REQUIRE(evaluate(spheres, x, shape));
    CHECK(std::is_sorted(shape.nodes.begin(), shape.nodes.end()));
    const auto one = combine(cloud, shape, [](const Vector3&) { return 1.0; });
    CHECK(std::abs(one.value - 1) < 1e-12);
    CHECK(one.gradient.norm() * finest < 1e-12);
    const auto p = combine(cloud, shape, [&](const Vector3& y) { return polynomial.value(y); });
    CHECK(std::abs(p.value - polynomial.value(x)) < 1e-12);
    CHECK((p.gradient - polynomial.gradient(x)).norm() * finest < 1e-12);

    REQUIRE(evaluate_second(spheres, x, shape));
    const auto q = combine(cloud, shape, [&](const Vector3& y) { return polynomial.value(y); });
    CHECK(std::abs(q.value - polynomial.value(x)) < 1e-12);
    CHECK((q.gradient - polynomial.gradient(x)).norm() * finest < 1e-12);
    for (int m = 0; m < 6; ++m)
      CHECK(std::abs(q.second[m] - polynomial.second()[m]) * finest * finest < 1e-12);
  }
}

TEST_CASE("First and second derivatives agree with finite differences", "[shape_functions]") {
  const Basis basis = GENERATE(Basis::linear, Basis::quadratic);
  const Cloud cloud = lattice(6, 1, 7);
  const Spheres spheres(cloud.centres, cloud.spacings, basis == Basis::linear ? 1.8 : 2.4, basis);
  const double h = 1.0 / 6, step = 1e-5 * h;
  std::mt19937_64 random(2);
  ShapeFunctions shape, behind, ahead;
  for (int trial = 0; trial < 20; ++trial) {
    // The last point is a node, where the weight's radius vanishes.
    const Vector3 x = trial == 19 ? cloud.centres[171] : Vector3(corner + random_point(random, 0.1, 0.9));
    REQUIRE(evaluate_second(spheres, x, shape));
    for (int axis = 0; axis < 3; ++axis) {
      REQUIRE(evaluate_second(spheres, x - step * Vector3::Unit(axis), behind));
      REQUIRE(evaluate_second(spheres, x + step * Vector3::Unit(axis), ahead));
      const auto difference = [&](const std::vector<double> ShapeFunctions::*array, int node) {
        return (value_of_node(ahead, ahead.*array, node) - value_of_node(behind, behind.*array, node)) / (2 * step);
      };
      const std::array<std::array<std::vector<double> ShapeFunctions::*, 3>, 3> second{
          {{&ShapeFunctions::dxx, &ShapeFunctions::dxy, &ShapeFunctions::dxz},
           {&ShapeFunctions::dxy, &ShapeFunctions::dyy, &ShapeFunctions::dyz},
           {&ShapeFunctions::dxz, &ShapeFunctions::dyz, &ShapeFunctions::dzz}}};
      const std::array<std::vector<double> ShapeFunctions::*, 3> first{&ShapeFunctions::dx, &ShapeFunctions::dy,
                                                                       &ShapeFunctions::dz};
      for (int k = 0; k < shape.size(); ++k) {
        const int node = shape.nodes[k];
        CHECK(std::abs(shape.gradient(k)[axis] - difference(&ShapeFunctions::value, node)) * h < 1e-7);
        for (int other = 0; other < 3; ++other)
          CHECK(std::abs((shape.*second[other][axis])[k] - difference(first[other], node)) * h * h < 2e-4);
      }
    }
  }
}

TEST_CASE("Every kernel this machine runs gives the same shape functions", "[shape_functions]") {
  const Cloud cloud = graded(0.04, 0.4, 9);
  const Spheres spheres(cloud.centres, cloud.spacings, 1.8);
  std::mt19937_64 random(4);
  ShapeFunctions one, second, other;
  std::vector<const shape_kernel::Kernel*> kernels{&shape_kernel::dispatched()};
  for (const shape_kernel::Kernel* kernel : {shape_kernel::avx2(), shape_kernel::avx512()})
    if (kernel != nullptr && kernel->width <= shape_kernel::dispatched().width)
      kernels.push_back(kernel);
  for (int trial = 0; trial < 200; ++trial) {
    const Vector3 x = corner + random_point(random, 0, 1);
    REQUIRE(shape_kernel::evaluate_with(shape_kernel::portable(), spheres, x, one));
    REQUIRE(evaluate_second(spheres, x, second));
    for (const shape_kernel::Kernel* kernel : kernels) {
      REQUIRE(shape_kernel::evaluate_with(*kernel, spheres, x, other));
      REQUIRE(one.nodes == other.nodes);
      REQUIRE(one.nodes == second.nodes);
      CHECK(one.moment_condition == Approx(other.moment_condition).epsilon(1e-9));
      for (int k = 0; k < one.size(); ++k) {
        CHECK(std::abs(one.value[k] - other.value[k]) < 1e-12);
        CHECK((one.gradient(k) - other.gradient(k)).norm() * 0.04 < 1e-12);
        CHECK((one.gradient(k) - second.gradient(k)).norm() * 0.04 < 1e-12);
      }
    }
  }
}

TEST_CASE("Every kernel gives points together the gradients that each has alone", "[shape_functions]") {
  const Cloud cloud = graded(0.04, 0.4, 9);
  const Spheres spheres(cloud.centres, cloud.spacings, 1.8);
  std::mt19937_64 random(6);
  std::vector<const shape_kernel::Kernel*> kernels{&shape_kernel::portable(), &shape_kernel::dispatched()};
  if (shape_kernel::avx2() != nullptr && shape_kernel::dispatched().width >= 4)
    kernels.push_back(shape_kernel::avx2());
  constexpr int together = shape_kernel::points_together, stride = 16;
  for (int trial = 0; trial < 30; ++trial) {
    const Vector3 middle = corner + random_point(random, 0.1, 0.9);
    shape_kernel::Points points;
    std::array<ShapeFunctions, together> alone;
    for (int p = 0; p < together; ++p) {
      const Vector3 x = middle + random_point(random, -0.02, 0.02);
      points.x[p] = x.x();
      points.y[p] = x.y();
      points.z[p] = x.z();
      points.factor[p] = 0.5 + p;
      REQUIRE(shape_kernel::evaluate_with(shape_kernel::portable(), spheres, x, alone[p]));
    }
    std::vector<shape_kernel::Sphere> all;
    for (int j = 0; j < spheres.size(); ++j) {
      const Vector3& x = spheres.centres()[j];
      all.push_back({x.x(), x.y(), x.z(), 1 / (spheres.radii()[j] * spheres.radii()[j])});
    }
    for (const shape_kernel::Kernel* kernel : kernels) {
      std::vector<std::uint8_t> inside(all.size());
      kernel->find_inside(all.data(), spheres.size(), points, inside.data());
      std::vector<shape_kernel::Sphere> near;
      std::vector<int> ids;
      for (int j = 0; j < spheres.size(); ++j)
        if (inside[j] != 0) {
          near.push_back(all[j]);
          ids.push_back(j);
        }
      std::vector<double> gradients(3 * stride * near.size(), 7.0);
      std::array<double, together> condition{};
      kernel->gradients_at_points(near.data(), static_cast<int>(near.size()), points, stride, gradients.data(),
                                  condition.data());
      for (int p = 0; p < together; ++p) {
        CHECK(condition[p] == Approx(alone[p].moment_condition).epsilon(1e-9));
        std::size_t next = 0;
        double worst = 0;
        for (std::size_t k = 0; k < near.size(); ++k) {
          const bool is_inside = (inside[ids[k]] >> p & 1) != 0;
          REQUIRE(is_inside == (next < alone[p].nodes.size() && alone[p].nodes[next] == ids[k]));
          const Vector3 expected = is_inside ? alone[p].gradient(static_cast<int>(next++)) : Vector3(Vector3::Zero());
          for (std::size_t a = 0; a < 3; ++a)
            worst = std::max(worst, std::abs(gradients[(3 * k + a) * stride + p] - points.factor[p] * expected[a]));
          CHECK(gradients[3 * k * stride + together + p] == 7.0); // room of other points
        }
        CHECK(next == alone[p].nodes.size());
        CHECK(worst * 0.04 < 1e-11);
      }
    }
  }
}

TEST_CASE("The moment condition is that of the scaled matrix", "[shape_functions]") {
  const Cloud cloud = lattice(4, 0.02, 1);
  const Spheres spheres(cloud.centres, cloud.spacings, 1.8);
  const Vector3 x = corner + Vector3(0.011, 0.009, 0.0003);
  ShapeFunctions shape;
  REQUIRE(evaluate(spheres, x, shape));
  const double radius = 1.8 * 0.005;
  Eigen::Matrix4d a = Eigen::Matrix4d::Zero();
  for (int j = 0; j < spheres.size(); ++j) {
    const Vector3 y = (cloud.centres[j] - x) / radius;
    const Eigen::Vector4d p(1, y.x(), y.y(), y.z());
    a += quartic_spline(y.norm()) * p * p.transpose();
  }
  const double condition = a.cwiseAbs().colwise().sum().maxCoeff() * a.inverse().cwiseAbs().colwise().sum().maxCoeff();
  CHECK(shape.moment_condition == Approx(condition).epsilon(1e-10));
}

TEST_CASE("Candidates hold every supporting node and not many more", "[shape_functions]") {
  const bool is_graded = GENERATE(true, false);
  const Cloud cloud = is_graded ? graded(0.04, 0.4, 3) : lattice(12, 1, 5);
  const Spheres spheres(cloud.centres, cloud.spacings, 1.8);
  std::mt19937_64 random(8);
  long candidates = 0, supporting = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const Vector3 x = corner + random_point(random, trial < 1500 ? 0 : -1, trial < 1500 ? 1 : 2);
    const std::span<const int> found = spheres.candidates(x);
    CHECK(std::is_sorted(found.begin(), found.end()));
    for (int j = 0; j < spheres.size(); ++j)
      if ((cloud.centres[j] - x).norm() < spheres.radii()[j]) {
        CHECK(std::binary_search(found.begin(), found.end(), j));
        supporting += trial < 1500 ? 1 : 0;
      }
    candidates += trial < 1500 ? std::ssize(found) : 0;
  }
  CHECK(static_cast<double>(candidates) <= 3.0 * static_cast<double>(supporting));
}

TEST_CASE("Spheres grow where the support is not sound", "[shape_functions]") {
  Cloud cloud = lattice(6, 1, 5);
  cloud.centres.emplace_back(corner + Vector3(1.4, 0.5, 0.5)); // stands apart: reached by growth alone
  cloud.spacings.push_back(1.0 / 6);
  const Spheres spheres(cloud.centres, cloud.spacings, 1.7);
  CHECK(spheres.grown() > 0);
  CHECK(spheres.grown() < spheres.size() / 2);
  int grown = 0;
  for (int j = 0; j < spheres.size(); ++j) {
    const double ratio = std::log(spheres.radii()[j] / (1.7 / 6)) / std::log(1.25);
    CHECK(std::abs(ratio - std::round(ratio)) < 1e-9);
    CHECK(std::round(ratio) <= 6);
    grown += ratio > 0.5 ? 1 : 0;
  }
  CHECK(grown == spheres.grown());
  ShapeFunctions shape;
  for (const Vector3& x : cloud.centres) {
    int holders = 0;
    for (int j = 0; j < spheres.size(); ++j)
      holders += (cloud.centres[j] - x).norm() < spheres.radii()[j] ? 1 : 0;
    CHECK(holders >= 6);
    REQUIRE(evaluate(spheres, x, shape));
    CHECK(shape.size() == holders);
  }
}

TEST_CASE("A node whose support never becomes sound is named", "[shape_functions]") {
  Cloud cloud = lattice(4, 1, 5);
  const int stray = static_cast<int>(cloud.centres.size());
  cloud.centres.emplace_back(corner + Vector3(40, 0, 0));
  cloud.spacings.push_back(0.25);
  CHECK_THROWS_AS(Spheres(cloud.centres, cloud.spacings, 1.8), NumericalError);
  CHECK_THROWS_WITH(Spheres(cloud.centres, cloud.spacings, 1.8), Catch::Contains("node " + std::to_string(stray)));

  Cloud plane; // every moment matrix is singular
  for (int i = 0; i < 36; ++i) {
    plane.centres.emplace_back(corner + Vector3(i % 6, std::floor(i / 6.0), 0));
    plane.spacings.push_back(1);
  }
  CHECK_THROWS_WITH(Spheres(plane.centres, plane.spacings, 1.8), Catch::Contains("node 0"));
}

TEST_CASE("Spheres refuse input that cannot be used", "[shape_functions]") {
  const Cloud good = lattice(3, 1, 5);
  Cloud bad = good;
  bad.centres[7].y() = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(Spheres(bad.centres, bad.spacings, 1.8), InputError);
  CHECK_THROWS_WITH(Spheres(bad.centres, bad.spacings, 1.8), Catch::Contains("node 7"));
  bad = good;
  bad.spacings[9] = 0;
  CHECK_THROWS_WITH(Spheres(bad.centres, bad.spacings, 1.8), Catch::Contains("node 9"));
  bad.spacings.pop_back();
  CHECK_THROWS_AS(Spheres(bad.centres, bad.spacings, 1.8), InputError);
  CHECK_THROWS_AS(Spheres(good.centres, good.spacings, -1), InputError);
  CHECK_THROWS_AS(Spheres({corner, corner}, {1, 1}, 1.8), InputError);
}

TEST_CASE("A point beyond the supports is met by radii grown there", "[shape_functions]") {
  const Cloud cloud = lattice(5, 1, 5);
  const Spheres spheres(cloud.centres, cloud.spacings, 1.8);
  const Polynomial polynomial{true};
  ShapeFunctions shape;
  const Vector3 outside = corner + Vector3(1.5, 0.5, 0.5);
  REQUIRE(evaluate(spheres, outside, shape));
  const auto p = combine(cloud, shape, [&](const Vector3& y) { return polynomial.value(y); });
  CHECK(p.value == Approx(polynomial.value(outside)).epsilon(1e-10));
  CHECK_FALSE(evaluate(spheres, corner + Vector3(9, 0, 0), shape));
  CHECK(shape.size() == 0);
  CHECK_FALSE(evaluate(spheres, Vector3::Constant(std::numeric_limits<double>::quiet_NaN()), shape));
}

TEST_CASE("Many points at once are evaluated as one by one", "[shape_functions]") {
  const Cloud cloud = lattice(5, 1, 5);
  const Spheres spheres(cloud.centres, cloud.spacings, 1.8);
  std::mt19937_64 random(3);
  std::vector<Vector3> points(9);
  for (Vector3& x : points)
    x = corner + random_point(random, 0, 1);
  std::vector<ShapeFunctions> many(points.size());
  REQUIRE(evaluate(spheres, points, many));
  ShapeFunctions one;
  for (std::size_t i = 0; i < points.size(); ++i) {
    REQUIRE(evaluate(spheres, points[i], one));
    CHECK(one.nodes == many[i].nodes);
    CHECK(one.value == many[i].value);
    CHECK(one.dz == many[i].dz);
  }
  CHECK_THROWS_AS(evaluate(spheres, points, std::span<ShapeFunctions>(many).first(3)), InputError);
}
