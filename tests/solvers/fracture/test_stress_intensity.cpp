#include "solvers/fracture/inset_integral.hpp"
#include "solvers/fracture/stress_intensity.hpp"

#include "solvers/body/elastic_body.hpp"
#include "topology/base/errors.hpp"

#include "tests/support/cut_block.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

using namespace spherecut;
using namespace spherecut::solvers;
using namespace spherecut::tests;

namespace {

// A discretisation whose field is given in closed form: what the extraction makes of an exact field is its own error.
class ExactBody final : public Discretisation {
 public:
  ExactBody(const CutBlock& block, const Intensities& k) : frame_(block.frame), k_(k) {
    problem_.domain = block.domain;
    problem_.incision = block.incision;
    problem_.nodes = block.nodes;
    problem_.material = {2, 0.3, 0};
  }
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
  PointState at(const Vector3& x, const Field&) const override {
    const Vector3 d = x - frame_.origin;
    const TipField tip = tip_field(problem_.material, k_, d.dot(frame_.ahead), d.dot(frame_.normal));
    Matrix3 turn;
    turn << frame_.ahead, frame_.normal, frame_.tangent;
    PointState state;
    // Uniaxial stress along the front and a rotation load no face and carry no intensity.
    const double nu = problem_.material.poisson_ratio;
    Matrix3 uniform = 0.3 * ((1 + nu) * frame_.tangent * frame_.tangent.transpose() - nu * Matrix3::Identity());
    uniform(0, 1) += 0.2;
    uniform(1, 0) -= 0.2;
    state.displacement = turn * tip.displacement + uniform * d;
    state.gradient = turn * tip.gradient * turn.transpose() + uniform;
    state.strain = 0.5 * (state.gradient + state.gradient.transpose());
    state.stress = stress_from_gradient(problem_.material, state.gradient);
    return state;
  }
  std::vector<Vector3> constraint_forces(const Field&) const override { return {}; }
  double residual(const Field&, const std::vector<int>&, const std::vector<Vector3>&) const override { return 0; }

 private:
  Problem problem_;
  AssemblyReport report_;
  CutFrame frame_;
  Intensities k_;
};

} // namespace

TEST_CASE("Both extractions find the intensities of an exact field in mixed mode", "[stress_intensity]") {
  const Intensities k(1.3, -0.7, 0.5);
  const CutBlock block = cut_block(14, false, 1);
  const ExactBody body(block, k);
  const auto front = block.incision->front_frame(block.frame.origin, 0.1);
  REQUIRE(front);
  CHECK((displacement_correlation(body, {}, *front) - k).norm() < 1e-3);
  CHECK((interaction_integral(body, {}, *front) - k).norm() < 5e-3);
  InteractionOptions fine;
  fine.radial = 40;
  fine.around = 64;
  CHECK((interaction_integral(body, {}, *front, fine) - k).norm() < 1e-3);
}

TEST_CASE("The integral holds where its tube leaves the body, if the shift fades towards the surface",
          "[stress_intensity]") {
  const Intensities k(1.3, -0.7, 0.5);
  const CutBlock block = cut_block(14, false, 1);
  const ExactBody body(block, k);
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
  const ExactBody body(block, k);
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
  const ExactBody body(block, {1, 0, 0});
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
  CHECK_THROWS_AS(displacement_correlation(ExactBody(uncut, {1, 0, 0}), {}, *front), InputError);
}
