// Powers of a symmetric positive matrix of 3 x 3. Entries: xx, yy, zz, xy, xz, yz.

/// Eigenvalues and eigenvectors by cyclic Jacobi rotations; T is double or a pack. Five sweeps reach the last bit from
/// any matrix of that size, for convergence is quadratic, and need no branch.
template <class T>
struct Spectrum {
  T logs[3]; // of the eigenvalues
  T vectors[9];

  explicit Spectrum(const T* matrix) {
    T a[9] = {matrix[0], matrix[3], matrix[4], matrix[3], matrix[1], matrix[5], matrix[4], matrix[5], matrix[2]};
    for (int k = 0; k < 9; ++k)
      vectors[k] = T{} + (k % 4 == 0 ? 1.0 : 0.0);
    for (int sweep = 0; sweep < 5; ++sweep) {
      rotate<0, 1>(a);
      rotate<0, 2>(a);
      rotate<1, 2>(a);
    }
    for (int k = 0; k < 3; ++k)
      logs[k] = logarithm(a[4 * k]);
  }
  /// Sum of the eigenvalues' powers.
  [[nodiscard]] T power_trace(double exponent) const {
    return exponential(exponent * logs[0]) + exponential(exponent * logs[1]) + exponential(exponent * logs[2]);
  }
  /// The matrix to the power.
  void power(double exponent, T* out) const {
    for (int k = 0; k < 6; ++k)
      out[k] = T{};
    for (int k = 0; k < 3; ++k) {
      const T factor = exponential(exponent * logs[k]);
      const T* q = vectors + 3 * k;
      const T x = factor * q[0], y = factor * q[1];
      out[0] = out[0] + x * q[0];
      out[1] = out[1] + y * q[1];
      out[2] = out[2] + factor * q[2] * q[2];
      out[3] = out[3] + x * q[1];
      out[4] = out[4] + x * q[2];
      out[5] = out[5] + y * q[2];
    }
  }

 private:
  /// The rotation in the plane of p and q that makes their off-diagonal entry zero.
  template <int p, int q>
  void rotate(T* a) {
    constexpr int r = 3 - p - q;
    const T off = a[p + 3 * q], half = 0.5 * (a[q + 3 * q] - a[p + 3 * p]);
    // tan of the angle, the smaller root; the least normal number keeps 0 / 0 away.
    const T size = root(half * half + off * off) + 2.3e-308;
    const T t = half < 0.0 ? -off / (size - half) : off / (size + half);
    const T c = 1.0 / root(1.0 + t * t), s = t * c;
    a[p + 3 * p] = a[p + 3 * p] - t * off;
    a[q + 3 * q] = a[q + 3 * q] + t * off;
    a[p + 3 * q] = a[q + 3 * p] = T{};
    const T x = a[r + 3 * p], y = a[r + 3 * q];
    a[r + 3 * p] = a[p + 3 * r] = c * x - s * y;
    a[r + 3 * q] = a[q + 3 * r] = s * x + c * y;
    for (int i = 0; i < 3; ++i) {
      const T u = vectors[i + 3 * p], v = vectors[i + 3 * q];
      vectors[i + 3 * p] = c * u - s * v;
      vectors[i + 3 * q] = s * u + c * v;
    }
  }
};

/// The same for a matrix of dual numbers: derivatives by divided differences of the eigenvalues' powers [Daletskii and
/// Krein 1951], which are regular where eigenvalues meet.
template <int n>
struct Spectrum<Dual<n>> {
  double values[6];
  Spectrum<double> plain;
  const Dual<n>* matrix;

  explicit Spectrum(const Dual<n>* m)
      : values{m[0].value, m[1].value, m[2].value, m[3].value, m[4].value, m[5].value}, plain(values), matrix(m) {}

  [[nodiscard]] Dual<n> power_trace(double exponent) const {
    Dual<n> sum(plain.power_trace(exponent));
    double slope[6];
    plain.power(exponent - 1, slope);
    for (int k = 0; k < n; ++k)
      for (int i = 0; i < 6; ++i)
        sum.slope[k] += (i < 3 ? 1 : 2) * exponent * slope[i] * matrix[i].slope[k];
    return sum;
  }
  void power(double exponent, Dual<n>* out) const {
    double value[6];
    plain.power(exponent, value);
    for (int i = 0; i < 6; ++i)
      out[i] = Dual<n>(value[i]);
    // (a^e - b^e) / (a - b) = b^(e-1) (exp(e t) - 1) / (exp(t) - 1) with t = ln a/b.
    double divided[3][3];
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) {
        const double t = plain.logs[a] - plain.logs[b];
        const double ratio = std::abs(t) < 1e-15 ? exponent : std::expm1(exponent * t) / std::expm1(t);
        divided[a][b] = std::exp((exponent - 1) * plain.logs[b]) * ratio;
      }
    static constexpr int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
    const double* q = plain.vectors;
    for (int k = 0; k < n; ++k) {
      double change[3][3]; // of the matrix
      for (int i = 0; i < 6; ++i)
        change[row[i]][column[i]] = change[column[i]][row[i]] = matrix[i].slope[k];
      double turned[3][3] = {}; // in the eigenvectors, times the divided differences
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) {
          for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
              turned[a][b] += q[i + 3 * a] * change[i][j] * q[j + 3 * b];
          turned[a][b] *= divided[a][b];
        }
      for (int e = 0; e < 6; ++e)
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b)
            out[e].slope[k] += q[row[e] + 3 * a] * turned[a][b] * q[column[e] + 3 * b];
    }
  }
};
