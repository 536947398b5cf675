// Neo-Hookean law: W_iso = mu/2 (I1 - 3).

struct NeoHookeanModel {
  static constexpr const char* name = "neo_hookean";
  static constexpr bool any_gradient = false;
  double shear;

  explicit NeoHookeanModel(const double* constants) : shear(constants[0]) {}

  /// Energy; the stress to `stress`.
  template <class T, class Real>
  T evaluate(const T* f, const Real* /*frame*/, double bulk, T* stress) const {
    const Deformation<T> d(f);
    const T shape = d.jacobian_to(-2.0 / 3), trace = d.trace();
    stress_of_first_invariant<T>(d, shape, trace, T{} + 0.5 * shear, stress);
    const T energy = 0.5 * shear * (shape * trace - 3.0);
    return energy + add_volumetric_part(d, bulk, stress);
  }
};
