// Key: row_i . alpha = sign_i (l_i + F_i / m_i) for node i with load l_i (traction t on the surface, body force b
// inside), nodal force F_i and measure m_i (area or volume); sign_i is +1 on the surface and -1 inside. Rows are scaled
// by h / mu (surface) and h^2 / mu (inside) before they are factored: all entries are then of the order of those of
// u_h(x_i) = g.
#include "solvers/published/published.hpp"

#include "solvers/algebra/factorisation.hpp"
#include "solvers/body/elastic_body.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

constexpr int largest_dense = 200; // nodes; beyond that sparse factors are faster
constexpr double singular_condition = 1e15;
constexpr double worst_solve = 1e-8; // relative residual of a linear solve

class DenseFactorisation final : public Factorisation {
 public:
  explicit DenseFactorisation(const SparseMatrix& matrix) : factor_(MatrixX(matrix)) {}
  [[nodiscard]] MatrixX solve(const MatrixX& right_hand_sides) const override {
    return factor_.solve(right_hand_sides);
  }
  [[nodiscard]] MatrixX solve_transposed(const MatrixX& right_hand_sides) const override {
    return factor_.transpose().solve(right_hand_sides);
  }
  [[nodiscard]] long nonzeros() const override { return static_cast<long>(factor_.matrixLU().size()); }

 private:
  Eigen::PartialPivLU<MatrixX> factor_;
};

double support_radius(const DiscretisationOptions& options) {
  return options.support_radius > 0 ? options.support_radius : published_support_radius;
}

class Published final : public ElasticBody {
 public:
  Published(Problem problem, const DiscretisationOptions& options)
      : ElasticBody(std::move(problem), Method::published, support_radius(options), SightRule::visibility),
        tip_(options.tip_node) {
    find_held_components();
    const Stopwatch assembly;
    evaluate_rows();
    assemble();
    report_.unknowns = 3 * problem_.nodes.size();
    report_.matrix_nonzeros = matrix_.nonZeros();
    report_.assembly_seconds = assembly.seconds();
    const Stopwatch factor;
    if (report_.nodes <= largest_dense)
      factorisation_ = std::make_unique<DenseFactorisation>(matrix_);
    else
      factorisation_ = factor_general(matrix_);
    report_.factor_nonzeros = factorisation_->nonzeros();
    report_.factor_seconds = factor.seconds();
    report_.condition_estimate = condition_estimate(*factorisation_, one_norm(matrix_), report_.unknowns);
    if (!(report_.condition_estimate < singular_condition))
      throw NumericalError(fmt::format("published collocation: the system of {} nodes is singular (condition estimate "
                                       "{:.1e}); prescribe enough displacements to hold the body",
                                       report_.nodes, report_.condition_estimate));
  }

  [[nodiscard]] Method method() const override { return Method::published; }

  [[nodiscard]] Field solve() const override {
    return solution(right_hand_side(1, prescribed_values(problem_)), 1, prescribed_values(problem_));
  }

  [[nodiscard]] std::vector<Field> force_responses(const std::vector<int>& candidates) const override {
    require_nodes(candidates);
    const VectorX none = VectorX::Zero(3 * std::ssize(problem_.prescribed));
    std::vector<Field> responses;
    responses.reserve(3 * candidates.size());
    for (int node : candidates)
      for (int axis = 0; axis < 3; ++axis)
        responses.push_back(solution(right_hand_side(0, none, {node}, {Vector3::Unit(axis)}), 0, none));
    return responses;
  }

  [[nodiscard]] Field prescribed_response(const std::vector<Vector3>& values) const override {
    const VectorX prescribed = prescribed_values(problem_, values);
    return solution(right_hand_side(0, prescribed), 0, prescribed);
  }

  [[nodiscard]] std::vector<Vector3> constraint_forces(const Field& field) const override {
    require_own(field);
    std::vector<Vector3> forces;
    forces.reserve(problem_.prescribed.size());
    for (const Prescribed& entry : problem_.prescribed)
      forces.push_back(held_part(entry, unbalanced(entry.node, field)));
    return forces;
  }

  [[nodiscard]] double residual(const Field& field, const std::vector<int>& loaded_nodes,
                                const std::vector<Vector3>& nodal_forces) const override {
    require_loads(loaded_nodes, nodal_forces);
    require_own(field);
    double largest = 0;
    std::vector<Vector3> rest(report_.nodes);
    for (int i = 0; i < report_.nodes; ++i) {
      rest[i] = unbalanced(i, field);
      largest = std::max(largest, (field.load_factor * measure_[i] * load_[i]).cwiseAbs().maxCoeff());
    }
    for (std::size_t k = 0; k < loaded_nodes.size(); ++k) {
      rest[loaded_nodes[k]] -= nodal_forces[k];
      largest = std::max(largest, nodal_forces[k].cwiseAbs().maxCoeff());
    }
    double worst = 0;
    for (int i = 0; i < report_.nodes; ++i)
      for (int a = 0; a < 3; ++a) {
        double& kind = entry_of_[i][a] < 0 ? worst : largest;
        kind = std::max(kind, std::abs(rest[i][a]));
      }
    return largest > 0 ? worst / largest : worst;
  }

  [[nodiscard]] PublishedTip tip() const {
    if (tip_ < 0)
      throw InputError("published collocation: no tip node was given");
    PublishedTip condensed;
    condensed.node = tip_;
    condensed.measure = measure_[tip_];
    const int entry = entry_of_[tip_][0];
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<Vector3> values(problem_.prescribed.size(), Vector3::Zero());
      values[entry] = Vector3::Unit(axis);
      condensed.stiffness.col(axis) = unbalanced(tip_, prescribed_response(values));
    }
    condensed.row_stiffness = condensed.stiffness / condensed.measure;
    return condensed;
  }

 private:
  void find_held_components();
  void evaluate_rows();
  void assemble();
  [[nodiscard]] VectorX right_hand_side(double load_factor, const VectorX& prescribed,
                                        const std::vector<int>& loaded_nodes = {},
                                        const std::vector<Vector3>& nodal_forces = {}) const;
  [[nodiscard]] Field solution(const VectorX& right, double load_factor, const VectorX& prescribed) const;
  [[nodiscard]] double sign(int node) const { return problem_.nodes.kinds[node] == NodeKind::interior ? -1 : 1; }

  // Force on the node that the field's loads leave open, N: what a constraint or a nodal force must supply.
  [[nodiscard]] Vector3 unbalanced(int node, const Field& field) const {
    Vector3 row = Vector3::Zero();
    for (int k = supports_.start[node]; k < supports_.start[node + 1]; ++k)
      row += blocks_[k] * field.coefficients.segment<3>(3 * supports_.nodes[k]);
    return measure_[node] * (sign(node) * row - field.load_factor * load_[node]);
  }

  int tip_;
  std::vector<std::array<int, 3>> entry_of_; // entry of problem().prescribed that holds a component, or -1
  std::vector<Matrix3> blocks_;              // unscaled rows of every node, aligned with supports_.nodes
  std::vector<Vector3> load_;                // traction, Pa, or body force, N/m3
  std::vector<double> measure_, scale_;
  SparseMatrix matrix_;
  std::unique_ptr<Factorisation> factorisation_;
};

void Published::find_held_components() {
  entry_of_.assign(report_.nodes, {-1, -1, -1});
  bool others = false;
  for (int e = 0; e < std::ssize(problem_.prescribed); ++e) {
    const Prescribed& entry = problem_.prescribed[e];
    for (int a = 0; a < 3; ++a) {
      if (!entry.components[a])
        continue;
      if (entry_of_[entry.node][a] >= 0)
        throw InputError(
            fmt::format("published collocation: component {} of node {} is prescribed twice", a, entry.node));
      entry_of_[entry.node][a] = e;
      others = others || entry.node != tip_;
    }
  }
  if (tip_ < 0)
    return;
  if (tip_ >= report_.nodes)
    throw InputError(
        fmt::format("published collocation: tip node {} does not exist; there are {}", tip_, report_.nodes));
  if (*std::min_element(entry_of_[tip_].begin(), entry_of_[tip_].end()) < 0)
    throw InputError(
        fmt::format("published collocation: all three components of tip node {} must be prescribed", tip_));
  if (!others)
    throw InputError(fmt::format("published collocation: nothing but tip node {} is held", tip_));
}

void Published::evaluate_rows() {
  const NodeCloud& nodes = problem_.nodes;
  const double mu = problem_.material.shear_modulus();
  const Matrix3 initial = initial_stress(problem_);
  blocks_.resize(supports_.nodes.size());
  load_.assign(report_.nodes, Vector3::Zero());
  measure_.resize(report_.nodes);
  scale_.resize(report_.nodes);
  ShapeFunctions shape;
  for (int i = 0; i < report_.nodes; ++i) {
    const Vector3 &x = nodes.positions[i], &normal = nodes.normals[i];
    const double h = nodes.spacings[i];
    const bool inside = nodes.kinds[i] == NodeKind::interior;
    if (!inside && !(std::abs(normal.norm() - 1) < 1e-6))
      throw InputError(fmt::format("published collocation: the normal of surface node {} has length {}; it must be 1",
                                   i, normal.norm()));
    if (!evaluate_second(spheres_, x, shape))
      throw NumericalError(fmt::format("published collocation: the support of node {} is not sound", i));
    for (int k = 0; k < shape.size(); ++k)
      blocks_[supports_.start[i] + k] =
          inside ? equilibrium_block(shape, k, problem_.material) : traction_block(shape, k, normal, problem_.material);
    measure_[i] = inside ? h * h * h : h * h;
    scale_[i] = inside ? h * h / mu : h / mu;
    if (inside && problem_.loads.body_force)
      load_[i] = problem_.loads.body_force(x);
    const auto& traction = nodes.kinds[i] == NodeKind::lip ? problem_.loads.lip_traction : problem_.loads.traction;
    if (!inside)
      load_[i] = initial * normal;
    if (!inside && traction)
      load_[i] += traction(x, normal);
  }
}

void Published::assemble() {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(9 * blocks_.size());
  for (int i = 0; i < report_.nodes; ++i)
    for (int a = 0; a < 3; ++a) {
      const int row = 3 * i + a;
      if (i == tip_) {
        entries.emplace_back(row, row, 1);
        continue;
      }
      for (int k = supports_.start[i]; k < supports_.start[i + 1]; ++k) {
        const int j = supports_.nodes[k];
        if (entry_of_[i][a] >= 0)
          entries.emplace_back(row, 3 * j + a, supports_.value[k]);
        else
          for (int b = 0; b < 3; ++b)
            entries.emplace_back(row, 3 * j + b, scale_[i] * blocks_[k](a, b));
      }
    }
  matrix_.resize(3 * report_.nodes, 3 * report_.nodes);
  matrix_.setFromTriplets(entries.begin(), entries.end());
}

VectorX Published::right_hand_side(double load_factor, const VectorX& prescribed, const std::vector<int>& loaded_nodes,
                                   const std::vector<Vector3>& nodal_forces) const {
  VectorX right(report_.unknowns);
  for (int i = 0; i < report_.nodes; ++i)
    right.segment<3>(3 * i) = sign(i) * scale_[i] * load_factor * load_[i];
  for (std::size_t k = 0; k < loaded_nodes.size(); ++k) {
    const int i = loaded_nodes[k];
    if (i < 0 || i >= report_.nodes)
      throw InputError(fmt::format("loaded node {} does not exist; there are {}", i, report_.nodes));
    right.segment<3>(3 * i) += sign(i) * scale_[i] / measure_[i] * nodal_forces[k];
  }
  for (int i = 0; i < report_.nodes; ++i)
    for (int a = 0; a < 3; ++a)
      if (entry_of_[i][a] >= 0)
        right[3 * i + a] = prescribed[3 * entry_of_[i][a] + a];
  return right;
}

Field Published::solution(const VectorX& right, double load_factor, const VectorX& prescribed) const {
  Field field{factorisation_->solve(right), {}, load_factor, prescribed};
  require_finite(field, report_);
  const double error = (matrix_ * field.coefficients - right).lpNorm<Eigen::Infinity>();
  const double size = right.lpNorm<Eigen::Infinity>();
  if (error > worst_solve * size)
    throw NumericalError(fmt::format("published collocation: the solve left a relative residual of {:.1e} (condition "
                                     "estimate {:.1e})",
                                     error / size, report_.condition_estimate));
  return field;
}

const Published& published(const Discretisation& body) {
  const auto* found = dynamic_cast<const Published*>(&body);
  if (found == nullptr)
    throw InputError(
        fmt::format("the condensed tool tip belongs to the published method, not to '{}'", to_string(body.method())));
  return *found;
}

} // namespace

Matrix3 equilibrium_block(const ShapeFunctions& shape, int k, const Material& material) {
  const double mu = material.shear_modulus(), lambda = material.lame_lambda();
  Matrix3 hessian;
  hessian << shape.dxx[k], shape.dxy[k], shape.dxz[k], //
      shape.dxy[k], shape.dyy[k], shape.dyz[k],        //
      shape.dxz[k], shape.dyz[k], shape.dzz[k];
  return mu * hessian.trace() * Matrix3::Identity() + (lambda + mu) * hessian;
}

Matrix3 traction_block(const ShapeFunctions& shape, int k, const Vector3& normal, const Material& material) {
  const double mu = material.shear_modulus(), lambda = material.lame_lambda();
  const Vector3 g = shape.gradient(k);
  return mu * g.dot(normal) * Matrix3::Identity() + lambda * normal * g.transpose() + mu * g * normal.transpose();
}

std::unique_ptr<Discretisation> make_published(Problem problem, const DiscretisationOptions& options) {
  return std::make_unique<Published>(std::move(problem), options);
}

PublishedTip tip_stiffness(const Discretisation& body) {
  return published(body).tip();
}

Vector3 published_tip_force(const Discretisation& body, const Vector3& displacement) {
  return tip_stiffness(body).stiffness * displacement;
}

} // namespace spherecut::solvers
