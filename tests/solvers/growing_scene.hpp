// A small body whose cut grows, for tests of those that follow it.
#pragma once

#include "solvers/cut/growing_body.hpp"
#include "topology/blade/blade.hpp"
#include "topology/incision/cut_sheets.hpp"

namespace spherecut::tests {

using namespace solvers;

/// A block of 60 x 40 (or more) x 30 mm on its base, and an upright blade that runs into it from the side along a
/// slanted line.
struct GrowingScene {
  static constexpr double step = 0.004, depth = 0.0123;
  const Vector3 heading = Vector3(1, 0.083, 0).normalized();
  std::shared_ptr<const topology::Domain> domain;
  topology::BladeSweep sweep;
  SprinkleOptions sprinkling;
  NodeCloud nodes;
  Method method;
  double poisson_ratio = 0.4;
  double time = 0;
  double lower_end;

  explicit GrowingScene(double lower = -depth, double half_width = 0.02, Method wanted = Method::galerkin)
      : domain(topology::make_box_domain({-0.03, -half_width, -0.03}, {0.03, half_width, 0}, 0.005)),
        sweep({{{0, 0, lower}, {0, 0, 0.004}}, 1e-4}, domain, {.edge = 0.003}), method(wanted), lower_end(lower) {
    for (int k = 0; k < 8; ++k)
      advance();
    sprinkling.spacing.fine = sprinkling.spacing.coarse = 0.006;
    if (half_width > 0.02) { // coarse far from the blade's way
      sprinkling.spacing.coarse = 0.009;
      sprinkling.spacing.segments = {{Vector3(-0.03, 0, 0), Vector3(0.03, 0, 0)},
                                     {Vector3(-0.03, 0, -depth), Vector3(0.03, 0, -depth)}};
    }
    sprinkling.incision = sweep.incision();
    sprinkling.ring_ahead = wants_ring_ahead(method);
    nodes = sprinkle(*domain, sprinkling).nodes;
  }

  void advance() {
    sweep.move_to({time, Vector3(-0.0341, 0.0013, 0) + time * step * heading});
    time += 1;
  }

  [[nodiscard]] Problem problem() const {
    Problem p;
    p.domain = domain;
    p.incision = sweep.incision();
    p.nodes = nodes;
    p.material = {5000, poisson_ratio, 1000};
    for (int i = 0; i < nodes.size(); ++i)
      if ((nodes.kinds[i] == NodeKind::surface || nodes.kinds[i] == NodeKind::edge) &&
          nodes.positions[i].z() < -0.03 + 1e-9)
        p.prescribed.push_back({i, {true, true, true}, Vector3(1e-4, 0, 0)});
    p.prescribed_region = [](const Vector3& x, const Vector3& normal) { return normal.z() < -0.5 && x.z() < -0.029; };
    p.loads.initial_strain.diagonal() << 0, -0.05, 0;
    p.loads.body_force = [](const Vector3& x) { return Vector3(200 * x.y(), 0, -3000); };
    return p;
  }

  [[nodiscard]] GrowthOptions options() const {
    GrowthOptions o;
    o.method.method = method;
    o.method.support_radius = 1.8;
    o.method.estimate_condition = false;
    const Vector3 tip = Vector3(-0.0341, 0.0013, 0) + (time - 1) * step * heading;
    o.way =
        topology::make_rectangle_sheet(tip + 2 * step * heading + 0.5 * lower_end * Vector3::UnitZ(),
                                       heading.cross(Vector3::UnitZ()), Vector3::UnitZ(), 6 * step, -lower_end, 0.002);
    return o;
  }

  /// The blade goes on by one step; nodes are exchanged beside it.
  SprinkleIncrement grow() {
    const auto before = sweep.incision();
    advance();
    sprinkling.incision = sweep.incision();
    SprinkleIncrement change = extend_sprinkling(*domain, sprinkling, nodes, before.get());
    NodeCloud next;
    std::size_t gone = 0;
    for (int i = 0; i < nodes.size(); ++i)
      if (gone < change.removed.size() && change.removed[gone] == i)
        ++gone;
      else
        next.add(nodes, i);
    for (int k = 0; k < change.added.size(); ++k)
      next.add(change.added, k);
    nodes = std::move(next);
    return change;
  }

  [[nodiscard]] int first(NodeKind kind) const {
    for (int i = nodes.size(); i-- > 0;)
      if (nodes.kinds[i] == kind && nodes.positions[i].z() > -0.029)
        return i;
    throw std::logic_error("no such node");
  }
};

} // namespace spherecut::tests
