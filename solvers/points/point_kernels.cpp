#include "solvers/points/point_kernels.hpp"

namespace spherecut::solvers {

namespace {

/// A number of each point; narrower machines take it in parts.
using PointPack = double __attribute__((vector_size(8 * point_lanes), may_alias));

/// (1, scale (x_k - x)) at the points of a group, zero where the gradient of node k is.
class LinearBasis {
 public:
  [[gnu::always_inline]] LinearBasis(const int* nodes, const LaneValues* gradients, const Vector3* places,
                                     const Vector3* points, double scale)
      : nodes_(nodes), gradients_(reinterpret_cast<const PointPack*>(gradients)), places_(places), scale_(scale) {
    for (int lane = 0; lane < point_lanes; ++lane)
      for (int axis = 0; axis < 3; ++axis)
        points_[axis][lane] = points[lane][axis];
  }

  [[gnu::always_inline]] void at(int k, PointPack* basis) const {
    const PointPack none{}, one = none + 1.0;
    const PointPack* g = gradients_ + 3 * static_cast<long>(k);
    const PointPack reached = ((g[0] != none) | (g[1] != none) | (g[2] != none)) ? one : none;
    const Vector3& place = places_[nodes_[k]];
    basis[0] = reached;
    for (int axis = 0; axis < 3; ++axis)
      basis[1 + axis] = reached * scale_ * (place[axis] - points_[axis]);
  }

  /// `inverse` times the moments of a function.
  [[gnu::always_inline]] static void times(const LaneValues* inverse, const PointPack* moments, PointPack* product) {
    const auto* m = reinterpret_cast<const PointPack*>(inverse);
    const PointPack* a = moments;
    product[0] = m[0] * a[0] + m[1] * a[1] + m[2] * a[2] + m[3] * a[3];
    product[1] = m[1] * a[0] + m[4] * a[1] + m[5] * a[2] + m[6] * a[3];
    product[2] = m[2] * a[0] + m[5] * a[1] + m[7] * a[2] + m[8] * a[3];
    product[3] = m[3] * a[0] + m[6] * a[1] + m[8] * a[2] + m[9] * a[3];
  }

 private:
  const int* nodes_;
  const PointPack* gradients_;
  const Vector3* places_;
  double scale_;
  PointPack points_[3]{};
};

} // namespace

__attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4"))) void
deformation_gradients(const int* nodes, int count, const LaneValues* gradients, const double* coefficients,
                      LaneValues* deformation) {
  const auto* g = reinterpret_cast<const PointPack*>(gradients);
  PointPack xx{}, yx{}, zx{}, xy{}, yy{}, zy{}, xz{}, yz{}, zz{};
  for (int k = 0; k < count; ++k, g += 3) {
    const double* u = coefficients + 3 * static_cast<long>(nodes[k]);
    const PointPack gx = g[0], gy = g[1], gz = g[2];
    xx += u[0] * gx;
    yx += u[1] * gx;
    zx += u[2] * gx;
    xy += u[0] * gy;
    yy += u[1] * gy;
    zy += u[2] * gy;
    xz += u[0] * gz;
    yz += u[1] * gz;
    zz += u[2] * gz;
  }
  auto* f = reinterpret_cast<PointPack*>(deformation);
  f[0] = xx + 1.0;
  f[1] = yx;
  f[2] = zx;
  f[3] = xy;
  f[4] = yy + 1.0;
  f[5] = zy;
  f[6] = xz;
  f[7] = yz;
  f[8] = zz + 1.0;
}

__attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4"))) void
group_forces(int count, const LaneValues* gradients, const LaneValues* stress, double* forces) {
  const auto* p = reinterpret_cast<const PointPack*>(stress);
  const PointPack p0 = p[0], p1 = p[1], p2 = p[2], p3 = p[3], p4 = p[4], p5 = p[5], p6 = p[6], p7 = p[7], p8 = p[8];
  const auto* g = reinterpret_cast<const PointPack*>(gradients);
  int k = 0;
  // Eight nodes at a time: twenty-four sums over the lanes, in three steps of pairwise additions of eight vectors each.
  for (; k + point_lanes <= count; k += point_lanes, g += 3 * point_lanes) {
    PointPack t[3 * point_lanes];
    for (int n = 0; n < point_lanes; ++n) {
      const PointPack gx = g[3 * n], gy = g[3 * n + 1], gz = g[3 * n + 2];
      t[3 * n] = gx * p0 + gy * p3 + gz * p6;
      t[3 * n + 1] = gx * p1 + gy * p4 + gz * p7;
      t[3 * n + 2] = gx * p2 + gy * p5 + gz * p8;
    }
    for (int part = 0; part < 3; ++part) {
      const PointPack* v = t + point_lanes * part;
      PointPack s[4], q[2];
      for (int i = 0; i < 4; ++i)
        s[i] = __builtin_shufflevector(v[2 * i], v[2 * i + 1], 0, 8, 2, 10, 4, 12, 6, 14) +
               __builtin_shufflevector(v[2 * i], v[2 * i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
      for (int i = 0; i < 2; ++i)
        q[i] = __builtin_shufflevector(s[2 * i], s[2 * i + 1], 0, 1, 8, 9, 4, 5, 12, 13) +
               __builtin_shufflevector(s[2 * i], s[2 * i + 1], 2, 3, 10, 11, 6, 7, 14, 15);
      const PointPack sum = __builtin_shufflevector(q[0], q[1], 0, 1, 2, 3, 8, 9, 10, 11) +
                            __builtin_shufflevector(q[0], q[1], 4, 5, 6, 7, 12, 13, 14, 15);
      for (int i = 0; i < point_lanes; ++i)
        forces[3 * k + point_lanes * part + i] = sum[i];
    }
  }
  for (; k < count; ++k, g += 3) {
    const PointPack x = g[0] * p0 + g[1] * p3 + g[2] * p6;
    const PointPack y = g[0] * p1 + g[1] * p4 + g[2] * p7;
    const PointPack z = g[0] * p2 + g[1] * p5 + g[2] * p8;
    const auto sum = [](const PointPack& v) {
      return ((v[0] + v[1]) + (v[2] + v[3])) + ((v[4] + v[5]) + (v[6] + v[7]));
    };
    forces[3 * k] = sum(x);
    forces[3 * k + 1] = sum(y);
    forces[3 * k + 2] = sum(z);
  }
}

__attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4"))) void
take_linear(const int* nodes, int count, const LaneValues* gradients, const Vector3* places, const Vector3* points,
            double scale, const LaneValues* inverse, const double* vectors, LaneValues* change) {
  const LinearBasis linear(nodes, gradients, places, points, scale);
  PointPack moments[3][4]{};
  for (int k = 0; k < count; ++k) {
    PointPack p[4];
    linear.at(k, p);
    const double* v = vectors + 3 * static_cast<long>(nodes[k]);
    for (int axis = 0; axis < 3; ++axis)
      for (int j = 0; j < 4; ++j)
        moments[axis][j] += v[axis] * p[j];
  }
  PointPack fit[3][4];
  for (int axis = 0; axis < 3; ++axis)
    LinearBasis::times(inverse, moments[axis], fit[axis]);
  auto* out = reinterpret_cast<PointPack*>(change);
  for (int k = 0; k < count; ++k) {
    PointPack p[4];
    linear.at(k, p);
    const double* v = vectors + 3 * static_cast<long>(nodes[k]);
    for (int axis = 0; axis < 3; ++axis) {
      const PointPack* l = fit[axis];
      out[3 * k + axis] = p[0] * (v[axis] - l[0] - l[1] * p[1] - l[2] * p[2] - l[3] * p[3]);
    }
  }
}

__attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4"))) void
linear_leftover(const int* nodes, int count, const LaneValues* gradients, const Vector3* places, const Vector3* points,
                double scale, const LaneValues* inverse, const LaneValues& weights, double* matrix) {
  const LinearBasis linear(nodes, gradients, places, points, scale);
  const PointPack w = *reinterpret_cast<const PointPack*>(&weights);
  const auto sum = [](const PointPack& pack) {
    double all = 0;
    for (int lane = 0; lane < point_lanes; ++lane)
      all += pack[lane];
    return all;
  };
  for (int k = 0; k < count; ++k) {
    PointPack p[4], q[4];
    linear.at(k, p);
    LinearBasis::times(inverse, p, q);
    for (PointPack& entry : q)
      entry *= w;
    const PointPack own = w * p[0] - q[0] * p[0] - q[1] * p[1] - q[2] * p[2] - q[3] * p[3];
    matrix[count * k + k] = sum(own);
    for (int l = 0; l < k; ++l) {
      PointPack other[4];
      linear.at(l, other);
      const PointPack both = q[0] * other[0] + q[1] * other[1] + q[2] * other[2] + q[3] * other[3];
      matrix[count * k + l] = matrix[count * l + k] = -sum(both);
    }
  }
}

} // namespace spherecut::solvers
