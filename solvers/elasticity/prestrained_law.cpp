#include "solvers/elasticity/prestrained_law.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/LU>
#include <fmt/format.h>

namespace spherecut::solvers {
namespace {

constexpr double least_volume_ratio = 0.1, most_volume_ratio = 10;

class PrestrainedLaw final : public Law {
 public:
  PrestrainedLaw(std::shared_ptr<const Law> law, const Matrix3& elastic)
      : law_(std::move(law)), elastic_(elastic), back_(elastic.inverse()), ratio_(elastic.determinant()) {
    const FibreFrame own = law_->own_fibres();
    has_own_ = !own.direction[0].isZero(0);
    own_ = stress_free(own);
  }

  void evaluate(std::span<const Matrix3> gradients, std::span<const FibreFrame> fibres, std::span<double> energy,
                std::span<Matrix3> stress) const override {
    carry(gradients, fibres, energy, stress,
          [this](auto... arguments) { law_->evaluate(std::forward<decltype(arguments)>(arguments)...); });
  }
  void evaluate_isochoric(std::span<const Matrix3> gradients, std::span<const FibreFrame> fibres,
                          std::span<double> energy, std::span<Matrix3> stress) const override {
    carry(gradients, fibres, energy, stress,
          [this](auto... arguments) { law_->evaluate_isochoric(std::forward<decltype(arguments)>(arguments)...); });
  }
  [[nodiscard]] Matrix9 tangent(const Matrix3& gradient, const FibreFrame& fibre) const override {
    return carried(law_->tangent(gradient * elastic_, stress_free_or_own(fibre)));
  }
  [[nodiscard]] Matrix9 tangent_isochoric(const Matrix3& gradient, const FibreFrame& fibre) const override {
    return carried(law_->tangent_isochoric(gradient * elastic_, stress_free_or_own(fibre)));
  }
  [[nodiscard]] FibreFrame own_fibres() const override { return law_->own_fibres(); }
  [[nodiscard]] bool small_strain_only() const override { return false; }
  [[nodiscard]] double volumetric_energy(double jacobian) const override {
    return law_->volumetric_energy(ratio_ * jacobian) / ratio_;
  }
  [[nodiscard]] double pressure(double jacobian) const override { return law_->pressure(ratio_ * jacobian); }
  [[nodiscard]] double bulk_slope(double jacobian) const override {
    return ratio_ * law_->bulk_slope(ratio_ * jacobian);
  }
  [[nodiscard]] ElasticConstants small_strain() const override { return law_->small_strain(); }
  [[nodiscard]] std::string name() const override { return law_->name(); }

 private:
  /// Directions of the given shape in the stress-free state.
  [[nodiscard]] FibreFrame stress_free(const FibreFrame& given) const {
    FibreFrame free;
    for (std::size_t family = 0; family < 2; ++family)
      if (!given.direction[family].isZero(0))
        free.direction[family] = (back_ * given.direction[family]).normalized();
    return free;
  }
  [[nodiscard]] FibreFrame stress_free_or_own(const FibreFrame& given) const {
    return given.direction[0].isZero(0) ? own_ : stress_free(given);
  }

  template <class Evaluate>
  void carry(std::span<const Matrix3> gradients, std::span<const FibreFrame> fibres, std::span<double> energy,
             std::span<Matrix3> stress, const Evaluate& evaluate) const {
    std::vector<Matrix3> elastic;
    elastic.reserve(gradients.size());
    for (const Matrix3& f : gradients)
      elastic.emplace_back(f * elastic_);
    std::vector<FibreFrame> frames;
    for (const FibreFrame& frame : fibres)
      frames.push_back(stress_free_or_own(frame));
    if (fibres.empty() && has_own_)
      frames.assign(gradients.size(), own_);
    evaluate(std::span<const Matrix3>(elastic), std::span<const FibreFrame>(frames), energy, stress);
    const Matrix3 back = elastic_.transpose() / ratio_;
    for (std::size_t k = 0; k < gradients.size(); ++k) {
      energy[k] /= ratio_;
      stress[k] = (stress[k] * back).eval();
    }
  }

  // P'_iJ = P_ia F0_Ja / det F0, and its slope by F_kL likewise.
  [[nodiscard]] Matrix9 carried(const Matrix9& tangent) const {
    Matrix9 result = Matrix9::Zero();
    for (int j = 0; j < 3; ++j)
      for (int l = 0; l < 3; ++l)
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b)
            result.block<3, 3>(3 * j, 3 * l) +=
                elastic_(j, a) * elastic_(l, b) / ratio_ * tangent.block<3, 3>(3 * a, 3 * b);
    return result;
  }

  std::shared_ptr<const Law> law_;
  Matrix3 elastic_, back_;
  double ratio_; // det F_0
  FibreFrame own_;
  bool has_own_ = false;
};

} // namespace

std::shared_ptr<const Law> prestrained(std::shared_ptr<const Law> law, const Matrix3& elastic) {
  if (law == nullptr)
    throw InputError("a pre-strain needs a law");
  if (law->small_strain_only())
    throw InputError("law " + law->name() + ": a multiplicative pre-strain is one of laws of finite strain");
  const double ratio = elastic.determinant();
  if (!elastic.allFinite() || !(ratio >= least_volume_ratio && ratio <= most_volume_ratio))
    throw InputError(fmt::format("pre-strain with a volume ratio of {:g}; allowed: {:g} to {:g}", ratio,
                                 least_volume_ratio, most_volume_ratio));
  return std::make_shared<PrestrainedLaw>(std::move(law), elastic);
}

} // namespace spherecut::solvers
