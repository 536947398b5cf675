#include "solvers/collocation/balance_rows.hpp"

#include "solvers/collocation/face_operators.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <array>
#include <fmt/format.h>
#include <numeric>
#include <span>

namespace spherecut::solvers {

namespace {

constexpr double pair_reach = 0.01; // nodes nearer than this, in spacings, are partners of a lip pair

using Block = Eigen::Matrix4d;

/// Axes along which a fixed region that leaves others free holds the body's surface of a cell whose node it does not
/// hold: between the nodes of a coarse set such cells reach the surface too, and what holds them there pulls at them.
std::array<bool, 3> held_beside(const Problem& problem, const topology::BoundaryFace& face,
                                const std::array<bool, 3>& of_node) {
  const Vector3 normal = face.area.normalized();
  std::array<bool, 3> held{};
  for (std::size_t a = 0; a < 3; ++a) {
    std::array<bool, 3> axis{};
    axis[a] = true;
    held[a] = problem.prescribed_region.holds(face.centroid, normal, axis);
  }
  if (held[0] && held[1] && held[2])
    return {};
  for (std::size_t a = 0; a < 3; ++a)
    held[a] = held[a] && !of_node[a];
  return held;
}

/// What the rows of a body are made of, cell by cell.
class RowAssembly {
 public:
  RowAssembly(const Problem& problem, const topology::CellComplex& cells, const Spheres& spheres,
              const NodalSupports& supports, bool mixed)
      : problem_(problem), cells_(cells), spheres_(spheres), supports_(supports), mixed_(mixed),
        x_(problem.nodes.positions), mu_(problem.material.shear_modulus()),
        lambda_(mixed ? 0 : problem.material.lame_lambda()),
        operators_(face_operators(cells, problem, spheres, supports)) {
    list_faces();
  }

  void assemble(std::vector<BalanceRow>& rows) {
    const int count = problem_.nodes.size();
    rows.assign(count, {});
    place_.assign(count, -1);
    std::size_t expected = 0; // nodes of a row
    for (int i = 0; i < count; ++i) {
      row_ = &rows[i];
      row_->nodes.reserve(expected);
      row_->blocks.reserve(expected);
      const std::span<const Side> sides(all_sides_.data() + first_side_[i], all_sides_.data() + first_side_[i + 1]);
      if (sides.empty())
        throw InputError(fmt::format("node {} at ({:.6g}, {:.6g}, {:.6g}) m has no cell: it lies outside the body", i,
                                     x_[i].x(), x_[i].y(), x_[i].z()));
      block(i);
      for (const Side& side : sides)
        add_side(i, side);
      if (problem_.prescribed_region)
        add_held_faces(i);
      if (mixed_)
        add_volume_balance(i);
      for (const int node : row_->nodes)
        place_[node] = -1;
      expected = row_->nodes.size() + row_->nodes.size() / 4;
    }
  }

 private:
  struct Side {
    int other;
    double sign; // of the stored area
    int face;
  };

  /// The block of node j in the row at hand.
  Block& block(int j) {
    if (place_[j] < 0) {
      place_[j] = static_cast<int>(row_->nodes.size());
      row_->nodes.push_back(j);
      row_->blocks.emplace_back(Block::Zero());
    }
    return row_->blocks[place_[j]];
  }

  void list_faces();
  void add_side(int i, const Side& side);
  void add_held_faces(int i);
  void add_volume_balance(int i);

  const Problem& problem_;
  const topology::CellComplex& cells_;
  const Spheres& spheres_;
  const NodalSupports& supports_;
  const bool mixed_;
  const std::vector<Vector3>& x_;
  const double mu_, lambda_; // Pa; lambda is 0 where the pressure is an unknown
  const FaceOperators operators_;
  std::vector<int> first_side_;
  std::vector<Side> all_sides_;
  std::vector<std::vector<int>> lips_, boundary_; // faces of every node
  std::vector<std::array<bool, 3>> held_;         // axes of every node
  ShapeFunctions shape_;
  BalanceRow* row_ = nullptr; // at hand
  std::vector<int> place_;    // of nodes in it, -1: not there
};

void RowAssembly::list_faces() {
  const auto count = static_cast<std::size_t>(problem_.nodes.size());
  first_side_.assign(count + 1, 0);
  for (const topology::CellFace& face : cells_.faces) {
    ++first_side_[face.first + 1];
    ++first_side_[face.second + 1];
  }
  std::partial_sum(first_side_.begin(), first_side_.end(), first_side_.begin());
  all_sides_.resize(2 * cells_.faces.size());
  std::vector<int> next_side(first_side_.begin(), first_side_.end() - 1);
  for (int f = 0; f < std::ssize(cells_.faces); ++f) {
    all_sides_[next_side[cells_.faces[f].first]++] = {cells_.faces[f].second, 1, f};
    all_sides_[next_side[cells_.faces[f].second]++] = {cells_.faces[f].first, -1, f};
  }
  lips_.resize(count);
  for (int l = 0; mixed_ && l < std::ssize(cells_.lips); ++l)
    lips_[cells_.lips[l].node].push_back(l);
  boundary_.resize(count);
  for (int b = 0; b < std::ssize(cells_.boundary); ++b)
    boundary_[cells_.boundary[b].node].push_back(b);
  held_.assign(count, {false, false, false});
  for (const Prescribed& entry : problem_.prescribed)
    for (std::size_t c = 0; c < 3; ++c)
      held_[entry.node][c] |= entry.components[c];
}

/// The flux through the face to a neighbour, and what damps the difference of the two.
void RowAssembly::add_side(int i, const Side& side) {
  const topology::CellFace& face = cells_.faces[side.face];
  const Vector3 area = side.sign * face.area;
  const Vector3 d = x_[side.other] - x_[i];
  const bool at_front = operators_.at_front[side.face] != 0;
  // Partners of a lip pair ahead of the front are too near for a difference of theirs to mean anything.
  const bool pair = d.norm() < pair_reach * problem_.nodes.spacings[i];
  const double gamma = pair ? 0 : at_front ? problem_.tuning.damping_at_front : problem_.tuning.damping;
  const double w = gamma * mu_ * area.dot(d) / d.squaredNorm();
  block(side.other).topLeftCorner<3, 3>().diagonal().array() -= w;
  block(i).topLeftCorner<3, 3>().diagonal().array() += w;
  if (at_front)
    for (const int node : {i, side.other})
      for (int k = supports_.start[node]; k < supports_.start[node + 1]; ++k)
        block(supports_.nodes[k]).topLeftCorner<3, 3>().diagonal().array() += (node == i ? -w : w) * supports_.value[k];
  // Minus sigma(g X) A as a matrix on X, -(lambda A g^T + mu (g.A) I + mu g A^T), and the damping's w (g.d) I. By
  // columns, x and y in one register: half of the time went into waiting for a matrix stored piece by piece.
  const Vector3 lambda_area = -lambda_ * area, mu_area = -mu_ * area;
  const Vector3 on_diagonal = at_front ? mu_area : Vector3(mu_area + w * d);
  const Eigen::Vector2d lambda_area_xy = lambda_area.head<2>();
  for (int k = operators_.start[side.face]; k < operators_.start[side.face + 1]; ++k) {
    Block& target = block(operators_.nodes[k]);
    const Vector3& g = operators_.gradient[k];
    const Eigen::Vector2d g_xy = g.head<2>();
    for (int c = 0; c < 3; ++c) {
      target.col(c).head<2>() += lambda_area_xy * g[c] + g_xy * mu_area[c];
      target(2, c) += lambda_area.z() * g[c] + g.z() * mu_area[c];
    }
    target.diagonal().head<3>().array() += g.dot(on_diagonal);
    if (mixed_)
      target.block<1, 3>(3, 0) += operators_.value[k] * area.transpose();
  }
  if (!mixed_)
    return;
  const double smoothing = problem_.tuning.pressure_smoothing * area.norm() * d.norm() / mu_;
  Block& other = block(side.other);
  other.block<3, 1>(0, 3) += 0.5 * area; // -(-p A)
  other(3, 3) -= smoothing;
  Block& own = block(i);
  own.block<3, 1>(0, 3) += 0.5 * area;
  own(3, 3) += smoothing;
}

void RowAssembly::add_held_faces(int i) {
  for (const int b : boundary_[i]) {
    const topology::BoundaryFace& face = cells_.boundary[b];
    const std::array<bool, 3> axes = held_beside(problem_, face, held_[i]);
    if (!(axes[0] || axes[1] || axes[2]) || !evaluate(spheres_, face.centroid, shape_))
      continue;
    for (int k = 0; k < shape_.size(); ++k) {
      const Vector3 g = shape_.gradient(k);
      const Matrix3 pull = lambda_ * face.area * g.transpose() + mu_ * g.dot(face.area) * Matrix3::Identity() +
                           mu_ * g * face.area.transpose();
      for (int a = 0; a < 3; ++a)
        if (axes[a])
          block(shape_.nodes[k]).block<1, 3>(a, 0) -= pull.row(a);
    }
    for (int a = 0; mixed_ && a < 3; ++a)
      if (axes[a])
        block(i)(a, 3) += face.area[a];
  }
}

/// Outflow through all faces against the pressure's compression of the cell.
void RowAssembly::add_volume_balance(int i) {
  block(i)(3, 3) += cells_.volumes[i] / problem_.material.lame_lambda();
  // Of a lip the centroid lies on the sheet: the cell's own expansion stays on its side.
  const auto add_outflow_of_node = [&](const Vector3& at, const Vector3& area) {
    for (int k = supports_.start[i]; k < supports_.start[i + 1]; ++k)
      block(supports_.nodes[k]).block<1, 3>(3, 0) +=
          (supports_.value[k] + supports_.gradient[k].dot(at - x_[i])) * area.transpose();
  };
  for (int l : lips_[i])
    add_outflow_of_node(cells_.lips[l].centroid, cells_.lips[l].area);
  for (int b : boundary_[i]) {
    const topology::BoundaryFace& face = cells_.boundary[b];
    if (problem_.hiding() && problem_.hiding()->blocks(x_[i], face.centroid)) {
      add_outflow_of_node(face.centroid, face.area);
      continue;
    }
    if (!evaluate(spheres_, face.centroid, shape_))
      throw NumericalError(fmt::format("the surface of the cell of node {} has {} supporting nodes: the nodes leave a "
                                       "hole there",
                                       i, shape_.size()));
    for (int k = 0; k < shape_.size(); ++k)
      block(shape_.nodes[k]).block<1, 3>(3, 0) += shape_.value[k] * face.area.transpose();
  }
}

} // namespace

void assemble_rows(const Problem& problem, const topology::CellComplex& cells, const Spheres& spheres,
                   const NodalSupports& supports, bool mixed, std::vector<BalanceRow>& rows) {
  RowAssembly(problem, cells, spheres, supports, mixed).assemble(rows);
}

} // namespace spherecut::solvers
