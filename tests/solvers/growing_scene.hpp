// A small body whose cut grows, for tests of bodies that follow it or are made again.
#pragma once

#include "solvers/body/discretisation.hpp"
#include "topology/blade/blade.hpp"

#include <stdexcept>

namespace spherecut::tests {

using namespace solvers;

/// A block of 60 x 40 x 30 mm on its base, and an upright blade that runs into it from the side along a slanted line.
struct GrowingScene {
  static constexpr double step = 0.004, depth = 0.0123;
  const Vector3 heading = Vector3(1, 0.083, 0).normalized();
  std::shared_ptr<const topology::Domain> domain;
  topology::BladeSweep sweep;
  SprinkleOptions sprinkling;
  NodeCloud nodes;
  double poisson_ratio = 0.4;
  double time = 0;

  explicit GrowingScene(Method method = Method::galerkin, bool lips_apart = false)
      : domain(topology::make_box_domain({-0.03, -0.02, -0.03}, {0.03, 0.02, 0}, 0.005)),
        sweep({{{0, 0, -depth}, {0, 0, 0.004}}, 1e-4}, domain, {.edge = 0.003}) {
    for (int k = 0; k < 8; ++k)
      advance();
    sprinkling.spacing.fine = sprinkling.spacing.coarse = 0.006;
    sprinkling.incision = sweep.incision();
    sprinkling.ring_ahead = wants_ring_ahead(method);
    sprinkling.lips_apart = lips_apart;
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
