// What holds a body at finite strain by its surface: a tool that it is bonded to, one that rubs on it, a grasper.
// Against the small-strain contact, homogeneous states, and the laws of friction, balance and energy.
#include "experiments/analytic/finite_strain.hpp"
#include "experiments/support/finite_block.hpp"
#include "solvers/algebra/parallel.hpp"
#include "solvers/body/discretisation.hpp"
#include "solvers/contact/friction.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <numbers>
#include <random>
#include <tuple>

using namespace spherecut;
using namespace spherecut::solvers;
using experiments::face_force;
using experiments::FiniteBlock;
using topology::FlatPunch;
using topology::SphereTip;
using topology::ToolPose;

namespace {

const Vector3 up = Vector3::UnitZ();
const FlatPunch plate{3, 1}; // wider than any block here

FiniteContactOptions bonded() {
  return {.condition = ContactCondition::bonded};
}

FiniteContactOptions rubbing(double friction) {
  return {.condition = ContactCondition::frictional, .friction = friction};
}

EquilibriumOptions strict(double tolerance) {
  EquilibriumOptions options;
  options.tolerance = options.unsettled = tolerance;
  options.penetration = 1e-5;
  return options;
}

/// Entries of the unit block's base hold it along all axes.
Problem on_base(double spacing, const Vector3& upper = Vector3::Ones(), double jitter = 0.25) {
  FiniteBlock block{.upper = upper, .spacing = spacing, .jitter = jitter};
  block.held[4].fill(true);
  Problem problem = experiments::finite_block(block);
  problem.touched_from = up;
  return problem;
}

std::vector<int> top_of(const Problem& problem, bool with_edges) {
  double top = 0;
  for (const Vector3& x : problem.nodes.positions)
    top = std::max(top, x.z());
  std::vector<int> nodes;
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (problem.nodes.positions[i].z() > top - 1e-9 && (with_edges || problem.nodes.kinds[i] == NodeKind::surface))
      nodes.push_back(i);
  return nodes;
}

/// The entries that hold the sides leave their upper edges to what holds the top.
void leave_top(Problem& problem) {
  std::erase_if(problem.prescribed,
                [&](const Prescribed& entry) { return problem.nodes.positions[entry.node].z() > 1 - 1e-9; });
  problem.touched_from = up;
}

FiniteLoading at(const Vector3& point, const Vector3& axis = up) {
  FiniteLoading loading;
  loading.tool = ToolPose{point, axis.normalized()};
  return loading;
}

/// Force and torque about the origin of the constraints on the body and of the body on the tool: their differences,
/// over the force on the tool.
std::pair<double, double> imbalance(const FiniteBody& body, const Equilibrium& equilibrium,
                                    const EquilibriumStatus& status) {
  Vector3 force = -status.tool_force;
  Vector3 torque = -status.tool_torque - equilibrium.contact()->pose().point.cross(status.tool_force);
  for (std::size_t e = 0; e < body.held().entries().size(); ++e) {
    const DisplacementMean& mean = body.held().means()[e];
    const Vector3& reaction = equilibrium.constraint_forces()[e];
    force += reaction;
    torque += (mean.centroid + mean.of(equilibrium.coefficients())).cross(reaction);
  }
  return {force.norm() / status.tool_force.norm(), torque.norm() / status.tool_force.norm()};
}

} // namespace

TEST_CASE("At 0.1 % strain a bonded and a rubbing tool have the forces of the small-strain contact") {
  const auto law = experiments::neo_hookean(1, 0.4);
  Problem problem = on_base(1.0 / 9);
  problem.material = {2.8, 0.4, 0}; // the law's at small strain
  const std::vector<int> candidates = top_of(problem, false);
  DiscretisationOptions by_galerkin;
  by_galerkin.method = Method::galerkin;
  const std::unique_ptr<Discretisation> linear = discretise(problem, by_galerkin);
  const ContactPatch patch = condense(*linear, candidates);
  const FiniteBody body(problem, law);
  const Vector3 pressed(0.5, 0.5, 0.999);

  for (const topology::ToolShape& tool : {topology::ToolShape(FlatPunch{0.36, 1}), topology::ToolShape(SphereTip{120})})
    for (const FiniteContactOptions& options : {bonded(), rubbing(0.4)}) {
      Equilibrium equilibrium(body, strict(1e-6));
      equilibrium.set_contact(tool, candidates, options);
      ContactOptions small;
      small.condition = options.condition;
      small.friction = options.friction;
      ContactState state;
      const ContactState* before = nullptr;
      // Pressed, then pushed sideways: at first it sticks, at last it slips.
      for (const double aside : {0.0, 3e-4, 2e-3}) {
        const ToolPose pose{pressed + Vector3(aside, 0.5 * aside, 0), up};
        state = press(patch, tool, pose, small, before);
        before = &state;
        const EquilibriumStatus status = equilibrium.solve(at(pose.point));
        INFO("aside " << aside << ", " << tool.index() << ": " << status.tool_force.transpose() << " for "
                      << state.tool_force.transpose());
        CHECK((status.tool_force - state.tool_force).norm() < 0.01 * state.tool_force.norm());
        CHECK(std::abs(status.touching - state.active_nodes) <= 2); // at the rim
        CHECK(status.friction_work == Approx(state.friction_work).epsilon(0.05).margin(1e-9));
      }
    }
}

TEST_CASE("At 0.1 % strain a grasper has the force of given displacements in the small") {
  const auto law = experiments::neo_hookean(1, 0.4);
  Problem problem = on_base(1.0 / 9);
  problem.material = {2.8, 0.4, 0}; // the law's at small strain
  std::vector<int> patch_nodes;
  for (const int node : top_of(problem, false))
    if ((problem.nodes.positions[node] - Vector3(0.5, 0.5, 1)).norm() < 0.36)
      patch_nodes.push_back(node);
  DiscretisationOptions by_galerkin;
  by_galerkin.method = Method::galerkin;
  const std::unique_ptr<Discretisation> linear = discretise(problem, by_galerkin);
  const ContactPatch patch = condense(*linear, patch_nodes);
  const FiniteBody body(problem, law);
  Equilibrium equilibrium(body, strict(1e-7));
  equilibrium.take_hold(SphereTip{0.3}, {{0.5, 0.5, 1}, up}, patch_nodes);
  for (const Vector3& way : {Vector3(0, 0, 1e-3), Vector3(1e-3, -5e-4, 5e-4)}) {
    const ContactState state = prescribe(patch, std::vector<Vector3>(patch_nodes.size(), way));
    const EquilibriumStatus status = equilibrium.solve(at(Vector3(0.5, 0.5, 1) + way));
    INFO(status.tool_force.transpose() << " for " << state.tool_force.transpose());
    CHECK((status.tool_force - state.tool_force).norm() < 0.01 * state.tool_force.norm());
  }
}

TEST_CASE("A confined block that is bonded to a plate is pressed and drawn as the closed form says") {
  FiniteBlock block{.spacing = 0.25};
  for (int face = 0; face < 5; ++face)
    block.held[face][face / 2] = true; // rollers
  Problem problem = experiments::finite_block(block);
  leave_top(problem);
  const std::vector<int> top = top_of(problem, true);
  const auto law = experiments::neo_hookean(1, 0.45);
  const FiniteBody body(problem, law);
  Equilibrium equilibrium(body, strict(1e-6));
  equilibrium.set_contact(plate, top, bonded());
  for (const double stretch : {0.9, 0.75, 1.0, 1.2, 1.4}) {
    const EquilibriumStatus status = equilibrium.solve(at({0.5, 0.5, stretch}));
    const auto exact = experiments::block_state(*law, {1, 1, stretch}, {true, true, true});
    CHECK(status.tool_force.z() == Approx(-exact.stress.z()).epsilon(2e-3).margin(1e-4));
    CHECK(status.touching == std::ssize(top));
  }
  const FiniteState middle = body.at({0.5, 0.5, 0.5}, equilibrium.coefficients());
  CHECK(middle.deformation(2, 2) == Approx(1.4).epsilon(1e-4));
}

TEST_CASE("A plate bonded to the top of a block shears it: tau = mu gamma, and it rises by the Poynting effect") {
  FiniteBlock block{.spacing = 0.25};
  for (int face = 0; face < 5; ++face)
    block.held[face].fill(true); // sides and base are sheared, the top is left to the plate
  Problem problem = experiments::finite_block(block);
  leave_top(problem);
  const std::vector<int> top = top_of(problem, true);
  const FiniteBody body(problem, experiments::neo_hookean(2, 0.45));
  Equilibrium equilibrium(body, strict(1e-6));
  equilibrium.take_hold(plate, {{0.5, 0.5, 1}, up}, top);
  for (const double shear : {0.2, 0.5, 0.8}) {
    FiniteLoading loading = at({0.5 + shear, 0.5, 1});
    loading.prescribed = body.prescribed_values([&](const Vector3& x) { return Vector3(shear * x.z(), 0, 0); });
    const EquilibriumStatus status = equilibrium.solve(loading);
    CHECK(status.touching == std::ssize(top));
    // On the body, over an area of 1: sigma = mu (b - tr b / 3) at J = 1.
    CHECK(status.tool_force.x() == Approx(-2 * shear).epsilon(5e-3));
    CHECK(status.tool_force.z() == Approx(2 * shear * shear / 3).epsilon(2e-2));
    CHECK(std::abs(status.tool_force.y()) < 1e-3);
    CHECK(status.energy == Approx(shear * shear).epsilon(1e-3));
    Matrix3 exact = Matrix3::Identity();
    exact(0, 2) = shear;
    CHECK((body.at({0.5, 0.5, 0.5}, equilibrium.coefficients()).deformation - exact).norm() < 1e-3 * shear);
  }
}

TEST_CASE("A plate that rubs on a block drags it along until it slides at friction times pressure") {
  const double friction = 0.3;
  const Problem problem = on_base(0.25, {1, 1, 0.5});
  const std::vector<int> top = top_of(problem, true);
  const FiniteBody body(problem, experiments::neo_hookean(1, 0.45));
  Equilibrium equilibrium(body, strict(1e-8));
  equilibrium.set_contact(plate, top, rubbing(friction));
  EquilibriumStatus status = equilibrium.solve(at({0.5, 0.5, 0.4}));
  double most = 0;
  const auto check = [&] {
    const Vector3& n = up;
    const double pressure = n.dot(status.tool_force), along = along_surface(status.tool_force, n).norm();
    CHECK(along <= friction * pressure * (1 + 1e-9));
    CHECK(status.friction_work >= -1e-9 * pressure);
    CHECK(along_surface(status.tool_force - status.friction, n).norm() < 1e-9 * pressure);
    const auto [force, torque] = imbalance(body, equilibrium, status);
    CHECK(force < 1e-6);
    CHECK(torque < 1e-6);
    most = along / (friction * pressure);
  };
  check();
  CHECK(most < 0.05);
  double last = 0;
  for (const double way : {0.02, 0.04, 0.08, 0.2, 0.5, 0.8, 1.1, 1.4, 1.7, 2.0}) {
    status = equilibrium.solve(at({0.5 + way, 0.5, 0.4}));
    check();
    CHECK(status.tool_force.x() < 0);
    CHECK(most >= last * (1 - 1e-9));
    last = most;
  }
  CHECK(most == Approx(1).epsilon(1e-6)); // it slides
  const double sliding = -status.tool_force.x();
  // Back: at first it unloads, then it slides the other way with the same force.
  status = equilibrium.solve(at({2.47, 0.5, 0.4}));
  check();
  CHECK(most < 0.95);
  status = equilibrium.solve(at({0.5, 0.5, 0.4}));
  check();
  CHECK(most == Approx(1).epsilon(1e-6));
  CHECK(status.tool_force.x() == Approx(sliding).epsilon(1e-2));
}

TEST_CASE("A ball that is pressed in deep and led around a loop gives work to friction, as much as is put in") {
  const double friction = 0.5;
  const Problem problem = on_base(1.0 / 6);
  const FiniteBody body(problem, experiments::neo_hookean(1, 0.45));
  Equilibrium equilibrium(body);
  equilibrium.set_contact(SphereTip{0.4}, top_of(problem, false), rubbing(friction));
  static_cast<void>(equilibrium.solve(at({0.5, 0.5, 1.01})));
  std::vector<Vector3> way;
  for (const double depth : {0.05, 0.1, 0.15})
    way.emplace_back(0.5, 0.5, 1 - depth);
  for (int k = 1; k <= 24; ++k) {
    const double angle = 2 * std::numbers::pi * k / 24;
    way.emplace_back(0.5 + 0.15 * (1 - std::cos(angle)), 0.5 + 0.15 * std::sin(angle), 0.85);
  }
  for (const double depth : {0.1, 0.05, -0.01})
    way.emplace_back(0.5, 0.5, 1 - depth);
  double put_in = 0, taken = 0;
  Vector3 place(0.5, 0.5, 1.01), force = Vector3::Zero();
  for (const Vector3& next : way) {
    const EquilibriumStatus status = equilibrium.solve(at(next));
    put_in -= 0.5 * (force + status.tool_force).dot(next - place);
    taken += status.friction_work;
    CHECK(status.friction_work >= -1e-6);
    force = status.tool_force;
    place = next;
    const std::vector<ContactShare>& shares = equilibrium.contact_shares();
    for (const ContactShare& share : shares)
      CHECK(share.along.norm() <= friction * share.pressing * (1 + 1e-9));
  }
  CHECK(force.norm() == 0);
  CHECK(taken > 0);
  CHECK(put_in == Approx(taken).epsilon(0.1));
}

TEST_CASE("A grasper folds a flap by 90 degrees, which comes to rest again when it lets go") {
  FiniteBlock block{.upper = {1.2, 0.4, 0.15}, .spacing = 0.1};
  block.held[0].fill(true);
  Problem problem = experiments::finite_block(block);
  problem.touched_from = up;
  std::vector<int> end;
  for (int i = 0; i < problem.nodes.size(); ++i)
    if (problem.nodes.positions[i].x() > 1.05 && problem.nodes.positions[i].z() > 0.15 - 1e-9)
      end.push_back(i);
  const FiniteBody body(problem, experiments::neo_hookean(1, 0.45));
  for (const bool turns : {false, true}) {
    EquilibriumOptions options;
    options.tolerance = 1e-5;
    options.maximum_iterations = 400;
    Equilibrium equilibrium(body, options);
    const Vector3 begin(1.15, 0.2, 0.15);
    equilibrium.take_hold(SphereTip{0.2}, {begin, up}, end);
    CHECK(equilibrium.solve(at(begin)).tool_force.norm() < 1e-8);
    // The end goes round a quarter of a circle of the strip's length as an arc, back over the strip.
    EquilibriumStatus status;
    double energy = 0;
    for (int k = 1; k <= 12; ++k) {
      const double angle = std::numbers::pi / 2 * k / 12, radius = 1.15 / angle;
      const Vector3 axis = turns ? Vector3(-std::sin(angle), 0, std::cos(angle)) : up;
      const Vector3 place(radius * std::sin(angle), 0.2, 0.15 + radius * (1 - std::cos(angle)));
      status = equilibrium.solve(at(place, axis));
      CHECK(status.residual < options.tolerance);
      CHECK(status.energy > energy);
      energy = status.energy;
    }
    INFO("turns " << turns << ", halvings " << status.halvings << ", least J " << status.least_jacobian);
    CHECK(status.least_jacobian > 0.2);
    const auto [force, torque] = imbalance(body, equilibrium, status);
    CHECK(force < 0.01);
    CHECK(torque < 0.01);
    if (turns) { // its end stands upright
      const Matrix3 f = body.at({1.15, 0.2, 0.1}, equilibrium.coefficients()).deformation;
      CHECK((f * Vector3::UnitX()).normalized().z() > 0.95);
    }
    equilibrium.let_go();
    CHECK(equilibrium.contact() == nullptr);
    status = equilibrium.solve({});
    CHECK(equilibrium.coefficients().lpNorm<Eigen::Infinity>() < 2e-3);
    CHECK(status.tool_force.norm() == 0);
  }
}

TEST_CASE("Tool and held face turned together by 90 degrees leave forces that have turned with them") {
  const Problem problem = on_base(0.25, {1, 1, 0.75});
  const FiniteBody body(problem, experiments::neo_hookean(1, 0.45));
  const Vector3 turning = Vector3(1, 0, 0), middle(0.5, 0.5, 0);
  const std::vector<int> top = top_of(problem, false);
  for (const bool held : {true, false}) {
    EquilibriumOptions options = strict(1e-10);
    options.maximum_iterations = 300;
    Equilibrium equilibrium(body, options);
    if (held)
      equilibrium.take_hold(SphereTip{0.5}, {{0.5, 0.5, 0.75}, up}, {top.begin() + 2, top.begin() + 6});
    else
      equilibrium.set_contact(SphereTip{0.5}, top, rubbing(0.4));
    for (const double depth : {0.05, 0.1})
      static_cast<void>(equilibrium.solve(at({0.5, 0.5, 0.75 - depth})));
    const Vector3 place(0.53, 0.52, 0.65);
    const EquilibriumStatus before = equilibrium.solve(at(place));
    const std::vector<Vector3> reactions = equilibrium.constraint_forces();
    EquilibriumStatus after;
    Matrix3 turn;
    for (int degrees = 2; degrees <= 90; degrees += 2) { // short of the strides of friction
      turn = Eigen::AngleAxisd(degrees * std::numbers::pi / 180, turning).toRotationMatrix();
      FiniteLoading loading = at(middle + turn * (place - middle), turn * up);
      loading.prescribed =
          body.prescribed_values([&](const Vector3& x) { return Vector3(middle + turn * (x - middle) - x); });
      after = equilibrium.solve(loading);
    }
    const double size = before.tool_force.norm();
    REQUIRE(along_surface(before.tool_force, up).norm() > 0.02 * size);
    CHECK((after.tool_force - turn * before.tool_force).norm() < 1e-9 * size);
    CHECK((after.tool_torque - turn * before.tool_torque).norm() < 1e-9 * size);
    CHECK(after.energy == Approx(before.energy).epsilon(1e-9));
    CHECK(after.friction_work < 1e-9 * size);
    for (std::size_t e = 0; e < reactions.size(); ++e)
      CHECK((equilibrium.constraint_forces()[e] - turn * reactions[e]).norm() < 1e-9 * size);
  }
}

TEST_CASE("What grips has the same bits with any number of threads, and a step that fails leaves it as it was") {
  const Problem problem = on_base(0.25);
  const FiniteBody body(problem, experiments::neo_hookean(1, 0.45));
  for (const FiniteContactOptions& contact : {bonded(), rubbing(0.4)}) {
    Vector3 forces[2];
    VectorX coefficients[2];
    for (const int threads : {1, 3}) {
      set_thread_count(threads);
      EquilibriumOptions options;
      options.halvings = 1;
      options.maximum_iterations = 30;
      options.fall_back = false;
      Equilibrium equilibrium(body, options);
      equilibrium.set_contact(SphereTip{0.5}, top_of(problem, false), contact);
      static_cast<void>(equilibrium.solve(at({0.5, 0.5, 0.9})));
      if (threads > 1) { // through the base
        const std::vector<ContactShare> before = equilibrium.contact_shares();
        const VectorX was = equilibrium.coefficients();
        CHECK_THROWS_AS(equilibrium.solve(at({0.5, 0.5, -0.5})), NumericalError);
        CHECK(equilibrium.coefficients() == was);
        REQUIRE(equilibrium.contact_shares().size() == before.size());
        for (std::size_t c = 0; c < before.size(); ++c) {
          CHECK(equilibrium.contact_shares()[c].pressing == before[c].pressing);
          CHECK(equilibrium.contact_shares()[c].along == before[c].along);
          CHECK(equilibrium.contact_shares()[c].anchor == before[c].anchor);
          CHECK(equilibrium.contact_shares()[c].touches == before[c].touches);
        }
        equilibrium.set_contact(SphereTip{0.5}, top_of(problem, false), contact);
        equilibrium.set_coefficients(VectorX::Zero(was.size()));
        static_cast<void>(equilibrium.solve(at({0.5, 0.5, 0.9})));
      }
      forces[threads > 1 ? 1 : 0] = equilibrium.solve(at({0.6, 0.5, 0.9})).tool_force;
      coefficients[threads > 1 ? 1 : 0] = equilibrium.coefficients();
      set_thread_count(1);
    }
    CHECK(forces[0] == forces[1]);
    CHECK(coefficients[0] == coefficients[1]);
  }
}

TEST_CASE("A step that is halved rubs as one that is not") {
  const Problem problem = on_base(0.25);
  const FiniteBody body(problem, experiments::neo_hookean(1, 0.45));
  const auto force = [&](int steps, int iterations) {
    EquilibriumOptions options = strict(1e-6);
    options.maximum_iterations = iterations;
    options.fall_back = false;
    Equilibrium equilibrium(body, options);
    equilibrium.set_contact(SphereTip{0.5}, top_of(problem, false), rubbing(0.4));
    EquilibriumStatus status = equilibrium.solve(at({0.5, 0.5, 0.9}));
    int halvings = status.halvings;
    for (int k = 1; k <= steps; ++k) {
      status = equilibrium.solve(at({0.5 + 0.1 * k / steps, 0.5, 0.9}));
      halvings += status.halvings;
    }
    return std::pair(status.tool_force, halvings);
  };
  const auto [whole, none] = force(1, 100);
  const auto [fine, few] = force(8, 100);
  CHECK(none == 0);
  Vector3 halved;
  int some = 0;
  for (int most = 14; some == 0 && most > 5; --most) // so few iterations that a step has to be halved
    std::tie(halved, some) = force(1, most);
  REQUIRE(some > 0);
  CHECK((fine - whole).norm() < 0.03 * whole.norm());
  CHECK((halved - whole).norm() < 0.03 * whole.norm());
}

TEST_CASE("On random ways every step of a tool that rubs, or is bonded, finds its equilibrium") {
  for (const int seed : {1, 2, 3}) {
    std::mt19937 random(seed);
    const auto one = [&] { return 2.0 * random() / std::mt19937::max() - 1; };
    const Problem problem = on_base(0.2);
    const FiniteBody body(problem, experiments::neo_hookean(1, seed == 3 ? 0.49 : 0.4));
    for (const FiniteContactOptions& contact : {rubbing(0.3 * seed), bonded()}) {
      EquilibriumOptions options;
      options.tolerance = 1e-4;
      Equilibrium equilibrium(body, options);
      equilibrium.set_contact(seed == 2 ? topology::ToolShape(FlatPunch{0.25, 1}) : SphereTip{0.3},
                              top_of(problem, true), contact);
      Vector3 place(0.5, 0.5, 1.02), axis = up;
      for (int step = 0; step < 20; ++step) {
        INFO("seed " << seed << ", step " << step);
        const EquilibriumStatus status = equilibrium.solve(at(place, axis));
        CHECK(status.residual < options.tolerance);
        CHECK(status.penetration <= options.penetration);
        CHECK(status.friction_work >= -1e-6);
        for (const ContactShare& share : equilibrium.contact_shares())
          if (contact.condition == ContactCondition::frictional)
            CHECK(share.along.norm() <= contact.friction * share.pressing * (1 + 1e-9));
        place += 0.05 * Vector3(one(), one(), step < 6 ? -0.6 : 0.6 * one());
        place = place.cwiseMax(Vector3(0.3, 0.3, 0.75)).cwiseMin(Vector3(0.7, 0.7, 1.05));
        const Vector3 turned = (axis + 0.05 * Vector3(one(), one(), 0)).normalized();
        axis = turned.z() > 0.9 ? turned : up;
      }
    }
  }
}

TEST_CASE("Under loads far larger than its own force a tool grips as exactly as they are balanced") {
  Problem problem = on_base(0.2);
  problem.loads.body_force = [](const Vector3&) { return Vector3(0, 0, -0.3); };
  const FiniteBody body(problem, experiments::neo_hookean(1, 0.45));
  for (const FiniteContactOptions& contact : {rubbing(0.4), bonded()}) {
    Vector3 forces[2];
    for (const bool is_strict : {false, true}) {
      EquilibriumOptions options = strict(1e-7);
      if (!is_strict) {
        options = {};
        options.tolerance = 1e-4;
      }
      Equilibrium equilibrium(body, options);
      equilibrium.set_contact(SphereTip{1}, top_of(problem, false), contact);
      static_cast<void>(equilibrium.solve({}));
      double sag = 0; // of the top's middle
      for (std::size_t c = 0; c < equilibrium.contact()->candidates().size(); ++c)
        if (const Vector3 x = equilibrium.contact()->place(static_cast<int>(c), equilibrium.coefficients());
            std::hypot(x.x() - 0.5, x.y() - 0.5) < 0.2)
          sag = std::max(sag, x.z());
      static_cast<void>(equilibrium.solve(at({0.5, 0.5, sag - 0.01})));
      forces[is_strict ? 1 : 0] = equilibrium.solve(at({0.504, 0.5, sag - 0.01})).tool_force;
    }
    INFO(forces[0].transpose() << " for " << forces[1].transpose());
    CHECK(forces[1].norm() < 0.1 * 0.3);
    CHECK((forces[0] - forces[1]).norm() < 0.02 * forces[1].norm());
  }
}

TEST_CASE("Grips refuse what they cannot use") {
  const Problem problem = on_base(0.25);
  const FiniteBody body(problem, experiments::neo_hookean(1, 0.45));
  Equilibrium equilibrium(body);
  const std::vector<int> top = top_of(problem, false);
  CHECK_THROWS_WITH(equilibrium.set_contact(plate, top, rubbing(-0.1)), Catch::Contains("friction of -0.1"));
  CHECK_THROWS_AS(equilibrium.set_contact(plate, top, rubbing(std::nan(""))), InputError);
  CHECK_THROWS_AS(equilibrium.take_hold(plate, {{0, 0, std::nan("")}, up}, top), InputError);
  CHECK(equilibrium.contact() == nullptr);
  equilibrium.set_contact(plate, top, rubbing(0.1));
  CHECK_THROWS_WITH(equilibrium.set_coefficients(equilibrium.coefficients(), 0, {}, std::vector<ContactShare>(3)),
                    Catch::Contains("3 shares of a contact with"));
  EquilibriumOptions options;
  options.unsettled = 0;
  CHECK_THROWS_WITH(Equilibrium(body, options), Catch::Contains("unsettled; it must be positive"));
}
