#include "solvers/appended/cut_system.hpp"

#include "solvers/dense_products.hpp"
#include "solvers/galerkin.hpp"
#include "topology/errors.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

extern "C" {
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
}

namespace spherecut::solvers {

namespace {

Matrix3 stress_of(const Material& material, const Matrix3& gradient) {
  Matrix3 stress = material.shear_modulus() * (gradient + gradient.transpose());
  stress.diagonal().array() += material.lame_lambda() * gradient.trace();
  return stress;
}

/// lambda a b^T + mu b a^T + mu (a . b) 1.
Matrix3 pair_block(const Material& material, const Vector3& a, const Vector3& b) {
  const double mu = material.shear_modulus();
  Matrix3 block = material.lame_lambda() * a * b.transpose() + mu * b * a.transpose();
  block.diagonal().array() += mu * a.dot(b);
  return block;
}

Matrix3 held_components(const Prescribed& entry) {
  Vector3 held;
  for (int c = 0; c < 3; ++c)
    held[c] = entry.components[c] ? 1 : 0;
  return held.asDiagonal();
}

/// The lower Cholesky factor of a symmetric matrix in its lower triangle; zeros above. Returns the first column that is
/// not positive, or -1.
int factor_lower(MatrixX& matrix) {
  const int n = static_cast<int>(matrix.rows());
  if (n == 0)
    return -1;
  int info = 0;
  dpotrf_("L", &n, matrix.data(), &n, &info);
  matrix.triangularView<Eigen::StrictlyUpper>().setZero();
  return info > 0 ? info - 1 : -1;
}

} // namespace

// ---- functions and functionals

void CutSystem::evaluate(int function, FunctionData& data) const {
  const CutFunction& own = space_.functions()[function];
  const SmallBoxes& boxes = uncut_.boxes();
  for (const int box : space_.boxes_of(own))
    for (int k = 0; k < space_.cut().part_count(box); ++k) {
      const PartId part = part_id(box, k);
      if (own.is_front) {
        FrontTerm term;
        if (!space_.term_at(function, part, term))
          continue;
        data.front.push_back(term.gradient);
      } else {
        ScalarTerm term;
        if (!space_.term_at(function, part, term))
          continue;
        data.scalar.push_back(term.gradient);
      }
      data.parts.push_back(part);
      data.weights.push_back(space_.cut().part(part).share * boxes.boxes()[box].volume);
    }
}

Matrix3 CutSystem::elastic_block(const FunctionData& a, std::size_t at_a, const FunctionData& b,
                                 std::size_t at_b) const {
  const Material& material = uncut_.problem().material;
  Matrix3 block;
  if (!a.is_front() && !b.is_front())
    return pair_block(material, a.scalar[at_a], b.scalar[at_b]);
  if (!b.is_front())
    return elastic_block(b, at_b, a, at_a).transpose();
  for (int n = 0; n < 3; ++n) {
    const Matrix3 stress = stress_of(material, b.front[at_b][n]);
    if (!a.is_front())
      block.col(n) = stress * a.scalar[at_a];
    else
      for (int m = 0; m < 3; ++m)
        block(m, n) = stress.cwiseProduct(a.front[at_a][m]).sum();
  }
  return block;
}

CutFunctional CutSystem::mean_over(const std::vector<QuadraturePoint>& points) const {
  std::map<int, double> base;
  std::map<int, Matrix3> cut;
  ShapeFunctions shape;
  CutTerms terms;
  for (const QuadraturePoint& point : points) {
    if (!solvers::evaluate(uncut_.spheres(), point.position, shape))
      throw NumericalError(fmt::format("no sound support covers the point ({:.6g}, {:.6g}, {:.6g}) m",
                                       point.position.x(), point.position.y(), point.position.z()));
    for (int k = 0; k < shape.size(); ++k)
      base[shape.nodes[k]] += point.weight * shape.value[k];
    if (space_.functions().empty())
      continue;
    space_.terms_at(point.position, space_.cut().part_at(point.position, *space_.incision()), shape, terms);
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
  MatrixX half(3 * uncut_.size(), 3 * count), elastic = MatrixX::Zero(3 * count, 3 * count), penalty = elastic,
                                              schur = elastic;
  for (Eigen::Index k = 0; k < kept; ++k) {
    const Eigen::Index from = change.kept[k];
    data.push_back(std::move(data_[from]));
    half.middleCols<3>(3 * k) = half_.middleCols<3>(3 * from);
    for (Eigen::Index l = 0; l < kept; ++l) {
      const Eigen::Index other = change.kept[l];
      elastic.block<3, 3>(3 * l, 3 * k) = elastic_.block<3, 3>(3 * other, 3 * from);
      penalty.block<3, 3>(3 * l, 3 * k) = penalty_.block<3, 3>(3 * other, 3 * from);
      schur.block<3, 3>(3 * l, 3 * k) = schur_.block<3, 3>(3 * other, 3 * from);
    }
  }
  data_ = std::move(data);
  half_ = std::move(half);
  elastic_ = std::move(elastic);
  penalty_ = std::move(penalty);
  schur_ = std::move(schur);
  const int first_new = static_cast<int>(kept);
  for (Eigen::Index k = kept; k < count; ++k)
    evaluate(static_cast<int>(k), data_.emplace_back());
  at_part_.clear();
  for (int k = 0; k < count; ++k)
    for (int entry = 0; entry < std::ssize(data_[k].parts); ++entry)
      at_part_[data_[k].parts[entry]].emplace_back(k, entry);
  add_elastic(first_new);
  add_held(first_new);

  // W of the new columns.
  const Eigen::Index fresh = 3 * (count - kept);
  if (fresh > 0) {
    MatrixX columns = MatrixX::Zero(3 * uncut_.size(), fresh);
    for (Eigen::Index k = kept; k < count; ++k) {
      const FunctionData& own = data_[k];
      for (std::size_t n = 0; n < own.nodes.size(); ++n)
        columns.block<3, 3>(3 * static_cast<Eigen::Index>(uncut_.rank()[own.nodes[n]]), 3 * (k - kept)) += own.blocks[n];
      for (const auto& [node, block] : own.penalty)
        columns.block<3, 3>(3 * static_cast<Eigen::Index>(uncut_.rank()[node]), 3 * (k - kept)) += block;
    }
    half_.rightCols(fresh) = uncut_.factor().forward(columns);
    MatrixX corner = elastic_.rightCols(fresh) + penalty_.rightCols(fresh);
    const MatrixX newest = half_.rightCols(fresh);
    add_product(-1, half_, true, newest, corner);
    schur_.rightCols(fresh) = corner;
    schur_.bottomLeftCorner(fresh, 3 * kept) = corner.topRows(3 * kept).transpose();
  }
  const bool sprung = springs_.cols() > 0;
  add_springs(loose);
  factor(sprung || springs_.cols() > 0 ? 0 : std::min<Eigen::Index>(unchanged, kept));
  part_held_shares();
  solve_multipliers();
}

void CutSystem::add_elastic(int first_new) {
  const SmallBoxes& boxes = uncut_.boxes();
  const Material& material = uncut_.problem().material;
  for (int k = first_new; k < functions(); ++k) {
    FunctionData& own = data_[k];
    // Cells it lives in, and their nodes.
    std::vector<int> cells;
    for (const PartId part : own.parts)
      if (const int cell = boxes.cell_of(box_of(part)); cells.empty() || cells.back() != cell)
        cells.push_back(cell);
    std::sort(cells.begin(), cells.end());
    cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
    for (const int cell : cells)
      own.nodes.insert(own.nodes.end(), boxes.cells()[cell].nodes.begin(), boxes.cells()[cell].nodes.end());
    std::sort(own.nodes.begin(), own.nodes.end());
    own.nodes.erase(std::unique(own.nodes.begin(), own.nodes.end()), own.nodes.end());
    own.blocks.assign(own.nodes.size(), Matrix3::Zero());
    // Gradients of the base are constant over a box: what the parts ask of them adds up first.
    std::size_t entry = 0;
    while (entry < own.parts.size()) {
      const int cell_index = boxes.cell_of(box_of(own.parts[entry]));
      const BoxShapes& cell = boxes.cells()[cell_index];
      std::array<Vector3, BoxShapes::lanes> pull;
      std::array<std::array<Matrix3, 3>, BoxShapes::lanes> stress;
      pull.fill(Vector3::Zero());
      if (own.is_front())
        for (auto& of_lane : stress)
          of_lane.fill(Matrix3::Zero());
      for (; entry < own.parts.size() && boxes.cell_of(box_of(own.parts[entry])) == cell_index; ++entry) {
        const int lane = boxes.lane_of(box_of(own.parts[entry]));
        if (own.is_front())
          for (int m = 0; m < 3; ++m)
            stress[lane][m] += own.weights[entry] * stress_of(material, own.front[entry][m]);
        else
          pull[lane] += own.weights[entry] * own.scalar[entry];
      }
      auto place = own.nodes.begin();
      for (std::size_t n = 0; n < cell.nodes.size(); ++n) {
        place = std::lower_bound(place, own.nodes.end(), cell.nodes[n]);
        Matrix3& block = own.blocks[place - own.nodes.begin()];
        if (own.is_front()) {
          for (int lane = 0; lane < cell.boxes; ++lane) {
            const Vector3 gradient = cell.gradient_at(n, lane);
            for (int m = 0; m < 3; ++m)
              block.col(m) += stress[lane][m] * gradient;
          }
        } else {
          Matrix3 products = Matrix3::Zero();
          for (int lane = 0; lane < cell.boxes; ++lane)
            products += cell.gradient_at(n, lane) * pull[lane].transpose();
          block += material.lame_lambda() * products + material.shear_modulus() * products.transpose();
          block.diagonal().array() += material.shear_modulus() * products.trace();
        }
      }
    }
    // Among the appended functions.
    for (std::size_t at = 0; at < own.parts.size(); ++at)
      for (const auto& [other, there] : at_part_.at(own.parts[at])) {
        if (other > k)
          continue;
        const Matrix3 block = own.weights[at] * elastic_block(data_[other], there, own, at);
        elastic_.block<3, 3>(3 * static_cast<Eigen::Index>(other), 3 * static_cast<Eigen::Index>(k)) += block;
        if (other != k)
          elastic_.block<3, 3>(3 * static_cast<Eigen::Index>(k), 3 * static_cast<Eigen::Index>(other)) +=
              block.transpose();
      }
  }
}

void CutSystem::add_held(int first_new) {
  const Problem& problem = uncut_.problem();
  held_.resize(uncut_.held().size());
  std::vector<char> carries(uncut_.size(), 0); // some function
  for (const CutFunction& function : space_.functions())
    if (function.is_front)
      for (const int node : function.group.nodes)
        carries[node] = 1;
    else
      carries[function.twin.node] = 1;
  held_touched_.assign(held_.size(), 0);
  for (std::size_t p = 0; p < held_.size(); ++p) {
    const DisplacementMean& mean = uncut_.held()[p];
    held_touched_[p] = std::any_of(mean.nodes.begin(), mean.nodes.end(), [&](int node) { return carries[node] != 0; });
    CutFunctional& held = held_[p];
    if (held_touched_[p] == 0) {
      held.cut.clear();
      if (held.base.empty())
        for (std::size_t k = 0; k < mean.nodes.size(); ++k)
          held.base.emplace_back(mean.nodes[k], mean.weights[k]);
      continue;
    }
    held = mean_over(mean.share);
    const Prescribed& entry = problem.prescribed[p];
    const double stiffness = constraint_stiffness(problem, entry.node);
    const Matrix3 components = held_components(entry);
    for (const auto& [function, matrix] : held.cut) {
      if (function < first_new)
        continue;
      const Matrix3 pulled = stiffness * components * matrix;
      for (const auto& [node, weight] : held.base)
        data_[function].penalty.emplace_back(node, weight * pulled);
      for (const auto& [other, there] : held.cut) {
        if (other > function)
          continue;
        const Matrix3 block = there.transpose() * pulled;
        penalty_.block<3, 3>(3 * static_cast<Eigen::Index>(other), 3 * static_cast<Eigen::Index>(function)) += block;
        if (other != function)
          penalty_.block<3, 3>(3 * static_cast<Eigen::Index>(function), 3 * static_cast<Eigen::Index>(other)) +=
              block.transpose();
      }
    }
  }
}

// Shares of the held surface whose points the cut hides from one another.
void CutSystem::part_held_shares() {
  parted_.clear();
  const topology::Incision* incision = space_.incision();
  if (incision == nullptr)
    return;
  for (std::size_t p = 0; p < held_.size(); ++p) {
    if (held_touched_[p] == 0)
      continue;
    std::vector<std::vector<QuadraturePoint>> groups;
    std::vector<double> weights;
    for (const QuadraturePoint& point : uncut_.held()[p].share) {
      std::size_t g = 0;
      while (g < groups.size() && incision->blocks(groups[g].front().position, point.position))
        ++g;
      if (g == groups.size()) {
        groups.emplace_back();
        weights.push_back(0);
      }
      groups[g].push_back(point);
      weights[g] += point.weight;
    }
    double behind = 0;
    for (std::size_t g = groups.size(); g-- > 0;) {
      const double whole = weights[g];
      if (g + 1 < groups.size()) {
        PartedShare parted;
        parted.entry = static_cast<int>(p);
        const Prescribed& entry = uncut_.problem().prescribed[p];
        parted.stiffness = constraint_stiffness(uncut_.problem(), entry.node) * whole * behind / (whole + behind);
        for (QuadraturePoint point : groups[g]) {
          point.weight /= whole;
          parted.first.push_back(point);
        }
        for (std::size_t later = g + 1; later < groups.size(); ++later)
          for (QuadraturePoint point : groups[later]) {
            point.weight /= behind;
            parted.second.push_back(point);
          }
        std::vector<QuadraturePoint> both = parted.first;
        for (QuadraturePoint point : parted.second) {
          point.weight = -point.weight;
          both.push_back(point);
        }
        parted.difference = mean_over(both);
        const Matrix3 components = held_components(entry);
        for (auto& [function, matrix] : parted.difference.cut)
          matrix = components * matrix;
        parted_.push_back(std::move(parted));
      }
      behind += whole;
    }
  }
}

// Rigid motions of a loose piece, as its twins carry them, made orthonormal.
void CutSystem::add_springs(const std::vector<std::vector<int>>& loose) {
  springs_ = MatrixX::Zero(schur_.rows(), 6 * std::ssize(loose));
  for (Eigen::Index p = 0; p < std::ssize(loose); ++p) {
    Vector3 centre = Vector3::Zero();
    double spacing = 0;
    for (const int k : loose[p]) {
      centre += uncut_.nodes().positions[space_.functions()[k].twin.node] / static_cast<double>(loose[p].size());
      spacing = std::max(spacing, uncut_.nodes().spacings[space_.functions()[k].twin.node]);
    }
    MatrixX rigid = MatrixX::Zero(schur_.rows(), 6);
    for (const int k : loose[p]) {
      const Vector3 x = (uncut_.nodes().positions[space_.functions()[k].twin.node] - centre) / spacing;
      rigid.block<3, 3>(3 * static_cast<Eigen::Index>(k), 0).setIdentity();
      rigid.block<3, 3>(3 * static_cast<Eigen::Index>(k), 3) << 0, x.z(), -x.y(), -x.z(), 0, x.x(), x.y(), -x.x(), 0;
    }
    const double stiffness = uncut_.problem().material.young_modulus * spacing;
    const MatrixX basis = Eigen::HouseholderQR<MatrixX>(rigid).householderQ() * MatrixX::Identity(rigid.rows(), 6);
    springs_.middleCols(6 * p, 6) = std::sqrt(stiffness) * basis;
  }
}

void CutSystem::factor(Eigen::Index unchanged) {
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
    if (const int column = factor_lower(corner); column >= 0) {
      const CutFunction& function = space_.functions()[unchanged + column / 3];
      const Vector3 x = function.is_front ? function.group.station.point
                                          : uncut_.nodes().positions[function.twin.node];
      throw NumericalError(fmt::format("what the cut appends is not positive definite (unknown {} of {}, about ({:.4g}, "
                                       "{:.4g}, {:.4g}) m): a severed piece is not held, or a function repeats another",
                                       first + column, count, x.x(), x.y(), x.z()));
    }
    lower.bottomRightCorner(rest, rest) = corner;
  }
  lower_ = std::move(lower);
}

void CutSystem::solve_multipliers() {
  const Eigen::Index count = 3 * std::ssize(parted_);
  parted_half_.resize(3 * uncut_.size(), count);
  parted_schur_.resize(schur_.rows(), count);
  parted_lower_.resize(count, count);
  if (count == 0)
    return;
  MatrixX base = MatrixX::Zero(3 * uncut_.size(), count), cut = MatrixX::Zero(schur_.rows(), count),
          left = MatrixX::Zero(count, count);
  for (Eigen::Index a = 0; a < std::ssize(parted_); ++a) {
    const PartedShare& parted = parted_[a];
    const Matrix3 components = held_components(uncut_.problem().prescribed[parted.entry]);
    for (const auto& [node, weight] : parted.difference.base)
      base.block<3, 3>(3 * static_cast<Eigen::Index>(uncut_.rank()[node]), 3 * a) += weight * components;
    for (const auto& [function, matrix] : parted.difference.cut)
      cut.block<3, 3>(3 * static_cast<Eigen::Index>(function), 3 * a) += matrix.transpose();
    left.diagonal().segment<3>(3 * a).setConstant(1 / parted.stiffness);
  }
  parted_half_ = uncut_.factor().forward(base);
  add_product(-1, half_, true, parted_half_, cut);
  triangular_solve(false, lower_.data(), static_cast<int>(lower_.rows()), cut);
  parted_schur_ = cut;
  left += gram(parted_half_) + gram(parted_schur_);
  if (factor_lower(left) >= 0)
    throw NumericalError(fmt::format("the parted shares of the held surface contradict one another ({} of them)",
                                     parted_.size()));
  parted_lower_ = std::move(left);
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
  add_product(-1, half_, true, half.base, half.cut);
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
  add_product(-1, half_, false, half.cut, half.base);
  uncut_.factor().backward(0, half.base);
  half.base = uncut_.unordered(half.base);
  return half;
}

CutVectors CutSystem::half_solutions(const CutVectors& loads) const {
  CutVectors half{uncut_.factor().forward(uncut_.ordered(loads.base)), loads.cut, loads.multipliers};
  add_product(-1, half_, true, half.base, half.cut);
  triangular_solve(false, lower_.data(), static_cast<int>(lower_.rows()), half.cut);
  if (!parted_.empty()) {
    add_product(-1, parted_half_, true, half.base, half.multipliers);
    add_product(-1, parted_schur_, true, half.cut, half.multipliers);
    triangular_solve(false, parted_lower_.data(), static_cast<int>(parted_lower_.rows()), half.multipliers);
  }
  return half;
}

MatrixX CutSystem::compliance(const CutVectors& a, const CutVectors& b) {
  MatrixX result = MatrixX::Zero(a.base.cols(), b.base.cols());
  add_product(1, a.base, true, b.base, result);
  add_product(1, a.cut, true, b.cut, result);
  if (a.multipliers.rows() > 0)
    add_product(-1, a.multipliers, true, b.multipliers, result);
  return result;
}

VectorX CutSystem::parted_values(const std::function<Vector3(const Vector3&)>& field) const {
  VectorX values = VectorX::Zero(3 * std::ssize(parted_));
  for (Eigen::Index k = 0; k < std::ssize(parted_); ++k) {
    Vector3 value = Vector3::Zero();
    for (const QuadraturePoint& point : parted_[k].first)
      value += point.weight * field(point.position);
    for (const QuadraturePoint& point : parted_[k].second)
      value -= point.weight * field(point.position);
    values.segment<3>(3 * k) = held_components(uncut_.problem().prescribed[parted_[k].entry]) * value;
  }
  return values;
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

void CutSystem::subtract_holding(const VectorX& base, const VectorX& cut, const VectorX& prescribed,
                                 const std::function<Vector3(const Vector3&)>& field, CutVectors& rows) const {
  const Problem& problem = uncut_.problem();
  for (std::size_t p = 0; p < held_.size(); ++p) {
    const Prescribed& entry = problem.prescribed[p];
    const Vector3 gap = prescribed.segment<3>(3 * static_cast<Eigen::Index>(p)) - value(held_[p], base, cut);
    add_force(held_[p], -constraint_stiffness(problem, entry.node) * (held_components(entry) * gap), 0, rows);
  }
  rows.cut.col(0) += springs_ * (springs_.transpose() * cut);
  const VectorX parted = field ? parted_values(field) : VectorX::Zero(3 * std::ssize(parted_));
  for (Eigen::Index k = 0; k < std::ssize(parted_); ++k) {
    const Matrix3 components = held_components(problem.prescribed[parted_[k].entry]);
    const Vector3 gap = parted.segment<3>(3 * k) - components * value(parted_[k].difference, base, cut);
    add_force(parted_[k].difference, -parted_[k].stiffness * gap, 0, rows);
  }
}

} // namespace spherecut::solvers
