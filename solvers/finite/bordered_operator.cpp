#include "solvers/finite/bordered_operator.hpp"

#include "solvers/algebra/dense_cholesky.hpp"
#include "solvers/algebra/dense_products.hpp"
#include "solvers/finite/cut_functions.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <set>

namespace spherecut::solvers {

namespace {

constexpr double same_column = 1e-8;         // difference of columns that are the same, over their norm
constexpr double support_of_appended = 1e-7; // of mu times the spacing, as the tangent's own

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
    if (from[k] >= 0)
      result.halves.middleCols(width * k, width) =
          before->halves.middleCols(width * static_cast<Eigen::Index>(from[k]), width);
    else
      fresh.push_back(k);
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
                           std::shared_ptr<const OrderedCholesky> factor)
    : uniform_(uniform), factor_(std::move(factor)), rank_(body.rank()), blocks_(body.blocks()),
      held_(body.held().entries()), means_(body.held().means()) {}

bool UncutTangent::fits(const FiniteBody& body, const UniformTangent& uniform) const {
  constexpr double alike = 1e-12;
  // Entries of the uncut body are those of the problem; a cut may have parted those of the other.
  const std::vector<Prescribed>& held = body.problem().prescribed;
  return body.cut_functions()->uncut()->size() == std::ssize(rank_) &&
         (uniform.stiffness - uniform_.stiffness).norm() < alike * uniform_.stiffness.norm() &&
         (uniform.cofactor - uniform_.cofactor).norm() < alike * uniform_.cofactor.norm() &&
         std::abs(uniform.bulk_slope - uniform_.bulk_slope) <= alike * uniform_.bulk_slope &&
         (body.blocks().size() > 0) == (blocks_.size() > 0) &&
         std::equal(held.begin(), held.end(), held_.begin(), held_.end(), holds_alike);
}

std::shared_ptr<const KeptBorder> UncutTangent::border() const {
  const std::lock_guard lock(guard_);
  return border_;
}

void UncutTangent::keep(std::shared_ptr<const KeptBorder> border) const {
  const std::lock_guard lock(guard_);
  border_ = std::move(border);
}

/// Terms of rank one: columns, the sign of each, and what it comes from.
struct BorderedOperator::Terms {
  Columns columns;
  std::vector<double> sign;
  std::vector<int> key;
};

BorderedOperator::BorderedOperator(const FiniteBody& body, std::shared_ptr<const UncutTangent> uncut,
                                   const UniformTangent& uniform, double penalty)
    : body_(body), uncut_(std::move(uncut)), base_(body.cut_functions()->uncut()->size()),
      appended_(body.cut_functions()->appended()) {
  MatrixX coupling = MatrixX::Zero(3 * base_, 3 * appended_), corner = MatrixX::Zero(3 * appended_, 3 * appended_);
  append_elastic(uniform, coupling, corner);
  Terms terms{columns(0), {}, {}};
  if (body.blocks().size() > 0)
    append_blocks(uniform, coupling, corner, terms);
  append_held(penalty, terms);
  for (Eigen::Index k = 0; k < appended_; ++k)
    corner.diagonal().segment<3>(3 * k).array() +=
        support_of_appended * body.law().small_strain().shear_modulus *
        body.problem().nodes.spacings[body.node_of(base_ + static_cast<int>(k))];
  const std::shared_ptr<const KeptBorder> before = uncut_->border();
  auto now = std::make_shared<KeptBorder>();
  border(std::move(coupling), corner, before.get(), *now);
  lower_ = now->schur;
  if (const int column = factor_lower(lower_); column >= 0)
    throw NumericalError(
        fmt::format("what a cut appends is not positive definite (unknown {} of {})", column, 3 * appended_));
  terms_.cut = std::move(terms.columns.cut);
  std::vector<int> from;
  now->terms = half_solutions(uncut_->factor(), std::move(terms.key), std::move(terms.columns.base), 1,
                              before != nullptr ? &before->terms : nullptr, from);
  terms_.base = now->terms.halves;
  border_ = now;
  uncut_->keep(std::move(now));
  forward_cut(terms_);
  MatrixX middle = MatrixX::Zero(terms_.base.cols(), terms_.base.cols());
  add_product(1, terms_.base, true, terms_.base, middle);
  add_product(1, terms_.cut, true, terms_.cut, middle);
  for (Eigen::Index t = 0; t < middle.rows(); ++t)
    middle(t, t) += terms.sign[t];
  if (middle.size() > 0)
    middle_back_ = middle.partialPivLu().inverse();
  if (!middle_back_.allFinite())
    throw NumericalError("what a cut parts leaves a singular tangent");
}

void BorderedOperator::border(MatrixX coupling, const MatrixX& corner, const KeptBorder* before,
                              KeptBorder& now) const {
  std::vector<int> key(static_cast<std::size_t>(appended_)), from;
  for (int k = 0; k < appended_; ++k)
    key[k] = 2 * body_.node_of(base_ + k) + (body_.cut_functions()->twin(k).is_step ? 1 : 0);
  now.functions = half_solutions(uncut_->factor(), std::move(key), std::move(coupling), 3,
                                 before != nullptr ? &before->functions : nullptr, from);
  const MatrixX& half = now.functions.halves;
  std::vector<Eigen::Index> kept, fresh;
  for (Eigen::Index k = 0; k < appended_; ++k)
    (from[k] >= 0 ? kept : fresh).push_back(k);
  MatrixX newest(half.rows(), 3 * std::ssize(fresh)), products = MatrixX::Zero(3 * appended_, newest.cols());
  for (Eigen::Index j = 0; j < std::ssize(fresh); ++j) {
    newest.middleCols<3>(3 * j) = half.middleCols<3>(3 * fresh[j]);
    products.middleCols<3>(3 * j) = corner.middleCols<3>(3 * fresh[j]);
  }
  add_product(-1, half, true, newest, products);
  now.schur.resize(3 * appended_, 3 * appended_);
  for (Eigen::Index j = 0; j < std::ssize(fresh); ++j) {
    now.schur.middleCols<3>(3 * fresh[j]) = products.middleCols<3>(3 * j);
    now.schur.middleRows<3>(3 * fresh[j]) = products.middleCols<3>(3 * j).transpose();
  }
  for (const Eigen::Index j : kept)
    for (const Eigen::Index i : kept)
      now.schur.block<3, 3>(3 * i, 3 * j) =
          before->schur.block<3, 3>(3 * static_cast<Eigen::Index>(from[i]), 3 * static_cast<Eigen::Index>(from[j]));
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
    while (end < table.groups() && table.cell[end] == table.cell[first])
      ++end;
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
      const auto points = static_cast<Eigen::Index>(point_lanes) * (end - first);
      const Eigen::Index spheres = std::ssize(nodes), all = spheres + std::ssize(functions);
      MatrixX weighed = MatrixX::Zero(points, 3 * all); // gradients, times the root of the weight
      for (int group = first; group < end; ++group) {
        double root[point_lanes];
        for (int lane = 0; lane < point_lanes; ++lane)
          root[lane] = std::sqrt(table.weights[group].value[lane]);
        const auto row = static_cast<Eigen::Index>(point_lanes) * (group - first);
        for (int slot = table.start[group]; slot < table.start[group + 1]; ++slot) {
          const LaneValues* const g = table.gradients.data() + 3 * static_cast<std::size_t>(slot);
          const auto add_to = [&](Eigen::Index column) {
            for (int c = 0; c < 3; ++c) {
              double* const to = &weighed(row, 3 * column + c);
              for (int lane = 0; lane < point_lanes; ++lane)
                to[lane] += root[lane] * g[c].value[lane];
            }
          };
          const int function = table.nodes[slot];
          add_to(place[body_.node_of(function)]);
          if (function < base_)
            continue;
          add_to(spheres + place[function]);
          if (const int host = body_.cut_functions()->host_of(function - base_); host >= base_)
            add_to(spheres + place[host]);
        }
      }
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
void BorderedOperator::append_blocks(const UniformTangent& uniform, MatrixX& coupling, MatrixX& corner,
                                     Terms& terms) const {
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
  std::vector<int> gone;
  std::set<int> come;
  for (int block = 0; block < whole.size(); ++block)
    if (is_changed(block)) {
      gone.push_back(block);
      come.insert(parts[block].begin(), parts[block].end());
    }
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
  const auto first = std::ssize(terms.sign);
  const auto count = first + std::ssize(gone) + std::ssize(come);
  terms.columns.base.conservativeResizeLike(MatrixX::Zero(3 * base_, count));
  terms.columns.cut.conservativeResizeLike(MatrixX::Zero(3 * appended_, count));
  Eigen::Index column = first;
  for (const int block : gone) {
    add_swelling(groups[block], root(whole.volume[block]), column++, terms.columns);
    terms.sign.push_back(-1);
    terms.key.push_back(block);
  }
  for (const int part : come) {
    add_swelling(groups_of_part[part], root(parted.volume[part]), column++, terms.columns);
    terms.sign.push_back(1);
    terms.key.push_back(*wholes[part].begin());
  }
}

// Where a cut changes the mean of a held share, the penalty of the whole share goes, and that of each part comes.
void BorderedOperator::append_held(double penalty, Terms& terms) const {
  const HeldMeans& held = body_.held();
  const auto share_of = [](const Prescribed& entry) { return std::pair(entry.node, entry.components); };
  std::map<std::pair<int, std::array<bool, 3>>, std::vector<int>> parts_of;
  for (int e = 0; e < std::ssize(held.entries()); ++e)
    parts_of[share_of(held.entries()[e])].push_back(e);
  for (int share = 0; share < uncut_->held(); ++share) {
    const DisplacementMean& whole = uncut_->held(share);
    const std::vector<int>& parts = parts_of.at(share_of(uncut_->entry(share)));
    if (parts.size() == 1 && is_same(held.means()[parts.front()], whole))
      continue;
    const double root = std::sqrt(body_.penalty_stiffness(parts.front(), penalty));
    for (int axis = 0; axis < 3; ++axis) {
      if (!uncut_->entry(share).components[axis])
        continue;
      const auto first = std::ssize(terms.sign), count = first + 1 + std::ssize(parts);
      terms.columns.base.conservativeResizeLike(MatrixX::Zero(3 * base_, count));
      terms.columns.cut.conservativeResizeLike(MatrixX::Zero(3 * appended_, count));
      for (std::size_t k = 0; k < whole.nodes.size(); ++k) // displacements of whole spheres alone
        terms.columns.base(3 * uncut_->rank()[whole.nodes[k]] + axis, first) += root * whole.weights[k];
      terms.sign.push_back(-1);
      for (std::size_t p = 0; p < parts.size(); ++p) {
        const DisplacementMean& part = held.means()[parts[p]];
        for (std::size_t k = 0; k < part.nodes.size(); ++k)
          add(part.nodes[k], root * part.weights[k] * Vector3::Unit(axis), first + 1 + static_cast<Eigen::Index>(p),
              terms.columns);
        terms.sign.push_back(1);
      }
      terms.key.resize(terms.sign.size(), -1 - share);
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
  if (middle_back_.size() > 0) {
    MatrixX answer = MatrixX::Zero(middle_back_.rows(), cases);
    add_product(1, terms_.base, true, half.base, answer);
    add_product(1, terms_.cut, true, half.cut, answer);
    answer = (middle_back_ * answer).eval();
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
