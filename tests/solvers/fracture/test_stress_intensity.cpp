#include "solvers/fracture/inset_integral.hpp"
#include "solvers/fracture/stress_intensity.hpp"

#include "solvers/body/elastic_body.hpp"
#include "topology/base/errors.hpp"

#include "experiments/analytic/cracks.hpp"
#include "experiments/support/straight_crack.hpp"
#include "solvers/quadrature/background_cells.hpp"
#include "solvers/shapes/functions.hpp"
#include "tests/support/cut_block.hpp"
#include "topology/incision/cut_sheets.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <complex>
#include <numbers>

using namespace spherecut;
using namespace spherecut::solvers;
using namespace spherecut::tests;

namespace {

// A discretisation whose field is given in closed form: what the extraction makes of an exact field is its own error.
class ExactBody : public Discretisation {
 public:
  explicit ExactBody(Problem problem) : problem_(std::move(problem)) {}
  Method method() const override { return Method::galerkin; }
  const Problem& problem() const override { return problem_; }
  const AssemblyReport& report() const override { return report_; }
  Field solve() const override { return {}; }
  std::vector<Field> force_responses(const std::vector<int>&) const override { return {}; }
  Field prescribed_response(const std::vector<Vector3>&) const override { return {}; }
  std::vector<Vector3> constraint_points() const override { return {}; }
  Vector3 contact_point(int) const override { return Vector3::Zero(); }
  MatrixX contact_displacements(const std::vector<int>&, const std::vector<Field>&) const override { return {}; }
  VectorX nodal_displacements(const Field&) const override { return {}; }
  std::vector<Vector3> constraint_forces(const Field&) const override { return {}; }
  double residual(const Field&, const std::vector<int>&, const std::vector<Vector3>&) const override { return 0; }

 protected:
  PointState state_of(const Vector3& displacement, const Matrix3& gradient) const {
    PointState state;
    state.displacement = displacement;
    state.gradient = gradient;
    state.strain = 0.5 * (gradient + gradient.transpose());
    state.stress = stress_from_gradient(problem_.material, gradient);
    return state;
  }

 private:
  Problem problem_;
  AssemblyReport report_;
};

// The field of a straight front, with more that carries no intensity.
class StraightFront final : public ExactBody {
 public:
  StraightFront(const CutBlock& block, const Intensities& k)
      : ExactBody(problem_of(block, {2, 0.3, 0})), frame_(block.frame), k_(k) {}
  PointState at(const Vector3& x, const Field&) const override {
    const Vector3 d = x - frame_.origin;
    const TipField tip = tip_field(problem().material, k_, d.dot(frame_.ahead), d.dot(frame_.normal));
    Matrix3 turn;
    turn << frame_.ahead, frame_.normal, frame_.tangent;
    // Uniaxial stress along the front and a rotation load no face and carry no intensity.
    const double nu = problem().material.poisson_ratio;
    Matrix3 uniform = 0.3 * ((1 + nu) * frame_.tangent * frame_.tangent.transpose() - nu * Matrix3::Identity());
    uniform(0, 1) += 0.2;
    uniform(1, 0) -= 0.2;
    return state_of(turn * tip.displacement + uniform * d, turn * tip.gradient * turn.transpose() + uniform);
  }

 private:
  CutFrame frame_;
  Intensities k_;
};

/// A disc-shaped cut of radius 1 m across the z axis in a wide block, free and without loads.
Problem disc_in_block(double poisson_ratio) {
  Problem problem;
  problem.domain = topology::make_box_domain(Vector3::Constant(-3), Vector3::Constant(3), 0.2);
  problem.incision = std::make_shared<topology::Incision>(
      std::vector<topology::SurfaceMesh>{topology::make_disc_sheet(Vector3::Zero(), Vector3::UnitZ(), 1, 0.04)},
      problem.domain);
  problem.nodes.add(Vector3::UnitX(), 0.15, NodeKind::interior, Vector3::Zero());
  problem.material = {2, poisson_ratio, 0};
  return problem;
}

// A penny crack of radius 1 m across the z axis in a wide block. The displacement is u_theta(r, z) about the axis: that
// of a twist by `twist` rad/m and that of a crack whose faces carry -`shear` r / radius.
class TwistedPenny final : public ExactBody {
 public:
  TwistedPenny(double twist, double shear) : ExactBody(penny(twist, shear)), twist_(twist), shear_(shear) {}

  PointState at(const Vector3& x, const Field&) const override {
    // Fourth order differences on one side of the crack: the error goes with the fourth power of step / distance.
    const double r = std::hypot(x.x(), x.y()), step = 1e-3 * std::hypot(r - 1, x.z());
    const auto slope = [step](const auto& u) {
      return (8 * (u(step) - u(-step)) - u(2 * step) + u(-2 * step)) / (12 * step);
    };
    const double side = x.z() < 0 ? -1 : 1, z = std::abs(x.z());
    const double u = side * around(r, z);
    const double along_r = side * slope([&](double d) { return around(r + d, z); });
    // The field is continued across the face by its own formula, up to which it is smooth.
    const double along_z = z > 2 * step
                               ? slope([&](double d) { return around(r, z + d); })
                               : (-25 * around(r, z) + 48 * around(r, z + step) - 36 * around(r, z + 2 * step) +
                                  16 * around(r, z + 3 * step) - 3 * around(r, z + 4 * step)) /
                                     (12 * step);
    const Vector3 out = Vector3(x.x(), x.y(), 0) / r, about = Vector3::UnitZ().cross(out);
    return state_of(u * about,
                    about * (along_r * out + along_z * Vector3::UnitZ()).transpose() - u / r * out * about.transpose());
  }

 private:
  static Problem penny(double twist, double shear) {
    Problem problem = disc_in_block(0.3);
    const double on_faces = problem.material.shear_modulus() * twist - shear; // Pa/m
    if (on_faces != 0)
      problem.loads.lip_traction = [on_faces](const Vector3& x, const Vector3& normal) -> Vector3 {
        return on_faces * normal.z() * Vector3::UnitZ().cross(x);
      };
    return problem;
  }

  // u_theta at z >= 0. The crack's part is 4 shear / (3 pi mu) times
  //   int_0^inf j_2(k) J_1(k r) exp(-k z) dk up to a factor, with the spherical Bessel function j_2, which is
  //   int P_2(s) exp(i k s) ds / -2 over -1 < s < 1: integrated over k first, then over zeta = z + i s.
  double around(double r, double z) const {
    const std::complex<double> zeta(z, 1), root = std::sqrt(r * r + zeta * zeta);
    const std::complex<double> first = root, second = 0.5 * (zeta * root - r * r * std::log((zeta + root) / r)),
                               third = root * root * root / 3.0 - r * r * root;
    const double crack = (-1.5 * (third - 2 * z * second + z * z * first) - 0.5 * first).imag() / r;
    return twist_ * r * z + 4 * shear_ / (3 * std::numbers::pi * problem().material.shear_modulus()) * crack;
  }

  double twist_, shear_;
};

// A penny crack of radius 1 m across the z axis in a wide block, under a pressure of 1 Pa on its faces.
class PressedPenny final : public ExactBody {
 public:
  explicit PressedPenny(double poisson_ratio) : ExactBody(penny(poisson_ratio)) {}

  PointState at(const Vector3& x, const Field&) const override {
    // Differences along steps that neither reach the front nor cross the plane of the crack.
    const double away = std::hypot(std::hypot(x.x(), x.y()) - 1, x.z());
    const auto displacement = [this](const Vector3& place) {
      return experiments::penny_displacement(problem().material, experiments::CutFrame{}, 1, 1, place);
    };
    Matrix3 gradient;
    for (int axis = 0; axis < 3; ++axis) {
      const double step = axis < 2 ? 1e-3 * away : std::min(1e-3 * away, 0.3 * std::abs(x.z()));
      const Vector3 way = step * Vector3::Unit(axis);
      gradient.col(axis) = (8 * (displacement(x + way) - displacement(x - way)) -
                            (displacement(x + 2 * way) - displacement(x - 2 * way))) /
                           (12 * step);
    }
    return state_of(displacement(x), gradient);
  }

 private:
  static Problem penny(double poisson_ratio) {
    Problem problem = disc_in_block(poisson_ratio);
    problem.loads.lip_traction = [](const Vector3&, const Vector3& normal) -> Vector3 { return -normal; };
    return problem;
  }
};

} // namespace

TEST_CASE("Both extractions find the intensities of an exact field in mixed mode", "[stress_intensity]") {
  const Intensities k(1.3, -0.7, 0.5);
  const CutBlock block = cut_block(14, false, 1);
  const StraightFront body(block, k);
  const auto front = block.incision->front_frame(block.frame.origin, 0.1);
  REQUIRE(front);
  CHECK((displacement_correlation(body, {}, *front) - k).norm() < 1e-3);
  CHECK((interaction_integral(body, {}, *front) - k).norm() < 5e-3);
  InteractionOptions fine;
  fine.radial = 40;
  fine.around = 64;
  CHECK((interaction_integral(body, {}, *front, fine) - k).norm() < 1e-3);
}

TEST_CASE("The points of a weak form fill a cut body, and linear fields are reproduced at each of them",
          "[stress_intensity]") {
  const SightRule sight = GENERATE(SightRule::enriched, SightRule::appended);
  experiments::CutBody body = experiments::straight_crack_body(1, 0.3, Method::galerkin, sight);
  experiments::hold_whole_surface(body.problem, [](const Vector3&) -> Vector3 { return Vector3::Zero(); });
  DiscretisationOptions options;
  options.sight = sight;
  options.estimate_condition = false;
  const auto cut = discretise(body.problem, options);
  double volume = 0, upper = 0, worst = 0;
  const auto everywhere = [](const Vector3&) { return true; };
  const auto add = [&](const QuadraturePoint& point, const ShapeFunctions& shape) {
    volume += point.weight;
    Vector3 place = -point.position;
    Matrix3 gradient = -Matrix3::Identity();
    for (int k = 0; k < shape.size(); ++k)
      if (shape.nodes[k] < cut->sphere_count()) { // what a cut has appended has no part in a linear field
        const Vector3& x = body.problem.nodes.positions[shape.nodes[k]];
        place += shape.value[k] * x;
        gradient += x * shape.gradient(k).transpose();
      }
    worst = std::max({worst, place.norm(), gradient.norm()});
  };
  cut->visit_weak_points(body.problem.domain->bounds(), everywhere, add);
  CHECK(volume == Approx(4).epsilon(1e-9)); // m3, of the block
  CHECK(worst < 1e-8);
  const auto is_upper = [](const Vector3& x) { return x.z() > 0.3; };
  cut->visit_weak_points(body.problem.domain->bounds(), is_upper,
                         [&](const QuadraturePoint& point, const ShapeFunctions&) {
                           CHECK(point.position.z() > 0.3);
                           upper += point.weight;
                         });
  CHECK(upper == Approx(1.4).epsilon(0.1));
  cut->visit_weak_points({{2, 2, 2}, {3, 3, 3}}, everywhere,
                         [](const QuadraturePoint&, const ShapeFunctions&) { FAIL("outside of the region"); });
}

TEST_CASE("The energy at the points of the weak form is the work of what loads the body", "[stress_intensity]") {
  const SightRule sight = GENERATE(SightRule::enriched, SightRule::appended);
  experiments::CutBody body = experiments::straight_crack_body(1, 0.3, Method::galerkin, sight);
  experiments::hold_surface(
      body.problem, [](const Vector3&, const Vector3& n) { return n.z() < -0.9; },
      [](const Vector3&) -> Vector3 { return Vector3::Zero(); });
  DiscretisationOptions options;
  options.sight = sight;
  options.estimate_condition = false;
  const auto cut = discretise(body.problem, options);
  const NodeCloud& nodes = cut->problem().nodes;
  int pulled = -1; // above the cut, which it opens
  for (int i = 0; i < nodes.size(); ++i)
    if (nodes.kinds[i] == NodeKind::surface && nodes.positions[i].z() > 1 - 1e-9 &&
        (pulled < 0 ||
         (nodes.positions[i] - Vector3(-0.7, 0, 1)).norm() < (nodes.positions[pulled] - Vector3(-0.7, 0, 1)).norm()))
      pulled = i;
  REQUIRE(pulled >= 0);
  const Field field = cut->force_response({pulled}, {Vector3::UnitZ()});
  double energy = 0;
  cut->visit_weak_points(
      body.problem.domain->bounds(), [](const Vector3&) { return true; },
      [&](const QuadraturePoint& point, const ShapeFunctions& shape) {
        const PointState state = state_from(cut->problem(), cut->problem().material, shape, field);
        energy += point.weight * state.stress.cwiseProduct(state.gradient).sum();
      });
  // The penalties of what is held take the rest.
  CHECK(energy == Approx(cut->contact_displacement(pulled, field).z()).epsilon(2e-3));
}

TEST_CASE("At a curved front the integral of the third mode tells twist from intensity", "[stress_intensity]") {
  const double shear = 0.9; // Pa at the front
  const double mu = Material{2, 0.3, 0}.shear_modulus();
  const TwistedPenny crack(shear / mu, shear), twist(shear / mu, 0);
  const double exact = experiments::torsion_intensity(1, shear);
  // The field is what the closed forms say of it: the turn of the faces, and no traction on them.
  for (double r : {0.2, 0.6, 0.95}) {
    CHECK(crack.at({r, 0, 1e-9}, {}).displacement.y() ==
          Approx(0.5 * r * experiments::torsion_turn(crack.problem().material, 1, shear, r)).epsilon(1e-6));
    CHECK(std::abs(crack.at({r, 0, 1e-9}, {}).stress(1, 2)) < 1e-6);
  }
  Field loaded;
  loaded.load_factor = 1;
  InteractionOptions fine;
  fine.radial = 40;
  fine.around = 64;
  for (double w : {0.3, 2.0, 4.4}) {
    const auto front = crack.problem().incision->front_frame({std::cos(w), std::sin(w), 0}, 0.1);
    REQUIRE(front);
    const Intensities of_crack = interaction_integral(crack, loaded, *front, fine),
                      of_twist = interaction_integral(twist, loaded, *front, fine);
    INFO("at " << w << ": " << of_crack.transpose() << " for " << exact << ", and of the twist "
               << of_twist.transpose());
    CHECK(std::abs(of_crack[2] - exact) < 2e-3 * exact);
    CHECK(of_crack.head<2>().norm() < 1e-3 * exact);
    CHECK(of_twist.norm() < 1e-3 * exact);
  }
}

TEST_CASE("At a curved front the integral is exact near incompressibility, too", "[stress_intensity]") {
  const double poisson_ratio = GENERATE(0.3, 0.49, 0.499);
  const PressedPenny crack(poisson_ratio);
  Field loaded;
  loaded.load_factor = 1;
  const Intensities exact(2 / std::sqrt(std::numbers::pi), 0, 0);
  for (const double w : {0.3, 2.0, 4.4}) {
    const auto front = crack.problem().incision->front_frame({std::cos(w), std::sin(w), 0}, 0.1);
    REQUIRE(front);
    const Intensities found = interaction_integral(crack, loaded, *front);
    INFO("nu " << poisson_ratio << " at " << w << ": " << found.transpose() << " for " << exact.transpose());
    CHECK((found - exact).norm() < 0.01 * exact.norm());
  }
}

TEST_CASE("The integral holds where its tube leaves the body, if the shift fades towards the surface",
          "[stress_intensity]") {
  const Intensities k(1.3, -0.7, 0.5);
  const CutBlock block = cut_block(14, false, 1);
  const StraightFront body(block, k);
  int near = 0;
  for (const topology::FrontFrame& front : front_samples(*block.incision, 0.3 * block.nodes.spacings.front())) {
    const double depth = -block.domain->signed_distance(front.point) / block.nodes.spacings.front();
    if (depth < 0.3 || depth > 1)
      continue;
    ++near;
    INFO("depth " << depth << " spacings");
    CHECK_THROWS_WITH(interaction_integral(body, {}, front), Catch::Contains("leaves the body"));
    InteractionOptions options;
    options.half_length = depth;
    CHECK((inset_integral(body, {}, front, depth, options) - k).norm() < 0.05);
    options.along = 12;
    CHECK((inset_integral(body, {}, front, depth, options) - k).norm() < 0.01);
  }
  CHECK(near >= 2);
  const auto front = block.incision->front_frame(block.frame.origin, 0.1);
  REQUIRE(front); // away from the surface the fading changes nothing
  CHECK((inset_integral(body, {}, *front, 0.5) - interaction_integral(body, {}, *front)).norm() < 1e-12);
  CHECK_THROWS_WITH(inset_integral(body, {}, *front, 0), Catch::Contains("must be positive"));
  CHECK_THROWS_WITH(inset_integral(body, {}, *front, 100), Catch::Contains("from the surface"));
}

TEST_CASE("A tube of four spacings' length is shortened where it would leave the body, down to two",
          "[stress_intensity]") {
  const Intensities k(1.3, -0.7, 0.5);
  const CutBlock block = cut_block(14, false, 1);
  const StraightFront body(block, k);
  int near = 0;
  for (const topology::FrontFrame& front : front_samples(*block.incision, 0.2 * block.nodes.spacings.front())) {
    const double depth = -block.domain->signed_distance(front.point) / block.nodes.spacings.front();
    INFO("depth " << depth << " spacings");
    try {
      static_cast<void>(interaction_integral(body, {}, front, InteractionOptions{.half_length = 1}));
    } catch (const InputError&) { // too near to the surface for the shortest
      CHECK_THROWS_WITH(interaction_integral(body, {}, front), Catch::Contains("leaves the body"));
      continue;
    }
    CHECK((interaction_integral(body, {}, front) - k).norm() < 0.05);
    near += depth < 1.9 ? 1 : 0; // one of full length leaves the body there
  }
  CHECK(near >= 2);
}

TEST_CASE("The energy release rate adds up the modes", "[stress_intensity]") {
  const Material material{2, 0.3, 0};
  CHECK(energy_release_rate(material, {2, 0, 0}) == Approx(4 * (1 - 0.09) / 2));
  CHECK(energy_release_rate(material, {0, 0, 3}) == Approx(9 / (2 * material.shear_modulus())));
  CHECK(energy_release_rate(material, {2, 1, 3}) == Approx(5 * (1 - 0.09) / 2 + 9 / (2 * material.shear_modulus())));
}

TEST_CASE("The jump behind a front that has just turned tells the intensities of a short kink", "[stress_intensity]") {
  const double angle = 0.5;
  const Intensities k(1.3, -0.2, 0.5);
  CutBlock block = cut_block(14, false, 1);
  const StraightFront body(block, k);
  auto front = block.incision->front_frame(block.frame.origin, 0.1);
  REQUIRE(front);
  const Vector3 ahead = front->ahead, normal = front->normal;
  front->ahead = std::cos(angle) * ahead + std::sin(angle) * normal;
  front->normal = std::cos(angle) * normal - std::sin(angle) * ahead;
  CHECK((displacement_correlation(body, {}, *front) - at_kink(k, angle)).norm() < 1e-3);
  // In the axes of the front as it lies the faces would seem to slide by nearly twice that.
  CHECK(at_kink({1, 0, 0}, angle)[1] == Approx(0.5 * std::sin(angle)).epsilon(0.05));
}

TEST_CASE("Front samples keep their distance from one another and from the surface", "[stress_intensity]") {
  const CutBlock block = cut_block(8, false, 1);
  const auto all = front_samples(*block.incision, 0.1), inner = front_samples(*block.incision, 0.1, 0.2);
  CHECK(all.size() == Approx(block.incision->front_length() / 0.1).margin(1));
  CHECK(inner.size() < all.size());
  for (const topology::FrontFrame& front : inner)
    CHECK(block.domain->signed_distance(front.point) <= -0.2);
  CHECK_THROWS_AS(front_samples(*block.incision, 0), InputError);
}

TEST_CASE("A tube that leaves the body, a body without a cut and a place without a sheet are refused",
          "[stress_intensity]") {
  const CutBlock block = cut_block(6, false, 1);
  const StraightFront body(block, {1, 0, 0});
  const auto front = block.incision->front_frame(block.frame.origin, 0.1);
  InteractionOptions wide;
  wide.outer = 5;
  CHECK_THROWS_WITH(interaction_integral(body, {}, *front, wide), Catch::Contains("leaves the body"));
  CorrelationOptions far;
  far.from = 20;
  far.to = 30;
  CHECK_THROWS_WITH(displacement_correlation(body, {}, *front, far), Catch::Contains("no sheet"));
  CutBlock uncut = block;
  uncut.incision = nullptr;
  CHECK_THROWS_AS(displacement_correlation(StraightFront(uncut, {1, 0, 0}), {}, *front), InputError);
}
