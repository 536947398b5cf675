#include "solvers/body/elastic_body.hpp"

#include "topology/base/errors.hpp"

#include <chrono>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

Problem checked(Problem problem) {
  check_problem(problem);
  return problem;
}

} // namespace

void check_problem(const Problem& problem) {
  problem.material.check();
  const NodeCloud& nodes = problem.nodes;
  const std::size_t count = nodes.positions.size();
  if (nodes.spacings.size() != count || nodes.reaches.size() != count || nodes.kinds.size() != count ||
      nodes.normals.size() != count)
    throw InputError(fmt::format("{} node positions, but {} spacings, {} reaches, {} kinds and {} normals", count,
                                 nodes.spacings.size(), nodes.reaches.size(), nodes.kinds.size(),
                                 nodes.normals.size()));
  if (nodes.size() < 4)
    throw InputError(fmt::format("{} nodes: a linear basis in three dimensions needs at least 4", nodes.size()));
  if (!problem.loads.initial_strain.allFinite())
    throw InputError("the initial strain is not finite");
  for (int i = 0; i < nodes.size(); ++i) {
    if (!nodes.positions[i].allFinite())
      throw InputError(fmt::format("node {}: its position is not finite", i));
    if (!(nodes.spacings[i] > 0) || !std::isfinite(nodes.spacings[i]))
      throw InputError(fmt::format("node {}: spacing {} m must be positive", i, nodes.spacings[i]));
    if (!(nodes.reaches[i] > 0 && nodes.reaches[i] <= nodes.spacings[i]))
      throw InputError(fmt::format("node {}: a reach of {} m; allowed: above 0, at most its spacing of {} m", i,
                                   nodes.reaches[i], nodes.spacings[i]));
  }
  std::vector<std::array<bool, 3>> held(nodes.positions.size(), {false, false, false});
  bool any_held = false;
  for (const Prescribed& entry : problem.prescribed) {
    if (entry.node < 0 || entry.node >= nodes.size())
      throw InputError(fmt::format("prescribed node {} does not exist; there are {}", entry.node, nodes.size()));
    if (!entry.value.allFinite())
      throw InputError(fmt::format("prescribed displacement of node {} is not finite", entry.node));
    for (int c = 0; c < 3; ++c) {
      if (!entry.components[c])
        continue;
      // Two values contradict each other, and one value twice would count its force twice.
      if (held[entry.node][c])
        throw InputError(fmt::format("node {}: displacement component {} is prescribed twice", entry.node, "xyz"[c]));
      held[entry.node][c] = any_held = true;
    }
  }
  if (!any_held)
    throw InputError("nothing is fixed: no node has a prescribed displacement, so the body can move freely (6 rigid "
                     "motions); fix a part of its surface");
}

NodalSupports nodal_supports(const Spheres& spheres) {
  NodalSupports supports;
  const std::size_t count = spheres.centres().size();
  supports.start.assign(1, 0);
  supports.start.reserve(count + 1);
  supports.nodes.reserve(32 * count);
  supports.value.reserve(32 * count);
  supports.gradient.reserve(32 * count);
  ShapeFunctions shape;
  for (int i = 0; i < spheres.size(); ++i) {
    if (!evaluate(spheres, spheres.centres()[i], shape))
      throw NumericalError(fmt::format("node {}: its support has {} nodes and moment condition {:.1e}; it is not sound",
                                       i, shape.size(), shape.moment_condition));
    supports.worst_moment_condition = std::max(supports.worst_moment_condition, shape.moment_condition);
    for (int k = 0; k < shape.size(); ++k) {
      supports.nodes.push_back(shape.nodes[k]);
      supports.value.push_back(shape.value[k]);
      supports.gradient.push_back(shape.gradient(k));
    }
    supports.start.push_back(static_cast<int>(supports.nodes.size()));
  }
  return supports;
}

Matrix3 stress_from_gradient(const Material& material, const Matrix3& gradient) {
  return material.lame_lambda() * gradient.trace() * Matrix3::Identity() +
         material.shear_modulus() * (gradient + gradient.transpose());
}

Matrix3 initial_stress(const Problem& problem, const Material& material) {
  return stress_from_gradient(material,
                              0.5 * (problem.loads.initial_strain + problem.loads.initial_strain.transpose()));
}

Matrix3 initial_stress(const Problem& problem) {
  return initial_stress(problem, problem.material);
}

void require_one_material(const Problem& problem, std::string_view what) {
  if (problem.regions != nullptr)
    throw InputError(fmt::format("{} on a body of several materials ({} regions, the first is '{}'): it takes one "
                                 "alone; take method galerkin, linear and without a cut, or leave the regions out",
                                 what, problem.regions->all().size(), problem.regions->all().front().name));
}

Sight sight_about_cut(const Problem& problem, Method method, SightRule rule) {
  const Tuning& tuning = problem.tuning;
  Sight sight{.incision = problem.hiding(), .rule = rule, .reach = tuning.front_reach, .blend = tuning.front_blend};
  if (method == Method::collocation && rule == SightRule::enriched) {
    sight.reach = tuning.collocation_front_reach;
    sight.enriched_growth = 2;
    sight.radius_factor = tuning.collocation_front_radius;
  }
  if (problem.material.is_nearly_incompressible())
    sight.reach = tuning.front_reach_soft;
  sight.regions = problem.regions;
  return sight;
}

ElasticBody::ElasticBody(Problem problem, Method method, double rho, SightRule rule,
                         std::vector<double> NodeCloud::*lengths)
    : problem_(checked(std::move(problem))), spheres_([&] {
        const Stopwatch watch;
        Spheres spheres(problem_.nodes.positions, problem_.nodes.*lengths, rho, Basis::linear, worst_moment_condition,
                        sight_about_cut(problem_, method, rule));
        report_.supports_seconds = watch.seconds();
        return spheres;
      }()) {
  const Stopwatch watch;
  supports_ = nodal_supports(spheres_);
  report_.nodes = problem_.nodes.size();
  report_.grown_supports = spheres_.grown();
  report_.worst_moment_condition = supports_.worst_moment_condition;
  report_.supports_seconds += watch.seconds();
}

VectorX NodalSupports::displacements(const Field& field) const {
  const Eigen::Index count = std::ssize(start) - 1;
  VectorX result(3 * count);
  const double* const coefficients = field.coefficients.data();
  for (Eigen::Index i = 0; i < count; ++i) {
    double x = 0, y = 0, z = 0; // sums in registers: most of a step that presses goes here
    for (int k = start[i]; k < start[i + 1]; ++k) {
      const double* const of_node = coefficients + 3 * static_cast<std::ptrdiff_t>(nodes[k]);
      x += value[k] * of_node[0];
      y += value[k] * of_node[1];
      z += value[k] * of_node[2];
    }
    result.segment<3>(3 * i) = Vector3(x, y, z);
  }
  return result;
}

VectorX ElasticBody::nodal_displacements(const Field& field) const {
  require_own(field);
  return supports_.displacements(field);
}

std::vector<Vector3> ElasticBody::constraint_points() const {
  std::vector<Vector3> points;
  points.reserve(problem_.prescribed.size());
  for (const Prescribed& entry : problem_.prescribed)
    points.push_back(problem_.nodes.positions[entry.node]);
  return points;
}

MatrixX ElasticBody::contact_displacements(const std::vector<int>& nodes, const std::vector<Field>& fields) const {
  require_nodes(nodes);
  require_own(fields);
  MatrixX displacements = MatrixX::Zero(3 * std::ssize(nodes), std::ssize(fields));
  for (Eigen::Index f = 0; f < displacements.cols(); ++f)
    for (Eigen::Index c = 0; c < std::ssize(nodes); ++c)
      for (int k = supports_.start[nodes[c]]; k < supports_.start[nodes[c] + 1]; ++k)
        displacements.col(f).segment<3>(3 * c) +=
            supports_.value[k] * fields[f].coefficients.segment<3>(3 * supports_.nodes[k]);
  return displacements;
}

MatrixX pattern_loads(const Spheres& spheres, const std::vector<ForcePattern>& patterns) {
  MatrixX loads = MatrixX::Zero(3 * static_cast<Eigen::Index>(spheres.size()), std::ssize(patterns));
  ShapeFunctions shape;
  for (std::size_t p = 0; p < patterns.size(); ++p) {
    if (patterns[p].points.size() != patterns[p].forces.size())
      throw InputError(
          fmt::format("a pattern of {} forces on {} points", patterns[p].forces.size(), patterns[p].points.size()));
    for (std::size_t q = 0; q < patterns[p].points.size(); ++q) {
      const Vector3& x = patterns[p].points[q];
      if (!evaluate(spheres, x, shape))
        throw NumericalError(
            fmt::format("no sound support covers the loaded point ({:.6g}, {:.6g}, {:.6g}) m", x.x(), x.y(), x.z()));
      for (int k = 0; k < shape.size(); ++k)
        loads.col(static_cast<Eigen::Index>(p)).segment<3>(3 * static_cast<Eigen::Index>(shape.nodes[k])) +=
            shape.value[k] * patterns[p].forces[q];
    }
  }
  return loads;
}

MatrixX ElasticBody::pattern_displacements(const std::vector<ForcePattern>& patterns,
                                           const std::vector<Field>& fields) const {
  require_own(fields);
  const MatrixX loads = pattern_loads(spheres_, patterns);
  MatrixX displacements(std::ssize(patterns), std::ssize(fields));
  for (std::size_t f = 0; f < fields.size(); ++f)
    displacements.col(static_cast<Eigen::Index>(f)) = loads.transpose() * fields[f].coefficients;
  return displacements;
}

PointState ElasticBody::at(const Vector3& x, const Field& field) const {
  require_own(field);
  thread_local ShapeFunctions shape;
  require_support(spheres_, x, shape);
  return state_from(problem_, problem_.material_at(x), shape, field);
}

void require_support(const Spheres& spheres, const Vector3& x, ShapeFunctions& shape) {
  if (!evaluate(spheres, x, shape))
    throw InputError(fmt::format("no sound support covers the point ({:.6g}, {:.6g}, {:.6g}) m", x.x(), x.y(), x.z()));
}

PointState state_from(const Problem& problem, const Material& material, const ShapeFunctions& shape,
                      const Field& field) {
  PointState state;
  double pressure = 0;
  for (int k = 0; k < shape.size(); ++k) {
    const int j = shape.nodes[k];
    const Vector3 coefficient = field.coefficients.segment<3>(3 * j);
    state.displacement += shape.value[k] * coefficient;
    state.gradient += coefficient * shape.gradient(k).transpose();
    if (field.pressure.size() > 0)
      pressure += shape.value[k] * field.pressure[j];
  }
  for (const VectorTerm& term : shape.vectors) {
    const Vector3 coefficients = field.coefficients.segment<3>(3 * static_cast<Eigen::Index>(term.group));
    state.displacement += term.value * coefficients;
    for (int m = 0; m < 3; ++m)
      state.gradient += coefficients[m] * term.gradient[m];
  }
  state.strain = 0.5 * (state.gradient + state.gradient.transpose());
  // The initial strain acts with the loads. A pressure unknown holds the volumetric part, -lambda tr(strain - initial).
  const Matrix3& initial = problem.loads.initial_strain;
  if (field.pressure.size() > 0)
    state.stress =
        2 * material.shear_modulus() * (state.strain - field.load_factor * 0.5 * (initial + initial.transpose())) -
        pressure * Matrix3::Identity();
  else
    state.stress =
        stress_from_gradient(material, state.gradient) - field.load_factor * initial_stress(problem, material);
  return state;
}

VectorX prescribed_values(const Problem& problem) {
  std::vector<Vector3> values;
  values.reserve(problem.prescribed.size());
  for (const Prescribed& entry : problem.prescribed)
    values.push_back(problem.prescribed_field ? problem.prescribed_field(problem.nodes.positions[entry.node])
                                              : entry.value);
  return prescribed_values(problem, values);
}

VectorX prescribed_values(const Problem& problem, const std::vector<Vector3>& values) {
  if (values.size() != problem.prescribed.size())
    throw InputError(fmt::format("{} displacements for {} prescribed nodes", values.size(), problem.prescribed.size()));
  VectorX result(3 * static_cast<Eigen::Index>(values.size()));
  for (std::size_t k = 0; k < values.size(); ++k)
    result.segment<3>(3 * static_cast<Eigen::Index>(k)) = values[k];
  return result;
}

Vector3 held_part(const Prescribed& entry, const Vector3& value) {
  Vector3 held = value;
  for (int c = 0; c < 3; ++c)
    if (!entry.components[c])
      held[c] = 0;
  return held;
}

void require_domain(const Problem& problem) {
  if (problem.domain == nullptr)
    throw InputError("the problem has no domain: the body that the nodes fill");
}

void require_regular(const AssemblyReport& report) {
  constexpr double limit = 1e15; // a free rigid motion gives 1e19, bodies that are held 1e3 to 1e12
  if (!(report.condition_estimate < limit))
    throw NumericalError(fmt::format("the system of {} unknowns is singular (condition estimate {:.1e}, limit {:.0e}): "
                                     "the body is not held against every rigid motion, or a support is unsound",
                                     report.unknowns, report.condition_estimate, limit));
}

void require_finite(const Field& field, const AssemblyReport& report) {
  if (!field.coefficients.allFinite() || !field.pressure.allFinite())
    throw NumericalError(fmt::format("the solution is not finite ({} unknowns, condition estimate {:.1e}): the body is "
                                     "not held or the system is singular",
                                     report.unknowns, report.condition_estimate));
}

Stopwatch::Stopwatch() : start_(std::chrono::steady_clock::now().time_since_epoch().count()) {}

double Stopwatch::seconds() const {
  using Clock = std::chrono::steady_clock;
  return std::chrono::duration<double>(Clock::duration(Clock::now().time_since_epoch().count() - start_)).count();
}

} // namespace spherecut::solvers
