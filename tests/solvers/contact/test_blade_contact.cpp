#include "solvers/contact/blade_contact.hpp"
#include "solvers/contact/solver.hpp"

#include "tests/support/cut_block.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

constexpr double toughness = 150, width = 0.02; // J/m2, m

/// A body of one contact with compliance c, m/N.
BladePatch single(double c) {
  BladePatch patch;
  patch.contacts = {EdgeContact{Vector3::Zero(), -Vector3::UnitZ(), Vector3::UnitX(), width}};
  patch.compliance = MatrixX::Constant(1, 1, c);
  patch.base = patch.free = VectorX::Zero(1);
  return patch;
}

VectorX one(double value) {
  return VectorX::Constant(1, value);
}

/// Contacts, pairs and drag of a random positive definite compliance.
BladePatch random_patch(int contacts, int pairs, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  BladePatch patch;
  for (int c = 0; c < contacts; ++c)
    patch.contacts.push_back({Vector3::Zero(), -Vector3::UnitZ(), Vector3::UnitX(), 0.01 * (1 + c)});
  patch.pairs.resize(pairs);
  patch.dragged = true;
  patch.drag = {0, 0, -0.4};
  const int n = contacts + pairs + 1;
  const MatrixX root = MatrixX::NullaryExpr(n, n, [&] { return normal(random); });
  patch.compliance = 0.2 / n * root * root.transpose() + MatrixX::Identity(n, n);
  patch.base = VectorX::NullaryExpr(n, [&] { return 0.05 * normal(random); });
  patch.free = patch.base;
  patch.base.segment(contacts, pairs) = patch.base.segment(contacts, pairs).cwiseAbs();
  return patch;
}

/// Compliance of a block cut to the depth a: softer at its face, where less material is around the edge.
double compliance_at(double a) {
  return 1e-3 * (1 + std::exp(-a / 0.004));
}

} // namespace

TEST_CASE("The edge's half width is that of Hertz's line contact", "[blade_contact]") {
  const Material material{6000, 0.45, 1000};
  const double r = 1e-4, b = edge_half_width(material, r, toughness);
  // Load per length back from the half width: f = pi E* b^2 / (4 r).
  CHECK(std::numbers::pi * 6000 / (1 - 0.45 * 0.45) * b * b / (4 * r) == Approx(toughness).epsilon(1e-12));
  CHECK(edge_half_width(material, 4 * r, toughness) == Approx(2 * b).epsilon(1e-12));
  CHECK_THROWS_AS(edge_half_width(material, 0, toughness), InputError);
  CHECK_THROWS_AS(edge_half_width(material, r, -1), InputError);
  CHECK_THROWS_AS(edge_half_width(material, std::nan(""), toughness), InputError);
}

TEST_CASE("An edge pushes and does not pull", "[blade_contact]") {
  const BladePatch patch = single(2e-3);
  const BladeState pushed = push_blade(patch, one(0.004));
  CHECK(pushed.forces[0] == Approx(2).epsilon(1e-12));
  CHECK(pushed.stored == Approx(0.5 * 2 * 0.004).epsilon(1e-12));
  CHECK(pushed.edge_force.z() == Approx(2).epsilon(1e-12)); // of the tissue on the edge: against its way
  const BladeState clear = push_blade(patch, one(-0.004));
  CHECK(clear.forces[0] == 0);
  CHECK(clear.stored == 0);
  CHECK_THROWS_AS(push_blade(patch, VectorX::Zero(2)), InputError);
}

TEST_CASE("Energy release by forces is the difference of potential energies", "[blade_contact]") {
  // A front of several contacts that goes on by s with the blade at rest: advances fall by s, the compliance changes.
  const BladePatch patch = random_patch(4, 0, 7);
  const MatrixX change = 0.1 * random_patch(4, 0, 8).compliance;
  const VectorX advance = VectorX::Constant(4, 0.3), motion = VectorX::Constant(4, 1.0);
  double swept = 0;
  for (const EdgeContact& contact : patch.contacts)
    swept += contact.length;
  const double s = 1e-5;
  const auto grown = [&](double by) {
    BladePatch other = patch;
    other.compliance += by * change;
    return push_blade(other, advance - by * motion).driving;
  };
  const BladeState state = push_blade(patch, advance);
  REQUIRE(state.forces.head(4).minCoeff() > 0);
  const double by_forces = energy_release(patch, state, motion, change.topLeftCorner(4, 4));
  CHECK(by_forces == Approx((grown(-s) - grown(s)) / (2 * s * swept)).epsilon(1e-8));
  CHECK_THROWS_AS(energy_release(patch, state, VectorX::Zero(4)), InputError);
}

TEST_CASE("A block that looks the same at every depth is cut at toughness times width, and all work is accounted for",
          "[blade_contact]") {
  const BladePatch body = single(1e-3);
  const double step = 0.0004, sharpness = 0.8, needed = toughness / sharpness * step * width;
  BladeLedger ledger;
  double front = 0, blade = 0, force_work = 0, way = 0;
  BladeState state = push_blade(body, one(0));
  int cuts = 0;
  for (int k = 1; k <= 400; ++k) {
    const double target = 1e-4 * k;
    while (blade < target) {
      const BladeStroke stroke{one(blade - front), one(target - front)};
      const BladeStroke beyond{one(blade - front - step), one(target - front - step)};
      const auto share = cutting_share(body, stroke, body, beyond, needed);
      const double reached = share ? blade + *share * (target - blade) : target;
      const BladeState next = push_blade(body, one(reached - front));
      ledger.move(body, state, next, next.advance - state.advance, 0);
      if (front > 0.02) {
        force_work += 0.5 * (state.forces[0] + next.forces[0]) * (reached - blade);
        way += reached - blade;
      }
      blade = reached;
      state = next;
      if (!share)
        break;
      front += step;
      const BladeState after = push_blade(body, one(blade - front));
      ledger.cut(state, after, toughness, sharpness, step * width);
      state = after;
      ++cuts;
    }
  }
  REQUIRE(cuts > 50);
  CHECK(force_work / way == Approx(toughness / sharpness * width).epsilon(0.005)); // whole increments but for the last
  CHECK(ledger.surface == Approx(toughness * width * front).epsilon(1e-12));
  CHECK(ledger.crushing == Approx(0.25 * ledger.surface).epsilon(1e-12));
  CHECK(std::abs(ledger.excess) < 1e-6 * ledger.work);
  CHECK(ledger.imbalance() < 1e-12);
}

TEST_CASE("An edge that slices cuts with less force ahead, and pulls along itself by its ratio", "[blade_contact]") {
  const double c = 1e-3, step = 0.0002;
  for (const double ratio : {0.5, 1.0, 3.0}) {
    const double way = std::sqrt(1 + ratio * ratio); // of the edge for every metre ahead
    BladePatch body = single(c);
    EdgeContact& contact = body.contacts[0];
    contact.edge = Vector3::UnitY();
    contact.push = (ratio * Vector3::UnitY() - Vector3::UnitZ()) / way;
    CHECK((contact.ahead() + Vector3::UnitZ()).norm() < 1e-15);
    CHECK(contact.swept_width() == Approx(width / way).epsilon(1e-12));
    const BladeState pressed = push_blade(body, one(0.003));
    CHECK(energy_release(body, pressed, one(1)) == Approx(pressed.forces[0] / (width / way)).epsilon(1e-12));
    double front = 0, blade = 0, work_ahead = 0, work_along = 0, gone = 0; // m, m ahead
    BladeState state = push_blade(body, one(0));
    for (int k = 1; k <= 600; ++k) {
      const double target = 1e-4 * k;
      while (blade < target) {
        const auto advance = [&](double at, double depth) { return one((at - depth) * way); };
        const auto share =
            cutting_share(body, {advance(blade, front), advance(target, front)}, body,
                          {advance(blade, front + step), advance(target, front + step)}, toughness * step * width);
        const double reached = share ? blade + *share * (target - blade) : target;
        const BladeState next = push_blade(body, advance(reached, front));
        if (front > 0.01) {
          const Vector3 mean = -0.5 * (state.edge_force + next.edge_force);
          work_ahead -= mean.z() * (reached - blade);
          work_along += mean.y() * (reached - blade);
          gone += reached - blade;
        }
        blade = reached;
        state = next;
        if (!share)
          break;
        front += step;
        state = push_blade(body, advance(blade, front));
      }
    }
    REQUIRE(gone > 0.01);
    const double share = 1 / (1 + ratio * ratio); // [Atkins, Xu and Jeronimidis 2004]
    CHECK(work_ahead / gone == Approx(share * toughness * width).epsilon(0.02));
    CHECK(work_along / work_ahead == Approx(ratio).epsilon(1e-12));
  }
}

TEST_CASE("The first cut of a finite length needs the force that its own energy asks for", "[blade_contact]") {
  // Closed form: x^2/2C0 - (x - l)^2/2C = G w l.
  const double c0 = compliance_at(0);
  for (const double length : {0.004, 0.006, 0.009}) {
    const double c = compliance_at(length), needed = toughness * width * length;
    const double p = 0.5 / c0 - 0.5 / c, q = length / c, r = -0.5 * length * length / c - needed;
    const double discriminant = q * q - 4 * p * r;
    if (discriminant < 0)
      continue;
    const double exact = (-q + std::sqrt(discriminant)) / (2 * p);
    const auto share =
        cutting_share(single(c0), {one(0), one(0.02)}, single(c), {one(-length), one(0.02 - length)}, needed);
    REQUIRE(share);
    CHECK(0.02 * *share == Approx(exact).epsilon(1e-7));
    CHECK(exact / c0 > toughness * width);    // above the force of steady cutting
    CHECK((exact - length) / c < exact / c0); // which it drops towards
  }
  CHECK_FALSE(cutting_share(single(c0), {one(0), one(0.001)}, single(c0), {one(-0.001), one(0)}, 1));
}

TEST_CASE("With lips in contact and dragging flanks every motion and cut balances", "[blade_contact]") {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const BladePatch before = random_patch(3, 5, seed);
    BladePatch after = before;
    after.compliance *= 0.9;
    BladeLedger ledger;
    BladeState state = push_blade(before, VectorX::Zero(3), 1);
    const double initially = state.stored;
    constexpr int parts = 4000; // forces change evenly but for where a contact sets in
    for (int k = 1; k <= parts; ++k) {
      const BladeState next = push_blade(before, VectorX::Constant(3, 0.5 * k / parts), 1);
      REQUIRE(next.converged);
      ledger.move(before, state, next, next.advance - state.advance, 0.5 / parts);
      state = next;
    }
    CHECK(state.forces.head(8).minCoeff() >= 0);
    CHECK((state.displacements.head(3) - state.advance).minCoeff() > -1e-9);
    CHECK(state.displacements.segment(3, 5).minCoeff() > -1e-9);
    CHECK(ledger.work - ledger.friction - (ledger.stored - initially) == Approx(0).margin(1e-6 * ledger.work));
    const BladeState cut = push_blade(after, VectorX::Constant(3, 0.4), 1);
    ledger.cut(state, cut, 0.1, 1, 0.01);
    CHECK(ledger.work - ledger.friction - ledger.surface - ledger.excess - (ledger.stored - initially) ==
          Approx(0).margin(1e-6 * ledger.work));
    CHECK(state.blade_force.z() == Approx(state.edge_force.z() + 0.4).epsilon(1e-12));
  }
}

TEST_CASE("On a body the edge meets what it asks for, and the held surface carries its force", "[blade_contact]") {
  const tests::CutBlock block = tests::cut_block(8, false, 3);
  for (const Method method : {Method::galerkin, Method::collocation}) {
    Problem problem = tests::problem_of(block, {1, 0.3, 0});
    for (int i = 0; i < problem.nodes.size(); ++i)
      if (problem.nodes.positions[i].z() < -0.5 + 1e-9)
        problem.prescribed.push_back({i, {true, true, true}, Vector3::Zero()});
    problem.prescribed_region = [](const Vector3& x, const Vector3&) { return x.z() < -0.5 + 1e-9; };
    DiscretisationOptions options;
    options.method = method;
    const auto body = discretise(problem, options);
    const tests::CutFrame& frame = block.frame;
    std::vector<EdgeContact> contacts;
    for (const double along : {-0.2, 0.0, 0.2})
      contacts.push_back({frame.origin + along * frame.tangent, frame.ahead, frame.normal, 0.2});
    const ForcePattern pattern = edge_pattern(contacts[1], 0.15, *block.domain);
    Vector3 total = Vector3::Zero();
    for (std::size_t q = 0; q < pattern.points.size(); ++q) {
      total += pattern.forces[q];
      CHECK((pattern.points[q] - contacts[1].point).dot(frame.ahead) > 0);
    }
    CHECK((total - frame.ahead).norm() < 1e-12);
    // Of an edge that slices the force is turned, and acts on the same material.
    EdgeContact slicing = contacts[1];
    slicing.edge = frame.tangent;
    slicing.push = (frame.ahead + frame.tangent).normalized();
    const ForcePattern turned = edge_pattern(slicing, 0.15, *block.domain);
    REQUIRE(turned.points.size() == pattern.points.size());
    for (std::size_t q = 0; q < pattern.points.size(); ++q) {
      CHECK((turned.points[q] - pattern.points[q]).norm() < 1e-12);
      CHECK((turned.forces[q] - pattern.forces[q].norm() * slicing.push).norm() < 1e-12);
    }

    const Field base = body->solve();
    const BladePatch patch = condense_blade(*body, base, contacts, 0.15);
    const VectorX advance = Vector3(0.04, 0.05, 0.06);
    const BladeState state = push_blade(patch, advance);
    const Field field = deform(patch, state, base);
    std::vector<ForcePattern> patterns;
    for (const EdgeContact& contact : contacts)
      patterns.push_back(edge_pattern(contact, 0.15, *block.domain));
    const VectorX met = body->pattern_displacements(patterns, {field}).col(0);
    // Symmetrised where the method is not symmetric: to its discretisation error.
    CHECK((met - advance).norm() < (method == Method::galerkin ? 1e-9 : 0.03) * advance.norm());
    // What another patch of the body knows need not be solved for again, whatever its order.
    const ForcePattern drag = drag_pattern({{frame.origin - 0.1 * frame.ahead, frame.normal, 0.01}}, 0.1, frame.ahead,
                                           problem.nodes.spacings.front());
    const std::vector<EdgeContact> fewer{contacts[2], contacts[0]};
    const BladePatch fresh = condense_blade(*body, base, fewer, 0.15, {}, drag),
                     dragged = condense_blade(*body, base, contacts, 0.15, {}, drag);
    for (const BladePatch* known : {&patch, &dragged, &fresh}) {
      const BladePatch again = condense_blade(*body, base, fewer, 0.15, {}, drag, known);
      CHECK((again.compliance - fresh.compliance).norm() < 1e-12 * fresh.compliance.norm());
      CHECK(again.base == fresh.base);
      CHECK(again.drag == fresh.drag);
      for (std::size_t k = 0; k < 3; ++k)
        CHECK((again.responses[k].coefficients - fresh.responses[k].coefficients).norm() <
              1e-12 * fresh.responses[k].coefficients.norm());
    }
    std::vector<EdgeContact> moved = fewer;
    moved[0].point += 0.01 * frame.ahead;
    CHECK((condense_blade(*body, base, moved, 0.15, {}, drag, &fresh).compliance -
           condense_blade(*body, base, moved, 0.15, {}, drag).compliance)
              .norm() < 1e-12 * fresh.compliance.norm());
    // What a tool holds stays where it is, and bears a part of the edge's force.
    std::vector<int> grasped;
    for (int i = 0; i < problem.nodes.size(); ++i)
      if (problem.nodes.positions[i].z() > 0.5 - 1e-9 && problem.nodes.positions[i].head<2>().norm() < 0.3)
        grasped.push_back(i);
    REQUIRE(grasped.size() >= 2);
    const ContactPatch grip = condense(*body, grasped);
    const BladePatch gripped = condense_blade(*body, base, contacts, 0.15, {}, {}, nullptr, &grip);
    const BladeState pressed = push_blade(gripped, advance);
    const Field under = deform(gripped, pressed, base);
    CHECK((body->contact_displacements(grasped, {under}) - body->contact_displacements(grasped, {base})).norm() <
          1e-9 * advance.norm());
    CHECK(pressed.edge_force.norm() > 1.001 * state.edge_force.norm());
    const VectorX borne = gripped.held_forces * pressed.forces;
    Vector3 all = pressed.edge_force, at_base = Vector3::Zero();
    for (Eigen::Index c = 0; c < borne.size(); c += 3)
      all -= borne.segment<3>(c);
    for (const Vector3& force : body->constraint_forces(under))
      at_base += force;
    CHECK((all - at_base).norm() < 1e-7 * pressed.edge_force.norm());
    const BladePatch taken = condense_blade(*body, base, fewer, 0.15, {}, {}, &gripped, &grip),
                     alone = condense_blade(*body, base, fewer, 0.15, {}, {}, nullptr, &grip);
    CHECK((taken.compliance - alone.compliance).norm() < 1e-12 * alone.compliance.norm());
    CHECK((taken.held_forces - alone.held_forces).norm() < 1e-9 * alone.held_forces.norm());

    Vector3 held = Vector3::Zero();
    for (const Vector3& force : body->constraint_forces(field))
      held += force;
    CHECK((held + Vector3(-state.edge_force)).norm() < 1e-8 * state.edge_force.norm());
    CHECK_THROWS_AS(condense_blade(*body, base, {}, 0.15), InputError);
    CHECK_THROWS_AS(edge_pattern({Vector3(0, 0, 2), Vector3::UnitZ(), Vector3::UnitX(), 0.1}, 0.1, *block.domain),
                    InputError);
  }
}
