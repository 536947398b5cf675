// The edge of a blade against a body at finite strain.
#include "src/model/finite_model.hpp"

#include "solvers/elasticity/rotation.hpp"
#include "topology/base/errors.hpp"

namespace spherecut::app {
namespace {

/// Of the acting forces that may stay unbalanced under the edge of a blade, whose own force is most of what acts. Its
/// pieces overlap, and which of them bear the force changes from iteration to iteration.
constexpr double most_unbalanced_of_edge = 1e-3;
/// Of E times the length of a piece of an edge: the penalty by which it stands against tissue, N/m.
constexpr double edge_stiffness = 20;

/// The compliance of the rest operator, carried along, is soft by a third where the strain is a fifth. Made to give the
/// way that the last forces have made, positive definite as before (a BFGS update).
void meet_secant(const VectorX& way, const VectorX& forces, MatrixX& compliance) {
  constexpr double least = 1e-3; // of what the forces would do by the compliance
  const double work = way.dot(forces);
  if (!(work > 0 && work > least * forces.dot(compliance * forces)))
    return;
  const MatrixX left = MatrixX::Identity(way.size(), way.size()) - way * forces.transpose() / work;
  compliance = (left * compliance * left.transpose() + way * way.transpose() / work).eval();
}

} // namespace

// Where the tissue has turned, what is ahead of the edge at rest has, too.
MatrixX FiniteModel::patterns_of(const solvers::BladePatch& patch, double half_width) const {
  const auto entries = std::ssize(patch.contacts) + (patch.dragged ? 1 : 0);
  MatrixX patterns = MatrixX::Zero(3 * static_cast<Eigen::Index>(body_.functions()), entries);
  solvers::ShapeFunctions shape;
  const auto add = [&](const Vector3& x, const Vector3& force, Eigen::Index column) {
    body_.shape_at(x, shape);
    for (int k = 0; k < shape.size(); ++k)
      patterns.col(column).segment<3>(3 * static_cast<Eigen::Index>(shape.nodes[k])) += shape.value[k] * force;
  };
  for (std::size_t c = 0; c < patch.contacts.size(); ++c) {
    solvers::EdgeContact at_rest = patch.contacts[c];
    const Vector3 push = at_rest.push;
    const Matrix3 turned = solvers::rotation_of(body_.at(at_rest.point, coefficients()).deformation).transpose();
    at_rest.push = turned * push;
    at_rest.normal = turned * at_rest.normal;
    at_rest.edge = turned * at_rest.edge;
    const solvers::ForcePattern pattern = solvers::edge_pattern(at_rest, half_width, *body_.problem().domain);
    for (std::size_t k = 0; k < pattern.points.size(); ++k)
      add(pattern.points[k], pattern.forces[k].dot(at_rest.push) * push, static_cast<Eigen::Index>(c));
  }
  if (patch.dragged)
    for (std::size_t k = 0; k < patch.flanks.points.size(); ++k)
      add(patch.flanks.points[k], patch.flanks.forces[k], entries - 1);
  return patterns;
}

solvers::BladePatch FiniteModel::edge_patch(const std::vector<solvers::EdgeContact>& contacts, double half_width,
                                            const solvers::ForcePattern& flanks) {
  if (contacts.empty())
    throw InputError("a blade without contacts has nothing to condense");
  solvers::BladePatch patch;
  patch.contacts = contacts;
  patch.dragged = !flanks.points.empty();
  patch.flanks = flanks;
  for (const Vector3& force : flanks.forces)
    patch.drag += force;
  patch.patterns = patterns_of(patch, half_width);
  patch.base = patch.patterns.transpose() * coefficients();
  patch.free = patch.base;
  patch.compliance = MatrixX::Identity(patch.base.size(), patch.base.size()); // until it is pressed
  patch.drag_torques = MatrixX::Zero(3, patch.base.size());
  return patch;
}

std::vector<solvers::UnilateralMean> FiniteModel::edges_of(const PressedEdge& edge) const {
  const solvers::NodeCloud& nodes = body_.problem().nodes;
  const double modulus = body_.problem().material.young_modulus;
  std::vector<solvers::UnilateralMean> means;
  for (std::size_t c = 0; c < edge.contacts.size(); ++c) {
    const solvers::EdgeContact& contact = edge.contacts[c];
    solvers::UnilateralMean mean;
    mean.direction = contact.push;
    mean.mean.centroid = contact.point;
    for (int i = 0; i < body_.functions(); ++i) {
      const double weight = contact.push.dot(
          edge.patterns.col(static_cast<Eigen::Index>(c)).segment<3>(3 * static_cast<Eigen::Index>(i)));
      if (weight != 0) {
        mean.mean.nodes.push_back(i);
        mean.mean.weights.push_back(weight);
      }
    }
    int nearest = 0;
    for (int i = 0; i < nodes.size(); ++i)
      if ((nodes.positions[i] - contact.point).squaredNorm() < (nodes.positions[nearest] - contact.point).squaredNorm())
        nearest = i;
    const bool is_carried = body_.cut_functions() != nullptr && !mean.mean.nodes.empty();
    const int carrier = is_carried ? solvers::FiniteBody::carrier_of(mean.mean) : nearest;
    mean.carriers = {carrier, carrier};
    mean.spacing = nodes.spacings[nearest];
    mean.stiffness = edge_stiffness * modulus * contact.length;
    means.push_back(std::move(mean));
  }
  return means;
}

void FiniteModel::press_edge(const VectorX& advance, double drag, solvers::BladePatch& patch) {
  constexpr double least_change = 10 * most_unbalanced_of_edge; // of the forces: one that tells more than what is left
  const auto contacts = std::ssize(patch.contacts);
  if (!edge_) {
    edge_.emplace();
    edge_->free = equilibrium_.coefficients();
    edge_->potential = last_->energy - last_->loads;
    edge_->shares = equilibrium_.contact_shares();
  }
  if (edge_->contacts != patch.contacts || edge_->patterns.cols() != patch.patterns.cols() ||
      edge_->patterns != patch.patterns) {
    std::vector<double> forces;
    if (edge_->contacts.size() == patch.contacts.size())
      forces = equilibrium_.edges()->known_forces();
    edge_->contacts = patch.contacts;
    edge_->patterns = patch.patterns;
    edge_->moved.resize(0);
    edge_->way.resize(0);
    equilibrium_.set_edges(edges_of(*edge_), std::move(forces));
  }
  solvers::FiniteLoading loading;
  if (equilibrium_.contact() != nullptr)
    loading.tool = pose_;
  loading.advances = advance;
  loading.tolerance = most_unbalanced_of_edge;
  const MatrixX& patterns = edge_->patterns;
  if (patch.dragged)
    loading.forces = drag * patterns.col(contacts);
  const solvers::EquilibriumStatus status = equilibrium_.solve(loading);
  edge_->pressed = step_of(status, loading.tool, loading.tool);
  const std::vector<double>& forces = equilibrium_.edges()->known_forces();
  VectorX acting(patch.base.size());
  acting.head(contacts) = Eigen::Map<const VectorX>(forces.data(), contacts);
  if (patch.dragged)
    acting[contacts] = drag;
  const VectorX moved = patterns.transpose() * equilibrium_.coefficients();
  const MatrixX compliance = patterns.transpose() * equilibrium_.responses(patterns);
  patch.compliance = 0.5 * (compliance + compliance.transpose());
  if (edge_->moved.size() == 0) {
    edge_->moved = moved;
    edge_->acting = acting;
  } else if ((acting - edge_->acting).norm() > least_change * acting.norm()) {
    edge_->way = moved - edge_->moved;
    edge_->forces = acting - edge_->acting;
    edge_->moved = moved;
    edge_->acting = acting;
  }
  if (edge_->way.size() > 0)
    meet_secant(edge_->way, edge_->forces, patch.compliance);
  patch.base = moved - patch.compliance * acting;
  // Of strain, loads and drag, above the body without blade; with the drag alone that gives way to it.
  double potential = edge_->pressed.energy - edge_->pressed.loads - edge_->potential;
  if (patch.dragged) {
    const double free = patterns.col(contacts).dot(edge_->free);
    potential += drag * (free - moved[contacts]) + 0.5 * drag * drag * patch.compliance(contacts, contacts);
    patch.drag_torque = Vector3::Zero();
    solvers::ShapeFunctions shape;
    for (std::size_t k = 0; k < patch.flanks.points.size(); ++k) {
      body_.shape_at(patch.flanks.points[k], shape);
      Vector3 x = patch.flanks.points[k];
      for (int n = 0; n < shape.size(); ++n)
        x += shape.value[n] * equilibrium_.coefficients().segment<3>(3 * static_cast<Eigen::Index>(shape.nodes[n]));
      patch.drag_torque += x.cross(patch.flanks.forces[k]);
    }
  }
  const VectorX edge = acting.head(contacts);
  patch.energy = potential - 0.5 * edge.dot(patch.compliance.topLeftCorner(contacts, contacts) * edge);
}

Vector3 FiniteModel::turned_back(const Vector3& x, const Vector3& direction) const {
  const solvers::PointState state = at(x);
  return solvers::rotation_of(Matrix3::Identity() + state.gradient).transpose() * direction;
}

void FiniteModel::leave_edge() {
  if (!edge_)
    return;
  equilibrium_.set_edges({});
  equilibrium_.set_coefficients(edge_->free, 1, pose_, edge_->shares);
  edge_.reset();
  shows_pressed_ = false;
}

} // namespace spherecut::app
