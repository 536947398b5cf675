#include "solvers/appended/cut_system.hpp"

#include "solvers/algebra/dense_cholesky.hpp"
#include "solvers/algebra/dense_products.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

// ---- functions and functionals

CutFunctional CutSystem::mean_over(const std::vector<QuadraturePoint>& points, Faint faint) const {
  std::map<int, double> base;
  std::map<int, Matrix3> cut;
  ShapeFunctions shape;
  CutTerms terms;
  for (const QuadraturePoint& point : points) {
    const PartId part = space_->part_at(point.position);
    uncut_.boxes().evaluate(box_of(part), point.position, shape);
    if (faint == Faint::left_out)
      space_->take_out_faint(point.position, part, shape);
    space_->terms_at(point.position, part, shape, terms);
    for (int k = 0; k < shape.size(); ++k)
      base[shape.nodes[k]] += point.weight * shape.value[k];
    for (const ScalarTerm& term : terms.scalar)
      cut.try_emplace(term.function, Matrix3::Zero()).first->second.diagonal().array() += point.weight * term.value;
    for (const FrontTerm& term : terms.front)
      cut.try_emplace(term.function, Matrix3::Zero()).first->second += point.weight * term.value;
  }
  return {{base.begin(), base.end()}, {cut.begin(), cut.end()}};
}

Vector3 CutSystem::value(const CutFunctional& functional, const VectorX& base, const VectorX& cut) {
  Vector3 value = Vector3::Zero();
  for (const auto& [node, weight] : functional.base)
    value += weight * base.segment<3>(3 * static_cast<Eigen::Index>(node));
  for (const auto& [function, matrix] : functional.cut)
    value += matrix * cut.segment<3>(3 * static_cast<Eigen::Index>(function));
  return value;
}

// ---- growth

void CutSystem::update(const CutSpace::Change& change, const std::vector<std::vector<int>>& loose) {
  const auto kept = std::ssize(change.kept), count = kept + change.added;
  // What stays moves together.
  Eigen::Index unchanged = 0;
  while (unchanged < kept && change.kept[unchanged] == unchanged)
    ++unchanged;
  std::vector<FunctionData> data;
  data.reserve(count);
  MatrixX elastic = MatrixX::Zero(3 * count, 3 * count), penalty = elastic, schur = elastic;
  if (half_.cols() < 3 * count)
    half_.conservativeResize(3 * uncut_.size(), 3 * count + half_.cols() / 2);
  for (Eigen::Index k = 0; k < kept; ++k) {
    const Eigen::Index from = change.kept[k];
    data.push_back(std::move(data_[from]));
    if (from != k) // from ascends
      half_.middleCols<3>(3 * k) = half_.middleCols<3>(3 * from);
    for (Eigen::Index l = 0; l < kept; ++l) {
      const Eigen::Index other = change.kept[l];
      elastic.block<3, 3>(3 * l, 3 * k) = elastic_.block<3, 3>(3 * other, 3 * from);
      penalty.block<3, 3>(3 * l, 3 * k) = penalty_.block<3, 3>(3 * other, 3 * from);
      schur.block<3, 3>(3 * l, 3 * k) = schur_.block<3, 3>(3 * other, 3 * from);
    }
  }
  data_ = std::move(data);
  elastic_ = std::move(elastic);
  penalty_ = std::move(penalty);
  schur_ = std::move(schur);
  const int first_new = static_cast<int>(kept);
  evaluate(first_new);
  in_cell_.assign(uncut_.boxes().cells().size(), {});
  for (int k = 0; k < count; ++k) {
    int last = -1;
    for (const PartId part : data_[k].parts)
      if (const int cell = uncut_.boxes().cell_of(box_of(part)); cell != last) {
        in_cell_[cell].push_back(k);
        last = cell;
      }
  }
  add_elastic(first_new);
  add_held(first_new, change);

  // W of the new columns.
  const Eigen::Index fresh = 3 * (count - kept);
  if (fresh > 0) {
    MatrixX columns = MatrixX::Zero(3 * uncut_.size(), fresh);
    for (Eigen::Index k = kept; k < count; ++k) {
      const FunctionData& own = data_[k];
      for (std::size_t n = 0; n < own.nodes.size(); ++n)
        columns.block<3, 3>(3 * static_cast<Eigen::Index>(uncut_.rank()[own.nodes[n]]), 3 * (k - kept)) +=
            own.blocks[n];
      for (const auto& [node, block] : own.penalty)
        columns.block<3, 3>(3 * static_cast<Eigen::Index>(uncut_.rank()[node]), 3 * (k - kept)) += block;
    }
    const MatrixX newest = uncut_.factor().forward_sparse(columns);
    half_.middleCols(3 * kept, fresh) = newest;
    MatrixX corner = elastic_.rightCols(fresh) + penalty_.rightCols(fresh);
    add_transposed_product(-1, half_.data(), static_cast<int>(half_.rows()), newest, corner);
    schur_.rightCols(fresh) = corner;
    schur_.bottomLeftCorner(fresh, 3 * kept) = corner.topRows(3 * kept).transpose();
  }
  const bool sprung = springs_.cols() > 0;
  add_springs(loose);
  factor(sprung || springs_.cols() > 0 ? 0 : std::min<Eigen::Index>(unchanged, kept));
  part_held_shares();
  solve_multipliers();
}

// Rigid motions of a loose piece, as its twins carry them, made orthonormal: each counts by the root of its energy. One
// that has next to none in the piece costs nothing to move, and would take the spring's share alone.
void CutSystem::add_springs(const std::vector<std::vector<int>>& loose) {
  springs_ = MatrixX::Zero(schur_.rows(), 6 * std::ssize(loose));
  for (Eigen::Index p = 0; p < std::ssize(loose); ++p) {
    Vector3 centre = Vector3::Zero();
    double spacing = 0;
    for (const int k : loose[p]) {
      centre += uncut_.nodes().positions[space_->functions()[k].twin.node] / static_cast<double>(loose[p].size());
      spacing = std::max(spacing, uncut_.nodes().spacings[space_->functions()[k].twin.node]);
    }
    MatrixX rigid = MatrixX::Zero(schur_.rows(), 6);
    for (const int k : loose[p]) {
      const Vector3 x = (uncut_.nodes().positions[space_->functions()[k].twin.node] - centre) / spacing;
      rigid.block<3, 3>(3 * static_cast<Eigen::Index>(k), 0).setIdentity();
      rigid.block<3, 3>(3 * static_cast<Eigen::Index>(k), 3) << 0, x.z(), -x.y(), -x.z(), 0, x.x(), x.y(), -x.x(), 0;
    }
    for (const int k : loose[p]) {
      const Eigen::Index row = 3 * static_cast<Eigen::Index>(k);
      rigid.middleRows<3>(row) *= std::sqrt(elastic_.diagonal().segment<3>(row).sum());
    }
    const double stiffness = uncut_.problem().material.young_modulus * spacing;
    const MatrixX basis = Eigen::HouseholderQR<MatrixX>(rigid).householderQ() * MatrixX::Identity(rigid.rows(), 6);
    springs_.middleCols(6 * p, 6) = std::sqrt(stiffness) * basis;
  }
}

// What is left out depends on all unknowns: where there is such a one all of it is factored.
void CutSystem::factor(Eigen::Index unchanged) {
  if (has_left_out_)
    unchanged = 0;
  const Eigen::Index count = schur_.rows(), first = 3 * unchanged, rest = count - first;
  MatrixX lower = MatrixX::Zero(count, count);
  lower.topLeftCorner(first, first) = lower_.topLeftCorner(first, first);
  if (rest > 0) {
    MatrixX corner = schur_.bottomRightCorner(rest, rest);
    if (springs_.cols() > 0) // then all of it is factored
      corner += springs_ * springs_.transpose();
    if (first > 0) {
      MatrixX beside = schur_.topRightCorner(first, rest);
      triangular_solve(false, lower.data(), static_cast<int>(count), beside);
      add_product(-1, beside, true, beside, corner);
      lower.bottomLeftCorner(rest, first) = beside.transpose();
    }
    const VectorX energy = elastic_.diagonal().tail(rest) + penalty_.diagonal().tail(rest);
    if (const int column = factor_lower_semidefinite(corner, energy, &has_left_out_); column >= 0) {
      const CutFunction& function = space_->functions()[unchanged + column / 3];
      const Vector3 x = function.is_front ? function.group.station.point : uncut_.nodes().positions[function.twin.node];
      throw NumericalError(fmt::format("what the cut appends is not semidefinite (unknown {} of {}, about ({:.4g}, "
                                       "{:.4g}, {:.4g}) m): a severed piece is not held, or a function repeats another",
                                       first + column, count, x.x(), x.y(), x.z()));
    }
    if (has_left_out_ && first > 0)
      return factor(0);
    lower.bottomRightCorner(rest, rest) = corner;
  }
  lower_ = std::move(lower);
}

// ---- solution

CutVectors CutSystem::zero(Eigen::Index cases) const {
  return {MatrixX::Zero(3 * uncut_.size(), cases), MatrixX::Zero(3 * functions(), cases),
          MatrixX::Zero(3 * std::ssize(parted_), cases)};
}

void CutSystem::add_force(const CutFunctional& on, const Vector3& force, Eigen::Index load_case, CutVectors& loads) {
  for (const auto& [node, weight] : on.base)
    loads.base.col(load_case).segment<3>(3 * static_cast<Eigen::Index>(node)) += weight * force;
  for (const auto& [function, matrix] : on.cut)
    loads.cut.col(load_case).segment<3>(3 * static_cast<Eigen::Index>(function)) += matrix.transpose() * force;
}

CutVectors CutSystem::solve(const CutVectors& loads) const {
  CutVectors half{uncut_.factor().forward(uncut_.ordered(loads.base)), loads.cut, loads.multipliers};
  add_transposed_product(-1, half_.data(), static_cast<int>(half_.rows()), half.base, half.cut);
  triangular_solve(false, lower_.data(), static_cast<int>(lower_.rows()), half.cut);
  if (!parted_.empty()) {
    // q = -M^-1 (g - Wd^T y - X^T z)
    add_product(-1, parted_half_, true, half.base, half.multipliers);
    add_product(-1, parted_schur_, true, half.cut, half.multipliers);
    triangular_solve(false, parted_lower_.data(), static_cast<int>(parted_lower_.rows()), half.multipliers);
    triangular_solve(true, parted_lower_.data(), static_cast<int>(parted_lower_.rows()), half.multipliers);
    half.multipliers *= -1;
    add_product(-1, parted_schur_, false, half.multipliers, half.cut);
    add_product(-1, parted_half_, false, half.multipliers, half.base);
  }
  triangular_solve(true, lower_.data(), static_cast<int>(lower_.rows()), half.cut);
  half.base -= half_.leftCols(half.cut.rows()) * half.cut;
  uncut_.factor().backward(0, half.base);
  half.base = uncut_.unordered(half.base);
  return half;
}

CutVectors CutSystem::half_solutions(const CutVectors& loads) const {
  CutVectors half{uncut_.factor().forward_sparse(uncut_.ordered(loads.base)), loads.cut, loads.multipliers};
  finish_halves(half);
  return half;
}

void CutSystem::finish_halves(CutVectors& half) const {
  add_transposed_product(-1, half_.data(), static_cast<int>(half_.rows()), half.base, half.cut);
  triangular_solve(false, lower_.data(), static_cast<int>(lower_.rows()), half.cut);
  if (parted_.empty())
    return;
  add_product(-1, parted_half_, true, half.base, half.multipliers);
  add_product(-1, parted_schur_, true, half.cut, half.multipliers);
  triangular_solve(false, parted_lower_.data(), static_cast<int>(parted_lower_.rows()), half.multipliers);
}

MatrixX CutSystem::compliance(const CutVectors& a, const CutVectors& b) {
  MatrixX result = MatrixX::Zero(a.base.cols(), b.base.cols());
  add_product(1, a.base, true, b.base, result);
  add_product(1, a.cut, true, b.cut, result);
  if (a.multipliers.rows() > 0)
    add_product(-1, a.multipliers, true, b.multipliers, result);
  return result;
}

CutVectors CutSystem::elastic_forces(const VectorX& base, const VectorX& cut) const {
  CutVectors forces = zero(1);
  forces.base.col(0) = uncut_.elastic_forces(base);
  forces.cut.col(0) = elastic_ * cut;
  for (Eigen::Index k = 0; k < functions(); ++k)
    for (std::size_t n = 0; n < data_[k].nodes.size(); ++n) {
      const Eigen::Index row = 3 * static_cast<Eigen::Index>(data_[k].nodes[n]);
      forces.base.col(0).segment<3>(row) += data_[k].blocks[n] * cut.segment<3>(3 * k);
      forces.cut.col(0).segment<3>(3 * k) += data_[k].blocks[n].transpose() * base.segment<3>(row);
    }
  return forces;
}

} // namespace spherecut::solvers
