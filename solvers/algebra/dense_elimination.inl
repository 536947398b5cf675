// Body of DenseSystem::solve, compiled once per instruction set in a namespace of its own. Loops run over blocks of
// eight with a fixed inner loop, which the compiler turns into whole registers.
//
// Four columns (a panel) are factored at a time in a copy stored by columns; every row below is then updated with the
// four pivot rows at once. The factor L is not kept, because B is carried along: columns left of the panel may be
// overwritten, so that updates can start at a multiple of eight.

constexpr int panel = 4;
constexpr int block = 8;

// row -= f0 p0 + f1 p1 + f2 p2 + f3 p3 in columns from .. to (multiples of eight), p the first of four rows.
inline void subtract(double* __restrict row, const double* p, int stride, const double* f, int from, int to) {
  const double f0 = f[0], f1 = f[1], f2 = f[2], f3 = f[3];
  const double *p0 = p, *p1 = p0 + stride, *p2 = p1 + stride, *p3 = p2 + stride;
  for (int j = from; j < to; j += block)
    for (int l = 0; l < block; ++l)
      row[j + l] -= f0 * p0[j + l] + f1 * p1[j + l] + f2 * p2[j + l] + f3 * p3[j + l];
}

inline void exchange(double& a, double& b) {
  const double t = a;
  a = b;
  b = t;
}

// Place of the entry of largest magnitude in column[from .. n); the column is zero from n up to a multiple of eight and
// from a multiple of eight up to `from`.
inline int largest_entry(const double* column, int from, int n) {
  double most[block] = {};
  for (int i = from / block * block; i < n; i += block)
    for (int l = 0; l < block; ++l) {
      const double size = __builtin_fabs(column[i + l]);
      most[l] = size > most[l] ? size : most[l];
    }
  double best = most[0];
  for (int l = 1; l < block; ++l)
    best = most[l] > best ? most[l] : best;
  int place = from;
  while (place < n - 1 && __builtin_fabs(column[place]) != best)
    ++place;
  return place;
}

// Factors columns first .. first + count of the panel copy, exchanging rows of the whole system. Leaves the factors of
// the rows below (and, for the pivot rows, of the columns before their own) in the copy and the pivot block in `upper`.
// Returns false at a zero pivot.
inline bool factor_panel(const Layout& a, int first, int count, double (&upper)[panel][panel], double& largest,
                         double& smallest) {
  const int end = first + count;
  for (int c = 0; c < count; ++c) {
    double* __restrict column = a.panel + c * a.padded;
    const int k = first + c, pivot = largest_entry(column, k, a.n), top = k / block * block;
    const double value = column[pivot], size = __builtin_fabs(value);
    if (!(size > 0))
      return false;
    largest = size > largest ? size : largest;
    smallest = size < smallest ? size : smallest;
    if (pivot != k) {
      for (int d = 0; d < count; ++d)
        exchange(a.panel[d * a.padded + k], a.panel[d * a.padded + pivot]);
      double* __restrict one = a.row(k), * __restrict other = a.row(pivot);
      for (int j = end / block * block; j < a.width; j += block)
        for (int l = 0; l < block; ++l)
          exchange(one[j + l], other[j + l]);
    }
    // The pivot row leaves the copy: what follows may then run over whole blocks.
    for (int d = c; d < count; ++d) {
      upper[c][d] = a.panel[d * a.padded + k];
      a.panel[d * a.padded + k] = 0;
    }
    // Entries of this column above k are zero: those rows left with their own pivots.
    const double inverse = 1 / value;
    for (int i = top; i < a.padded; i += block)
      for (int l = 0; l < block; ++l)
        column[i + l] *= inverse;
    for (int d = c + 1; d < count; ++d) {
      double* __restrict target = a.panel + d * a.padded;
      const double u = upper[c][d];
      for (int i = top; i < a.padded; i += block)
        for (int l = 0; l < block; ++l)
          target[i + l] -= column[i + l] * u;
    }
  }
  return true;
}

void substitute_back(const Layout& a) {
  for (int k = a.n - 1; k >= 0; --k) {
    const double* u = a.row(k);
    double sum[4][block] = {};
    int j = k + 1;
    for (; j + 3 < a.n; j += 4)
      for (int s = 0; s < 4; ++s)
        for (int l = 0; l < block; ++l)
          sum[s][l] += u[j + s] * a.solution[(j + s) * block + l];
    for (; j < a.n; ++j)
      for (int l = 0; l < block; ++l)
        sum[0][l] += u[j] * a.solution[j * block + l];
    const double inverse = 1 / u[k];
    for (int l = 0; l < block; ++l) {
      const double right = l < a.right ? u[a.n + l] : 0;
      a.solution[k * block + l] = (right - ((sum[0][l] + sum[1][l]) + (sum[2][l] + sum[3][l]))) * inverse;
    }
  }
}

EliminationResult solve(const Layout& a) {
  double largest = 0, smallest = __builtin_inf();
  for (int first = 0; first < a.n; first += panel) {
    const int count = first + panel < a.n ? panel : a.n - first, end = first + count;
    for (int c = 0; c < count; ++c) {
      double* column = a.panel + c * a.padded;
      for (int i = first / block * block; i < first; ++i)
        column[i] = 0;
      for (int i = first; i < a.n; ++i)
        column[i] = a.row(i)[first + c];
      for (int i = a.n; i < a.padded; ++i)
        column[i] = 0;
    }
    double upper[panel][panel] = {};
    if (!factor_panel(a, first, count, upper, largest, smallest))
      return {};
    const int from = end / block * block;
    for (int c = 1; c < count; ++c)
      for (int d = 0; d < c; ++d) {
        double* __restrict row = a.row(first + c);
        const double* __restrict pivots = a.row(first + d);
        const double f = a.panel[d * a.padded + first + c];
        for (int j = from; j < a.width; j += block)
          for (int l = 0; l < block; ++l)
            row[j + l] -= f * pivots[j + l];
      }
    for (int i = end; i < a.n; ++i) { // then count is that of a whole panel
      const double f[panel] = {a.panel[i], a.panel[a.padded + i], a.panel[2 * a.padded + i], a.panel[3 * a.padded + i]};
      subtract(a.row(i), a.row(first), a.width, f, from, a.width);
    }
    for (int c = 0; c < count; ++c)
      for (int d = c; d < count; ++d)
        a.row(first + c)[first + d] = upper[c][d];
  }
  substitute_back(a);
  return {smallest > 0 && largest < __builtin_inf(), largest / smallest};
}
