// Body of the shape kernel, written for registers of `width` doubles. The including unit defines, in its own namespace,
//   width, Pack (a GCC vector of `width` doubles), root(Pack), below_one(Pack) (a bit for every lane), and
//   collect(cell, point, support).
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
template <class V>
struct Symmetric4 {
  V m[10];
};

// Inverse by A = L D L^T, A^-1 = L^-T D^-1 L^-1. A singular matrix gives entries that are huge or not finite.
template <class V>
Symmetric4<V> inverse(const Symmetric4<V>& a) {
  const V* m = a.m;
  const V i0 = 1 / m[0];
  const V l10 = m[1] * i0, l20 = m[2] * i0, l30 = m[3] * i0;
  const V i1 = 1 / (m[4] - l10 * m[1]);
  const V t12 = m[5] - l10 * m[2], t13 = m[6] - l10 * m[3];
  const V l21 = t12 * i1, l31 = t13 * i1;
  const V i2 = 1 / (m[7] - l20 * m[2] - l21 * t12);
  const V t23 = m[8] - l20 * m[3] - l21 * t13;
  const V l32 = t23 * i2;
  const V i3 = 1 / (m[9] - l30 * m[3] - l31 * t13 - l32 * t23);
  // Rows of L^-1 below the unit diagonal.
  const V k10 = -l10, k21 = -l21, k32 = -l32;
  const V k20 = l21 * l10 - l20, k31 = l32 * l21 - l31;
  const V k30 = -(l30 + l31 * k10 + l32 * k20);
  const V u10 = i1 * k10, u20 = i2 * k20, u30 = i3 * k30, u21 = i2 * k21, u31 = i3 * k31, u32 = i3 * k32;
  return {{i0 + k10 * u10 + k20 * u20 + k30 * u30, u10 + k20 * u21 + k30 * u31, u20 + k30 * u32, u30,
           i1 + k21 * u21 + k31 * u31, u21 + k31 * u32, u31, i2 + k32 * u32, u32, i3}};
}

inline double magnitude(double v) {
  return __builtin_fabs(v);
}
inline Pack magnitude(Pack v) {
  return v < 0 ? -v : v;
}
template <class V>
V larger(V a, V b) {
  return ((a > b) | (a != a)) ? a : b;
} // keeps a NaN in either place

template <class V>
V norm1(const Symmetric4<V>& a) {
  const V c01 = magnitude(a.m[1]), c02 = magnitude(a.m[2]), c03 = magnitude(a.m[3]), c12 = magnitude(a.m[5]),
          c13 = magnitude(a.m[6]), c23 = magnitude(a.m[8]);
  const V first = larger(magnitude(a.m[0]) + c01 + c02 + c03, magnitude(a.m[4]) + c01 + c12 + c13);
  const V second = larger(magnitude(a.m[7]) + c02 + c12 + c23, magnitude(a.m[9]) + c03 + c13 + c23);
  return larger(first, second);
}

template <class V>
void multiply(const Symmetric4<V>& a, const V* v, V* out) {
  const V* m = a.m;
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
  Symmetric4<double> a;
  add_lanes(moment, 10, a.m);
  for (int i = 1; i < 4; ++i)
    a.m[i] *= scale;
  for (int i = 4; i < 10; ++i)
    a.m[i] *= scale2;
  const Symmetric4<double> b = inverse(a);
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

inline void find_inside(const Sphere* spheres, int count, const Points& points, std::uint8_t* inside) {
  for (int k = 0; k < count; ++k) {
    const Sphere& sphere = spheres[k];
    unsigned bits = 0;
    for (int p = 0; p < points_together; p += width) {
      const Pack x = sphere.x - load(points.x + p), y = sphere.y - load(points.y + p),
                 z = sphere.z - load(points.z + p);
      bits |= below_one((x * x + y * y + z * z) * sphere.q) << p;
    }
    inside[k] = static_cast<std::uint8_t>(bits);
  }
}

// As evaluate(), with a point in every lane in place of a node: no sums over lanes, and one inverse for all of them.
inline void gradients_at_points(const Sphere* spheres, int count, const Points& points, int stride, double* gradients,
                                double* condition) {
  for (int p = 0; p < points_together; p += width) {
    const Pack px = load(points.x + p), py = load(points.y + p), pz = load(points.z + p);
    Pack moment[10] = {}, first_q = {};
    double* to = gradients + p;
    for (int k = 0; k < count; ++k, to += 3 * static_cast<std::ptrdiff_t>(stride)) {
      const Sphere& sphere = spheres[k];
      const Pack x = sphere.x - px, y = sphere.y - py, z = sphere.z - pz;
      const Pack s = root((x * x + y * y + z * z) * sphere.q);
      Pack t = 1 - s;
      t = t > 0 ? t : Pack{};
      const Pack q = Pack{} + sphere.q;
      first_q = ((first_q == 0) & (t > 0)) ? q : first_q;
      const Pack t2 = t * t, w = t2 * t * (1 + 3 * s);
      store(to, w); // until the results are known the gradients keep the weights
      store(to + stride, 12 * t2 * q);
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
    const Pack scale = root(first_q), scale2 = scale * scale;
    Symmetric4<Pack> a;
    for (int i = 0; i < 10; ++i)
      a.m[i] = i == 0 ? moment[i] : i < 4 ? scale * moment[i] : scale2 * moment[i];
    const Symmetric4<Pack> b = inverse(a);
    store(condition + p, norm1(a) * norm1(b));

    Pack c[4] = {b.m[0], scale * b.m[1], scale * b.m[2], scale * b.m[3]};
    Pack t[9] = {};
    to = gradients + p;
    for (int k = 0; k < count; ++k, to += 3 * static_cast<std::ptrdiff_t>(stride)) {
      const Sphere& sphere = spheres[k];
      const Pack x = sphere.x - px, y = sphere.y - py, z = sphere.z - pz;
      const Pack r = load(to + stride) * (c[0] + c[1] * x + c[2] * y + c[3] * z);
      const Pack rx = r * x, ry = r * y, rz = r * z;
      t[0] += rx;
      t[1] += ry;
      t[2] += rz;
      t[3] += rx * x;
      t[4] += rx * y;
      t[5] += rx * z;
      t[6] += ry * y;
      t[7] += ry * z;
      t[8] += rz * z;
    }
    for (int i = 3; i < 9; ++i)
      t[i] *= scale;
    const Pack right[3][4] = {
        {-t[0], scale - t[3], -t[4], -t[5]}, {-t[1], -t[4], scale - t[6], -t[7]}, {-t[2], -t[5], -t[7], scale - t[8]}};
    const Pack factor = load(points.factor + p);
    Pack c1[3][4];
    for (int i = 0; i < 3; ++i) {
      multiply(b, right[i], c1[i]);
      c1[i][0] *= factor;
      for (int e = 1; e < 4; ++e)
        c1[i][e] *= factor * scale;
    }
    for (Pack& coefficient : c)
      coefficient *= factor;

    to = gradients + p;
    for (int k = 0; k < count; ++k, to += 3 * static_cast<std::ptrdiff_t>(stride)) {
      const Sphere& sphere = spheres[k];
      const Pack x = sphere.x - px, y = sphere.y - py, z = sphere.z - pz;
      const Pack w = load(to), r = load(to + stride) * (c[0] + c[1] * x + c[2] * y + c[3] * z);
      store(to, r * x + w * (c1[0][0] + c1[0][1] * x + c1[0][2] * y + c1[0][3] * z));
      store(to + stride, r * y + w * (c1[1][0] + c1[1][1] * x + c1[1][2] * y + c1[1][3] * z));
      store(to + 2 * stride, r * z + w * (c1[2][0] + c1[2][1] * x + c1[2][2] * y + c1[2][3] * z));
    }
  }
}
