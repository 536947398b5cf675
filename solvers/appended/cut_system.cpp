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
  data.id = own.id;
  data.is_front = own.is_front;
  if (!own.is_front) {
    for (const PartId part : own.twin.hidden)
      if (ScalarTerm term; space_.term_at(function, part, term)) {
        data.gradients.insert(data.gradients.end(), term.gradient.data(), term.gradient.data() + 3);
        data.parts.push_back(part);
      }
    return;
  }
  std::vector<PartId> parts;
  std::vector<FrontTerm> terms;
  for (const int cell : space_.cells_of(own)) {
    space_.terms_in(function, cell, parts, terms);
    data.parts.insert(data.parts.end(), parts.begin(), parts.end());
    for (const FrontTerm& term : terms)
      for (const Matrix3& gradient : term.gradient)
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j)
            data.gradients.push_back(gradient(i, j));
  }
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
  for (Eigen::Index k = kept; k < count; ++k)
    evaluate(static_cast<int>(k), data_.emplace_back());
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

/// Products over the parts of one cell, as many together as there are lanes.
struct CutSystem::CellProducts {
  static constexpr int lanes = BoxShapes::lanes;
  std::vector<PartId> parts;
  std::vector<int> twins, groups, new_twins, new_groups; // functions here, ascending
  std::vector<std::size_t> next;                         // entry of every twin, then of every group
  MatrixX gradient;                                      // row: base function or twin; column 3 l + axis
  MatrixX flat;                                          // the same of one axis
  MatrixX pull;                                          // w g of new twins: row l, column 3 t + axis
  MatrixX of_groups, stress; // row 3 t + m: gradients, column 9 l + 3 i + j; row 3 l + j: w sigma_ij of new ones
  MatrixX stress_columns;    // row 9 l + 3 i + j, column 3 t + m
  MatrixX with_groups, group_pairs, group_twin;
  std::array<MatrixX, 3> with_twins; // by axis of the gradient
};

void CutSystem::add_elastic(int first_new) {
  const SmallBoxes& boxes = uncut_.boxes();
  std::map<int, std::vector<int>> fresh;     // new functions by cell
  std::vector<int> taken(uncut_.size(), -1); // by the function that couples with it, the last to do so
  for (int k = first_new; k < functions(); ++k) {
    FunctionData& own = data_[k];
    int last = -1;
    for (const PartId part : own.parts) {
      const int cell = boxes.cell_of(box_of(part));
      if (cell == last)
        continue;
      last = cell;
      fresh[cell].push_back(k);
      for (const int node : boxes.cells()[cell].nodes)
        if (taken[node] != k) {
          taken[node] = k;
          own.nodes.push_back(node);
        }
    }
    std::sort(own.nodes.begin(), own.nodes.end());
    own.blocks.assign(own.nodes.size(), Matrix3::Zero());
  }
  CellProducts work;
  for (const auto& [cell, functions] : fresh)
    add_cell(cell, functions, work);
}

// Products of the new functions with everything in a cell. With g the gradient of a base function or twin, and of a new
// function the stress w sigma_m of its modes or w g of a twin,
//
//   base or twin with group:  block(c, m) = sum of (w sigma_m g)_c,
//   base or twin with twin:   products G = sum of g (w g')^T, then lambda G + mu G^T + mu tr G,
//   group with group:         sum of grad_m : w sigma_n.
void CutSystem::add_cell(int cell_index, std::span<const int> fresh, CellProducts& work) {
  constexpr int lanes = CellProducts::lanes;
  const SmallBoxes& boxes = uncut_.boxes();
  const BoxShapes& cell = boxes.cells()[cell_index];
  const Material& material = uncut_.problem().material;
  const double lambda = material.lame_lambda(), mu = material.shear_modulus();
  auto& parts = work.parts;
  auto &twins = work.twins, &groups = work.groups, &new_twins = work.new_twins, &new_groups = work.new_groups;
  auto& next = work.next;
  MatrixX &gradient = work.gradient, &flat = work.flat, &pull = work.pull, &of_groups = work.of_groups,
          &stress = work.stress, &stress_columns = work.stress_columns, &with_groups = work.with_groups,
          &group_pairs = work.group_pairs, &group_twin = work.group_twin;
  auto& with_twins = work.with_twins;
  for (auto* list : {&parts, &twins, &groups, &new_twins, &new_groups})
    list->clear();
  for (int box = cell.first_box; box < cell.first_box + cell.boxes; ++box)
    for (int k = 0; k < space_.cut().part_count(box); ++k)
      parts.push_back(part_id(box, k));
  for (const int k : in_cell_[cell_index])
    (data_[k].is_front ? groups : twins).push_back(k);
  for (const int k : fresh)
    (data_[k].is_front ? new_groups : new_twins).push_back(k);
  const auto base = std::ssize(cell.nodes), twin_count = std::ssize(twins), group_count = std::ssize(groups),
             fresh_twins = std::ssize(new_twins), fresh_groups = std::ssize(new_groups), rows = base + twin_count;
  with_groups.setZero(rows, 9 * fresh_groups);
  group_pairs.setZero(3 * group_count, 3 * fresh_groups);
  group_twin.setZero(fresh_twins, 9 * group_count);
  if (fresh_twins > 0)
    for (MatrixX& products : with_twins)
      products.setZero(rows, 3 * fresh_twins);
  next.clear();
  for (const auto* list : {&twins, &groups})
    for (const int k : *list)
      next.push_back(static_cast<std::size_t>(
          std::lower_bound(data_[k].parts.begin(), data_[k].parts.end(), parts.front()) - data_[k].parts.begin()));
  // Most cells have neither twins nor divided boxes: the gradients are then those of the cell as they lie there.
  const bool is_plain = twin_count == 0 && std::ssize(parts) == cell.boxes;
  for (std::size_t first = 0; first < parts.size(); first += lanes) {
    const int count = static_cast<int>(std::min<std::size_t>(lanes, parts.size() - first));
    std::array<double, lanes> weight{};
    for (int l = 0; l < count; ++l)
      weight[l] = space_.cut().part(parts[first + l]).share * boxes.boxes()[box_of(parts[first + l])].volume;
    const auto for_entries = [&](int k, std::size_t& at, auto&& visit) {
      const FunctionData& of = data_[k];
      for (int l = 0; l < count && at < of.parts.size(); ++l)
        if (of.parts[at] == parts[first + l])
          visit(l, of.gradients.data() + of.stride() * at++);
    };
    if (!is_plain) {
      gradient.setZero(rows, 3 * lanes);
      for (int l = 0; l < count; ++l)
        for (int a = 0; a < 3; ++a)
          std::copy_n(cell.gradients.data() + (3 * boxes.lane_of(box_of(parts[first + l])) + a) * base, base,
                      gradient.data() + (3 * l + a) * rows);
      for (Eigen::Index t = 0; t < twin_count; ++t)
        for_entries(twins[t], next[t], [&](int l, const double* g) {
          for (int a = 0; a < 3; ++a)
            gradient(base + t, 3 * l + a) = g[a];
        });
    }
    if (fresh_twins > 0) {
      pull.resize(lanes, 3 * fresh_twins);
      for (Eigen::Index t = 0; t < fresh_twins; ++t) {
        const auto row = base + (std::lower_bound(twins.begin(), twins.end(), new_twins[t]) - twins.begin());
        for (int l = 0; l < lanes; ++l)
          for (int a = 0; a < 3; ++a)
            pull(l, 3 * t + a) = weight[l] * gradient(row, 3 * l + a);
      }
      flat.resize(rows, lanes);
      for (int a = 0; a < 3; ++a) {
        for (int l = 0; l < lanes; ++l)
          flat.col(l) = gradient.col(3 * l + a);
        add_product(1, flat, false, pull, with_twins[a]);
      }
    }
    if (group_count == 0)
      continue;
    of_groups.setZero(3 * group_count, 9 * lanes);
    stress.setZero(3 * lanes, 9 * fresh_groups);
    stress_columns.setZero(9 * lanes, 3 * fresh_groups);
    for (Eigen::Index t = 0; t < group_count; ++t) {
      const auto at = std::lower_bound(new_groups.begin(), new_groups.end(), groups[t]);
      const Eigen::Index own = at != new_groups.end() && *at == groups[t] ? at - new_groups.begin() : -1;
      for_entries(groups[t], next[twin_count + t], [&](int l, const double* g) {
        for (int m = 0; m < 3; ++m, g += 9) {
          for (int e = 0; e < 9; ++e)
            of_groups(3 * t + m, 9 * l + e) = g[e];
          if (own < 0)
            continue;
          const double dilatation = lambda * (g[0] + g[4] + g[8]);
          for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) {
              const double sigma = weight[l] * (mu * (g[3 * i + j] + g[3 * j + i]) + (i == j ? dilatation : 0));
              stress(3 * l + j, 9 * own + 3 * m + i) = sigma; // columns 3 m + c: component c of mode m
              stress_columns(9 * l + 3 * i + j, 3 * own + m) = sigma;
            }
        }
      });
    }
    if (is_plain)
      add_product(static_cast<int>(rows), static_cast<int>(9 * fresh_groups), 3 * cell.boxes, cell.gradients.data(),
                  static_cast<int>(base), stress.data(), 3 * lanes, with_groups.data(), static_cast<int>(rows));
    else
      add_product(1, gradient, false, stress, with_groups);
    add_product(1, of_groups, false, stress_columns, group_pairs);
    // Kept groups with new twins: the twins' w g against the stress of the groups.
    for (Eigen::Index t = 0; t < group_count && fresh_twins > 0; ++t)
      for (int l = 0; l < count; ++l)
        for (int m = 0; m < 3; ++m) {
          const auto at = [&](int i, int j) { return of_groups(3 * t + m, 9 * l + 3 * i + j); };
          const double dilatation = lambda * (at(0, 0) + at(1, 1) + at(2, 2));
          for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) {
              const double sigma = mu * (at(i, j) + at(j, i)) + (i == j ? dilatation : 0);
              for (Eigen::Index n = 0; n < fresh_twins; ++n)
                group_twin(n, 9 * t + 3 * m + i) += sigma * pull(l, 3 * n + j);
            }
        }
  }
  distribute(cell_index, work);
}

// The sums of a cell go to where they belong.
void CutSystem::distribute(int cell_index, const CellProducts& work) {
  const BoxShapes& cell = uncut_.boxes().cells()[cell_index];
  const Material& material = uncut_.problem().material;
  const double lambda = material.lame_lambda(), mu = material.shear_modulus();
  const auto base = std::ssize(cell.nodes);
  const auto twin_block = [&](Eigen::Index row, Eigen::Index twin) {
    Matrix3 products;
    for (int a = 0; a < 3; ++a)
      products.row(a) = work.with_twins[a].block<1, 3>(row, 3 * twin);
    Matrix3 block = lambda * products + mu * products.transpose();
    block.diagonal().array() += mu * products.trace();
    return block;
  };
  const auto add_pair = [&](int other, int k, const Matrix3& block) {
    elastic_.block<3, 3>(3 * static_cast<Eigen::Index>(other), 3 * static_cast<Eigen::Index>(k)) += block;
    if (other != k)
      elastic_.block<3, 3>(3 * static_cast<Eigen::Index>(k), 3 * static_cast<Eigen::Index>(other)) += block.transpose();
  };
  for (Eigen::Index t = 0; t < std::ssize(work.new_groups); ++t) {
    const int k = work.new_groups[t];
    FunctionData& own = data_[k];
    const auto block_of = [&](Eigen::Index row) {
      Matrix3 block;
      for (int m = 0; m < 3; ++m)
        for (int c = 0; c < 3; ++c)
          block(c, m) = work.with_groups(row, 9 * t + 3 * m + c);
      return block;
    };
    std::size_t place = 0; // both lists ascend
    for (Eigen::Index n = 0; n < base; ++n) {
      while (own.nodes[place] != cell.nodes[n])
        ++place;
      own.blocks[place] += block_of(n);
    }
    for (Eigen::Index other = 0; other < std::ssize(work.twins); ++other)
      if (work.twins[other] < k)
        add_pair(work.twins[other], k, block_of(base + other));
    // Of a pair of new functions the later one counts; those that were there come first.
    for (Eigen::Index other = 0; other < std::ssize(work.groups); ++other)
      if (work.groups[other] <= k)
        add_pair(work.groups[other], k, work.group_pairs.block<3, 3>(3 * other, 3 * t));
  }
  for (Eigen::Index t = 0; t < std::ssize(work.new_twins); ++t) {
    const int k = work.new_twins[t];
    FunctionData& own = data_[k];
    std::size_t place = 0;
    for (Eigen::Index n = 0; n < base; ++n) {
      while (own.nodes[place] != cell.nodes[n])
        ++place;
      own.blocks[place] += twin_block(n, t);
    }
    for (Eigen::Index other = 0; other < std::ssize(work.twins); ++other)
      if (work.twins[other] <= k)
        add_pair(work.twins[other], k, twin_block(base + other, t));
    for (Eigen::Index other = 0; other < std::ssize(work.groups); ++other)
      if (work.groups[other] < k) {
        Matrix3 block; // rows: modes of the group
        for (int m = 0; m < 3; ++m)
          for (int c = 0; c < 3; ++c)
            block(m, c) = work.group_twin(t, 9 * other + 3 * m + c);
        add_pair(work.groups[other], k, block);
      }
  }
}

void CutSystem::add_held(int first_new, const CutSpace::Change& change) {
  const Problem& problem = uncut_.problem();
  held_.resize(uncut_.held().size());
  std::vector<char> carries(uncut_.size(), 0), news(uncut_.size(), 0); // some function; one that is new or has gone
  const auto mark = [](const std::vector<int>& nodes, std::vector<char>& at) {
    for (const int node : nodes)
      at[node] = 1;
  };
  std::vector<int> place_now(carriers_.size(), -1); // of functions before
  for (std::size_t k = 0; k < change.kept.size(); ++k)
    place_now[change.kept[k]] = static_cast<int>(k);
  for (std::size_t k = 0; k < carriers_.size(); ++k)
    if (place_now[k] < 0)
      mark(carriers_[k], news);
  carriers_.clear();
  for (int k = 0; k < functions(); ++k) {
    const CutFunction& function = space_.functions()[k];
    carriers_.push_back(function.is_front ? function.group.nodes : std::vector<int>{function.twin.node});
    mark(carriers_.back(), carries);
    if (k >= first_new)
      mark(carriers_.back(), news);
  }
  held_touched_.resize(held_.size(), 0);
  for (std::size_t p = 0; p < held_.size(); ++p) {
    const DisplacementMean& mean = uncut_.held()[p];
    const char touched =
        std::any_of(mean.nodes.begin(), mean.nodes.end(), [&](int node) { return carries[node] != 0; });
    const bool is_news = touched != held_touched_[p] ||
                         std::any_of(mean.nodes.begin(), mean.nodes.end(), [&](int node) { return news[node] != 0; });
    held_touched_[p] = touched;
    CutFunctional& held = held_[p];
    if (touched != 0 && !is_news) { // the same functions under new numbers
      for (auto& [function, matrix] : held.cut)
        function = place_now[function];
      continue;
    }
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
      const Vector3 x = function.is_front ? function.group.station.point : uncut_.nodes().positions[function.twin.node];
      throw NumericalError(
          fmt::format("what the cut appends is not positive definite (unknown {} of {}, about ({:.4g}, "
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
  parted_half_ = uncut_.factor().forward_sparse(base);
  add_transposed_product(-1, half_.data(), static_cast<int>(half_.rows()), parted_half_, cut);
  triangular_solve(false, lower_.data(), static_cast<int>(lower_.rows()), cut);
  parted_schur_ = cut;
  left += gram(parted_half_) + gram(parted_schur_);
  if (factor_lower(left) >= 0)
    throw NumericalError(
        fmt::format("the parted shares of the held surface contradict one another ({} of them)", parted_.size()));
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
  add_transposed_product(-1, half_.data(), static_cast<int>(half_.rows()), half.base, half.cut);
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
