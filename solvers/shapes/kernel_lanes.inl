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

// Inverse by blocks of 2 x 2, A = [P Q; Q^T R] with Schur complement S = R - Q^T P^-1 Q: two divisions, one after the
// other, where L D L^T has four. A singular matrix gives entries that are huge or not finite.
template <class V>
inline __attribute__((always_inline)) Symmetric4<V> inverse(const Symmetric4<V>& a) {
  const V* m = a.m;
  const V ip = 1 / (m[0] * m[4] - m[1] * m[1]);
  const V p00 = ip * m[4], p01 = -ip * m[1], p11 = ip * m[0];
  // W = P^-1 Q.
  const V w00 = p00 * m[2] + p01 * m[5], w01 = p00 * m[3] + p01 * m[6];
  const V w10 = p01 * m[2] + p11 * m[5], w11 = p01 * m[3] + p11 * m[6];
  const V s00 = m[7] - (m[2] * w00 + m[5] * w10), s01 = m[8] - (m[2] * w01 + m[5] * w11),
          s11 = m[9] - (m[3] * w01 + m[6] * w11);
  const V is = 1 / (s00 * s11 - s01 * s01);
  const V r00 = is * s11, r01 = -is * s01, r11 = is * s00; // S^-1
  const V q00 = w00 * r00 + w01 * r01, q01 = w00 * r01 + w01 * r11;
  const V q10 = w10 * r00 + w11 * r01, q11 = w10 * r01 + w11 * r11; // W S^-1
  return {{p00 + q00 * w00 + q01 * w01, p01 + q00 * w10 + q01 * w11, -q00, -q01, p11 + q10 * w10 + q11 * w11, -q10,
           -q11, r00, r01, r11}};
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
inline __attribute__((always_inline)) V norm1(const Symmetric4<V>& a) {
  const V c01 = magnitude(a.m[1]), c02 = magnitude(a.m[2]), c03 = magnitude(a.m[3]), c12 = magnitude(a.m[5]),
          c13 = magnitude(a.m[6]), c23 = magnitude(a.m[8]);
  const V first = larger(magnitude(a.m[0]) + c01 + c02 + c03, magnitude(a.m[4]) + c01 + c12 + c13);
  const V second = larger(magnitude(a.m[7]) + c02 + c12 + c23, magnitude(a.m[9]) + c03 + c13 + c23);
  return larger(first, second);
}

template <class V>
inline __attribute__((always_inline)) void multiply(const Symmetric4<V>& a, const V* v, V* out) {
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
  const double *const dx = support.dx, *const dy = support.dy, *const dz = support.dz, *const iq = support.q;
  double *const value = output.value, *const to_x = output.dx, *const to_y = output.dy, *const to_z = output.dz;

  // Sums are variables of their own: an array of them would be cleared and filled in memory.
  Pack m0{}, m1{}, m2{}, m3{}, m4{}, m5{}, m6{}, m7{}, m8{}, m9{};
  for (int k = 0; k < n; k += width) {
    const Pack x = load(dx + k), y = load(dy + k), z = load(dz + k), q = load(iq + k);
    const Weight weight = weigh<second>(x, y, z, q);
    const Pack w = weight.w;
    store(to_x + k, w); // until the results are known the outputs keep the weights
    store(to_y + k, weight.g);
    if constexpr (second)
      store(output.second[0] + k, weight.f);
    const Pack wx = w * x, wy = w * y, wz = w * z;
    m0 += w;
    m1 += wx;
    m2 += wy;
    m3 += wz;
    m4 += wx * x;
    m5 += wx * y;
    m6 += wx * z;
    m7 += wy * y;
    m8 += wy * z;
    m9 += wz * z;
  }
  const Pack moment[10] = {m0, m1, m2, m3, m4, m5, m6, m7, m8, m9};
  const double scale = __builtin_sqrt(iq[0]); // 1 / l, of the first sphere of the support
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
  Pack t0{}, t1{}, t2{}, t3{}, t4{}, t5{}, t6{}, t7{}, t8{};
  for (int k = 0; k < n; k += width) {
    const Pack x = load(dx + k), y = load(dy + k), z = load(dz + k);
    const Pack p = c[0] + c[1] * x + c[2] * y + c[3] * z;
    store(value + k, load(to_x + k) * p);
    const Pack r = load(to_y + k) * p;
    store(to_z + k, r);
    const Pack rx = r * x, ry = r * y, rz = r * z;
    t0 += rx;
    t1 += ry;
    t2 += rz;
    t3 += rx * x;
    t4 += rx * y;
    t5 += rx * z;
    t6 += ry * y;
    t7 += ry * z;
    t8 += rz * z;
  }
  const Pack third[10] = {t0, t1, t2, t3, t4, t5, t6, t7, t8, t8};
  double t[10];
  add_lanes(third, 10, t);
  double c1[3][4];
  const auto slope = [&](int i, double r0, double r1, double r2, double r3) __attribute__((always_inline)) {
    const double right[4] = {r0, r1, r2, r3};
    multiply(b, right, c1[i]);
    c1[i][1] *= scale;
    c1[i][2] *= scale;
    c1[i][3] *= scale;
  };
  slope(0, -t[0], scale - scale * t[3], -scale * t[4], -scale * t[5]);
  slope(1, -t[1], -scale * t[4], scale - scale * t[6], -scale * t[7]);
  slope(2, -t[2], -scale * t[5], -scale * t[7], scale - scale * t[8]);

  double c2[6][4];
  if constexpr (second) {
    Pack fourth[6][4] = {};
    for (int k = 0; k < n; k += width) {
      const Pack d[3] = {load(dx + k), load(dy + k), load(dz + k)};
      const Pack g = load(to_y + k), f = load(output.second[0] + k);
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
    const Pack x = load(dx + k), y = load(dy + k), z = load(dz + k);
    const Pack w = load(to_x + k);
    const Pack r = load(to_z + k);
    store(to_x + k, r * x + w * (c1[0][0] + c1[0][1] * x + c1[0][2] * y + c1[0][3] * z));
    store(to_y + k, r * y + w * (c1[1][0] + c1[1][1] * x + c1[1][2] * y + c1[1][3] * z));
    store(to_z + k, r * z + w * (c1[2][0] + c1[2][1] * x + c1[2][2] * y + c1[2][3] * z));
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
    Pack m0{}, m1{}, m2{}, m3{}, m4{}, m5{}, m6{}, m7{}, m8{}, m9{}, first_q{};
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
      m0 += w;
      m1 += wx;
      m2 += wy;
      m3 += wz;
      m4 += wx * x;
      m5 += wx * y;
      m6 += wx * z;
      m7 += wy * y;
      m8 += wy * z;
      m9 += wz * z;
    }
    const Pack scale = root(first_q), scale2 = scale * scale;
    const Symmetric4<Pack> a{{m0, scale * m1, scale * m2, scale * m3, scale2 * m4, scale2 * m5, scale2 * m6,
                              scale2 * m7, scale2 * m8, scale2 * m9}};
    const Symmetric4<Pack> b = inverse(a);
    store(condition + p, norm1(a) * norm1(b));

    const Pack c[4] = {b.m[0], scale * b.m[1], scale * b.m[2], scale * b.m[3]};
    Pack t0{}, t1{}, t2{}, t3{}, t4{}, t5{}, t6{}, t7{}, t8{};
    to = gradients + p;
    for (int k = 0; k < count; ++k, to += 3 * static_cast<std::ptrdiff_t>(stride)) {
      const Sphere& sphere = spheres[k];
      const Pack x = sphere.x - px, y = sphere.y - py, z = sphere.z - pz;
      const Pack r = load(to + stride) * (c[0] + c[1] * x + c[2] * y + c[3] * z);
      store(to + stride, r);
      const Pack rx = r * x, ry = r * y, rz = r * z;
      t0 += rx;
      t1 += ry;
      t2 += rz;
      t3 += rx * x;
      t4 += rx * y;
      t5 += rx * z;
      t6 += ry * y;
      t7 += ry * z;
      t8 += rz * z;
    }
    const Pack factor = load(points.factor + p), factor_scale = factor * scale;
    Pack c1[3][4];
    const auto slope = [&](int i, Pack r0, Pack r1, Pack r2, Pack r3) __attribute__((always_inline)) {
      const Pack right[4] = {r0, r1, r2, r3};
      multiply(b, right, c1[i]);
      c1[i][0] *= factor;
      c1[i][1] *= factor_scale;
      c1[i][2] *= factor_scale;
      c1[i][3] *= factor_scale;
    };
    slope(0, -t0, scale - scale * t3, -scale * t4, -scale * t5);
    slope(1, -t1, -scale * t4, scale - scale * t6, -scale * t7);
    slope(2, -t2, -scale * t5, -scale * t7, scale - scale * t8);

    to = gradients + p;
    for (int k = 0; k < count; ++k, to += 3 * static_cast<std::ptrdiff_t>(stride)) {
      const Sphere& sphere = spheres[k];
      const Pack x = sphere.x - px, y = sphere.y - py, z = sphere.z - pz;
      const Pack w = load(to), r = factor * load(to + stride);
      store(to, r * x + w * (c1[0][0] + c1[0][1] * x + c1[0][2] * y + c1[0][3] * z));
      store(to + stride, r * y + w * (c1[1][0] + c1[1][1] * x + c1[1][2] * y + c1[1][3] * z));
      store(to + 2 * stride, r * z + w * (c1[2][0] + c1[2][1] * x + c1[2][2] * y + c1[2][3] * z));
    }
  }
}
