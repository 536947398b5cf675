// What laws read of a deformation gradient. Included, as all models, inside the unnamed namespace of a unit, so that
// nothing compiled for a wide instruction set can be linked into portable code. T is double, a dual number or a pack of
// doubles; it is made from a constant c by T{} + c.

/// F, its cofactor J F^-T, J = det F and ln J. Column-major.
template <class T>
struct Deformation {
  const T* gradient;
  T cofactor[9];
  T jacobian, log_jacobian;

  explicit Deformation(const T* f) : gradient(f) {
    for (int j = 0; j < 3; ++j) { // columns are cross products of the other two
      const T *a = f + 3 * ((j + 1) % 3), *b = f + 3 * ((j + 2) % 3);
      for (int i = 0; i < 3; ++i)
        cofactor[i + 3 * j] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
    }
    jacobian = f[0] * cofactor[0] + f[1] * cofactor[1] + f[2] * cofactor[2];
    log_jacobian = logarithm(jacobian);
  }
  /// tr F^T F
  [[nodiscard]] T trace() const {
    T sum = gradient[0] * gradient[0];
    for (int k = 1; k < 9; ++k)
      sum = sum + gradient[k] * gradient[k];
    return sum;
  }
  /// J^exponent
  [[nodiscard]] T jacobian_to(double exponent) const { return exponential(exponent * log_jacobian); }
};

/// Stress of a law that depends on I1 = J^(-2/3) tr F^T F alone: P = 2 slope J^(-2/3) (F - tr(F^T F) cof F / (3 J)),
/// with slope = dW/dI1 and shape = J^(-2/3).
template <class T>
void stress_of_first_invariant(const Deformation<T>& d, const T& shape, const T& trace, const T& slope, T* stress) {
  const T along = 2.0 * slope * shape;
  const T back = along * trace / (3.0 * d.jacobian);
  for (int k = 0; k < 9; ++k)
    stress[k] = along * d.gradient[k] - back * d.cofactor[k];
}

/// Energy kappa/4 (J^2 - 1 - 2 ln J) of a change of volume; its stress is added to `stress`.
template <class T>
T add_volumetric_part(const Deformation<T>& d, double bulk, T* stress) {
  const T& j = d.jacobian;
  const T pressure = 0.5 * bulk * (j - 1.0 / j);
  for (int k = 0; k < 9; ++k)
    stress[k] = stress[k] + pressure * d.cofactor[k];
  return 0.25 * bulk * (j * j - 1.0 - 2.0 * d.log_jacobian);
}
