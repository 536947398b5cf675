// A law in a strained shape against the law itself, and its derivatives by differences.
#include "solvers/elasticity/prestrained_law.hpp"
#include "tests/solvers/elasticity/sample_laws.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::solvers;
using namespace spherecut::tests;

namespace {

Matrix3 sample_elastic() {
  return sample_gradients(1, 0.1, 11).front();
}

} // namespace

TEST_CASE("Energy and stress of a strained shape are those of the law between it and the stress-free state") {
  const Matrix3 elastic = sample_elastic();
  const double ratio = elastic.determinant();
  for (LawSpec spec : sample_laws(0.45)) {
    if (std::holds_alternative<LinearLaw>(spec.law))
      continue;
    std::shared_ptr<const Law> free = make_law(spec);
    if (auto* fibres = std::get_if<HolzapfelLaw>(&spec.law)) // of the given shape: those that lie along the same lines
      for (Vector3& direction : fibres->directions)
        direction = (elastic * direction).normalized();
    const std::shared_ptr<const Law> law = prestrained(make_law(spec), elastic);
    INFO(law->name());
    for (const Matrix3& f : sample_gradients(5, 0.2, 5)) {
      const PointState there = at(*free, f * elastic), here = at(*law, f);
      CHECK(here.energy == Approx(there.energy / ratio).epsilon(1e-12));
      CHECK((here.stress - there.stress * elastic.transpose() / ratio).norm() < 1e-12 * here.stress.norm());
      // The same Cauchy stress.
      const double j = f.determinant();
      CHECK((here.stress * f.transpose() / j - there.stress * (f * elastic).transpose() / (j * ratio)).norm() <
            1e-12 * here.stress.norm());
      const PointState shape = at(*law, f, false);
      CHECK(here.energy - shape.energy == Approx(law->volumetric_energy(j)).epsilon(1e-9).margin(1e-9 * here.energy));
    }
    // Nothing is stressed where the pre-strain is undone.
    CHECK(at(*law, elastic.inverse()).stress.norm() < 1e-9 * law->small_strain().shear_modulus);
  }
}

TEST_CASE("The stress of a strained shape is the slope of its energy, its tangent that of the stress") {
  for (const LawSpec& spec : sample_laws(0.49)) {
    if (std::holds_alternative<LinearLaw>(spec.law))
      continue;
    const std::shared_ptr<const Law> law = prestrained(make_law(spec), sample_elastic());
    INFO(law->name());
    for (const Matrix3& f : sample_gradients(5, 0.15, 9))
      for (const bool volumetric : {true, false}) {
        const Matrix3 stress = at(*law, f, volumetric).stress;
        const Matrix9 tangent =
            volumetric ? law->tangent(f, law->own_fibres()) : law->tangent_isochoric(f, law->own_fibres());
        constexpr double h = 1e-3;
        for (int k = 0; k < 9; ++k) {
          const auto moved = [&](double by) {
            Matrix3 g = f;
            g.data()[k] += by;
            return at(*law, g, volumetric);
          };
          const PointState a = moved(h), b = moved(-h), c = moved(2 * h), d = moved(-2 * h);
          CHECK((8 * (a.energy - b.energy) - (c.energy - d.energy)) / (12 * h) ==
                Approx(stress.data()[k]).margin(1e-7 * tangent.norm()));
          const Matrix3 change = (8 * (a.stress - b.stress) - (c.stress - d.stress)) / (12 * h);
          CHECK((Eigen::Map<const Eigen::Matrix<double, 9, 1>>(change.data()) - tangent.col(k)).norm() <
                1e-6 * tangent.norm());
        }
      }
    constexpr double h = 1e-5;
    for (const double j : {0.8, 1.0, 1.3}) {
      CHECK((law->volumetric_energy(j + h) - law->volumetric_energy(j - h)) / (2 * h) ==
            Approx(law->pressure(j)).margin(1e-6 * law->bulk_slope(j)));
      CHECK((law->pressure(j + h) - law->pressure(j - h)) / (2 * h) == Approx(law->bulk_slope(j)).epsilon(1e-6));
    }
  }
}

TEST_CASE("A pre-strain that is none is refused") {
  const auto law = [] { return std::shared_ptr<const Law>(make_law({NeoHookeanLaw{1}, 10, {}})); };
  CHECK_THROWS_AS(prestrained(nullptr, Matrix3::Identity()), InputError);
  CHECK_THROWS_AS(prestrained(make_law({LinearLaw{1}, 10, {}}), Matrix3::Identity()), InputError);
  CHECK_THROWS_AS(prestrained(law(), Matrix3(0.1 * Matrix3::Identity())), InputError);
  CHECK_THROWS_AS(prestrained(law(), Matrix3(-Matrix3::Identity())), InputError);
  CHECK_THROWS_AS(prestrained(law(), Matrix3::Constant(std::nan(""))), InputError);
}
