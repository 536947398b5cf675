#include "experiments/support/cut_body.hpp"

namespace spherecut::experiments {

CutBody cut_body(const CutBodyCase& cut) {
  CutBody body;
  body.problem.domain = cut.domain;
  body.problem.incision = std::make_shared<topology::Incision>(cut.sheets, cut.domain);
  solvers::SprinkleOptions options;
  options.incision = body.problem.incision;
  options.random_seed = cut.seed;
  options.ring_ahead = solvers::wants_ring_ahead(cut.method);
  options.lips_apart = cut.sight == solvers::SightRule::appended;
  solvers::SpacingField shape;
  shape.fine = 1;
  shape.coarse = cut.coarse;
  shape.slope = cut.slope;
  shape.segments = solvers::front_segments(*body.problem.incision, 0.1 * cut.domain->bounds().extent().norm());
  if (cut.fine > 0) {
    shape.fine = cut.fine;
    shape.coarse = cut.coarse * cut.fine;
    options.spacing = shape;
  } else {
    options.spacing = solvers::spacing_for_count(*cut.domain, shape, cut.nodes, options);
  }
  body.fine = options.spacing.finest();
  body.problem.nodes = solvers::sprinkle(*cut.domain, options).nodes;
  return body;
}

void hold_surface(solvers::Problem& problem, std::function<bool(const Vector3& x, const Vector3& normal)> region,
                  std::function<Vector3(const Vector3& x)> field) {
  const solvers::NodeCloud& nodes = problem.nodes;
  for (int i = 0; i < nodes.size(); ++i) {
    const Vector3& x = nodes.positions[i];
    if (nodes.kinds[i] == solvers::NodeKind::interior || problem.domain->signed_distance(x) < -1e-3 * nodes.spacings[i])
      continue;
    // A node on an edge belongs to either side of it.
    const Vector3 on_surface = problem.domain->closest_surface_point(x);
    bool held = region(on_surface, problem.domain->normal(x));
    for (const Plane& plane : problem.domain->planes())
      held = held || (std::abs(plane.signed_distance(on_surface)) < 1e-6 * nodes.spacings[i] &&
                      region(on_surface, plane.normal));
    if (held)
      problem.prescribed.push_back({i, {true, true, true}, field(x)});
  }
  problem.prescribed_region = std::move(region);
  problem.prescribed_field = std::move(field);
}

void hold_whole_surface(solvers::Problem& problem, std::function<Vector3(const Vector3& x)> field) {
  hold_surface(
      problem, [](const Vector3&, const Vector3&) { return true; }, std::move(field));
}

Vector3 opening_at(const solvers::Discretisation& body, const solvers::Field& field, const Vector3& x,
                   const Vector3& normal, double spacing) {
  const Vector3 off = solvers::lip_offset * spacing * normal;
  return body.at(x + off, field).displacement - body.at(x - off, field).displacement;
}

} // namespace spherecut::experiments
