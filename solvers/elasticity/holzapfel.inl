// Law of Holzapfel, Gasser and Ogden: neo-Hookean ground and one or two families of fibres, each with the energy
// k1/(2 k2) (exp(k2 <E>^2) - 1), E = d (tr C - 3) + (1 - 3 d) (a.C a - 1), C = F^T F.

struct HolzapfelModel {
  static constexpr const char* name = "holzapfel_gasser_ogden";
  static constexpr bool any_gradient = false;
  double shear, k1, k2, dispersion;
  int families;

  explicit HolzapfelModel(const double* constants)
      : shear(constants[0]), k1(constants[1]), k2(constants[2]), dispersion(constants[3]),
        families(static_cast<int>(constants[4])) {}

  /// Energy; the stress to `stress`. `frame`: the families' directions, three numbers each.
  template <class T, class Real>
  T evaluate(const T* f, const Real* frame, double bulk, T* stress) const {
    const Deformation<T> d(f);
    const T shape = d.jacobian_to(-2.0 / 3), trace = d.trace();
    stress_of_first_invariant<T>(d, shape, trace, T{} + 0.5 * shear, stress);
    T energy = 0.5 * shear * (shape * trace - 3.0);
    for (int family = 0; family < families; ++family) {
      const Real* a = frame + 3 * family;
      T along[3]; // F a
      for (int i = 0; i < 3; ++i)
        along[i] = f[i] * a[0] + f[i + 3] * a[1] + f[i + 6] * a[2];
      const T square = along[0] * along[0] + along[1] * along[1] + along[2] * along[2];
      const T e = positive_part(dispersion * (trace - 3.0) + (1 - 3 * dispersion) * (square - 1.0));
      const T growth = exponential(k2 * e * e);
      energy = energy + 0.5 * k1 / k2 * (growth - 1.0);
      const T pull = 2.0 * k1 * e * growth; // 2 dW/dE
      for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i)
          stress[i + 3 * j] =
              stress[i + 3 * j] + pull * (dispersion * f[i + 3 * j] + (1 - 3 * dispersion) * along[i] * a[j]);
    }
    return energy + add_volumetric_part(d, bulk, stress);
  }
};
