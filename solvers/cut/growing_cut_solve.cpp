// Solving with the window of a growing cut: its factorisation, the condensation to the contact, responses, residuals.
#include "solvers/cut/growing_cut_state.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace spherecut::solvers {

namespace {

/// How far a cut may go on, in spacings, until each stage of what was eliminated ahead of it (schur_window.hpp) has to
/// be chosen anew: what the next few increments leave alone is not eliminated again with what only the next of them
/// does.
constexpr std::array advances_before_stages{2.0, 0.6, 0.15};
constexpr int recent = 8; // increments: what the last ones left alone the last stage eliminates, however near
constexpr double worth_a_stage = 0.85; // of the nodes that are left: so many at most a further stage leaves

} // namespace

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

GrowingCut::State::OnWindow GrowingCut::State::on_window(const MatrixX& forces) const {
  OnWindow on{MatrixX::Zero(window->slots(), forces.cols()), {}, {}};
  for (Eigen::Index s = 0; s < std::ssize(window_node); ++s)
    if (const Eigen::Index node = window_node[s]; node >= 0)
      on.by_slot.middleRows<3>(3 * s) = forces.middleRows<3>(3 * node);
  for (Eigen::Index c = 0; c < forces.cols(); ++c)
    if (std::any_of(far_order.begin(), far_order.end(),
                    [&](const Eigen::Index node) { return !forces.col(c).segment<3>(3 * node).isZero(0); }))
      on.far_columns.push_back(c);
  if (on.far_columns.empty())
    return on;
  const Eigen::Index size = window->far() + window->slots() - 3 * static_cast<Eigen::Index>(options.room);
  MatrixX ordered = MatrixX::Zero(size, std::ssize(on.far_columns));
  for (Eigen::Index c = 0; c < ordered.cols(); ++c)
    for (Eigen::Index k = 0; k < std::ssize(far_order); ++k)
      ordered.col(c).segment<3>(3 * k) =
          forces.col(on.far_columns[c]).segment<3>(3 * static_cast<Eigen::Index>(far_order[k]));
  const MatrixX reduced = window->reduce(ordered, &on.far_half);
  for (Eigen::Index c = 0; c < reduced.cols(); ++c)
    on.by_slot.col(on.far_columns[c]) += reduced.col(c);
  return on;
}

/// Coefficients under forces (3N rows) anywhere. What acts on the window alone need not pass the far part first.
MatrixX GrowingCut::State::respond(const MatrixX& forces) const {
  const OnWindow on = on_window(forces);
  const MatrixX in_window = window->solve(on.by_slot);
  MatrixX far = MatrixX::Zero(window->far(), forces.cols());
  for (Eigen::Index c = 0; c < on.far_half.cols(); ++c)
    far.col(on.far_columns[c]) = on.far_half.col(c);
  const MatrixX recovered = window->recover_from_half(in_window, far);
  MatrixX coefficients = MatrixX::Zero(forces.rows(), forces.cols());
  for (Eigen::Index k = 0; k < std::ssize(far_order); ++k)
    coefficients.middleRows<3>(3 * static_cast<Eigen::Index>(far_order[k])) = recovered.middleRows<3>(3 * k);
  for (Eigen::Index s = 0; s < std::ssize(window_node); ++s)
    if (const Eigen::Index node = window_node[s]; node >= 0)
      coefficients.middleRows<3>(3 * node) = in_window.middleRows<3>(3 * s);
  return coefficients;
}

/// With the factor's halves Y = L^-1 F of the cases F and those of the nodes' functionals: products of halves, and no
/// solution goes back through the far part. Halves of the contact's candidates are there since the last condensation.
CaseResponses GrowingCut::State::condense_cases(const MatrixX& forces, const std::vector<int>& at) const {
  const bool has_halves = window->condensed_count() == 3 * std::ssize(contact);
  std::vector<Eigen::Index> place; // in options.contact; -1: not there
  Eigen::Index others = 0;
  for (const int node : at) {
    const auto known = std::find(options.contact.begin(), options.contact.end(), node);
    place.push_back(has_halves && known != options.contact.end() ? known - options.contact.begin() : -1);
    others += place.back() < 0 ? 1 : 0;
  }
  const Eigen::Index cases = forces.cols();
  MatrixX all = MatrixX::Zero(forces.rows(), cases + 3 * others);
  all.leftCols(cases) = forces;
  Eigen::Index next = cases;
  for (std::size_t k = 0; k < at.size(); ++k)
    if (place[k] < 0) {
      const DisplacementMean& functional = mean(at[k]);
      for (std::size_t j = 0; j < functional.nodes.size(); ++j)
        for (int axis = 0; axis < 3; ++axis)
          all(3 * static_cast<Eigen::Index>(functional.nodes[j]) + axis, next + axis) += functional.weights[j];
      next += 3;
    }
  const OnWindow on = on_window(all);
  const SchurWindow::Half halves = window->half(on.by_slot);
  const SchurWindow::Half of_cases = halves.left_columns(cases);
  MatrixX products = SchurWindow::product(halves, of_cases); // all x cases
  const MatrixX far_products = on.far_half.transpose() * on.far_half;
  for (Eigen::Index c = 0; c < far_products.cols() && on.far_columns[c] < cases; ++c)
    for (Eigen::Index r = 0; r < far_products.rows(); ++r)
      products(on.far_columns[r], on.far_columns[c]) += far_products(r, c);
  CaseResponses responses;
  responses.among = products.topRows(cases);
  responses.at.resize(3 * std::ssize(at), cases);
  const MatrixX seen = has_halves ? window->seen_by_condensed(of_cases) : MatrixX();
  next = cases;
  for (Eigen::Index k = 0; k < std::ssize(at); ++k) {
    if (const Eigen::Index known = place[static_cast<std::size_t>(k)]; known >= 0) {
      responses.at.middleRows<3>(3 * k) = seen.middleRows<3>(3 * known);
    } else {
      responses.at.middleRows<3>(3 * k) = products.middleRows<3>(next);
      next += 3;
    }
  }
  return responses;
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

bool GrowingCut::State::factor_window(const std::vector<Vector3>& places, double reach) {
  const Nearness to_places(places);
  std::vector<double> distance(window_node.size(), std::numeric_limits<double>::infinity());
  for (std::size_t block = 0; block < window_node.size(); ++block)
    if (const int node = window_node[block], first = 3 * static_cast<int>(block); node >= 0) {
      distance[block] = to_places(problem.nodes.positions[node]);
      ++left_alone[block];
      if (window->changed(first) || window->changed(first + 1) || window->changed(first + 2)) {
        reach = std::max(reach, distance[block]);
        left_alone[block] = 0;
      }
    }
  const int stages = window->stages();
  const bool stood = stages > 0 && window->keep_sound_stages() == stages;
  if (std::exchange(is_prepared, false) && stood) { // so the next one will be, too
    window->factor();
    return true;
  }
  std::vector<int> left; // blocks
  for (int block = 0; block < std::ssize(window_node); ++block)
    if (std::isfinite(distance[block]) && window->is_kept(3 * block))
      left.push_back(block);
  const double finest = *std::min_element(problem.nodes.spacings.begin(), problem.nodes.spacings.end());
  std::vector<std::vector<char>> kept;
  for (const double advance : advances_before_stages) {
    const bool is_last = advance == advances_before_stages.back();
    std::vector<int> wanted;
    for (const int block : left)
      if (distance[block] <= reach + advance * finest && (!is_last || left_alone[block] < recent))
        wanted.push_back(block);
    if (wanted.empty() || static_cast<double>(wanted.size()) > worth_a_stage * static_cast<double>(left.size()))
      continue;
    std::vector<char>& slots = kept.emplace_back(window->slots(), 0);
    for (const int block : wanted)
      std::fill_n(slots.begin() + 3 * static_cast<std::ptrdiff_t>(block), 3, 1);
    left = std::move(wanted);
  }
  window->prepare(kept);
  return stood;
}

SparseMatrix GrowingCut::State::contact_functionals() const {
  SparseMatrix functionals(window->slots(), 3 * std::ssize(contact));
  Eigen::Index entries = 0;
  for (const DisplacementMean& mean : contact)
    entries += 3 * std::ssize(mean.nodes);
  functionals.reserve(entries);
  std::vector<std::pair<int, double>> of_blocks; // weights, by the places of the nodes
  for (Eigen::Index c = 0; c < std::ssize(contact); ++c) {
    of_blocks.clear();
    for (std::size_t k = 0; k < contact[c].nodes.size(); ++k)
      of_blocks.emplace_back(slot[contact[c].nodes[k]], contact[c].weights[k]);
    std::sort(of_blocks.begin(), of_blocks.end());
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      functionals.startVec(3 * c + axis);
      for (const auto& [block, weight] : of_blocks)
        functionals.insertBack(3 * static_cast<Eigen::Index>(block) + axis, 3 * c + axis) = weight;
    }
  }
  functionals.finalize();
  return functionals;
}

void GrowingCut::State::condense_contact() {
  SchurWindow::Condensed condensed = window->condense(contact_functionals(), window_right(loads));
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
const std::vector<char>& GrowingCut::altered() const {
  return state_->altered;
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
CaseResponses GrowingCut::condense_cases(const MatrixX& forces, const std::vector<int>& at) const {
  return state_->condense_cases(forces, at);
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
