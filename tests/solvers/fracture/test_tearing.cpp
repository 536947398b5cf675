#include "solvers/fracture/tearing.hpp"

#include "solvers/contact/lip_contact.hpp"
#include "solvers/fracture/tear_seed.hpp"
#include "tests/support/bodies.hpp"
#include "tests/support/cut_block.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

/// Hoop stress at the angle t and a small radius, from the gradient of the exact field.
double hoop_stress(const Material& material, const Intensities& k, double t) {
  const Matrix3 gradient = tip_field(material, k, std::cos(t), std::sin(t)).gradient;
  const Matrix3 stress = material.lame_lambda() * gradient.trace() * Matrix3::Identity() +
                         material.shear_modulus() * (gradient + gradient.transpose());
  const Vector3 across(-std::sin(t), std::cos(t), 0);
  return across.dot(stress * across);
}

FrontState state_at(double along, double release, double angle = 0) {
  FrontState state;
  state.frame.point = {0, along, 0};
  state.frame.ahead = Vector3::UnitX();
  state.frame.normal = Vector3::UnitZ();
  state.frame.tangent = Vector3::UnitY();
  state.release = release;
  state.toughness = 2;
  state.angle = angle;
  return state;
}

} // namespace

TEST_CASE("A front kinks to where the hoop stress of its field is largest", "[tearing]") {
  const Material material{1000, 0.3, 0};
  constexpr double pi = std::numbers::pi;
  CHECK(kink_angle({1, 0, 0}) == 0);
  CHECK(kink_angle({1, 0, 5}) == 0);
  CHECK(-kink_angle({0, 1, 0}) * 180 / pi == Approx(70.5288).epsilon(1e-5));
  for (const double mix : {0.1, 0.4, 0.9, 1.3, 1.5})
    for (const double sign : {1.0, -1.0}) {
      const Intensities k(std::cos(mix), sign * std::sin(mix), 0.3);
      double best = 0, largest = -1e300;
      for (int i = -20000; i <= 20000; ++i)
        if (const double t = 0.999 * pi * i / 20000, stress = hoop_stress(material, k, t); stress > largest) {
          largest = stress;
          best = t;
        }
      CHECK(kink_angle(k) == Approx(best).margin(2e-4));
    }
  // Pressed faces do not open.
  CHECK(kink_angle({-3, 1, 0}) == Approx(kink_angle({0, 1, 0})));
  CHECK(driving_release_rate(material, {-3, 1, 2}) == Approx(energy_release_rate(material, {0, 1, 2})));
  CHECK(driving_release_rate(material, {3, 1, 2}) == Approx(energy_release_rate(material, {3, 1, 2})));
}

TEST_CASE("A front moves where the release reaches the toughness, most where it exceeds it most", "[tearing]") {
  const std::vector<FrontState> states{state_at(0, 1), state_at(1, 2), state_at(2, 3, 0.5), state_at(3, 4, 0.5)};
  const auto motion = tear_motion(states, 0.1, 0.01); // hardly smoothed
  const auto at = [&](int k) { return motion(states[static_cast<std::size_t>(k)].frame); };
  CHECK(at(0).norm() < 1e-15);
  CHECK((at(1) - Vector3(0.01, 0, 0)).norm() < 1e-12);
  CHECK((at(2) - 0.05 * Vector3(std::cos(0.5), 0, std::sin(0.5))).norm() < 1e-12);
  CHECK((at(3) - 0.1 * Vector3(std::cos(0.5), 0, std::sin(0.5))).norm() < 1e-12);
  // Smoothing spreads it evenly in the limit.
  const auto even = tear_motion(states, 0.1, 100);
  CHECK(even(states[0].frame).norm() == Approx(0.04).epsilon(1e-3));
  // All at the toughness: all move alike.
  const auto exact = tear_motion({state_at(0, 2), state_at(1, 2)}, 0.1, 0.01);
  CHECK(exact(states[0].frame).norm() == Approx(0.1));
  CHECK_THROWS_AS(tear_motion({}, 0.1, 1), InputError);
  CHECK_THROWS_AS(tear_motion(states, 0, 1), InputError);
}

TEST_CASE("A wavy front straightens where motions are even enough, and grows ragged where they are not", "[tearing]") {
  // A front at x = A cos(k y) in a field without other lengths has G = G_c drive (1 - k A cos(k y)) [Rice 1985].
  constexpr int places = 96;
  constexpr double spacing = 1, wave = 12 * spacing, drive = 1.1, stride = 1.5 * spacing;
  constexpr double k = 2 * std::numbers::pi / wave;
  const auto height_after = [&](double slope, int steps) {
    std::vector<double> x;
    for (int i = 0; i < places; ++i)
      x.push_back(0.02 * std::cos(k * 0.5 * spacing * i));
    double height = 0;
    for (int step = 0; step < steps; ++step) {
      double cosine = 0; // Fourier component of the wave: smoothing and motion add no other of any size
      for (int i = 0; i < places; ++i)
        cosine += 2 * x[static_cast<std::size_t>(i)] * std::cos(k * 0.5 * spacing * i) / places;
      std::vector<FrontState> states;
      for (int i = 0; i < places; ++i)
        states.push_back(state_at(0.5 * spacing * i, 2 * drive * (1 - k * cosine * std::cos(k * 0.5 * spacing * i))));
      const auto motion = tear_motion(states, stride, spacing, slope);
      double lowest = 1e300, highest = -1e300;
      for (int i = 0; i < places; ++i) {
        double& at = x[static_cast<std::size_t>(i)];
        at += motion(states[static_cast<std::size_t>(i)].frame).x();
        if (i < places / 4 || i >= 3 * places / 4)
          continue; // the ends have neighbours on one side alone
        lowest = std::min(lowest, at);
        highest = std::max(highest, at);
      }
      height = 0.5 * (highest - lowest);
    }
    return height;
  };
  CHECK(height_after(2 * spacing, 6) < 0.002);
  CHECK(height_after(std::numeric_limits<double>::infinity(), 6) > 0.1);
  CHECK_THROWS_AS(tear_motion({state_at(0, 2)}, 0.1, 1, 0), InputError);
}

TEST_CASE("A front on a rough sheet goes on where its field opens it, not where its triangles point", "[tearing]") {
  // Mode I along x; the frames of the places lean by up to 0.2 rad, in turn to one side and the other. Intensities in a
  // frame that leans by t: those of a short kink at t [Cotterell and Rice 1980], G falling to cos(t/2)^4 of itself.
  const Material material{1000, 0.3, 0};
  std::vector<FrontState> states;
  for (int i = 0; i < 21; ++i) {
    FrontState state = state_at(i, 0);
    const double t = 0.2 * std::cos(std::numbers::pi * i) * (1 - 0.5 * (i % 3) / 2.0);
    state.frame.ahead = {std::cos(t), 0, std::sin(t)};
    state.frame.normal = {-std::sin(t), 0, std::cos(t)};
    state.intensities = {10 * std::pow(std::cos(t / 2), 3), 10 * std::sin(t / 2) * std::pow(std::cos(t / 2), 2), 0};
    state.toughness = 0.5 * driving_release_rate(material, {10, 0, 0});
    states.push_back(state);
  }
  const std::vector<FrontState> means = averaged(material, states, 1.5);
  const auto motion = tear_motion(means, 0.5, 1);
  for (const FrontState& state : means) {
    CHECK(state.release == Approx(driving_release_rate(material, {10, 0, 0})).epsilon(0.025));
    const Vector3 step = motion(state.frame);
    CHECK(step.norm() == Approx(0.5).epsilon(0.1));
    CHECK(std::abs(std::atan2(step.z(), step.x())) < 0.02);
  }
}

TEST_CASE("The integral as a rule for all fields on a body gives what it gives for each", "[tearing]") {
  const auto [method, poisson_ratio] = GENERATE(table<Method, double>(
      {{Method::galerkin, 0.3}, {Method::galerkin, 0.49}, {Method::collocation, 0.3}, {Method::collocation, 0.45}}));
  const tests::CutBlock block = tests::cut_block(8, false, 2);
  const tests::CutFrame& cut = block.frame;
  Problem problem = tests::problem_of(block, {1000, poisson_ratio, 0});
  problem.loads.body_force = [](const Vector3& x) { return Vector3(3 * x.y(), 1, -2); };
  problem.loads.initial_strain = 1e-3 * cut.normal * cut.normal.transpose();
  problem.loads.lip_traction = [](const Vector3&, const Vector3& n) -> Vector3 { return -2 * n; };
  for (int i = 0; i < block.nodes.size(); ++i)
    if ((block.nodes.kinds[i] == NodeKind::surface || block.nodes.kinds[i] == NodeKind::edge) &&
        std::abs((block.nodes.positions[i] - cut.origin).dot(cut.normal)) > 0.3)
      problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
  DiscretisationOptions options;
  options.method = method;
  const auto body = discretise(problem, options);
  Field field = body->solve();
  const bool with_pressure = field.pressure.size() > 0;
  CHECK(with_pressure == (method == Method::collocation && poisson_ratio > 0.4));
  int places = 0;
  for (const topology::FrontFrame& frame : front_samples(*problem.incision, 0.2, 0.35)) {
    std::optional<IntensityRule> rule;
    try {
      rule = interaction_rule(*body, with_pressure, frame);
    } catch (const InputError&) {
      continue;
    }
    ++places;
    for (const double load : {1.0, 0.4}) {
      Field other = field;
      other.load_factor = load;
      other.coefficients *= 1 + load;
      const Intensities expected = interaction_integral(*body, other, frame);
      CHECK(((*rule)(other)-expected).norm() < 1e-10 * expected.norm());
    }
    Field unfit = field;
    unfit.pressure = with_pressure ? VectorX() : VectorX::Zero(problem.nodes.size());
    CHECK_THROWS_AS((*rule)(unfit), InputError);
  }
  CHECK(places >= 1);
  const auto tough = [](const Vector3&) { return 1.0; };
  FrontRules rules;
  const auto first = front_states(*body, field, tough, 0.1, {}, &rules);
  field.coefficients *= 2;
  const auto kept = front_states(*body, field, tough, 0.1, {}, &rules);
  const auto anew = front_states(*body, field, tough, 0.1);
  REQUIRE(kept.size() == anew.size());
  for (std::size_t k = 0; k < anew.size(); ++k)
    CHECK(kept[k].intensities == anew[k].intensities);
}

TEST_CASE("A cut that is pressed together and sticks is not driven on", "[tearing]") {
  const tests::CutBlock block = tests::cut_block(8, false, 2);
  const tests::CutFrame& cut = block.frame;
  Problem problem = tests::problem_of(block, {1000, 0.3, 0});
  const Matrix3 shear = cut.normal * cut.ahead.transpose() + cut.ahead * cut.normal.transpose();
  const Matrix3 strain = 1e-3 * (-2 * cut.normal * cut.normal.transpose() + shear); // pressed more than sheared
  for (int i = 0; i < block.nodes.size(); ++i)
    if (block.nodes.kinds[i] == NodeKind::surface || block.nodes.kinds[i] == NodeKind::edge)
      problem.prescribed.push_back({i, {true, true, true}, strain * block.nodes.positions[i]});
  problem.prescribed_region = [](const Vector3&, const Vector3&) { return true; };
  problem.prescribed_field = [strain](const Vector3& x) -> Vector3 { return strain * x; };
  const auto body = discretise(problem, {});
  const std::vector<LipPair> pairs = lip_pairs(problem.nodes);
  const auto release = [&](const Field& field, const std::vector<Vector3>& closed) {
    double most = 0;
    for (const FrontState& state : front_states(
             *body, field, [](const Vector3&) { return 1.0; }, 0.1, closed))
      if (state.frame.point.cwiseAbs().maxCoeff() < 0.3)
        most = std::max(most, state.release);
    return most;
  };
  const Field open = body->solve();
  const LipPatch lips = condense_lips(*body, pairs, LipCondition::sticking, nullptr);
  const LipState state = close_lips(lips, lips.base_opening, 1e-12);
  std::vector<Vector3> closed;
  for (std::size_t p = 0; p < pairs.size(); ++p)
    if (state.closed[p] != 0)
      closed.push_back(problem.nodes.positions[pairs[p].plus]);
  REQUIRE(closed.size() == pairs.size());
  const Field stuck = deform(open, lips, state);
  const double sheared = release(open, {}); // faces pass through one another: K_II of the shear
  CHECK(sheared > 0);
  CHECK(release(stuck, closed) < 1e-3 * sheared);
  CHECK(release(stuck, {}) > 0.1 * sheared); // what the integral makes of tractions it does not know
}

TEST_CASE("A front turns along a weak plane, and by hoop stress where the toughness is uniform", "[tearing]") {
  const double weak_angle = 0.5, probe = 0.1;
  FrontState state = state_at(0, 4);
  state.intensities = {1, 0.3, 0};
  state.angle = kink_angle(state.intensities);
  const auto uniform = [](const Vector3&) { return 2.0; };
  CHECK(directed({state}, TearDirection::weakest, uniform, probe)[0].angle == Approx(state.angle).margin(0.011));
  CHECK(directed({state}, TearDirection::hoop_stress, uniform, probe)[0].angle == Approx(state.angle));
  const auto layered = [&](const Vector3& x) { // weak about the ray at weak_angle
    return std::abs(std::atan2(x.z(), x.x()) - weak_angle) < 0.03 ? 0.2 : 2.0;
  };
  const FrontState turned = directed({state}, TearDirection::weakest, layered, probe)[0];
  CHECK(turned.angle == Approx(weak_angle).margin(0.035));
  CHECK(turned.toughness == 0.2);
  const FrontState kept = directed({state}, TearDirection::hoop_stress, layered, probe)[0];
  CHECK(kept.angle == Approx(state.angle));
  CHECK(kept.toughness == 2);
  CHECK_THROWS_AS(directed({state}, TearDirection::weakest, uniform, 0), InputError);
}

TEST_CASE("The averaged stress of a hanging bar is that at the middle of the ball, on any nodes", "[tearing]") {
  const Material material{1000, 0, 1};
  for (const double h : {0.25, 0.125}) {
    Problem problem = tests::held_box({0, 0, 0}, {0.5, 0.5, 1}, h, 0.1, material);
    problem.loads.body_force = [](const Vector3&) { return Vector3(0, 0, -20); };
    problem.prescribed.clear(); // hung from above
    for (int i = 0; i < problem.nodes.size(); ++i)
      if (problem.nodes.positions[i].z() > 1 - 1e-9)
        problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    problem.prescribed_region = [](const Vector3& x, const Vector3& n) { return x.z() > 1 - 1e-9 && n.z() > 0.5; };
    const auto body = discretise(problem, {});
    const Field field = body->solve();
    const Vector3 middle(0.25, 0.25, 0.5);
    for (const double radius : {0.05, 0.2}) {
      const PrincipalStress stress = averaged_stress(*body, field, middle, radius);
      CHECK(stress.stress == Approx(20 * 0.5).epsilon(0.02));
      CHECK(std::abs(stress.direction.z()) > 0.999);
    }
    const WeakPlace place =
        weakest_place(*body, field, 0.1, 15, [&](int i) { return problem.nodes.positions[i].z() < 0.9; });
    REQUIRE(place.node >= 0);
    CHECK(problem.nodes.positions[place.node].z() > 0.7);
    CHECK(weakest_place(*body, field, 0.1, 25, [](int) { return true; }).node < 0);
    CHECK(body->load_work(field) == Approx(20.0 * 20 * 0.25 / (3 * 1000)).epsilon(0.03)); // (rho g)^2 V L^2 / (3 E)
    CHECK_THROWS_AS(averaged_stress(*body, field, middle, 0), InputError);
  }
}

TEST_CASE("A seed of a tear releases at the strength what its surface takes", "[tearing]") {
  const Material material{5000, 0.45, 0};
  const double toughness = 3, strength = 2000, a = seed_radius(material, toughness, strength);
  const double modulus = 5000 / (1 - 0.45 * 0.45);
  const double released = 8 * strength * strength * a * a * a / (3 * modulus); // [Sneddon 1946]
  CHECK(released == Approx(toughness * std::numbers::pi * a * a));
  CHECK(averaging_length(material, toughness, strength) < a);
}

TEST_CASE("The share of a load at which a front moves follows from intensities in proportion to it") {
  const Material material{1e4, 0.3, 0};
  const double modulus = material.young_modulus / (1 - material.poisson_ratio * material.poisson_ratio);
  FrontState rest, tough;
  rest.toughness = tough.toughness = 2;
  FrontState pulled = rest;
  pulled.intensities = Intensities(std::sqrt(4 * 2 * modulus), 0, 0); // G is four times the toughness
  tough.intensities = Intensities(-1e6, 0, 0);                        // pressed together
  CHECK(onset_share(material, {rest, tough}, {pulled, tough}, 1) == Approx(0.5).epsilon(1e-9));
  CHECK(onset_share(material, {rest, tough}, {pulled, tough}, 2.25) == Approx(0.75).epsilon(1e-9));
  CHECK(onset_share(material, {rest, tough}, {pulled, tough}, 4.1) == 1);
  CHECK(onset_share(material, {pulled}, {rest}, 1) == 0); // it is there already
  CHECK_THROWS_AS(onset_share(material, {rest}, {}, 1), InputError);
}
