// Moving least squares on given weights and basis functions, for points near a cut. Included after
// shape_kernel_lanes.inl, where its key holds; P_j = {1, d_j / l} or {1, d_j / l, b_1 .. b_4}.

inline double sum_of_lanes(Pack v) {
  const Pair pair = fold<width>(v);
  return pair[0] + pair[1];
}

inline Pack basis_at(const Moments& m, int i, int k) {
  return i == 0 ? Pack{} + 1 : load(m.basis[i - 1] + k);
}

// Row i and those below of A = sum_j W_j P_j P_j^T, with both triangles filled.
template <int size, int i>
void accumulate(const Moments& m, int n, double (&a)[size][size]) {
  Pack sums[size - i] = {};
  for (int k = 0; k < n; k += width) {
    const Pack w = load(m.weight + k) * basis_at(m, i, k);
    for (int j = i; j < size; ++j)
      sums[j - i] += w * basis_at(m, j, k);
  }
  for (int j = i; j < size; ++j)
    a[i][j] = a[j][i] = sum_of_lanes(sums[j - i]);
  if constexpr (i + 1 < size)
    accumulate<size, i + 1>(m, n, a);
}

// Inverse of a symmetric matrix: L^-1 by elimination, A^-1 = L^-T D^-1 L^-1. False unless A is positive definite.
template <int size>
bool invert(const double (&matrix)[size][size], double (&inverse)[size][size]) {
  double a[size][size], unit[size][size] = {};
  for (int i = 0; i < size; ++i) {
    for (int c = 0; c < size; ++c) {
      a[i][c] = matrix[i][c];
      inverse[i][c] = 0;
    }
    unit[i][i] = 1;
  }
  for (int j = 0; j < size; ++j) {
    if (!(a[j][j] > 0))
      return false;
    const double reciprocal = 1 / a[j][j];
    for (int i = j + 1; i < size; ++i) {
      const double factor = a[i][j] * reciprocal;
      for (int c = 0; c < size; ++c) {
        a[i][c] -= factor * a[j][c];
        unit[i][c] -= factor * unit[j][c];
      }
    }
    for (int i = 0; i <= j; ++i) {
      const double factor = unit[j][i] * reciprocal;
      for (int c = 0; c < size; ++c)
        inverse[i][c] += factor * unit[j][c];
    }
  }
  return true;
}

template <int size>
double norm1(const double (&a)[size][size]) {
  double largest = 0;
  for (int i = 0; i < size; ++i) {
    double sum = 0;
    for (int j = 0; j < size; ++j)
      sum += magnitude(a[i][j]);
    largest = larger(sum, largest);
  }
  return largest;
}

// Coefficients of h_j = W_j (P_j . c) and h_j,k = W_j,k (P_j . c) + W_j (P_j . slope_k).
struct Coefficients {
  double c[8], slope[3][8];
};

// A c = P(x) = e_0 and, with the frame and the linear parts of the branch functions fixed at x, A c_k = P,k - A,k c.
// Returns the 1-norm condition of A scaled to a unit diagonal, infinite where no use is to be made of it. `pc` has room
// for the padded nodes.
template <int size>
double solve_system(const Moments& m, int n, const double (&moment)[size][size], double* pc, Coefficients& out) {
  double scale[size], a[size][size], inverse[size][size];
  for (int i = 0; i < size; ++i) {
    if (!(moment[i][i] > 0))
      return __builtin_inf();
    scale[i] = 1 / __builtin_sqrt(moment[i][i]);
  }
  for (int i = 0; i < size; ++i)
    for (int j = 0; j < size; ++j)
      a[i][j] = scale[i] * moment[i][j] * scale[j];
  if (!invert(a, inverse))
    return __builtin_inf();
  for (int i = 0; i < size; ++i)
    out.c[i] = scale[0] * scale[i] * inverse[i][0];
  for (int k = 0; k < n; k += width) {
    Pack sum = Pack{} + out.c[0];
    for (int i = 1; i < size; ++i)
      sum += out.c[i] * basis_at(m, i, k);
    store(pc + k, sum);
  }
  for (int axis = 0; axis < 3; ++axis) {
    Pack sums[size] = {};
    for (int k = 0; k < n; k += width) {
      const Pack t = load(pc + k) * load(m.weight_gradient[axis] + k);
      for (int i = 0; i < size; ++i)
        sums[i] += t * basis_at(m, i, k);
    }
    double right[size];
    for (int i = 0; i < size; ++i)
      right[i] = -sum_of_lanes(sums[i]);
    right[1 + axis] += m.slope;
    for (int i = 4; i < size; ++i)
      right[i] += m.branch_slope[i - 4][axis];
    for (int i = 0; i < size; ++i)
      right[i] *= scale[i];
    for (int i = 0; i < size; ++i) {
      double sum = 0;
      for (int j = 0; j < size; ++j)
        sum += inverse[i][j] * right[j];
      out.slope[axis][i] = scale[i] * sum;
    }
  }
  return norm1(a) * norm1(inverse);
}

template <int size>
void write(const Moments& m, int n, const Coefficients& of, const LinearOutput& output) {
  double* const to[3] = {output.dx, output.dy, output.dz};
  for (int k = 0; k < n; k += width) {
    Pack p = Pack{} + of.c[0], slope[3] = {Pack{} + of.slope[0][0], Pack{} + of.slope[1][0], Pack{} + of.slope[2][0]};
    for (int i = 1; i < size; ++i) {
      const Pack b = basis_at(m, i, k);
      p += of.c[i] * b;
      for (int axis = 0; axis < 3; ++axis)
        slope[axis] += of.slope[axis][i] * b;
    }
    const Pack w = load(m.weight + k);
    store(output.value + k, w * p);
    for (int axis = 0; axis < 3; ++axis)
      store(to[axis] + k, p * load(m.weight_gradient[axis] + k) + w * slope[axis]);
  }
}

// The three principal spreads of the support must not be those of a plane; see Moments::flattest.
template <int size>
bool is_flat(const double (&a)[size][size], double flattest) {
  const double w = 1 / a[0][0];
  const double xx = a[1][1] - w * a[0][1] * a[0][1], yy = a[2][2] - w * a[0][2] * a[0][2],
               zz = a[3][3] - w * a[0][3] * a[0][3], xy = a[1][2] - w * a[0][1] * a[0][2],
               xz = a[1][3] - w * a[0][1] * a[0][3], yz = a[2][3] - w * a[0][2] * a[0][3];
  const double even = (xx + yy + zz) / 3;
  const double determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
  return !(determinant > flattest * even * even * even);
}

inline double solve_moments(const Moments& m, const LinearOutput& output) {
  const int n = (m.count + width - 1) / width * width;
  Coefficients plain;
  if (!m.enriched) {
    double a[4][4];
    accumulate<4, 0>(m, n, a);
    if (is_flat(a, m.flattest))
      return __builtin_inf();
    const double condition = solve_system(m, n, a, output.value, plain);
    write<4>(m, n, plain, output);
    return condition;
  }
  double a[8][8];
  accumulate<8, 0>(m, n, a);
  if (is_flat(a, m.flattest))
    return __builtin_inf();
  Coefficients mixed;
  const double condition = solve_system(m, n, a, output.value, mixed);
  if (m.share < 1) {
    // The plain basis has the same weights, its moments are a part of the enriched ones; h = s h_enriched + (1 - s)
    // h_plain is linear in the coefficients.
    double part[4][4];
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        part[i][j] = a[i][j];
    const double plain_condition = solve_system(m, n, part, output.value, plain);
    if (!(plain_condition < __builtin_inf()))
      return __builtin_inf();
    for (int i = 0; i < 8; ++i) {
      const double c = i < 4 ? plain.c[i] : 0, difference = mixed.c[i] - c;
      for (int axis = 0; axis < 3; ++axis)
        mixed.slope[axis][i] = m.share * mixed.slope[axis][i] + (i < 4 ? (1 - m.share) * plain.slope[axis][i] : 0) +
                               m.share_gradient[axis] * difference;
      mixed.c[i] = m.share * mixed.c[i] + (1 - m.share) * c;
    }
  }
  write<8>(m, n, mixed, output);
  return condition;
}
