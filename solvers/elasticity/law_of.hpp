// A Law from a model of one point: batches, the volumetric part and the tangent are the same for all models.
#pragma once

#include "solvers/elasticity/deformation.hpp"
#include "solvers/elasticity/dual.hpp"
#include "solvers/elasticity/law.hpp"

#include <Eigen/LU>
#include <limits>

namespace spherecut::solvers {

/// Throws InputError when the spans of a batch do not agree in length; without frames there are none.
void check_lengths(const char* law, std::size_t gradients, std::size_t frames, std::size_t energies,
                   std::size_t stresses);

template <class Model>
class LawOf final : public Law {
 public:
  LawOf(Model model, double bulk_modulus, FibreFrame own) : model_(std::move(model)), bulk_(bulk_modulus), own_(own) {}

  void evaluate(std::span<const Matrix3> gradients, std::span<const FibreFrame> fibres, std::span<double> energy,
                std::span<Matrix3> stress) const override {
    batch<true>(gradients, fibres, energy, stress);
  }
  void evaluate_isochoric(std::span<const Matrix3> gradients, std::span<const FibreFrame> fibres,
                          std::span<double> energy, std::span<Matrix3> stress) const override {
    batch<false>(gradients, fibres, energy, stress);
  }
  [[nodiscard]] Matrix9 tangent(const Matrix3& gradient, const FibreFrame& fibre) const override {
    return slope<true>(gradient, fibre);
  }
  [[nodiscard]] Matrix9 tangent_isochoric(const Matrix3& gradient, const FibreFrame& fibre) const override {
    return slope<false>(gradient, fibre);
  }
  [[nodiscard]] FibreFrame own_fibres() const override { return own_; }
  [[nodiscard]] double volumetric_energy(double j) const override {
    if (!Model::has_volumetric_part)
      return 0;
    return j > 0 ? 0.25 * bulk_ * (j * j - 1 - 2 * std::log(j)) : std::numeric_limits<double>::infinity();
  }
  [[nodiscard]] double pressure(double j) const override {
    return Model::has_volumetric_part ? 0.5 * bulk_ * (j - 1 / j) : 0;
  }
  [[nodiscard]] double bulk_slope(double j) const override {
    return Model::has_volumetric_part ? 0.5 * bulk_ * (1 + 1 / (j * j)) : 0;
  }
  [[nodiscard]] ElasticConstants small_strain() const override { return {model_.shear_modulus(), bulk_}; }
  [[nodiscard]] std::string name() const override { return Model::name; }

 private:
  /// Energy of one point; the stress to `stress`.
  template <bool volumetric, class T>
  T point(const T* gradient, const FibreFrame& frame, T* stress) const {
    const Deformation<T> d(gradient);
    T energy = model_.isochoric(d, frame.direction[0].data(), stress);
    if constexpr (volumetric && Model::has_volumetric_part) {
      using std::log;
      const T& j = d.jacobian;
      const T p = 0.5 * bulk_ * (j - 1.0 / j);
      for (int k = 0; k < 9; ++k)
        stress[k] = stress[k] + p * d.cofactor[k];
      energy = energy + 0.25 * bulk_ * (j * j - 1.0 - 2.0 * log(j));
    }
    return energy;
  }

  template <bool volumetric>
  void batch(std::span<const Matrix3> gradients, std::span<const FibreFrame> fibres, std::span<double> energy,
             std::span<Matrix3> stress) const {
    const std::size_t count = gradients.size();
    check_lengths(Model::name, count, fibres.size(), energy.size(), stress.size());
    for (std::size_t k = 0; k < count; ++k) {
      if (Model::has_volumetric_part && !(gradients[k].determinant() > 0)) {
        energy[k] = std::numeric_limits<double>::infinity();
        stress[k].setZero();
        continue;
      }
      energy[k] = point<volumetric>(gradients[k].data(), fibres.empty() ? own_ : fibres[k], stress[k].data());
    }
  }

  template <bool volumetric>
  Matrix9 slope(const Matrix3& gradient, const FibreFrame& frame) const {
    Matrix9 tangent = Matrix9::Zero();
    if (Model::has_volumetric_part && !(gradient.determinant() > 0))
      return tangent;
    Dual<9> f[9], stress[9];
    for (int k = 0; k < 9; ++k)
      f[k] = Dual<9>::variable(gradient.data()[k], k);
    point<volumetric>(f, frame, stress);
    for (int row = 0; row < 9; ++row)
      for (int column = 0; column < 9; ++column)
        tangent(row, column) = stress[row].slope[column];
    return tangent;
  }

  Model model_;
  double bulk_;
  FibreFrame own_;
};

} // namespace spherecut::solvers
