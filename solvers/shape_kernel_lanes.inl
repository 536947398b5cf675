// Body of the shape kernel, written for registers of `width` doubles. The including unit defines, in its own namespace,
//   width, Pack (a GCC vector of `width` doubles), root(Pack), and collect(cell, point, support).
// Everything here has internal linkage: nothing compiled for a wide instruction set can be linked into portable code.

inline Pack load(const double* p) {
  Pack v;
  __builtin_memcpy(&v, p, sizeof v);
  return v;
}
inline void store(double* p, Pack v) {
  __builtin_memcpy(p, &v, sizeof v);
}

using Pair __attribute__((vector_size(16))) = double;

// Halves of a register are added until two lanes are left.
template <int n, class V>
Pair fold(V v) {
  if constexpr (n == 8) {
    const auto half = __builtin_shufflevector(v, v, 0, 1, 2, 3) + __builtin_shufflevector(v, v, 4, 5, 6, 7);
    return fold<4>(half);
  } else if constexpr (n == 4) {
    return __builtin_shufflevector(v, v, 0, 1) + __builtin_shufflevector(v, v, 2, 3);
  } else {
    return v;
  }
}

// Sums over the lanes of `count` (even) packs, two at a time.
inline void add_lanes(const Pack* packs, int count, double* sums) {
  for (int k = 0; k < count; k += 2) {
    const Pair a = fold<width>(packs[k]), b = fold<width>(packs[k + 1]);
    const Pair sum = __builtin_shufflevector(a, b, 0, 2) + __builtin_shufflevector(a, b, 1, 3);
    __builtin_memcpy(sums + k, &sum, sizeof sum);
  }
}

// Symmetric 4 x 4 matrix, upper triangle by rows: 00 01 02 03 11 12 13 22 23 33.
struct Symmetric4 {
  double m[10];
};

// Inverse by A = L D L^T, A^-1 = L^-T D^-1 L^-1. A singular matrix gives entries that are huge or not finite.
inline Symmetric4 inverse(const Symmetric4& a) {
  const double* m = a.m;
  const double i0 = 1 / m[0];
  const double l10 = m[1] * i0, l20 = m[2] * i0, l30 = m[3] * i0;
  const double i1 = 1 / (m[4] - l10 * m[1]);
  const double t12 = m[5] - l10 * m[2], t13 = m[6] - l10 * m[3];
  const double l21 = t12 * i1, l31 = t13 * i1;
  const double i2 = 1 / (m[7] - l20 * m[2] - l21 * t12);
  const double t23 = m[8] - l20 * m[3] - l21 * t13;
  const double l32 = t23 * i2;
  const double i3 = 1 / (m[9] - l30 * m[3] - l31 * t13 - l32 * t23);
  // Rows of L^-1 below the unit diagonal.
  const double k10 = -l10, k21 = -l21, k32 = -l32;
  const double k20 = l21 * l10 - l20, k31 = l32 * l21 - l31;
  const double k30 = -(l30 + l31 * k10 + l32 * k20);
  const double u10 = i1 * k10, u20 = i2 * k20, u30 = i3 * k30, u21 = i2 * k21, u31 = i3 * k31, u32 = i3 * k32;
  return {{i0 + k10 * u10 + k20 * u20 + k30 * u30, u10 + k20 * u21 + k30 * u31, u20 + k30 * u32, u30,
           i1 + k21 * u21 + k31 * u31, u21 + k31 * u32, u31, i2 + k32 * u32, u32, i3}};
}

inline double magnitude(double v) {
  return __builtin_fabs(v);
}
inline double larger(double a, double b) {
  return a > b || a != a ? a : b;
} // keeps a NaN in either place

inline double norm1(const Symmetric4& a) {
  const double c01 = magnitude(a.m[1]), c02 = magnitude(a.m[2]), c03 = magnitude(a.m[3]), c12 = magnitude(a.m[5]),
               c13 = magnitude(a.m[6]), c23 = magnitude(a.m[8]);
  const double first = larger(magnitude(a.m[0]) + c01 + c02 + c03, magnitude(a.m[4]) + c01 + c12 + c13);
  const double second = larger(magnitude(a.m[7]) + c02 + c12 + c23, magnitude(a.m[9]) + c03 + c13 + c23);
  return larger(first, second);
}

inline void multiply(const Symmetric4& a, const double* v, double* out) {
  const double* m = a.m;
  out[0] = m[0] * v[0] + m[1] * v[1] + m[2] * v[2] + m[3] * v[3];
  out[1] = m[1] * v[0] + m[4] * v[1] + m[5] * v[2] + m[6] * v[3];
  out[2] = m[2] * v[0] + m[5] * v[1] + m[7] * v[2] + m[8] * v[3];
  out[3] = m[3] * v[0] + m[6] * v[1] + m[8] * v[2] + m[9] * v[3];
}

// Weight W = (1 - s)^3 (1 + 3 s) with W,k = g d_k and W,kl = -g delta_kl + f d_k d_l:
//   g = 12 (1 - s)^2 q,  f = 24 (1 - s) q^2 / s.
struct Weight {
  Pack w, g, f;
};
template <bool second>
Weight weigh(Pack x, Pack y, Pack z, Pack q) {
  const Pack s = root((x * x + y * y + z * z) * q);
  const Pack t = 1 - s, t2 = t * t;
  // f d_k d_l is of the order of |d| as d goes to zero: the small number keeps 0 / 0 away and changes nothing else.
  if constexpr (second)
    return {t2 * t * (1 + 3 * s), 12 * t2 * q, 24 * t * q * q / (s + 1e-150)};
  else
    return {t2 * t * (1 + 3 * s), 12 * t2 * q, t};
}

// The local coordinates are d / l; all sums are taken in metres and scaled afterwards. In the frame fixed at x:
//   A c = P(x) = e_0                                      h_j    = W_j (P_j . c)
//   A c_k = e_k / l - A,k c                               h_j,k  = r_j d_jk + W_j (P_j . c_k),  r_j = g_j (P_j . c)
//   A c_kl = - A,kl c - A,k c_l - A,l c_k = - sum_j u_jkl P_j     h_j,kl = u_jkl + W_j (P_j . c_kl)
//   with u_jkl = W_j,kl (P_j . c) + g_j (d_jk (P_j . c_l) + d_jl (P_j . c_k)).
template <bool second>
double evaluate(const Support& support, const LinearOutput& output) {
  const int n = (support.count + width - 1) / width * width;
  if (n == 0)
    return __builtin_inf();

  Pack moment[10] = {};
  for (int k = 0; k < n; k += width) {
    const Pack x = load(support.dx + k), y = load(support.dy + k), z = load(support.dz + k), q = load(support.q + k);
    const Weight weight = weigh<second>(x, y, z, q);
    const Pack w = weight.w;
    store(output.dx + k, w); // until the results are known the outputs keep the weights
    store(output.dy + k, weight.g);
    if constexpr (second)
      store(output.second[0] + k, weight.f);
    const Pack wx = w * x, wy = w * y, wz = w * z;
    moment[0] += w;
    moment[1] += wx;
    moment[2] += wy;
    moment[3] += wz;
    moment[4] += wx * x;
    moment[5] += wx * y;
    moment[6] += wx * z;
    moment[7] += wy * y;
    moment[8] += wy * z;
    moment[9] += wz * z;
  }
  const double scale = __builtin_sqrt(support.q[0]); // 1 / l, of the first sphere of the support
  const double scale2 = scale * scale;
  Symmetric4 a;
  add_lanes(moment, 10, a.m);
  for (int i = 1; i < 4; ++i)
    a.m[i] *= scale;
  for (int i = 4; i < 10; ++i)
    a.m[i] *= scale2;
  const Symmetric4 b = inverse(a);
  const double condition = norm1(a) * norm1(b);

  // From here on coefficient vectors are those of {1, d}, so that P_j . c needs no scaling.
  const double c[4] = {b.m[0], scale * b.m[1], scale * b.m[2], scale * b.m[3]};
  Pack third[10] = {}; // the last is not used
  for (int k = 0; k < n; k += width) {
    const Pack x = load(support.dx + k), y = load(support.dy + k), z = load(support.dz + k);
    const Pack p = c[0] + c[1] * x + c[2] * y + c[3] * z;
    store(output.value + k, load(output.dx + k) * p);
    const Pack r = load(output.dy + k) * p;
    const Pack rx = r * x, ry = r * y, rz = r * z;
    third[0] += rx;
    third[1] += ry;
    third[2] += rz;
    third[3] += rx * x;
    third[4] += rx * y;
    third[5] += rx * z;
    third[6] += ry * y;
    third[7] += ry * z;
    third[8] += rz * z;
  }
  double t[10];
  add_lanes(third, 10, t);
  for (int i = 3; i < 9; ++i)
    t[i] *= scale;
  const double right[3][4] = {
      {-t[0], scale - t[3], -t[4], -t[5]}, {-t[1], -t[4], scale - t[6], -t[7]}, {-t[2], -t[5], -t[7], scale - t[8]}};
  double c1[3][4];
  for (int i = 0; i < 3; ++i) {
    multiply(b, right[i], c1[i]);
    for (int e = 1; e < 4; ++e)
      c1[i][e] *= scale;
  }

  double c2[6][4];
  if constexpr (second) {
    Pack fourth[6][4] = {};
    for (int k = 0; k < n; k += width) {
      const Pack d[3] = {load(support.dx + k), load(support.dy + k), load(support.dz + k)};
      const Pack g = load(output.dy + k), f = load(output.second[0] + k);
      const Pack p = c[0] + c[1] * d[0] + c[2] * d[1] + c[3] * d[2];
      Pack gp[3];
      for (int i = 0; i < 3; ++i)
        gp[i] = g * (c1[i][0] + c1[i][1] * d[0] + c1[i][2] * d[1] + c1[i][3] * d[2]);
      const Pack fp = f * p, r = g * p;
      for (int m = 0; m < 6; ++m) {
        constexpr int first[6] = {0, 1, 2, 0, 0, 1}, other[6] = {0, 1, 2, 1, 2, 2};
        const int i = first[m], l = other[m];
        Pack u = fp * d[i] * d[l] + d[i] * gp[l] + d[l] * gp[i];
        if (i == l)
          u -= r;
        store(output.second[m] + k, u);
        fourth[m][0] += u;
        for (int e = 0; e < 3; ++e)
          fourth[m][1 + e] += u * d[e];
      }
    }
    for (int m = 0; m < 6; ++m) {
      double sums[4];
      add_lanes(fourth[m], 4, sums);
      const double negative[4] = {-sums[0], -scale * sums[1], -scale * sums[2], -scale * sums[3]};
      multiply(b, negative, c2[m]);
      for (int e = 1; e < 4; ++e)
        c2[m][e] *= scale;
    }
  }

  for (int k = 0; k < n; k += width) {
    const Pack x = load(support.dx + k), y = load(support.dy + k), z = load(support.dz + k);
    const Pack w = load(output.dx + k);
    const Pack r = load(output.dy + k) * (c[0] + c[1] * x + c[2] * y + c[3] * z);
    store(output.dx + k, r * x + w * (c1[0][0] + c1[0][1] * x + c1[0][2] * y + c1[0][3] * z));
    store(output.dy + k, r * y + w * (c1[1][0] + c1[1][1] * x + c1[1][2] * y + c1[1][3] * z));
    store(output.dz + k, r * z + w * (c1[2][0] + c1[2][1] * x + c1[2][2] * y + c1[2][3] * z));
    if constexpr (second)
      for (int m = 0; m < 6; ++m) {
        double* to = output.second[m] + k;
        store(to, load(to) + w * (c2[m][0] + c2[m][1] * x + c2[m][2] * y + c2[m][3] * z));
      }
  }
  return condition;
}
