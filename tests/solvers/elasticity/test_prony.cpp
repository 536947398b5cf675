#include "solvers/elasticity/prony.hpp"
#include "tests/solvers/elasticity/sample_laws.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::solvers;
using tests::at;

namespace {

const std::vector<PronyTerm> three_terms{{0.3, 0.05}, {0.2, 0.8}, {0.1, 12}};

/// Share of the stress that is left after a time under held strain.
double left_after(const std::vector<PronyTerm>& terms, double time) {
  double left = 1;
  for (const PronyTerm& term : terms)
    left -= term.share * -std::expm1(-time / term.time);
  return left;
}

/// Isochoric stress of a step at one point, which is accepted.
Matrix3 step(PronyState& state, const Law& law, const Matrix3& f, double duration) {
  tests::PointState point = at(law, f, false);
  const Matrix3 plain = point.stress;
  state.begin(duration);
  state.apply({&f, 1}, {&point.energy, 1}, {&point.stress, 1});
  state.accept({&f, 1}, {&plain, 1});
  return point.stress;
}

} // namespace

TEST_CASE("Stress under held strain fades as the series says, in steps of any length") {
  for (const LawSpec& spec : tests::sample_laws(0.45)) {
    const std::unique_ptr<Law> law = make_law(spec);
    INFO(law->name());
    const Matrix3 f = tests::sample_gradients(1, 0.2, 23)[0];
    const Matrix3 sudden = at(*law, f, false).stress;
    PronyState state(three_terms, 1, law->small_strain_only());
    CHECK((step(state, *law, f, 0) - sudden).norm() < 1e-13 * sudden.norm());
    double time = 0;
    for (const double duration : {0.001, 0.02, 0.3, 0.0, 1.0, 7.0, 40.0, 1e4}) {
      time += duration;
      const Matrix3 stress = step(state, *law, f, duration);
      CHECK((stress - left_after(three_terms, time) * sudden).norm() < 1e-12 * sudden.norm());
    }
    CHECK(state.lasting_share() == Approx(0.4));
  }
}

TEST_CASE("A ramp of stress-strain history is exact in one step or many") {
  // Small-strain shear at a constant rate, J = 1: tau(t) = mu rate [t - sum g (t - T (1 - exp(-t / T)))].
  const double mu = 3e3, rate = 0.02, end = 2.5;
  const std::unique_ptr<Law> law = make_law({LinearLaw{mu}, bulk_modulus_of(mu, 0.45), {}});
  double exact = mu * rate * end;
  for (const PronyTerm& term : three_terms)
    exact -= mu * rate * term.share * (end - term.time * -std::expm1(-end / term.time));
  for (const int steps : {1, 3, 50}) {
    PronyState state(three_terms, 1, true);
    Matrix3 stress;
    for (int k = 1; k <= steps; ++k) {
      Matrix3 f = Matrix3::Identity();
      f(0, 1) = rate * end * k / steps;
      stress = step(state, *law, f, end / steps);
    }
    CHECK(stress(0, 1) == Approx(exact).epsilon(1e-12));
  }
}

TEST_CASE("Creep under held stress approaches its closed form with the square of the step") {
  // One term, shear: strain(t) = tau / mu [1 + g / (1 - g) (1 - exp(-(1 - g) t / T))].
  const double mu = 3e3, tau = 30, g = 0.6, relaxation = 0.5, end = 1.2;
  const double exact = tau / mu * (1 + g / (1 - g) * -std::expm1(-(1 - g) * end / relaxation));
  const std::unique_ptr<Law> law = make_law({LinearLaw{mu}, bulk_modulus_of(mu, 0.45), {}});
  double error[2];
  for (int run = 0; run < 2; ++run) {
    const int steps = run == 0 ? 40 : 80;
    PronyState state({{g, relaxation}}, 1, true);
    Matrix3 f = Matrix3::Identity();
    f(0, 1) = tau / mu; // sudden
    step(state, *law, f, 0);
    for (int k = 0; k < steps; ++k) {
      state.begin(end / steps);
      f(0, 1) = (tau - state.history(0)(0, 1)) / (state.factor() * mu);
      CHECK(step(state, *law, f, end / steps)(0, 1) == Approx(tau));
    }
    error[run] = std::abs(f(0, 1) / exact - 1);
  }
  CHECK(error[0] < 1e-4);
  CHECK(error[0] / error[1] == Approx(4).epsilon(0.05));
}

TEST_CASE("A step's stress is the derivative of its energy, its tangent symmetric, and it turns with the body") {
  for (const LawSpec& spec : tests::sample_laws(0.45)) {
    const std::unique_ptr<Law> law = make_law(spec);
    INFO(law->name());
    const std::vector<Matrix3> f = tests::sample_gradients(3, 0.2, 29);
    PronyState state(three_terms, 1, law->small_strain_only());
    step(state, *law, f[0], 0.03);
    step(state, *law, f[1], 0.5);
    state.begin(0.2);
    const auto stepped = [&](const Matrix3& g) {
      tests::PointState point = at(*law, g, false);
      state.apply({&g, 1}, {&point.energy, 1}, {&point.stress, 1});
      return point;
    };
    Matrix9 tangent = law->tangent_isochoric(f[2], law->own_fibres());
    state.apply(0, tangent);
    CHECK((tangent - tangent.transpose()).norm() < 1e-12 * tangent.norm());
    const tests::PointState point = stepped(f[2]);
    for (int k = 0; k < 9; ++k) {
      constexpr double h = 1e-3;
      const auto moved = [&](double by) {
        Matrix3 g = f[2];
        g.data()[k] += by;
        return stepped(g);
      };
      const tests::PointState a = moved(h), b = moved(-h), c = moved(2 * h), d = moved(-2 * h);
      CHECK((8 * (a.energy - b.energy) - (c.energy - d.energy)) / (12 * h) ==
            Approx(point.stress.data()[k]).margin(1e-7 * tangent.norm()));
      const Matrix3 slope = (8 * (a.stress - b.stress) - (c.stress - d.stress)) / (12 * h);
      CHECK((slope - Eigen::Map<const Matrix3>(tangent.col(k).data())).norm() < 1e-6 * tangent.norm());
    }
    if (law->small_strain_only())
      continue;
    const Matrix3 q = tests::sample_rotation(3);
    const tests::PointState turned = stepped(q * f[2]);
    CHECK(turned.energy == Approx(point.energy).epsilon(1e-10).margin(1e-9));
    CHECK((turned.stress - q * point.stress).norm() < 1e-10 * point.stress.norm());
  }
}

TEST_CASE("A settled state has nothing left to fade, and a copy puts a state back") {
  const LawSpec spec = tests::sample_laws(0.45)[1];
  const std::unique_ptr<Law> law = make_law(spec);
  const std::vector<Matrix3> f = tests::sample_gradients(2, 0.2, 31);
  const tests::PointState sudden = at(*law, f[0], false);
  PronyState state(three_terms, 1);
  state.settle({&f[0], 1}, {&sudden.stress, 1});
  for (const double duration : {0.0, 0.1, 100.0})
    CHECK((step(state, *law, f[0], duration) - 0.4 * sudden.stress).norm() < 1e-12 * sudden.stress.norm());
  // From there a sudden change is met with the whole stiffness.
  const Matrix3 s0 = f[0].inverse() * sudden.stress, s1 = f[1].inverse() * at(*law, f[1], false).stress;
  const PronyState kept = state;
  const Matrix3 jump = step(state, *law, f[1], 0);
  CHECK((jump - f[1] * (0.4 * s0 + (s1 - s0))).norm() < 1e-12 * jump.norm());
  state = kept;
  CHECK((step(state, *law, f[0], 3) - 0.4 * sudden.stress).norm() < 1e-12 * sudden.stress.norm());
}

TEST_CASE("A history refuses what it cannot hold") {
  CHECK_THROWS_WITH(PronyState({{0.6, 1}, {0.4, 2}}, 1), Catch::Contains("add to 1"));
  PronyState state(three_terms, 2);
  CHECK_THROWS_WITH(state.begin(-1), Catch::Contains("lasts -1 s"));
  const Matrix3 f = Matrix3::Identity();
  CHECK_THROWS_WITH(state.accept({&f, 1}, {&f, 1}), Catch::Contains("1 gradients for 2 points"));
}
