// Ogden's law of up to three terms: W_iso = sum_p mu_p / alpha_p (J^(-alpha_p / 3) tr C^(alpha_p / 2) - 3), C = F^T F.

struct OgdenModel {
  static constexpr const char* name = "ogden";
  static constexpr bool any_gradient = false;
  int terms = 0;
  double modulus[3], exponent[3];

  /// Modulus and exponent of each term; an exponent of zero ends the terms.
  explicit OgdenModel(const double* constants) {
    for (; terms < 3 && constants[2 * terms + 1] != 0; ++terms) {
      modulus[terms] = constants[2 * terms];
      exponent[terms] = constants[2 * terms + 1];
    }
  }

  /// Energy; the stress to `stress`.
  template <class T, class Real>
  T evaluate(const T* f, const Real* /*frame*/, double bulk, T* stress) const {
    const Deformation<T> d(f);
    T squared[6]; // C
    static constexpr int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
    for (int e = 0; e < 6; ++e) {
      const T *a = f + 3 * row[e], *b = f + 3 * column[e];
      squared[e] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    }
    const Spectrum<T> spectrum(squared);
    T energy{}, back{}, sum[6] = {};
    for (int p = 0; p < terms; ++p) {
      const T shape = d.jacobian_to(-exponent[p] / 3), trace = spectrum.power_trace(0.5 * exponent[p]);
      energy = energy + modulus[p] / exponent[p] * (shape * trace - 3.0);
      T power[6];
      spectrum.power(0.5 * exponent[p] - 1, power);
      for (int e = 0; e < 6; ++e)
        sum[e] = sum[e] + modulus[p] * shape * power[e];
      back = back + modulus[p] * shape * trace;
    }
    back = back / (3.0 * d.jacobian);
    static constexpr int place[9] = {0, 3, 4, 3, 1, 5, 4, 5, 2};
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i)
        stress[i + 3 * j] = f[i] * sum[place[3 * j]] + f[i + 3] * sum[place[3 * j + 1]] +
                            f[i + 6] * sum[place[3 * j + 2]] - back * d.cofactor[i + 3 * j];
    return energy + add_volumetric_part(d, bulk, stress);
  }
};
