#include "solvers/finite/bordered_operator.hpp"

#include "solvers/algebra/dense_cholesky.hpp"
#include "solvers/algebra/dense_products.hpp"
#include "solvers/finite/cut_functions.hpp"
#include "solvers/points/weighed_gradients.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <set>

namespace spherecut::solvers {

namespace {

constexpr double same_column = 1e-12; // difference of columns that are the same, over their norm

bool holds_alike(const Prescribed& a, const Prescribed& b) {
  return a.node == b.node && a.components == b.components;
}

bool is_same(const DisplacementMean& a, const DisplacementMean& b) {
  const auto agree = [](double x, double y) { return std::abs(x - y) < 1e-12; }; // weights add up to one
  return a.nodes == b.nodes && std::equal(a.weights.begin(), a.weights.end(), b.weights.begin(), agree);
}

/// The place among columns before, `width` of them a key, of those that are the same; -1: they are new.
int find_same(const HalfSolutions& before, int key, const MatrixX& columns, Eigen::Index first, Eigen::Index width) {
  for (std::size_t k = 0; k < before.key.size(); ++k) {
    if (before.key[k] != key)
      continue;
    const auto was = before.columns.middleCols(width * static_cast<Eigen::Index>(k), width);
    const auto is = columns.middleCols(first, width);
    if ((is - was).squaredNorm() <= same_column * same_column * was.squaredNorm())
      return static_cast<int>(k);
  }
  return -1;
}

/// Half solutions of columns, `width` of them a key; `from`: places of those that were there before, or -1.
HalfSolutions half_solutions(const OrderedCholesky& factor, std::vector<int> key, MatrixX columns, Eigen::Index width,
                             const HalfSolutions* before, std::vector<int>& from) {
  HalfSolutions result{std::move(key), std::move(columns), {}};
  const auto count = std::ssize(result.key);
  from.assign(result.key.size(), -1);
  std::vector<Eigen::Index> fresh;
  result.halves.resize(result.columns.rows(), result.columns.cols());
  for (Eigen::Index k = 0; k < count; ++k) {
    if (before != nullptr)
      from[k] = find_same(*before, result.key[k], result.columns, width * k, width);
    if (from[k] < 0) {
      fresh.push_back(k);
      continue;
    }
    const Eigen::Index was = width * static_cast<Eigen::Index>(from[k]);
    result.columns.middleCols(width * k, width) = before->columns.middleCols(was, width); // so that they do not drift
    result.halves.middleCols(width * k, width) = before->halves.middleCols(was, width);
  }
  MatrixX right(result.columns.rows(), width * std::ssize(fresh));
  for (Eigen::Index k = 0; k < std::ssize(fresh); ++k)
    right.middleCols(width * k, width) = result.columns.middleCols(width * fresh[k], width);
  if (right.cols() > 0)
    right = factor.forward_sparse(right);
  for (Eigen::Index k = 0; k < std::ssize(fresh); ++k)
    result.halves.middleCols(width * fresh[k], width) = right.middleCols(width * k, width);
  return result;
}

} // namespace

UncutTangent::UncutTangent(const FiniteBody& body, const UniformTangent& uniform,
                           std::shared_ptr<const OrderedCholesky> factor, double norm)
    : uniform_(uniform), factor_(std::move(factor)), rank_(body.rank()), blocks_(body.blocks()), norm_(norm),
      shares_(body.held().entries()), means_(body.held().means()) {}

bool UncutTangent::fits(const FiniteBody& body, const UniformTangent& uniform) const {
  constexpr double alike = 1e-9;
  // Entries of the uncut body are those of the problem; a cut may have parted those of the other.
  const std::vector<Prescribed>& held = body.problem().prescribed;
  return body.cut_functions()->uncut()->size() == std::ssize(rank_) &&
         (uniform.stiffness - uniform_.stiffness).norm() <= alike * uniform_.stiffness.norm() &&
         (uniform.cofactor - uniform_.cofactor).norm() <= alike * uniform_.cofactor.norm() &&
         std::abs(uniform.bulk_slope - uniform_.bulk_slope) <= alike * uniform_.bulk_slope &&
         (body.blocks().size() > 0) == (blocks_.size() > 0) &&
         std::equal(held.begin(), held.end(), shares_.begin(), shares_.end(), holds_alike);
}

/// Terms of rank one, and what each comes from.
struct BorderedOperator::Terms {
  Columns columns;
  std::vector<int> key;

  /// So many more, of that key; returns the first.
  Eigen::Index add(Eigen::Index count, int of) {
    const auto first = std::ssize(key);
    columns.base.conservativeResizeLike(MatrixX::Zero(columns.base.rows(), first + count));
    columns.cut.conservativeResizeLike(MatrixX::Zero(columns.cut.rows(), first + count));
    key.resize(key.size() + static_cast<std::size_t>(count), of);
    return first;
  }
  void append(const Terms& others) {
    const Eigen::Index first = add(std::ssize(others.key), 0);
    columns.base.rightCols(std::ssize(others.key)) = others.columns.base;
    columns.cut.rightCols(std::ssize(others.key)) = others.columns.cut;
    std::copy(others.key.begin(), others.key.end(), key.begin() + first);
  }
};

BorderedOperator::BorderedOperator(const FiniteBody& body, std::shared_ptr<const UncutTangent> uncut,
                                   const KeptBorder* before, const UniformTangent& uniform, double penalty)
    : body_(body), uncut_(std::move(uncut)), base_(body.cut_functions()->uncut()->size()),
      appended_(body.cut_functions()->appended()) {
  MatrixX coupling = MatrixX::Zero(3 * base_, 3 * appended_), corner = MatrixX::Zero(3 * appended_, 3 * appended_);
  append_elastic(uniform, coupling, corner);
  interruption_point();
  Terms come{columns(0), {}}, gone = come;
  if (body.blocks().size() > 0)
    append_blocks(uniform, coupling, corner, come, gone);
  append_held(penalty, come, gone);
  for (Eigen::Index k = 0; k < appended_; ++k)
    corner.diagonal().segment<3>(3 * k).array() += body.support_of(base_ + static_cast<int>(k));
  auto now = std::make_shared<KeptBorder>();
  find_halves(std::move(coupling), before, *now);
  interruption_point();
  lower_ = corner - now->products;
  if (const int column = factor_lower(lower_); column >= 0)
    throw NumericalError(
        fmt::format("what a cut appends is not positive definite (unknown {} of {})", column, 3 * appended_));
  come_ = static_cast<int>(come.key.size());
  come.append(gone);
  std::vector<int> from;
  now->terms = half_solutions(uncut_->factor(), std::move(come.key), std::move(come.columns.base), 1,
                              before != nullptr ? &before->terms : nullptr, from);
  terms_ = {now->terms.halves, std::move(come.columns.cut)};
  border_ = std::move(now);
  forward_cut(terms_);
  factor_terms();
}

/// W and W^T W of functions that stay are what they were.
void BorderedOperator::find_halves(MatrixX coupling, const KeptBorder* before, KeptBorder& now) {
  std::vector<int> key(static_cast<std::size_t>(appended_)), from;
  for (int k = 0; k < appended_; ++k)
    key[k] = 2 * body_.node_of(base_ + k) + (body_.cut_functions()->twin(k).is_step ? 1 : 0);
  now.functions = half_solutions(uncut_->factor(), std::move(key), std::move(coupling), 3,
                                 before != nullptr ? &before->functions : nullptr, from);
  const MatrixX& half = now.functions.halves;
  std::vector<Eigen::Index> kept, fresh;
  for (Eigen::Index k = 0; k < appended_; ++k)
    (from[k] >= 0 ? kept : fresh).push_back(k);
  kept_ = static_cast<int>(kept.size());
  MatrixX newest(half.rows(), 3 * std::ssize(fresh)), products = MatrixX::Zero(3 * appended_, newest.cols());
  for (Eigen::Index j = 0; j < std::ssize(fresh); ++j)
    newest.middleCols<3>(3 * j) = half.middleCols<3>(3 * fresh[j]);
  add_product(1, half, true, newest, products);
  now.products.resize(3 * appended_, 3 * appended_);
  for (Eigen::Index j = 0; j < std::ssize(fresh); ++j) {
    now.products.middleCols<3>(3 * fresh[j]) = products.middleCols<3>(3 * j);
    now.products.middleRows<3>(3 * fresh[j]) = products.middleCols<3>(3 * j).transpose();
  }
  for (const Eigen::Index j : kept)
    for (const Eigen::Index i : kept)
      now.products.block<3, 3>(3 * i, 3 * j) =
          before->products.block<3, 3>(3 * static_cast<Eigen::Index>(from[i]), 3 * static_cast<Eigen::Index>(from[j]));
}

// With P of what comes, Q of what goes and B between, P is definite, and so is B^T P^-1 B - Q where the whole is
// (the inertia of a Schur complement).
void BorderedOperator::factor_terms() {
  MatrixX middle = MatrixX::Zero(terms_.base.cols(), terms_.base.cols());
  add_product(1, terms_.base, true, terms_.base, middle);
  add_product(1, terms_.cut, true, terms_.cut, middle);
  middle.diagonal().head(come_).array() += 1;
  const Eigen::Index gone = middle.rows() - come_;
  middle.diagonal().tail(gone).array() -= 1;
  MatrixX first = middle.topLeftCorner(come_, come_), between = middle.topRightCorner(come_, gone);
  bool is_definite = factor_lower(first) < 0;
  if (come_ > 0 && gone > 0)
    triangular_solve(false, first.data(), come_, between);
  MatrixX last = -middle.bottomRightCorner(gone, gone);
  add_product(1, between, true, between, last);
  is_definite = is_definite && factor_lower(last) < 0;
  if (!is_definite)
    throw NumericalError("what a cut parts leaves a tangent that is not positive definite");
  terms_lower_ = MatrixX::Zero(middle.rows(), middle.cols());
  terms_lower_.topLeftCorner(come_, come_) = first;
  terms_lower_.bottomLeftCorner(gone, come_) = between.transpose();
  terms_lower_.bottomRightCorner(gone, gone) = last;
}

BorderedOperator::Columns BorderedOperator::columns(Eigen::Index count) const {
  return {MatrixX::Zero(3 * base_, count), MatrixX::Zero(3 * appended_, count)};
}

// A sphere's functions add up to what it is without a cut; a host's guests to what it would be without them.
void BorderedOperator::add(int function, const Vector3& value, Eigen::Index column, Columns& to) const {
  to.base.col(column).segment<3>(3 * static_cast<Eigen::Index>(uncut_->rank()[body_.node_of(function)])) += value;
  if (function < base_)
    return;
  to.cut.col(column).segment<3>(3 * static_cast<Eigen::Index>(function - base_)) += value;
  if (const int host = body_.cut_functions()->host_of(function - base_); host >= base_)
    to.cut.col(column).segment<3>(3 * static_cast<Eigen::Index>(host - base_)) += value;
}

// K_ij = sum over c, d of D_acbd M_cd,ij with M_ij = sum over points of w g_i g_j^T, j appended, cell by cell.
void BorderedOperator::append_elastic(const UniformTangent& uniform, MatrixX& coupling, MatrixX& corner) const {
  const PointTable& table = body_.points();
  std::vector<int> place(static_cast<std::size_t>(body_.functions()), -1); // in a cell
  std::vector<int> nodes, functions;
  for (int first = 0, end = 0; first < table.groups(); first = end) {
    end = table.end_of_cell(first);
    nodes.clear();
    functions.clear();
    const auto take = [&](int function, std::vector<int>& list) {
      if (place[function] >= 0)
        return;
      place[function] = static_cast<int>(list.size());
      list.push_back(function);
    };
    for (int slot = table.start[first]; slot < table.start[end]; ++slot) {
      const int function = table.nodes[slot];
      take(body_.node_of(function), nodes);
      if (function < base_)
        continue;
      take(function, functions);
      if (const int host = body_.cut_functions()->host_of(function - base_); host >= base_)
        take(host, functions);
    }
    if (!functions.empty()) {
      const Eigen::Index spheres = std::ssize(nodes), all = spheres + std::ssize(functions);
      const MatrixX weighed = weighed_gradients(table, first, end, all, [&](int function, const auto& add) {
        add(place[body_.node_of(function)]);
        if (function < base_)
          return;
        add(spheres + place[function]);
        if (const int host = body_.cut_functions()->host_of(function - base_); host >= base_)
          add(spheres + place[host]);
      });
      const MatrixX beyond = weighed.rightCols(3 * std::ssize(functions));
      MatrixX moments = MatrixX::Zero(3 * all, beyond.cols());
      add_product(1, weighed, true, beyond, moments);
      for (Eigen::Index j = 0; j < std::ssize(functions); ++j) {
        const Eigen::Index column = 3 * static_cast<Eigen::Index>(functions[j] - base_);
        for (Eigen::Index i = 0; i < all; ++i) {
          const Matrix3 moment = moments.block<3, 3>(3 * i, 3 * j);
          if (i < spheres)
            coupling.block<3, 3>(3 * static_cast<Eigen::Index>(uncut_->rank()[nodes[i]]), column) += moment;
          else
            corner.block<3, 3>(3 * static_cast<Eigen::Index>(functions[i - spheres] - base_), column) += moment;
        }
      }
    }
    for (const std::vector<int>* list : {&nodes, &functions})
      for (const int function : *list)
        place[function] = -1;
  }
  for (MatrixX* const matrix : {&coupling, &corner})
    for (Eigen::Index j = 0; j < matrix->cols(); j += 3)
      for (Eigen::Index i = 0; i < matrix->rows(); i += 3) {
        const Matrix3 moment = matrix->block<3, 3>(i, j);
        if (moment.isZero(0))
          continue;
        const Eigen::Matrix<double, 9, 1> stiffness =
            uniform.stiffness * Eigen::Map<const Eigen::Matrix<double, 9, 1>>(moment.data());
        matrix->block<3, 3>(i, j) = Eigen::Map<const Matrix3>(stiffness.data());
      }
}

// What is appended takes part in the blocks of the uncut body; blocks that the cut has changed go, and others come.
void BorderedOperator::append_blocks(const UniformTangent& uniform, MatrixX& coupling, MatrixX& corner, Terms& come,
                                     Terms& gone) const {
  const PointTable& table = body_.points();
  const DilatationBlocks &whole = uncut_->blocks(), &parted = body_.blocks();
  std::vector<std::set<int>> parts(whole.volume.size()), wholes(parted.volume.size());
  std::vector<std::vector<int>> groups(whole.volume.size()), groups_of_part(parted.volume.size());
  std::vector<char> is_reached(whole.volume.size(), 0);
  for (int group = 0; group < table.groups(); ++group) {
    const int block = whole.block[body_.uncut_groups()[group]], part = parted.block[group];
    parts[block].insert(part);
    wholes[part].insert(block);
    groups[block].push_back(group);
    groups_of_part[part].push_back(group);
    const std::span<const int> functions = table.nodes_of(group);
    if (!functions.empty() && functions.back() >= base_) // they ascend
      is_reached[block] = 1;
  }
  const auto is_changed = [&](int block) {
    return parts[block].size() > 1 || wholes[*parts[block].begin()].size() > 1;
  };
  std::set<int> changed;
  for (int block = 0; block < whole.size(); ++block)
    if (parts[block].empty())
      throw NumericalError("a block of the uncut body has no points of the cut one");
    else if (is_changed(block))
      changed.insert(block);
  const auto add_swelling = [&](const std::vector<int>& of, double factor, Eigen::Index column, Columns& to) {
    for (const int group : of)
      for (int slot = table.start[group]; slot < table.start[group + 1]; ++slot) {
        Vector3 sum = Vector3::Zero();
        for (int lane = 0; lane < point_lanes; ++lane)
          sum += table.weights[group].value[lane] * table.gradient(slot, lane);
        add(table.nodes[slot], factor * uniform.cofactor * sum, column, to);
      }
  };
  const auto root = [&](double volume) { return std::sqrt(uniform.bulk_slope / volume); };
  for (int block = 0; block < whole.size(); ++block)
    if (is_reached[block] != 0) {
      Columns swelling = columns(1);
      add_swelling(groups[block], root(whole.volume[block]), 0, swelling);
      for (Eigen::Index j = 0; j < swelling.cut.rows(); ++j)
        if (const double here = swelling.cut(j, 0); here != 0) {
          coupling.col(j) += here * swelling.base;
          corner.col(j) += here * swelling.cut;
        }
    }
  std::set<int> new_parts;
  for (const int block : changed) {
    add_swelling(groups[block], root(whole.volume[block]), gone.add(1, block), gone.columns);
    new_parts.insert(parts[block].begin(), parts[block].end());
  }
  for (const int part : new_parts)
    add_swelling(groups_of_part[part], root(parted.volume[part]), come.add(1, *wholes[part].begin()), come.columns);
}

// Where a cut changes the mean of a held share, the penalty of the whole share goes, and that of each part comes.
void BorderedOperator::append_held(double penalty, Terms& come, Terms& gone) const {
  const HeldMeans& held = body_.held();
  const auto share_of = [](const Prescribed& entry) { return std::pair(entry.node, entry.components); };
  std::map<std::pair<int, std::array<bool, 3>>, std::vector<int>> parts_of;
  for (int e = 0; e < std::ssize(held.entries()); ++e)
    parts_of[share_of(held.entries()[e])].push_back(e);
  for (int share = 0; share < std::ssize(uncut_->shares()); ++share) {
    const DisplacementMean& whole = uncut_->means()[share];
    const std::vector<int>& parts = parts_of.at(share_of(uncut_->shares()[share]));
    if (parts.size() == 1 && is_same(held.means()[parts.front()], whole))
      continue;
    const double root = std::sqrt(body_.penalty_stiffness(parts.front(), penalty));
    for (int axis = 0; axis < 3; ++axis) {
      if (!uncut_->shares()[share].components[axis])
        continue;
      const Eigen::Index first = gone.add(1, -1 - share);
      for (std::size_t k = 0; k < whole.nodes.size(); ++k) // displacements of whole spheres alone
        gone.columns.base(3 * uncut_->rank()[whole.nodes[k]] + axis, first) += root * whole.weights[k];
      for (const int e : parts) {
        const DisplacementMean& part = held.means()[e];
        const Eigen::Index column = come.add(1, -1 - share);
        for (std::size_t k = 0; k < part.nodes.size(); ++k)
          add(part.nodes[k], root * part.weights[k] * Vector3::Unit(axis), column, come.columns);
      }
    }
  }
}

void BorderedOperator::forward_cut(Columns& columns) const {
  add_product(-1, border_->functions.halves, true, columns.base, columns.cut);
  triangular_solve(false, lower_.data(), static_cast<int>(lower_.rows()), columns.cut);
}

MatrixX BorderedOperator::solve(const MatrixX& right_hand_sides) const {
  const Eigen::Index cases = right_hand_sides.cols();
  Columns half = columns(cases);
  for (Eigen::Index c = 0; c < cases; ++c)
    for (int f = 0; f < body_.functions(); ++f)
      add(f, right_hand_sides.col(c).segment<3>(3 * static_cast<Eigen::Index>(f)), c, half);
  half.base = uncut_->factor().forward_sparse(half.base);
  forward_cut(half);
  if (const auto count = static_cast<int>(terms_lower_.rows()); count > 0) {
    MatrixX answer = MatrixX::Zero(count, cases);
    add_product(1, terms_.base, true, half.base, answer);
    add_product(1, terms_.cut, true, half.cut, answer);
    triangular_solve(false, terms_lower_.data(), count, answer);
    answer.bottomRows(count - come_) *= -1;
    triangular_solve(true, terms_lower_.data(), count, answer);
    add_product(-1, terms_.base, false, answer, half.base);
    add_product(-1, terms_.cut, false, answer, half.cut);
  }
  triangular_solve(true, lower_.data(), static_cast<int>(lower_.rows()), half.cut);
  add_product(-1, border_->functions.halves, false, half.cut, half.base);
  uncut_->factor().backward(0, half.base);
  MatrixX solution(3 * static_cast<Eigen::Index>(body_.functions()), cases);
  for (Eigen::Index i = 0; i < base_; ++i)
    solution.middleRows<3>(3 * i) = half.base.middleRows<3>(3 * static_cast<Eigen::Index>(uncut_->rank()[i]));
  for (int round = 0; round < 2; ++round) // hosts before their guests
    for (Eigen::Index k = 0; k < appended_; ++k) {
      const Eigen::Index host = body_.cut_functions()->host_of(static_cast<int>(k));
      if ((host < base_) == (round == 0))
        solution.middleRows<3>(3 * (base_ + k)) = solution.middleRows<3>(3 * host) + half.cut.middleRows<3>(3 * k);
    }
  return solution;
}

long BorderedOperator::nonzeros() const {
  return uncut_->factor().nonzeros() + static_cast<long>(border_->functions.halves.size() + lower_.size());
}

} // namespace spherecut::solvers
