#include "experiments/support/cutting_block.hpp"

#include "experiments/support/cut_body.hpp"

#include "topology/incision/cut_sheets.hpp"

#include <cmath>

namespace spherecut::experiments {

namespace {

constexpr int contacts = 4; // along the edge

Vector3 normal_of_cut(const CuttingCase& block) {
  return {0, -std::sin(block.tilt), std::cos(block.tilt)};
}

std::vector<solvers::FlankPoint> flanks_of(const CuttingCase& block, double depth) {
  std::vector<solvers::FlankPoint> points;
  const double reach = std::min(block.flank, depth);
  const int rows = static_cast<int>(std::ceil(reach / (0.5 * block.spacing)));
  const int columns = static_cast<int>(std::ceil(block.front() / (0.5 * block.spacing)));
  for (int i = 0; i < rows; ++i)
    for (int k = 0; k < columns; ++k) {
      const double back = reach * (i + 0.5) / rows, along = block.front() * ((k + 0.5) / columns - 0.5);
      points.push_back({Vector3(depth - back, 0, block.above) + along * block.along(), normal_of_cut(block),
                        reach * block.front() / (rows * columns)});
    }
  return points;
}

} // namespace

double CuttingCase::front() const {
  return width / std::cos(tilt);
}

double CuttingCase::way() const {
  return std::sqrt(1 + slice * slice);
}

Vector3 CuttingCase::along() const {
  return {0, std::cos(tilt), std::sin(tilt)};
}

Vector3 CuttingCase::course() const {
  return (Vector3::UnitX() + slice * along()) / way();
}

CuttingBody cutting_body(const CuttingCase& block, double depth, const solvers::NodeCloud* previous) {
  const Vector3 half(0, 0.5 * block.width, 0.5 * block.height);
  const auto domain = topology::make_box_domain(-half, half + Vector3(block.length, 0, 0), 0.25 * block.width);
  solvers::Problem problem;
  problem.domain = domain;
  problem.material = block.material;
  if (depth > 0) {
    const double beyond = 0.3 * block.width;
    problem.incision = std::make_shared<topology::Incision>(
        std::vector<topology::SurfaceMesh>{topology::make_rectangle_sheet(
            {0.5 * (depth - beyond), 0, block.above}, normal_of_cut(block), Vector3::UnitX(),
            block.front() + 2 * beyond, depth + beyond, 0.25 * block.width)},
        domain);
  }
  solvers::SprinkleOptions options;
  options.random_seed = block.seed;
  options.incision = problem.incision;
  options.ring_ahead = solvers::wants_ring_ahead(block.method);
  options.spacing.fine = block.spacing;
  options.spacing.coarse = 4 * block.spacing;
  options.spacing.slope = 0.35;
  options.spacing.plateau = 1.5 * block.half_width / block.spacing;
  options.spacing.segments = {{Vector3(0, 0, block.above), Vector3(block.path, 0, block.above)}};
  problem.nodes = previous == nullptr ? solvers::sprinkle(*domain, options).nodes
                                      : solvers::resprinkle(*domain, options, *previous).nodes;
  const double held = 0.5 * block.height - 1e-9;
  hold_surface(
      problem, [held](const Vector3& x, const Vector3&) { return std::abs(x.z()) > held; },
      [](const Vector3&) -> Vector3 { return Vector3::Zero(); });

  CuttingBody result;
  result.depth = depth;
  result.way = block.way();
  result.nodes = problem.nodes;
  solvers::DiscretisationOptions method;
  method.method = block.method;
  method.estimate_condition = false;
  const std::vector<solvers::LipPair> pairs = solvers::lip_pairs(problem.nodes);
  const auto body = solvers::discretise(std::move(problem), method);
  std::vector<solvers::EdgeContact> edge;
  edge.reserve(contacts);
  for (int k = 0; k < contacts; ++k)
    edge.push_back({Vector3(depth, 0, block.above) + block.front() * ((k + 0.5) / contacts - 0.5) * block.along(),
                    block.course(), normal_of_cut(block), block.front() / contacts,
                    block.slice != 0 ? block.along() : Vector3(Vector3::Zero())});
  const solvers::ForcePattern drag =
      block.shear > 0 ? solvers::drag_pattern(flanks_of(block, depth), block.shear, block.course(), block.spacing)
                      : solvers::ForcePattern{};
  result.patch = solvers::condense_blade(*body, body->solve(), edge, block.half_width, pairs, drag);
  if (block.gauge > 0 && depth > block.gauge) {
    result.gauge.resize(std::ssize(result.patch.responses));
    for (Eigen::Index k = 0; k < result.gauge.size(); ++k)
      result.gauge[k] = normal_of_cut(block).dot(opening_at(*body, result.patch.responses[static_cast<std::size_t>(k)],
                                                            {depth - block.gauge, 0, block.above}, normal_of_cut(block),
                                                            block.spacing));
  }
  return result;
}

std::vector<CuttingBody> cutting_bodies(const CuttingCase& block, const std::vector<double>& depths) {
  std::vector<CuttingBody> bodies;
  bodies.reserve(depths.size());
  for (const double depth : depths)
    bodies.push_back(cutting_body(block, depth, bodies.empty() ? nullptr : &bodies.back().nodes));
  return bodies;
}

} // namespace spherecut::experiments
