#include "solvers/points/point_kernels.hpp"

namespace spherecut::solvers {

namespace {

/// A number of each point; narrower machines take it in parts.
using PointPack = double __attribute__((vector_size(8 * point_lanes), may_alias));

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
  PointPack x{}, y{}, z{};
  for (int lane = 0; lane < point_lanes; ++lane) {
    x[lane] = points[lane].x();
    y[lane] = points[lane].y();
    z[lane] = points[lane].z();
  }
  const auto* g = reinterpret_cast<const PointPack*>(gradients);
  const PointPack none{}, one = none + 1.0;
  PointPack moments[3][4]{};
  for (int k = 0; k < count; ++k) {
    const Vector3& at = places[nodes[k]];
    const PointPack in = ((g[3 * k] != none) | (g[3 * k + 1] != none) | (g[3 * k + 2] != none)) ? one : none;
    const PointPack px = in * scale * (at.x() - x), py = in * scale * (at.y() - y), pz = in * scale * (at.z() - z);
    const double* v = vectors + 3 * static_cast<long>(nodes[k]);
    for (int axis = 0; axis < 3; ++axis) {
      moments[axis][0] += v[axis] * in;
      moments[axis][1] += v[axis] * px;
      moments[axis][2] += v[axis] * py;
      moments[axis][3] += v[axis] * pz;
    }
  }
  const auto* m = reinterpret_cast<const PointPack*>(inverse);
  PointPack linear[3][4];
  for (int axis = 0; axis < 3; ++axis) {
    const PointPack* a = moments[axis];
    linear[axis][0] = m[0] * a[0] + m[1] * a[1] + m[2] * a[2] + m[3] * a[3];
    linear[axis][1] = m[1] * a[0] + m[4] * a[1] + m[5] * a[2] + m[6] * a[3];
    linear[axis][2] = m[2] * a[0] + m[5] * a[1] + m[7] * a[2] + m[8] * a[3];
    linear[axis][3] = m[3] * a[0] + m[6] * a[1] + m[8] * a[2] + m[9] * a[3];
  }
  auto* out = reinterpret_cast<PointPack*>(change);
  for (int k = 0; k < count; ++k) {
    const Vector3& at = places[nodes[k]];
    const PointPack in = ((g[3 * k] != none) | (g[3 * k + 1] != none) | (g[3 * k + 2] != none)) ? one : none;
    const PointPack px = scale * (at.x() - x), py = scale * (at.y() - y), pz = scale * (at.z() - z);
    const double* v = vectors + 3 * static_cast<long>(nodes[k]);
    for (int axis = 0; axis < 3; ++axis) {
      const PointPack* l = linear[axis];
      out[3 * k + axis] = in * (v[axis] - l[0] - l[1] * px - l[2] * py - l[3] * pz);
    }
  }
}

__attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4"))) void
linear_leftover(const int* nodes, int count, const LaneValues* gradients, const Vector3* places, const Vector3* points,
                double scale, const LaneValues* inverse, const LaneValues& weights, double* matrix) {
  PointPack x{}, y{}, z{};
  for (int lane = 0; lane < point_lanes; ++lane) {
    x[lane] = points[lane].x();
    y[lane] = points[lane].y();
    z[lane] = points[lane].z();
  }
  const auto* g = reinterpret_cast<const PointPack*>(gradients);
  const auto* m = reinterpret_cast<const PointPack*>(inverse);
  const PointPack w = *reinterpret_cast<const PointPack*>(&weights);
  const PointPack none{}, one = none + 1.0;
  const auto sum = [](const PointPack& pack) {
    double all = 0;
    for (int lane = 0; lane < point_lanes; ++lane)
      all += pack[lane];
    return all;
  };
  for (int k = 0; k < count; ++k) {
    const auto polynomial = [&](int of, PointPack* p) {
      const PointPack in = ((g[3 * of] != none) | (g[3 * of + 1] != none) | (g[3 * of + 2] != none)) ? one : none;
      const Vector3& at = places[nodes[of]];
      p[0] = in;
      p[1] = in * scale * (at.x() - x);
      p[2] = in * scale * (at.y() - y);
      p[3] = in * scale * (at.z() - z);
    };
    PointPack p[4], q[4];
    polynomial(k, p);
    q[0] = w * (m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3] * p[3]);
    q[1] = w * (m[1] * p[0] + m[4] * p[1] + m[5] * p[2] + m[6] * p[3]);
    q[2] = w * (m[2] * p[0] + m[5] * p[1] + m[7] * p[2] + m[8] * p[3]);
    q[3] = w * (m[3] * p[0] + m[6] * p[1] + m[8] * p[2] + m[9] * p[3]);
    const PointPack own = w * p[0] - q[0] * p[0] - q[1] * p[1] - q[2] * p[2] - q[3] * p[3];
    matrix[count * k + k] = sum(own);
    for (int l = 0; l < k; ++l) {
      PointPack other[4];
      polynomial(l, other);
      const PointPack both = q[0] * other[0] + q[1] * other[1] + q[2] * other[2] + q[3] * other[3];
      matrix[count * k + l] = matrix[count * l + k] = -sum(both);
    }
  }
}

} // namespace spherecut::solvers
