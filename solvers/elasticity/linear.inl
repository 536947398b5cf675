// Linear law at small strain e = sym(F) - I: W = mu dev e : dev e + kappa/2 (tr e)^2. Not objective: a rotation
// strains.

struct LinearModel {
  static constexpr const char* name = "linear";
  static constexpr bool any_gradient = true; // det F <= 0 is no matter
  double shear;

  explicit LinearModel(const double* constants) : shear(constants[0]) {}

  /// Energy; the stress to `stress`.
  template <class T, class Real>
  T evaluate(const T* f, const Real* /*frame*/, double bulk, T* stress) const {
    const T dilatation = f[0] + f[4] + f[8] - 3.0, mean = dilatation / 3.0;
    const T x = f[0] - 1.0 - mean, y = f[4] - 1.0 - mean, z = f[8] - 1.0 - mean;
    const T xy = 0.5 * (f[1] + f[3]), xz = 0.5 * (f[2] + f[6]), yz = 0.5 * (f[5] + f[7]);
    const T pressure = bulk * dilatation;
    stress[0] = 2.0 * shear * x + pressure;
    stress[4] = 2.0 * shear * y + pressure;
    stress[8] = 2.0 * shear * z + pressure;
    stress[1] = stress[3] = 2.0 * shear * xy;
    stress[2] = stress[6] = 2.0 * shear * xz;
    stress[5] = stress[7] = 2.0 * shear * yz;
    return shear * (x * x + y * y + z * z + 2.0 * (xy * xy + xz * xz + yz * yz)) + 0.5 * pressure * dilatation;
  }
};
