#include "solvers/elasticity/law.hpp"

#include "solvers/elasticity/dual.hpp"
#include "solvers/elasticity/law_checks.hpp"
#include "solvers/elasticity/law_kernel.hpp"

#include <Eigen/LU>
#include <fmt/format.h>
#include <limits>

namespace spherecut::solvers {
namespace {

#include "solvers/elasticity/models.inl"

/// A law from the model of one point: batches go to the kernel of this machine, tangents through dual numbers.
template <class Model>
class ModelLaw final : public Law {
 public:
  ModelLaw(const LawSpec& spec, const LawConstants& constants)
      : constants_(constants), model_(constants_.values.data()), moduli_(small_strain_moduli(spec)),
        own_(law_fibres(spec)), index_(spec.law.index()) {}

  void evaluate(std::span<const Matrix3> gradients, std::span<const FibreFrame> fibres, std::span<double> energy,
                std::span<Matrix3> stress) const override {
    batch(moduli_.bulk_modulus, gradients, fibres, energy, stress);
  }
  void evaluate_isochoric(std::span<const Matrix3> gradients, std::span<const FibreFrame> fibres,
                          std::span<double> energy, std::span<Matrix3> stress) const override {
    batch(0, gradients, fibres, energy, stress);
  }
  [[nodiscard]] Matrix9 tangent(const Matrix3& gradient, const FibreFrame& fibre) const override {
    return slope(moduli_.bulk_modulus, gradient, fibre);
  }
  [[nodiscard]] Matrix9 tangent_isochoric(const Matrix3& gradient, const FibreFrame& fibre) const override {
    return slope(0, gradient, fibre);
  }
  [[nodiscard]] FibreFrame own_fibres() const override { return own_; }
  [[nodiscard]] bool small_strain_only() const override { return Model::any_gradient; }
  [[nodiscard]] double volumetric_energy(double j) const override {
    const double bulk = moduli_.bulk_modulus;
    if constexpr (Model::any_gradient)
      return 0.5 * bulk * (j - 1) * (j - 1);
    else
      return j > 0 ? 0.25 * bulk * (j * j - 1 - 2 * std::log(j)) : std::numeric_limits<double>::infinity();
  }
  [[nodiscard]] double pressure(double j) const override {
    return Model::any_gradient ? moduli_.bulk_modulus * (j - 1) : 0.5 * moduli_.bulk_modulus * (j - 1 / j);
  }
  [[nodiscard]] double bulk_slope(double j) const override {
    return Model::any_gradient ? moduli_.bulk_modulus : 0.5 * moduli_.bulk_modulus * (1 + 1 / (j * j));
  }
  [[nodiscard]] ElasticConstants small_strain() const override { return moduli_; }
  [[nodiscard]] std::string name() const override { return Model::name; }

 private:
  void batch(double bulk, std::span<const Matrix3> gradients, std::span<const FibreFrame> fibres,
             std::span<double> energy, std::span<Matrix3> stress) const {
    const std::size_t count = gradients.size();
    if (energy.size() != count || stress.size() != count || !(fibres.empty() || fibres.size() == count))
      throw InputError(
          fmt::format("law {}: {} gradients, {} fibre frames, {} energies, {} stresses; lengths must agree",
                      Model::name, count, fibres.size(), energy.size(), stress.size()));
    if (count == 0)
      return;
    static_assert(sizeof(Matrix3) == 9 * sizeof(double) && sizeof(FibreFrame) == 6 * sizeof(double));
    const FibreFrame& first = fibres.empty() ? own_ : fibres.front();
    law_kernel::dispatched().evaluate[index_]({.constants = constants_.values.data(),
                                               .bulk = bulk,
                                               .count = count,
                                               .gradients = gradients.front().data(),
                                               .frames = first.direction.front().data(),
                                               .frame_stride = fibres.empty() ? 0U : 6U,
                                               .energy = energy.data(),
                                               .stress = stress.front().data()});
  }

  [[nodiscard]] Matrix9 slope(double bulk, const Matrix3& gradient, const FibreFrame& frame) const {
    Matrix9 tangent = Matrix9::Zero();
    if (!Model::any_gradient && !(gradient.determinant() > 0))
      return tangent;
    Dual<9> f[9], stress[9];
    for (int k = 0; k < 9; ++k)
      f[k] = Dual<9>::variable(gradient.data()[k], k);
    model_.evaluate(f, frame.direction.front().data(), bulk, stress);
    for (int row = 0; row < 9; ++row)
      for (int column = 0; column < 9; ++column)
        tangent(row, column) = stress[row].slope[column];
    return tangent;
  }

  LawConstants constants_;
  Model model_;
  ElasticConstants moduli_;
  FibreFrame own_;
  std::size_t index_; // in LawSpec::law
};

/// Calls `visit` with the type of the model that the law has.
template <class Visit, class... Model>
void with_model(const LawSpec& spec, const Visit& visit, ModelList<Model...> /*models*/) {
  static_assert(sizeof...(Model) == std::variant_size_v<decltype(LawSpec::law)>, "a law without a model");
  std::size_t index = 0;
  const auto visit_one = [&]<class One>() {
    if (index++ == spec.law.index())
      visit.template operator()<One>();
  };
  (visit_one.template operator()<Model>(), ...);
}

} // namespace

const char* law_name(const LawSpec& spec) {
  const char* name = "";
  with_model(
      spec, [&]<class Model>() { name = Model::name; }, Models{});
  return name;
}

std::unique_ptr<Law> make_law_unchecked(const LawSpec& spec) {
  const LawConstants constants = law_constants(spec);
  std::unique_ptr<Law> law;
  with_model(
      spec, [&]<class Model>() { law = std::make_unique<ModelLaw<Model>>(spec, constants); }, Models{});
  return law;
}

std::unique_ptr<Law> make_law(const LawSpec& spec) {
  check_law(spec);
  return make_law_unchecked(spec);
}

} // namespace spherecut::solvers
