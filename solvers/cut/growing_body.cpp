#include "solvers/cut/growing_body.hpp"

#include "solvers/body/pieces.hpp"
#include "solvers/galerkin/galerkin.hpp"
#include "solvers/shapes/cut_reach.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

template <typename Column>
void add_force(const DisplacementMean& mean, const Vector3& force, Column&& right) {
  for (std::size_t k = 0; k < mean.nodes.size(); ++k)
    right.template segment<3>(3 * static_cast<Eigen::Index>(mean.nodes[k])) += mean.weights[k] * force;
}

} // namespace

GrowingBody::GrowingBody(Problem problem, GrowthOptions options)
    : problem_(problem), cut_(std::make_unique<GrowingCut>(std::move(problem), std::move(options))) {
  report_ = cut_->report();
  number_nodes();
  if (problem_.incision != nullptr)
    report_.pieces = pieces_by_sight(problem_);
}

void GrowingBody::number_nodes() {
  std::vector<int> ids, compact;
  for (const char gone : cut_->removed()) {
    if (gone == 0)
      ids.push_back(static_cast<int>(compact.size()));
    compact.push_back(gone == 0 ? static_cast<int>(ids.size()) - 1 : -1);
  }
  std::vector<int> place; // of the nodes before
  place.reserve(id_.size());
  for (const int id : id_)
    place.push_back(compact[id]);
  const std::vector<char>& altered = cut_->altered();
  std::vector<int> was, anew;
  for (const int id : ids) {
    const int before = id < std::ssize(compact_) ? compact_[id] : -1;
    const bool stays = before >= 0 && altered[id] == 0 && supports_.growth[before] == 1;
    was.push_back(stays ? before : -1);
    if (!stays)
      anew.push_back(id);
  }
  NodalSupports fresh = nodal_supports(cut_->spheres(), anew);
  for (int& node : fresh.nodes)
    node = compact[node];
  supports_ = renewed_supports(supports_, fresh, was, place);
  id_ = std::move(ids);
  compact_ = std::move(compact);
}

BodyGrowth GrowingBody::grow(const SprinkleIncrement& change, Problem grown,
                             const std::function<topology::SurfaceMesh()>& way_ahead, bool only_update) {
  const int count = problem_.nodes.size();
  const std::vector<int> place = places_after(change, count, grown.nodes.size());
  const int kept = grown.nodes.size() - change.added.size();
  std::vector<Piece> pieces = pieces_by_sight(grown);
  if (unheld_count(pieces) > unheld_count(report_.pieces))
    return {"a piece came free", {}};
  NodeChange by_id;
  by_id.added = change.added;
  std::vector<int> id(static_cast<std::size_t>(grown.nodes.size()));
  for (int i = 0; i < count; ++i)
    if (place[i] >= 0)
      id[place[i]] = id_[i];
    else
      by_id.removed.push_back(id_[i]);
  for (int k = 0; k < change.added.size(); ++k)
    id[kept + k] = cut_->problem().nodes.size() + k;
  for (const int node : by_id.removed)
    if (cut_->is_anchored(node))
      return {"a spring that holds a severed piece lost its node", {}};
  by_id.prescribed = grown.prescribed;
  for (Prescribed& entry : *by_id.prescribed)
    entry.node = id[entry.node];
  by_id.loads = grown.loads;
  BodyGrowth growth{"", cut_->grow(by_id, grown.incision, way_ahead, only_update)};
  if (growth.update.declined) {
    growth.uncovered = growth.update.reason;
    return growth;
  }
  problem_ = std::move(grown);
  number_nodes();
  report_.nodes = problem_.nodes.size();
  report_.unknowns = 3 * report_.nodes;
  report_.pieces = std::move(pieces);
  report_.grown_supports = cut_->spheres().grown();
  if (growth.update.condensed_anew) {
    const AssemblyReport& anew = cut_->report();
    report_.supports_seconds = anew.supports_seconds;
    report_.assembly_seconds = std::max(0.0, growth.update.total_seconds - anew.supports_seconds - anew.factor_seconds);
    report_.factor_seconds = anew.factor_seconds;
    report_.worst_moment_condition = anew.worst_moment_condition;
    report_.condition_estimate = anew.condition_estimate;
  } else {
    report_.supports_seconds = growth.update.spheres_seconds;
    report_.assembly_seconds = growth.update.cells_seconds;
    report_.factor_seconds = growth.update.factor_seconds + growth.update.condense_seconds;
  }
  return growth;
}

MatrixX GrowingBody::expanded(const MatrixX& present) const {
  MatrixX all = MatrixX::Zero(3 * std::ssize(compact_), present.cols());
  for (Eigen::Index i = 0; i < std::ssize(id_); ++i)
    all.middleRows<3>(3 * static_cast<Eigen::Index>(id_[i])) = present.middleRows<3>(3 * i);
  return all;
}

MatrixX GrowingBody::compacted(const MatrixX& all) const {
  MatrixX present(3 * std::ssize(id_), all.cols());
  for (Eigen::Index i = 0; i < std::ssize(id_); ++i)
    present.middleRows<3>(3 * i) = all.middleRows<3>(3 * static_cast<Eigen::Index>(id_[i]));
  return present;
}

Vector3 GrowingBody::constraint_force(std::size_t k, const VectorX& coefficients, const VectorX& prescribed) const {
  const Prescribed& entry = problem_.prescribed[k];
  const Vector3 gap = prescribed.segment<3>(3 * static_cast<Eigen::Index>(k)) - cut_->held()[k].of(coefficients);
  return constraint_stiffness(problem_, entry.node) * held_part(entry, gap);
}

VectorX GrowingBody::holding_forces(const VectorX& coefficients, const VectorX& prescribed) const {
  VectorX right = VectorX::Zero(coefficients.size());
  for (std::size_t k = 0; k < problem_.prescribed.size(); ++k)
    add_force(cut_->held()[k], constraint_force(k, coefficients, prescribed), right);
  return right;
}

/// Coefficients of all nodes the system knows, with one correction against the rounding of the penalties.
VectorX GrowingBody::solved(const VectorX& loads, const VectorX& prescribed) const {
  VectorX right = loads + holding_forces(VectorX::Zero(loads.size()), prescribed);
  if (right.isZero(0)) // held at rest and without loads: often
    return right;
  VectorX coefficients = cut_->respond(right);
  coefficients += cut_->respond(loads + holding_forces(coefficients, prescribed) - cut_->elastic_forces(coefficients));
  return coefficients;
}

Field GrowingBody::solve() const {
  VectorX prescribed = prescribed_values(problem_);
  if (problem_.prescribed_field)
    for (std::size_t k = 0; k < cut_->held().size(); ++k)
      prescribed.segment<3>(3 * static_cast<Eigen::Index>(k)) = cut_->held()[k].of(problem_.prescribed_field);
  Field field{compacted(solved(cut_->external_loads(), prescribed)), {}, 1, prescribed};
  require_finite(field, report_);
  return field;
}

double GrowingBody::load_work(const Field& field) const {
  require_own(field);
  return field.load_factor * cut_->external_loads().dot(expanded(field.coefficients).col(0));
}

std::vector<Field> GrowingBody::responses_to(const MatrixX& forces) const {
  const MatrixX solution = compacted(cut_->respond(forces));
  const VectorX no_displacement = VectorX::Zero(3 * static_cast<Eigen::Index>(problem_.prescribed.size()));
  std::vector<Field> responses;
  responses.reserve(static_cast<std::size_t>(solution.cols()));
  for (Eigen::Index k = 0; k < solution.cols(); ++k) {
    responses.push_back({solution.col(k), {}, 0, no_displacement});
    require_finite(responses.back(), report_);
  }
  return responses;
}

MatrixX GrowingBody::unit_forces(const std::vector<int>& nodes) const {
  MatrixX right = MatrixX::Zero(3 * std::ssize(compact_), 3 * std::ssize(nodes));
  for (std::size_t c = 0; c < nodes.size(); ++c) {
    const DisplacementMean& mean = cut_->mean(id_[nodes[c]]);
    for (int axis = 0; axis < 3; ++axis)
      add_force(mean, Vector3::Unit(axis), right.col(3 * static_cast<Eigen::Index>(c) + axis));
  }
  return right;
}

std::vector<Field> GrowingBody::force_responses(const std::vector<int>& candidates) const {
  require_nodes(candidates);
  return responses_to(unit_forces(candidates));
}

MatrixX GrowingBody::case_forces(const std::vector<int>& nodes, const MatrixX& forces) const {
  require_cases(nodes, forces);
  MatrixX right = MatrixX::Zero(3 * std::ssize(compact_), forces.cols());
  for (Eigen::Index c = 0; c < std::ssize(nodes); ++c) {
    const DisplacementMean& mean = cut_->mean(id_[nodes[c]]);
    for (Eigen::Index k = 0; k < forces.cols(); ++k)
      add_force(mean, forces.col(k).segment<3>(3 * c), right.col(k));
  }
  return right;
}

std::vector<Field> GrowingBody::case_responses(const std::vector<int>& nodes, const MatrixX& forces) const {
  return responses_to(case_forces(nodes, forces));
}

CaseResponses GrowingBody::condense_cases(const std::vector<int>& nodes, const MatrixX& forces,
                                          const std::vector<int>& at) const {
  require_nodes(at);
  std::vector<int> ids;
  ids.reserve(at.size());
  for (const int node : at)
    ids.push_back(id_[node]);
  return cut_->condense_cases(case_forces(nodes, forces), ids);
}

MatrixX GrowingBody::contact_compliance(const std::vector<int>& candidates) const {
  require_nodes(candidates);
  const std::vector<int>& known = cut_->candidates();
  std::vector<int> place(compact_.size(), -1); // of a node the system knows, in its compliance
  for (int k = 0; k < std::ssize(known); ++k)
    place[known[k]] = k;
  std::vector<int> others;
  for (const int node : candidates)
    if (place[id_[node]] < 0)
      others.push_back(node);
  MatrixX columns;
  if (!others.empty())
    columns = contact_displacements(candidates, responses_to(unit_forces(others)));
  const auto count = std::ssize(candidates);
  MatrixX compliance(3 * count, 3 * count);
  Eigen::Index next = 0;
  for (Eigen::Index d = 0; d < count; ++d) {
    const int there = place[id_[candidates[d]]];
    if (there >= 0) {
      for (Eigen::Index c = 0; c < count; ++c)
        if (const int here = place[id_[candidates[c]]]; here >= 0)
          compliance.block<3, 3>(3 * c, 3 * d) = cut_->compliance().block<3, 3>(3 * here, 3 * there);
      continue;
    }
    compliance.middleCols<3>(3 * d) = columns.middleCols<3>(3 * next++);
    compliance.middleRows<3>(3 * d) = compliance.middleCols<3>(3 * d).transpose();
  }
  return compliance;
}

std::vector<Field> GrowingBody::pattern_responses(const std::vector<ForcePattern>& patterns) const {
  return responses_to(pattern_loads(cut_->spheres(), patterns));
}

MatrixX GrowingBody::pattern_displacements(const std::vector<ForcePattern>& patterns,
                                           const std::vector<Field>& fields) const {
  require_own(fields);
  const MatrixX loads = compacted(pattern_loads(cut_->spheres(), patterns));
  MatrixX displacements(std::ssize(patterns), std::ssize(fields));
  for (std::size_t f = 0; f < fields.size(); ++f)
    displacements.col(static_cast<Eigen::Index>(f)) = loads.transpose() * fields[f].coefficients;
  return displacements;
}

Field GrowingBody::prescribed_response(const std::vector<Vector3>& values) const {
  const VectorX prescribed = prescribed_values(problem_, values);
  Field field{compacted(solved(VectorX::Zero(3 * std::ssize(compact_)), prescribed)), {}, 0, prescribed};
  require_finite(field, report_);
  return field;
}

std::vector<Vector3> GrowingBody::constraint_points() const {
  std::vector<Vector3> points;
  for (const DisplacementMean& mean : cut_->held())
    points.push_back(mean.centroid);
  return points;
}

Vector3 GrowingBody::contact_point(int node) const {
  require_nodes({node});
  return cut_->mean(id_[node]).centroid;
}

MatrixX GrowingBody::contact_displacements(const std::vector<int>& nodes, const std::vector<Field>& fields) const {
  require_nodes(nodes);
  require_own(fields);
  MatrixX displacements(3 * std::ssize(nodes), std::ssize(fields));
  for (Eigen::Index c = 0; c < std::ssize(nodes); ++c) {
    DisplacementMean mean = cut_->mean(id_[nodes[c]]);
    for (int& node : mean.nodes)
      node = compact_[node];
    for (Eigen::Index f = 0; f < displacements.cols(); ++f)
      displacements.col(f).segment<3>(3 * c) = mean.of(fields[f].coefficients);
  }
  return displacements;
}

VectorX GrowingBody::nodal_displacements(const Field& field) const {
  require_own(field);
  return supports_.displacements(field);
}

void GrowingBody::shape_at(const Vector3& x, ShapeFunctions& shape) const {
  require_support(cut_->spheres(), x, shape);
  for (int& node : shape.nodes)
    node = compact_[node];
}

PointState GrowingBody::at(const Vector3& x, const Field& field) const {
  require_own(field);
  thread_local ShapeFunctions shape;
  shape_at(x, shape);
  return state_from(problem_, problem_.material, shape, field);
}

std::vector<Vector3> GrowingBody::constraint_forces(const Field& field) const {
  require_own(field);
  const VectorX coefficients = expanded(field.coefficients);
  std::vector<Vector3> forces;
  forces.reserve(problem_.prescribed.size());
  for (std::size_t k = 0; k < problem_.prescribed.size(); ++k)
    forces.push_back(constraint_force(k, coefficients, field.prescribed));
  return forces;
}

double GrowingBody::residual(const Field& field, const std::vector<int>& loaded_nodes,
                             const std::vector<Vector3>& nodal_forces) const {
  require_loads(loaded_nodes, nodal_forces);
  require_own(field);
  const VectorX coefficients = expanded(field.coefficients);
  VectorX applied = field.load_factor * cut_->external_loads();
  for (std::size_t k = 0; k < loaded_nodes.size(); ++k)
    add_force(cut_->mean(id_[loaded_nodes[k]]), nodal_forces[k], applied);
  const VectorX rows = cut_->elastic_forces(coefficients) - holding_forces(coefficients, field.prescribed);
  const double unbalanced = compacted(rows - applied).lpNorm<Eigen::Infinity>();
  double largest = applied.lpNorm<Eigen::Infinity>();
  for (const Vector3& force : constraint_forces(field))
    largest = std::max(largest, force.lpNorm<Eigen::Infinity>());
  return largest > 0 ? unbalanced / largest : 0;
}

} // namespace spherecut::solvers
