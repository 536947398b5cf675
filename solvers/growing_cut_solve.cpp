// Solving with the window of a growing cut: its factorisation, the condensation to the contact, responses, residuals.
#include "solvers/growing_cut_state.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace spherecut::solvers {

/// Right-hand side by slots under `right` (3N), which differs from the first loads in window nodes alone.
VectorX GrowingCut::State::window_right(const VectorX& right) const {
  VectorX by_slot = reduced_first.col(0);
  for (Eigen::Index s = 0; s < std::ssize(window_node); ++s)
    if (const int node = window_node[s]; node >= 0) {
      by_slot.segment<3>(3 * s) += right.segment<3>(3 * node);
      if (3 * node < first_loads.size())
        by_slot.segment<3>(3 * s) -= first_loads.segment<3>(3 * node);
    }
  return by_slot;
}

/// Coefficients under forces (3N rows) anywhere. What acts on the window alone need not pass the far part first.
MatrixX GrowingCut::State::respond(const MatrixX& forces) const {
  const Eigen::Index size = window->far() + window->slots() - 3 * static_cast<Eigen::Index>(options.room);
  MatrixX ordered = MatrixX::Zero(size, forces.cols());
  for (Eigen::Index k = 0; k < std::ssize(far_order); ++k)
    ordered.middleRows<3>(3 * k) = forces.middleRows<3>(3 * static_cast<Eigen::Index>(far_order[k]));
  const bool far = !ordered.isZero(0);
  MatrixX right = far ? window->reduce(ordered) : MatrixX::Zero(window->slots(), forces.cols());
  for (Eigen::Index s = 0; s < std::ssize(window_node); ++s)
    if (const Eigen::Index node = window_node[s]; node >= 0)
      right.middleRows<3>(3 * s) += forces.middleRows<3>(3 * node);
  const MatrixX in_window = window->solve(right);
  const MatrixX recovered = far ? window->recover(in_window, ordered) : window->recover(in_window);
  MatrixX coefficients = MatrixX::Zero(forces.rows(), forces.cols());
  for (Eigen::Index k = 0; k < std::ssize(far_order); ++k)
    coefficients.middleRows<3>(3 * static_cast<Eigen::Index>(far_order[k])) = recovered.middleRows<3>(3 * k);
  for (Eigen::Index s = 0; s < std::ssize(window_node); ++s)
    if (const Eigen::Index node = window_node[s]; node >= 0)
      coefficients.middleRows<3>(3 * node) = in_window.middleRows<3>(3 * s);
  return coefficients;
}

/// The stiffness as the cells make it, not as the window has it: that at condensation, and what the exchanged boxes are
/// now less what they were.
VectorX GrowingCut::State::elastic_forces(const VectorX& coefficients) const {
  VectorX ordered(elastic.rows());
  for (Eigen::Index k = 0; k < std::ssize(elastic_order); ++k)
    ordered.segment<3>(3 * k) = coefficients.segment<3>(3 * static_cast<Eigen::Index>(elastic_order[k]));
  const VectorX product = elastic.selfadjointView<Eigen::Lower>() * ordered;
  VectorX forces = VectorX::Zero(coefficients.size());
  for (Eigen::Index k = 0; k < std::ssize(elastic_order); ++k)
    forces.segment<3>(3 * static_cast<Eigen::Index>(elastic_order[k])) = product.segment<3>(3 * k);
  const auto add = [&](const CellShapes& cell, double sign) {
    for (int q = 0; q < cell.points; ++q) {
      Matrix3 gradient = Matrix3::Zero();
      for (std::size_t k = 0; k < cell.nodes.size(); ++k)
        gradient +=
            coefficients.segment<3>(3 * static_cast<Eigen::Index>(cell.nodes[k])) * cell.gradient(k, q).transpose();
      const Matrix3 stress = sign * stress_from_gradient(problem.material, gradient);
      for (std::size_t k = 0; k < cell.nodes.size(); ++k)
        forces.segment<3>(3 * static_cast<Eigen::Index>(cell.nodes[k])) += stress * cell.gradient(k, q);
    }
  };
  for (const Box& box : boxes)
    if (box.exchanged) {
      for (const CellShapes& cell : box.first)
        add(cell, -1);
      for (const CellShapes& cell : box.cells)
        add(cell, 1);
    }
  return forces;
}

std::vector<char> GrowingCut::State::slots_within(const std::vector<Vector3>& places, double reach) const {
  const Nearness to_places(places);
  std::vector<char> slots(window->slots(), 0);
  for (Eigen::Index block = 0; block < std::ssize(window_node); ++block)
    if (const int node = window_node[block]; node >= 0 && to_places(problem.nodes.positions[node]) <= reach)
      std::fill_n(slots.begin() + 3 * block, 3, 1);
  return slots;
}

bool GrowingCut::State::factor_window(const std::vector<Vector3>& places) {
  const Nearness to_places(places);
  double reach = 0;
  for (Eigen::Index block = 0; block < std::ssize(window_node); ++block)
    if (const int node = window_node[block], first = 3 * static_cast<int>(block);
        node >= 0 && (window->changed(first) || window->changed(first + 1) || window->changed(first + 2)))
      reach = std::max(reach, to_places(problem.nodes.positions[node]));
  if (window->is_prepared() || !std::isfinite(reach))
    return window->factor();
  const double finest = *std::min_element(problem.nodes.spacings.begin(), problem.nodes.spacings.end());
  window->prepare(slots_within(places, reach + advance_before_new * finest));
  return false;
}

void GrowingCut::State::condense_contact() {
  const auto count = static_cast<Eigen::Index>(contact.size());
  MatrixX functionals = MatrixX::Zero(window->slots(), 3 * count);
  for (Eigen::Index c = 0; c < count; ++c)
    for (std::size_t k = 0; k < contact[c].nodes.size(); ++k)
      for (int a = 0; a < 3; ++a)
        functionals(3 * slot[contact[c].nodes[k]] + a, 3 * c + a) += contact[c].weights[k];
  SchurWindow::Condensed condensed = window->condense(functionals, window_right(loads));
  compliance = std::move(condensed.compliance);
  base = std::move(condensed.response);
}

const Problem& GrowingCut::problem() const {
  return state_->problem;
}
const std::vector<char>& GrowingCut::removed() const {
  return state_->removed;
}
int GrowingCut::window_unknowns() const {
  return 3 * static_cast<int>(std::count_if(state_->window_node.begin(), state_->window_node.end(),
                                            [](int node) { return node >= 0; }));
}
const MatrixX& GrowingCut::compliance() const {
  return state_->compliance;
}
const VectorX& GrowingCut::base_displacement() const {
  return state_->base;
}

const Spheres& GrowingCut::spheres() const {
  return *state_->spheres;
}
const std::vector<DisplacementMean>& GrowingCut::held() const {
  return state_->held;
}
const DisplacementMean& GrowingCut::mean(int node) const {
  return state_->mean(node);
}
const AssemblyReport& GrowingCut::report() const {
  return state_->report;
}
bool GrowingCut::is_anchored(int node) const {
  return std::any_of(state_->anchors.begin(), state_->anchors.end(),
                     [&](const Anchor& anchor) { return anchor.node == node; });
}
const std::vector<int>& GrowingCut::candidates() const {
  return state_->options.contact;
}
const VectorX& GrowingCut::external_loads() const {
  return state_->external;
}
MatrixX GrowingCut::respond(const MatrixX& forces) const {
  return state_->respond(forces);
}
VectorX GrowingCut::elastic_forces(const VectorX& coefficients) const {
  return state_->elastic_forces(coefficients);
}

VectorX GrowingCut::coefficients(const std::vector<Vector3>& contact_forces) const {
  const State& s = *state_;
  VectorX right = s.loads;
  for (std::size_t c = 0; c < contact_forces.size(); ++c)
    for (std::size_t k = 0; k < s.contact[c].nodes.size(); ++k)
      right.segment<3>(3 * static_cast<Eigen::Index>(s.contact[c].nodes[k])) +=
          s.contact[c].weights[k] * contact_forces[c];
  const MatrixX in_window = s.window->solve(s.window_right(right));
  const int far = s.window->far();
  VectorX ordered = VectorX::Zero(far + s.window->slots() - 3 * static_cast<Eigen::Index>(s.options.room));
  for (Eigen::Index k = 0; k < std::ssize(s.far_order); ++k)
    ordered.segment<3>(3 * k) = s.loads.segment<3>(3 * s.far_order[k]);
  const MatrixX recovered = s.window->recover(in_window, ordered);
  VectorX coefficients = VectorX::Zero(s.loads.size());
  for (Eigen::Index k = 0; k < std::ssize(s.far_order); ++k)
    coefficients.segment<3>(3 * s.far_order[k]) = recovered.col(0).segment<3>(3 * k);
  for (Eigen::Index b = 0; b < std::ssize(s.window_node); ++b)
    if (const int node = s.window_node[b]; node >= 0)
      coefficients.segment<3>(3 * node) = in_window.col(0).segment<3>(3 * b);
  return coefficients;
}

} // namespace spherecut::solvers
