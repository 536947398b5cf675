#include "solvers/body/discretisation.hpp"

#include "solvers/body/elastic_body.hpp"
#include "topology/base/errors.hpp"

#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

void Field::add(double factor, const Field& other) {
  if (coefficients.size() != other.coefficients.size() || (pressure.size() > 0) != (other.pressure.size() > 0) ||
      prescribed.size() != other.prescribed.size())
    throw InputError(
        fmt::format("a field of {} coefficients, {} pressures and {} prescribed displacements added to one "
                    "of {}, {} and {}: they are not of the same body",
                    other.coefficients.size(), other.pressure.size(), other.prescribed.size(), coefficients.size(),
                    pressure.size(), prescribed.size()));
  coefficients += factor * other.coefficients;
  if (pressure.size() > 0)
    pressure += factor * other.pressure;
  load_factor += factor * other.load_factor;
  prescribed += factor * other.prescribed;
}

void Discretisation::require_nodes(const std::vector<int>& nodes) const {
  const int count = problem().nodes.size();
  for (const int node : nodes)
    if (node < 0 || node >= count)
      throw InputError(fmt::format("node {} does not exist; there are {}", node, count));
}

void Discretisation::require_cases(const std::vector<int>& nodes, const MatrixX& forces) const {
  require_nodes(nodes);
  if (forces.rows() != 3 * std::ssize(nodes))
    throw InputError(
        fmt::format("forces in {} rows for {} nodes; allowed: three rows a node", forces.rows(), nodes.size()));
}

void Discretisation::require_loads(const std::vector<int>& nodes, const std::vector<Vector3>& forces) const {
  require_nodes(nodes);
  if (nodes.size() != forces.size())
    throw InputError(fmt::format("{} forces for {} loaded nodes", forces.size(), nodes.size()));
}

void Discretisation::require_own(const Field& field) const {
  if (const Eigen::Index count = coefficient_count(); field.coefficients.size() != count)
    throw InputError(fmt::format("a field of {} coefficients on a body of {}: it is another body's",
                                 field.coefficients.size(), count));
}

void Discretisation::require_own(const std::vector<Field>& fields) const {
  for (const Field& field : fields)
    require_own(field);
}

std::vector<Field> Discretisation::case_responses(const std::vector<int>& nodes, const MatrixX& forces) const {
  require_cases(nodes, forces);
  const std::vector<Field> units = force_responses(nodes);
  std::vector<Field> responses;
  for (Eigen::Index c = 0; c < forces.cols(); ++c) {
    Field sum = units.front();
    sum.add(forces(0, c) - 1, units.front());
    for (Eigen::Index k = 1; k < forces.rows(); ++k)
      sum.add(forces(k, c), units[k]);
    responses.push_back(std::move(sum));
  }
  return responses;
}

CaseResponses Discretisation::condense_cases(const std::vector<int>& nodes, const MatrixX& forces,
                                             const std::vector<int>& at) const {
  CaseResponses responses;
  responses.fields = case_responses(nodes, forces);
  const MatrixX displacements = contact_displacements(nodes, responses.fields);
  responses.among = MatrixX::Zero(forces.cols(), forces.cols());
  for (Eigen::Index c = 0; c < forces.cols(); ++c) // a case acts on few of the nodes
    for (Eigen::Index k = 0; k < forces.rows(); ++k)
      if (forces(k, c) != 0)
        responses.among.row(c) += forces(k, c) * displacements.row(k);
  responses.at = contact_displacements(at, responses.fields);
  return responses;
}

Field Discretisation::force_response(const std::vector<int>& nodes, const std::vector<Vector3>& forces) const {
  require_loads(nodes, forces);
  MatrixX together(3 * std::ssize(nodes), 1);
  for (Eigen::Index k = 0; k < std::ssize(nodes); ++k)
    together.col(0).segment<3>(3 * k) = forces[k];
  return case_responses(nodes, together).front();
}

MatrixX Discretisation::compliance_between(const std::vector<int>& at, const std::vector<int>& forced) const {
  return contact_displacements(at, force_responses(forced));
}

MatrixX Discretisation::contact_compliance(const std::vector<int>& candidates) const {
  return contact_displacements(candidates, force_responses(candidates));
}

std::vector<Field> Discretisation::pattern_responses(const std::vector<ForcePattern>&) const {
  throw InputError(fmt::format("method {} has no forces in newtons to spread over points", to_string(method())));
}

MatrixX Discretisation::pattern_displacements(const std::vector<ForcePattern>&, const std::vector<Field>&) const {
  throw InputError(fmt::format("method {} has no forces in newtons to spread over points", to_string(method())));
}

void Discretisation::shape_at(const Vector3&, ShapeFunctions&) const {
  throw InputError(fmt::format("method {} has no spheres here", to_string(method())));
}

void Discretisation::visit_weak_points(const BoundingBox&, const std::function<bool(const Vector3&)>&,
                                       const PointVisitor&) const {}

double Discretisation::sphere_radius(int) const {
  throw InputError(fmt::format("method {} has no spheres here", to_string(method())));
}

double Discretisation::load_work(const Field&) const {
  throw InputError(fmt::format("method {} has no forces in newtons that could do work", to_string(method())));
}

} // namespace spherecut::solvers
