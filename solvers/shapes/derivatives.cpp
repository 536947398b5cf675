#include "solvers/shapes/derivatives.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

namespace spherecut::solvers {

namespace {

// Pairs (k, l) of the second derivatives in the order of ShapeFunctions: xx yy zz xy xz yz.
constexpr std::array<std::array<int, 2>, 6> pairs{{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};

// Weight with derivatives with respect to x: W,k = g d_k; W,kl = -g delta_kl + curvature d_k d_l.
struct Weight {
  double value, g, curvature;
};

Weight weigh(double squared_distance, double q) {
  const double s = std::sqrt(squared_distance * q), t = 1 - s;
  // The last term of W,kl is of the order of |d| as d goes to zero.
  return {t * t * t * (1 + 3 * s), 12 * t * t * q, s > 1e-12 ? 24 * t * q * q / s : 0};
}

constexpr int size = basis_size(Basis::quadratic);
using Vector = Eigen::Matrix<double, size, 1>;
using Matrix = Eigen::Matrix<double, size, size>;

Vector monomials(const Vector3& y) {
  Vector p;
  p << 1, y, y.x() * y.x(), y.y() * y.y(), y.z() * y.z(), y.x() * y.y(), y.x() * y.z(), y.y() * y.z();
  return p;
}

} // namespace

// A(x) c(x) = P(x) with P in the frame fixed at x. Differentiating once and twice:
//   A c_k  = P,k  - A,k c
//   A c_kl = P,kl - A,k c_l - A,l c_k - A,kl c
// and h_j = W (P_j . c) gives h_j,k and h_j,kl by the product rule.
void evaluate_quadratic(const shape_kernel::Support& support, bool second, ShapeFunctions& out) {
  const int n = support.count;
  const double scale = n > 0 ? std::sqrt(support.q[0]) : 1; // 1 / l
  const auto offset = [&](int j) { return Vector3(support.dx[j], support.dy[j], support.dz[j]); };

  Matrix a = Matrix::Zero();
  for (int j = 0; j < n; ++j) {
    const Vector3 d = offset(j);
    const Vector p = monomials(scale * d);
    a.noalias() += (weigh(d.squaredNorm(), support.q[j]).value * p) * p.transpose();
  }
  const Eigen::LLT<Matrix> factor(a);
  out.moment_condition = std::numeric_limits<double>::infinity();
  if (n < size || factor.info() != Eigen::Success)
    return;
  const Matrix b = factor.solve(Matrix::Identity());
  out.moment_condition = a.cwiseAbs().colwise().sum().maxCoeff() * b.cwiseAbs().colwise().sum().maxCoeff();

  const Vector c = b.col(0);
  std::array<Vector, 3> c1, right1;
  std::array<Vector, 6> right2;
  for (int k = 0; k < 3; ++k)
    right1[k] = scale * Vector::Unit(1 + k);
  for (int m = 0; m < 6; ++m) {
    right2[m].setZero();
    right2[m][4 + m] = (m < 3 ? 2 : 1) * scale * scale;
  }
  for (int j = 0; j < n; ++j) {
    const Vector3 d = offset(j);
    const Vector p = monomials(scale * d);
    const Vector gp = (weigh(d.squaredNorm(), support.q[j]).g * p.dot(c)) * p;
    for (int k = 0; k < 3; ++k)
      right1[k] -= d[k] * gp;
  }
  for (int k = 0; k < 3; ++k)
    c1[k].noalias() = b * right1[k];

  std::array<Vector, 6> c2;
  if (second) {
    for (int j = 0; j < n; ++j) {
      const Vector3 d = offset(j);
      const Vector p = monomials(scale * d);
      const Weight w = weigh(d.squaredNorm(), support.q[j]);
      const double pc = p.dot(c);
      const Vector3 pc1(p.dot(c1[0]), p.dot(c1[1]), p.dot(c1[2]));
      for (int m = 0; m < 6; ++m) {
        const auto [k, l] = pairs[m];
        const double w_kl = w.curvature * d[k] * d[l] - (k == l ? w.g : 0);
        right2[m] -= (w.g * (d[k] * pc1[l] + d[l] * pc1[k]) + w_kl * pc) * p;
      }
    }
    for (int m = 0; m < 6; ++m)
      c2[m].noalias() = b * right2[m];
  }

  const std::array<std::vector<double>*, 6> seconds{&out.dxx, &out.dyy, &out.dzz, &out.dxy, &out.dxz, &out.dyz};
  for (int j = 0; j < n; ++j) {
    const Vector3 d = offset(j);
    const Vector p = monomials(scale * d);
    const Weight w = weigh(d.squaredNorm(), support.q[j]);
    const double pc = p.dot(c);
    const Vector3 pc1(p.dot(c1[0]), p.dot(c1[1]), p.dot(c1[2]));
    const Vector3 gradient = w.g * pc * d + w.value * pc1;
    out.value[j] = w.value * pc;
    out.dx[j] = gradient.x();
    out.dy[j] = gradient.y();
    out.dz[j] = gradient.z();
    if (!second)
      continue;
    for (int m = 0; m < 6; ++m) {
      const auto [k, l] = pairs[m];
      const double w_kl = w.curvature * d[k] * d[l] - (k == l ? w.g : 0);
      (*seconds[m])[j] = w_kl * pc + w.g * (d[k] * pc1[l] + d[l] * pc1[k]) + w.value * p.dot(c2[m]);
    }
  }
}

} // namespace spherecut::solvers
