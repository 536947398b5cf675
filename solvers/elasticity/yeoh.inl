// Yeoh's law: W_iso = c1 e + c2 e^2 + c3 e^3 with e = I1 - 3.

struct YeohModel {
  static constexpr const char* name = "yeoh";
  static constexpr bool any_gradient = false;
  double c1, c2, c3;

  explicit YeohModel(const double* constants) : c1(constants[0]), c2(constants[1]), c3(constants[2]) {}

  /// Energy; the stress to `stress`.
  template <class T, class Real>
  T evaluate(const T* f, const Real* /*frame*/, double bulk, T* stress) const {
    const Deformation<T> d(f);
    const T shape = d.jacobian_to(-2.0 / 3), trace = d.trace();
    const T e = shape * trace - 3.0;
    stress_of_first_invariant<T>(d, shape, trace, c1 + e * (2.0 * c2 + 3.0 * c3 * e), stress);
    const T energy = e * (c1 + e * (c2 + c3 * e));
    return energy + add_volumetric_part(d, bulk, stress);
  }
};
