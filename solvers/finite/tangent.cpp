#include "solvers/finite/tangent.hpp"

#include "solvers/algebra/dense_products.hpp"
#include "solvers/algebra/elimination_order.hpp"
#include "solvers/algebra/parallel.hpp"
#include "solvers/elasticity/function_law.hpp"
#include "solvers/points/weighed_gradients.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <limits>
#include <numeric>

namespace spherecut::solvers {

namespace {

constexpr int groups_at_once = 32; // local matrices that are made before they are added, in their order

/// Positions in an ascending list of ranks, with the order that sorts it.
std::vector<int> sorted_by_rank(std::span<const int> nodes, const std::vector<int>& rank) {
  std::vector<int> order(nodes.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return rank[nodes[a]] < rank[nodes[b]]; });
  return order;
}

} // namespace

FiniteTangent::FiniteTangent(const FiniteBody& body) : body_(body) {
  block_groups_.resize(body_.blocks().size());
  if (body_.blocks().size() > 0)
    for (int group = 0; group < body_.points().groups(); ++group)
      block_groups_[body_.blocks().block[group]].push_back(group);
  find_pattern();
}

// By the other rules sums keep their order, and with it their last bits: a flap of the coarsest nodes that can bear it
// tears on or not by these.
bool FiniteTangent::sums_by_cell() const {
  return body_.cut_functions() != nullptr;
}

void FiniteTangent::find_pattern() {
  const PointTable& table = body_.points();
  const int count = body_.functions();
  std::vector<std::vector<int>> neighbours(count);
  const auto tidy = [](std::vector<int>& list) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  };
  const auto couple = [&](const std::vector<int>& nodes) {
    for (const int i : nodes) {
      neighbours[i].insert(neighbours[i].end(), nodes.begin(), nodes.end());
      if (neighbours[i].size() > 4096)
        tidy(neighbours[i]);
    }
  };
  std::vector<int> nodes;
  if (block_groups_.empty())
    for (int group = 0, end = 0; group < table.groups(); group = end) {
      end = sums_by_cell() ? table.end_of_cell(group) : group + 1;
      nodes.assign(table.nodes.begin() + table.start[group], table.nodes.begin() + table.start[end]);
      tidy(nodes);
      couple(nodes);
    }
  for (const std::vector<int>& groups : block_groups_) {
    nodes.clear();
    for (const int group : groups)
      nodes.insert(nodes.end(), table.nodes_of(group).begin(), table.nodes_of(group).end());
    tidy(nodes);
    couple(nodes);
  }
  for (const DisplacementMean& mean : body_.held().means())
    couple(mean.nodes);
  std::vector<int> start(count + 1, 0), flat;
  for (int i = 0; i < count; ++i) {
    neighbours[i].push_back(i);
    tidy(neighbours[i]);
    flat.insert(flat.end(), neighbours[i].begin(), neighbours[i].end());
    start[i + 1] = static_cast<int>(flat.size());
  }
  const std::vector<int> order = fill_reducing_ordering(start, flat);
  rank_.resize(count);
  for (int k = 0; k < count; ++k)
    rank_[order[k]] = k;
  column_start_.assign(1, 0);
  for (int k = 0; k < count; ++k) {
    std::vector<int> column;
    for (const int i : neighbours[order[k]])
      if (rank_[i] >= k)
        column.push_back(rank_[i]);
    std::sort(column.begin(), column.end());
    rows_.insert(rows_.end(), column.begin(), column.end());
    if (rows_.size() > std::numeric_limits<int>::max() / 9)
      throw InputError(fmt::format("{} nodes couple to more entries than the factorisation can index", count));
    column_start_.push_back(static_cast<int>(rows_.size()));
  }
}

/// Calls visit(i, j, place of the pair in rows_) for every pair i >= j of a list of ascending ranks.
template <class Visit>
void FiniteTangent::for_each_pair(const std::vector<int>& ranks, Visit&& visit) const {
  for (int j = 0; j < std::ssize(ranks); ++j) {
    int entry = column_start_[ranks[j]];
    for (int i = j; i < std::ssize(ranks); ++i) {
      while (rows_[entry] != ranks[i])
        ++entry;
      visit(i, j, entry);
    }
  }
}

void FiniteTangent::scatter(const std::vector<int>& ranks, const MatrixX& matrix, SparseMatrix& lower) const {
  double* const values = lower.valuePtr();
  const int* const starts = lower.outerIndexPtr();
  for_each_pair(ranks, [&](int i, int j, int entry) {
    const int place = entry - column_start_[ranks[j]];
    for (int b = 0; b < 3; ++b)
      for (int a = 0; a < 3; ++a)
        values[starts[3 * ranks[j] + b] + 3 * place + a] += matrix(3 * i + a, 3 * j + b);
  });
}

void FiniteTangent::point_tangents(const FiniteBody& body, int group, const LaneValues* deformation,
                                   double block_jacobian, LaneValues* tangent, LaneValues* cofactor) {
  const Law& law = body.law();
  const bool blocks = body.blocks().size() > 0, minds = body.minds_volume();
  const double own = body.pointwise_share();
  const double shared_pressure = blocks ? (1 - own) * law.pressure(block_jacobian) : 0;
  const FibreFrame frame = law.own_fibres();
  for (int lane = 0; lane < body.points().count[group]; ++lane) {
    Matrix3 f;
    for (int k = 0; k < 9; ++k)
      f.data()[k] = deformation[k].value[lane];
    const double weight = body.points().weights[group].value[lane];
    Matrix9 d;
    try {
      d = law.tangent_isochoric(f, body.fibres_.empty() ? frame : body.fibres_[body.point_start_[group] + lane]);
    } catch (const LawValueError& error) {
      throw_with_place(error, body.points().positions[static_cast<std::size_t>(point_lanes) * group + lane]);
    }
    if (body.prony_ != nullptr)
      body.prony_->apply(static_cast<std::size_t>(body.point_start_[group]) + static_cast<std::size_t>(lane), d);
    if (minds) {
      Matrix3 c;
      c.col(0) = f.col(1).cross(f.col(2));
      c.col(1) = f.col(2).cross(f.col(0));
      c.col(2) = f.col(0).cross(f.col(1));
      const double j = f.col(0).dot(c.col(0));
      const Eigen::Map<const Eigen::Matrix<double, 9, 1>> flat(c.data());
      d += own * law.bulk_slope(j) * flat * flat.transpose();
      // d cof F_(., m) / d F_(., n) is the cross product with the third column: c_m = f_n x f_o, m n o cyclic.
      const double p = own * law.pressure(j) + shared_pressure;
      for (int m = 0; m < 3; ++m) {
        const int n = (m + 1) % 3, o = (m + 2) % 3;
        const auto cross = [](const Vector3& v) {
          Matrix3 matrix;
          matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
          return matrix;
        };
        d.block<3, 3>(3 * m, 3 * n) -= p * cross(f.col(o)); // df_n x f_o = -f_o x df_n
        d.block<3, 3>(3 * m, 3 * o) += p * cross(f.col(n));
      }
      for (int k = 0; k < 9; ++k)
        cofactor[k].value[lane] = weight * c.data()[k];
    }
    for (int k = 0; k < 81; ++k)
      tangent[k].value[lane] = weight * d.data()[k];
  }
}

void FiniteTangent::assemble(const std::vector<LaneValues>& deformation, const std::vector<double>& jacobian,
                             double penalty, SparseMatrix& lower) const {
  lay_pattern(lower);
  const bool blocks = body_.blocks().size() > 0;
  std::vector<VectorX> swelling(blocks ? body_.points().groups() : 0);
  std::optional<UniformTangent> uniform;
  if (sums_by_cell())
    uniform = uniform_tangent_of(body_, deformation, jacobian);
  if (uniform)
    add_uniform(*uniform, swelling, lower);
  else
    add_groups(deformation, jacobian, swelling, lower);
  if (blocks)
    add_blocks(jacobian, swelling, lower);
  if (penalty > 0) {
    add_penalties(penalty, lower);
    if (body_.cut_functions() != nullptr)
      add_support(lower);
  }
}

void FiniteTangent::lay_pattern(SparseMatrix& lower) const {
  const int count = body_.functions();
  lower.resize(3 * count, 3 * count);
  lower.resizeNonZeros(9 * static_cast<Eigen::Index>(rows_.size()));
  int* const starts = lower.outerIndexPtr();
  for (int column = 0, at = 0; column < count; ++column)
    for (int b = 0; b < 3; ++b) {
      starts[3 * column + b] = at;
      for (int k = column_start_[column]; k < column_start_[column + 1]; ++k)
        for (int a = 0; a < 3; ++a)
          lower.innerIndexPtr()[at++] = 3 * rows_[k] + a;
    }
  starts[3 * count] = 9 * static_cast<int>(rows_.size());
  std::fill_n(lower.valuePtr(), lower.nonZeros(), 0.0);
}

// Group by group in their order, so that the sums do not depend on threads.
void FiniteTangent::add_groups(const std::vector<LaneValues>& deformation, const std::vector<double>& jacobian,
                               std::vector<VectorX>& swelling, SparseMatrix& lower) const {
  const int groups = body_.points().groups();
  const bool blocks = !swelling.empty();
  std::vector<Local> locals(groups_at_once);
  for (int first = 0; first < groups; first += groups_at_once) {
    const int here = std::min(groups_at_once, groups - first);
    parallel_ranges(here, 4, [&](int begin, int end) {
      std::vector<LaneValues> tangent(81);
      for (int k = begin; k < end; ++k) {
        const int group = first + k;
        LaneValues cofactor[9];
        std::fill(tangent.begin(), tangent.end(), LaneValues{});
        point_tangents(body_, group, deformation.data() + 9 * static_cast<std::size_t>(group),
                       blocks ? jacobian[body_.blocks().block[group]] : 1, tangent.data(), cofactor);
        if (blocks)
          swelling[group] = swelling_of(group, cofactor);
        group_matrix(group, tangent.data(), locals[k]);
      }
    });
    for (int k = 0; k < here; ++k)
      scatter(locals[k].ranks, locals[k].matrix, lower);
  }
}

VectorX FiniteTangent::swelling_of(int group, const LaneValues* cofactor) const {
  const int size = static_cast<int>(body_.points().nodes_of(group).size());
  const LaneValues* g = body_.points().gradients_of(group);
  VectorX swelling(3 * size);
  for (int i = 0; i < size; ++i)
    for (int a = 0; a < 3; ++a) {
      double sum = 0;
      for (int c = 0; c < 3; ++c)
        for (int lane = 0; lane < point_lanes; ++lane)
          sum += cofactor[a + 3 * c].value[lane] * g[3 * i + c].value[lane];
      swelling[3 * i + a] = sum;
    }
  return swelling;
}

// left: (3 lanes) x nodes, of gradients; right for a: (3 lanes) x 3 nodes, of tangent times gradients.
void FiniteTangent::group_matrix(int group, const LaneValues* tangent, Local& local) const {
  const std::span<const int> nodes = body_.points().nodes_of(group);
  const std::vector<int> order = sorted_by_rank(nodes, rank_);
  const int size = static_cast<int>(nodes.size());
  const LaneValues* g = body_.points().gradients_of(group);
  MatrixX left(3 * point_lanes, size), right(3 * point_lanes, 3 * size), product(size, 3 * size);
  local.ranks.resize(size);
  local.matrix.resize(3 * size, 3 * size);
  for (int i = 0; i < size; ++i) {
    local.ranks[i] = rank_[nodes[order[i]]];
    for (int c = 0; c < 3; ++c)
      for (int lane = 0; lane < point_lanes; ++lane)
        left(point_lanes * c + lane, i) = g[3 * order[i] + c].value[lane];
  }
  for (int a = 0; a < 3; ++a) {
    for (int j = 0; j < size; ++j)
      for (int b = 0; b < 3; ++b)
        for (int c = 0; c < 3; ++c)
          for (int lane = 0; lane < point_lanes; ++lane) {
            double sum = 0;
            for (int d = 0; d < 3; ++d)
              sum += tangent[a + 3 * c + 9 * (b + 3 * d)].value[lane] * left(point_lanes * d + lane, j);
            right(point_lanes * c + lane, 3 * j + b) = sum;
          }
    product.setZero();
    add_product(1, left, true, right, product);
    for (int i = 0; i < size; ++i)
      local.matrix.row(3 * i + a) = product.row(i);
  }
}

std::optional<UniformTangent> uniform_tangent_of(const FiniteBody& body, const std::vector<LaneValues>& deformation,
                                                 const std::vector<double>& jacobian) {
  constexpr double alike = 1e-10; // coefficients grow with the distance from the origin, and round
  const PointTable& table = body.points();
  if (!body.fibres_.empty() || body.prony_ != nullptr || table.groups() == 0)
    return std::nullopt;
  for (int group = 0; group < table.groups(); ++group)
    for (int k = 0; k < 9; ++k)
      for (int lane = 0; lane < table.count[group]; ++lane)
        if (!(std::abs(deformation[9 * static_cast<std::size_t>(group) + k].value[lane] - deformation[k].value[0]) <
              alike))
          return std::nullopt;
  for (const double block : jacobian)
    if (!(std::abs(block - jacobian.front()) < alike))
      return std::nullopt;
  const double block_jacobian = jacobian.empty() ? 1 : jacobian.front(), weight = table.weights[0].value[0];
  LaneValues tangent[81], cofactor[9];
  FiniteTangent::point_tangents(body, 0, deformation.data(), block_jacobian, tangent, cofactor);
  UniformTangent uniform;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      for (int c = 0; c < 3; ++c)
        for (int d = 0; d < 3; ++d)
          uniform.stiffness(a + 3 * b, c + 3 * d) = tangent[a + 3 * c + 9 * (b + 3 * d)].value[0] / weight;
  for (int k = 0; k < 9; ++k)
    uniform.cofactor.data()[k] = cofactor[k].value[0] / weight;
  if (body.blocks().size() > 0)
    uniform.bulk_slope = (1 - body.pointwise_share()) * body.law().bulk_slope(block_jacobian);
  return uniform;
}

// Groups of a cell have much the same nodes: their moments are one product.
void FiniteTangent::cell_moments(int first, int end, std::vector<int>& place, Local& local) const {
  const PointTable& table = body_.points();
  std::vector<int> nodes;
  for (int slot = table.start[first]; slot < table.start[end]; ++slot)
    if (place[table.nodes[slot]] < 0) {
      place[table.nodes[slot]] = 0;
      nodes.push_back(table.nodes[slot]);
    }
  std::sort(nodes.begin(), nodes.end(), [&](int i, int j) { return rank_[i] < rank_[j]; });
  local.ranks.clear();
  for (int i = 0; i < std::ssize(nodes); ++i) {
    place[nodes[i]] = i;
    local.ranks.push_back(rank_[nodes[i]]);
  }
  local.matrix = gram(
      weighed_gradients(table, first, end, std::ssize(nodes), [&](int node, const auto& add) { add(place[node]); }));
  for (const int node : nodes)
    place[node] = -1;
}

// K_ij = sum over c, d of D_acbd M_cd,ij with M_ij = sum over all points of w g_i g_j^T.
void FiniteTangent::add_uniform(const UniformTangent& uniform, std::vector<VectorX>& swelling,
                                SparseMatrix& lower) const {
  const PointTable& table = body_.points();
  for (int group = 0; group < std::ssize(swelling); ++group) {
    LaneValues cofactor[9];
    for (int c = 0; c < 9; ++c)
      for (int lane = 0; lane < point_lanes; ++lane)
        cofactor[c].value[lane] = table.weights[group].value[lane] * uniform.cofactor.data()[c];
    swelling[group] = swelling_of(group, cofactor);
  }
  std::vector<int> cells; // their first groups
  for (int group = 0; group < table.groups(); group = table.end_of_cell(group))
    cells.push_back(group);
  MatrixX moments = MatrixX::Zero(9, std::ssize(rows_));
  std::vector<Local> locals(groups_at_once);
  for (int first = 0; first < std::ssize(cells); first += groups_at_once) {
    const int here = std::min(groups_at_once, static_cast<int>(std::ssize(cells)) - first);
    parallel_ranges(here, 4, [&](int begin, int end) {
      std::vector<int> place(body_.functions(), -1);
      for (int k = begin; k < end; ++k)
        cell_moments(cells[first + k], table.end_of_cell(cells[first + k]), place, locals[k]);
    });
    for (int k = 0; k < here; ++k)
      for_each_pair(locals[k].ranks, [&](int i, int j, int entry) {
        Eigen::Map<Matrix3>(moments.col(entry).data()) += locals[k].matrix.block<3, 3>(3 * i, 3 * j);
      });
  }
  MatrixX stiffness = MatrixX::Zero(9, moments.cols());
  add_product(1, uniform.stiffness, false, moments, stiffness);
  double* const values = lower.valuePtr();
  for (int column = 0; column < body_.functions(); ++column)
    for (int b = 0; b < 3; ++b) {
      double* to = values + lower.outerIndexPtr()[3 * column + b];
      for (int entry = column_start_[column]; entry < column_start_[column + 1]; ++entry)
        for (int a = 0; a < 3; ++a)
          *to++ += stiffness(a + 3 * b, entry);
    }
}

// The pressure of a block is that of its mean volume change: one row a block.
void FiniteTangent::add_blocks(const std::vector<double>& jacobian, const std::vector<VectorX>& swelling,
                               SparseMatrix& lower) const {
  const PointTable& table = body_.points();
  std::vector<int> nodes, place(body_.functions(), -1), ranks;
  for (int b = 0; b < std::ssize(block_groups_); ++b) {
    nodes.clear();
    for (const int group : block_groups_[b])
      for (const int node : table.nodes_of(group))
        if (place[node] < 0) {
          place[node] = 0;
          nodes.push_back(node);
        }
    std::sort(nodes.begin(), nodes.end(), [&](int i, int j) { return rank_[i] < rank_[j]; });
    ranks.clear();
    for (int i = 0; i < std::ssize(nodes); ++i) {
      place[nodes[i]] = i;
      ranks.push_back(rank_[nodes[i]]);
    }
    VectorX sum = VectorX::Zero(3 * std::ssize(nodes));
    for (const int group : block_groups_[b])
      for (int k = 0; k < std::ssize(table.nodes_of(group)); ++k)
        sum.segment<3>(3 * place[table.nodes_of(group)[k]]) += swelling[group].segment<3>(3 * k);
    const double slope = (1 - body_.pointwise_share()) * body_.law().bulk_slope(jacobian[b]);
    scatter(ranks, slope / body_.blocks().volume[b] * sum * sum.transpose(), lower);
    for (const int node : nodes)
      place[node] = -1;
  }
}

// Where a cut leaves slivers of the body, more functions may reach a part than it has strains: some of their sums do
// nothing to any point, and no force moves them.
void FiniteTangent::add_support(SparseMatrix& lower) const {
  for (int f = 0; f < body_.functions(); ++f) {
    const double support = body_.support_of(f);
    for (int a = 0; a < 3; ++a) {
      const int column = 3 * rank_[f] + a; // its diagonal comes after those before it in its block
      lower.valuePtr()[lower.outerIndexPtr()[column] + a] += support;
    }
  }
}

void FiniteTangent::add_penalties(double penalty, SparseMatrix& lower) const {
  std::vector<int> ranks;
  for (int e = 0; e < std::ssize(body_.held().entries()); ++e) {
    const DisplacementMean& mean = body_.held().means()[e];
    const std::vector<int> order = sorted_by_rank(mean.nodes, rank_);
    MatrixX matrix = MatrixX::Zero(3 * std::ssize(order), 3 * std::ssize(order));
    ranks.clear();
    for (int i = 0; i < std::ssize(order); ++i) {
      ranks.push_back(rank_[mean.nodes[order[i]]]);
      for (int j = 0; j < std::ssize(order); ++j)
        for (int a = 0; a < 3; ++a)
          if (body_.held().entries()[e].components[a])
            matrix(3 * i + a, 3 * j + a) =
                body_.penalty_stiffness(e, penalty) * mean.weights[order[i]] * mean.weights[order[j]];
    }
    scatter(ranks, matrix, lower);
  }
}

} // namespace spherecut::solvers
