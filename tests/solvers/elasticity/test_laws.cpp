#include "solvers/elasticity/dual.hpp"
#include "solvers/elasticity/law_checks.hpp"
#include "solvers/elasticity/law_kernel.hpp"
#include "tests/solvers/elasticity/sample_laws.hpp"

#include <catch2/catch.hpp>
#include <cstring>

using namespace spherecut;
using namespace spherecut::solvers;
using tests::at;
using tests::PointState;
using tests::sample_gradients;
using tests::sample_laws;

namespace {

#include "solvers/elasticity/models.inl"

/// dW/dF by dual numbers carried through the energy alone, and the stress that the model gives itself.
template <class Model>
void energy_slope(const LawSpec& spec, const Matrix3& f, Matrix3& slope, Matrix3& stress) {
  const LawConstants constants = law_constants(spec);
  const Model model(constants.values.data());
  const FibreFrame frame = law_fibres(spec);
  Dual<9> dual[9], p[9];
  for (int k = 0; k < 9; ++k)
    dual[k] = Dual<9>::variable(f.data()[k], k);
  const Dual<9> energy = model.evaluate(dual, frame.direction[0].data(), spec.bulk_modulus, p);
  for (int k = 0; k < 9; ++k) {
    slope.data()[k] = energy.slope[k];
    stress.data()[k] = p[k].value;
  }
}

Matrix9 hooke(const ElasticConstants& moduli) {
  Matrix9 c = Matrix9::Zero();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      c(i + 3 * i, j + 3 * j) += moduli.bulk_modulus - 2.0 / 3 * moduli.shear_modulus;
      c(i + 3 * j, i + 3 * j) += moduli.shear_modulus;
      c(i + 3 * j, j + 3 * i) += moduli.shear_modulus;
    }
  return c;
}

} // namespace

TEST_CASE("The stress of every law is the derivative of its energy, and the tangent that of the stress") {
  for (const double nu : {0.3, 0.49})
    for (const LawSpec& spec : sample_laws(nu)) {
      const std::unique_ptr<Law> law = make_law(spec);
      INFO(law->name() << ", nu = " << nu);
      for (const Matrix3& f : sample_gradients(20, 0.25, 3))
        for (const bool volumetric : {true, false}) {
          const Matrix3 stress = at(*law, f, volumetric).stress;
          const Matrix9 tangent =
              volumetric ? law->tangent(f, law->own_fibres()) : law->tangent_isochoric(f, law->own_fibres());
          Matrix3 slope;
          Matrix9 slopes;
          for (int k = 0; k < 9; ++k) { // central differences of fourth order
            constexpr double h = 1e-3;
            const auto moved = [&](double by) {
              Matrix3 g = f;
              g.data()[k] += by;
              return at(*law, g, volumetric);
            };
            const PointState a = moved(h), b = moved(-h), c = moved(2 * h), d = moved(-2 * h);
            slope.data()[k] = (8 * (a.energy - b.energy) - (c.energy - d.energy)) / (12 * h);
            const Matrix3 change = (8 * (a.stress - b.stress) - (c.stress - d.stress)) / (12 * h);
            slopes.col(k) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(change.data());
          }
          CHECK((slope - stress).norm() < 2e-7 * tangent.norm() * 1e-1 + 1e-6 * stress.norm());
          CHECK((slopes - tangent).norm() < 1e-6 * tangent.norm());
          CHECK((tangent - tangent.transpose()).norm() < 1e-13 * tangent.norm());
        }
    }
}

TEST_CASE("Dual numbers through the energy give the stress to the last digits") {
  for (const LawSpec& spec : sample_laws(0.45))
    for (const Matrix3& f : sample_gradients(50, 0.3, 5)) {
      INFO(law_name(spec));
      Matrix3 slope, stress;
      switch (spec.law.index()) {
      case 0:
        energy_slope<LinearModel>(spec, f, slope, stress);
        break;
      case 1:
        energy_slope<NeoHookeanModel>(spec, f, slope, stress);
        break;
      case 2:
        energy_slope<YeohModel>(spec, f, slope, stress);
        break;
      case 3:
        energy_slope<OgdenModel>(spec, f, slope, stress);
        break;
      default:
        energy_slope<HolzapfelModel>(spec, f, slope, stress);
      }
      CHECK((slope - stress).norm() < 1e-12 * stress.norm());
      const PointState state = at(*make_law(spec), f);
      CHECK((slope - state.stress).norm() < 1e-12 * stress.norm());
    }
}

TEST_CASE("Ogden's tangent is regular where stretches meet") {
  const std::unique_ptr<Law> law = make_law(sample_laws(0.45)[3]);
  for (const Vector3& stretches : {Vector3(1, 1, 1), Vector3(1.3, 1.3, 0.7), Vector3(1.3, 1.3 + 1e-9, 0.7),
                                   Vector3(1.3, 1.3 + 1e-5, 0.7), Vector3(0.6, 0.6, 0.6)}) {
    const Matrix3 f = tests::sample_rotation(1) * Matrix3(stretches.asDiagonal()) * tests::sample_rotation(2);
    const Matrix9 tangent = law->tangent(f, {});
    for (int k = 0; k < 9; ++k) {
      constexpr double h = 1e-3;
      const auto moved = [&](double by) {
        Matrix3 g = f;
        g.data()[k] += by;
        return at(*law, g).stress;
      };
      const Matrix3 slope = (8 * (moved(h) - moved(-h)) - (moved(2 * h) - moved(-2 * h))) / (12 * h);
      const Matrix3 column = Eigen::Map<const Matrix3>(tangent.col(k).data());
      CHECK((slope - column).norm() < 1e-7 * tangent.norm());
    }
  }
}

TEST_CASE("A rotation turns the stress and costs no energy") {
  for (const LawSpec& spec : sample_laws(0.49)) {
    const std::unique_ptr<Law> law = make_law(spec);
    INFO(law->name());
    const Matrix3 q = tests::sample_rotation(7);
    if (law->small_strain_only()) {
      CHECK(at(*law, q).energy > 0.1 * spec.bulk_modulus); // said of it: rotation strains
      continue;
    }
    CHECK(at(*law, q).stress.norm() < 1e-13 * spec.bulk_modulus);
    for (const Matrix3& f : sample_gradients(20, 0.3, 9)) {
      const PointState still = at(*law, f), turned = at(*law, q * f);
      CHECK(turned.energy == Approx(still.energy).epsilon(1e-11));
      CHECK((turned.stress - q * still.stress).norm() < 1e-11 * still.stress.norm());
    }
  }
}

TEST_CASE("Isotropic laws do not feel how the body lay before") {
  for (const LawSpec& spec : sample_laws(0.45)) {
    if (std::holds_alternative<HolzapfelLaw>(spec.law))
      continue;
    const std::unique_ptr<Law> law = make_law(spec);
    const Matrix3 q = tests::sample_rotation(8);
    for (const Matrix3& f : sample_gradients(10, 0.3, 11)) {
      const Matrix3 g = law->small_strain_only() ? Matrix3(q.transpose() * f * q) : Matrix3(f * q);
      CHECK(at(*law, g).energy == Approx(at(*law, f).energy).epsilon(1e-11));
    }
  }
}

TEST_CASE("Small strains follow Hooke's law with the moduli that the law tells") {
  for (const double nu : {0.0, 0.3, 0.499})
    for (const LawSpec& spec : sample_laws(nu)) {
      const std::unique_ptr<Law> law = make_law(spec);
      INFO(law->name() << ", nu = " << nu);
      const ElasticConstants moduli = law->small_strain();
      CHECK(moduli.poisson_ratio() == Approx(nu).margin(1e-12));
      CHECK(moduli.young_modulus() == Approx(2 * 3e3 * (1 + nu)));
      const Matrix9 exact = hooke(moduli);
      // Pressed from all sides a little, no fibre pulls.
      const Matrix3 rest = (1 - 1e-9) * Matrix3::Identity();
      CHECK((law->tangent(rest, law->own_fibres()) - exact).norm() < 1e-7 * exact.norm());
      // A strain by which fibres shorten.
      Matrix3 strain;
      strain << -3, 1, 0.4, 0.2, -2, -0.7, 0.5, 0.1, -2.5;
      const Eigen::Matrix<double, 9, 1> flat = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(strain.data());
      const Eigen::Matrix<double, 9, 1> hooke_stress = exact * flat;
      double error[2];
      for (int k = 0; k < 2; ++k) {
        const double size = k == 0 ? 1e-4 : 1e-5;
        const Matrix3 stress = at(*law, Matrix3::Identity() + size * strain).stress / size;
        error[k] =
            (Eigen::Map<const Eigen::Matrix<double, 9, 1>>(stress.data()) - hooke_stress).norm() / hooke_stress.norm();
      }
      CHECK(error[1] < 1e-3);
      if (!law->small_strain_only())
        CHECK(error[0] / error[1] == Approx(10).epsilon(0.1)); // of first order
    }
}

TEST_CASE("Fibres add 4 k1 along them in small tension and nothing in compression") {
  HolzapfelLaw fibres = tests::sample_fibres(0);
  fibres.families = 1;
  fibres.directions = {Vector3(1, 2, 2).normalized()};
  const Vector3 a = fibres.directions[0];
  const double bulk = bulk_modulus_of(fibres.shear_modulus, 0.45);
  const std::unique_ptr<Law> law = make_law({fibres, bulk, {}}), ground = make_law({NeoHookeanLaw{3e3}, bulk, {}});
  constexpr double strain = 1e-6;
  for (const double sign : {1.0, -1.0}) {
    const Matrix3 f = Matrix3::Identity() + sign * strain * a * a.transpose();
    const double more = a.dot((at(*law, f).stress - at(*ground, f).stress) * a) / strain;
    CHECK(more == Approx(sign > 0 ? 4 * fibres.fibre_modulus : 0).epsilon(1e-5).margin(1e-6));
  }
}

TEST_CASE("The energy is that of its two parts, and the volumetric part has the slopes it tells") {
  for (const LawSpec& spec : sample_laws(0.49)) {
    const std::unique_ptr<Law> law = make_law(spec);
    INFO(law->name());
    for (const Matrix3& f : sample_gradients(10, 0.3, 13)) {
      const double j = law->small_strain_only() ? f.trace() - 2 : f.determinant();
      const PointState whole = at(*law, f), part = at(*law, f, false);
      CHECK(whole.energy == Approx(part.energy + law->volumetric_energy(j)).epsilon(1e-10));
      const Matrix3 slope =
          law->small_strain_only() ? Matrix3(Matrix3::Identity()) : Matrix3(f.determinant() * f.inverse().transpose());
      CHECK((whole.stress - part.stress - law->pressure(j) * slope).norm() < 1e-10 * whole.stress.norm());
      constexpr double h = 1e-4;
      CHECK((law->volumetric_energy(j + h) - law->volumetric_energy(j - h)) / (2 * h) ==
            Approx(law->pressure(j)).epsilon(1e-5).margin(1e-6 * spec.bulk_modulus));
      CHECK((law->pressure(j + h) - law->pressure(j - h)) / (2 * h) == Approx(law->bulk_slope(j)).epsilon(1e-5));
    }
    CHECK(law->bulk_slope(1) == Approx(spec.bulk_modulus));
  }
}

TEST_CASE("Kernels of all instruction sets agree, and a point has the same bits wherever it stands") {
  for (const LawSpec& spec : sample_laws(0.49)) {
    INFO(law_name(spec));
    constexpr std::size_t count = 61; // no multiple of a width
    const std::vector<Matrix3> f = sample_gradients(count, 0.3, 17);
    const LawConstants constants = law_constants(spec);
    const FibreFrame frame = law_fibres(spec);
    const auto run = [&](const law_kernel::Kernel& kernel, std::size_t first, std::size_t points,
                         std::vector<double>& energy, std::vector<Matrix3>& stress) {
      energy.assign(points, -1);
      stress.assign(points, Matrix3::Zero());
      kernel.evaluate[spec.law.index()]({.constants = constants.values.data(),
                                         .bulk = spec.bulk_modulus,
                                         .count = points,
                                         .gradients = f[first].data(),
                                         .frames = frame.direction[0].data(),
                                         .frame_stride = 0,
                                         .energy = energy.data(),
                                         .stress = stress[0].data()});
    };
    std::vector<double> energy, other_energy;
    std::vector<Matrix3> stress, other_stress;
    run(law_kernel::portable(), 0, count, energy, stress);
    std::vector<const law_kernel::Kernel*> kernels{&law_kernel::portable()};
    const std::string widest = law_kernel::dispatched().name;
    if (widest != "portable")
      kernels.push_back(law_kernel::avx2());
    if (widest == "avx512")
      kernels.push_back(law_kernel::avx512());
    for (const law_kernel::Kernel* kernel : kernels) {
      INFO(kernel->name);
      run(*kernel, 0, count, other_energy, other_stress);
      for (std::size_t k = 0; k < count; ++k) {
        CHECK(other_energy[k] == Approx(energy[k]).epsilon(1e-13));
        CHECK((other_stress[k] - stress[k]).norm() < 1e-13 * stress[k].norm() + 1e-13 * spec.bulk_modulus);
      }
      std::vector<double> alone;
      std::vector<Matrix3> stress_alone;
      for (std::size_t k = 0; k < count; k += 7) {
        run(*kernel, k, 1, alone, stress_alone);
        CHECK(std::memcmp(&alone[0], &other_energy[k], sizeof(double)) == 0);
        CHECK(std::memcmp(stress_alone[0].data(), other_stress[k].data(), sizeof(Matrix3)) == 0);
      }
    }
  }
}

TEST_CASE("Inverted and overstretched points have infinite energy and no stress; their neighbours feel nothing") {
  const double infinite = std::numeric_limits<double>::infinity();
  for (const LawSpec& spec : sample_laws(0.45)) {
    const std::unique_ptr<Law> law = make_law(spec);
    INFO(law->name());
    std::vector<Matrix3> f = sample_gradients(9, 0.2, 19);
    f[2] = Vector3(1, 1, -0.1).asDiagonal();
    f[4].setZero();
    f[6] = Vector3(300, 300, 1).asDiagonal(); // exp(k2 E^2) is beyond double
    std::vector<double> energy(9);
    std::vector<Matrix3> stress(9);
    law->evaluate(f, {}, energy, stress);
    for (std::size_t k = 0; k < 9; ++k) {
      const bool inverted = k == 2 || k == 4, overstretched = k == 6 && std::holds_alternative<HolzapfelLaw>(spec.law);
      if ((inverted && !law->small_strain_only()) || overstretched) {
        CHECK(energy[k] == infinite);
        CHECK(stress[k].isZero(0));
        if (inverted)
          CHECK(law->tangent(f[k], law->own_fibres()).isZero(0));
      } else {
        CHECK(std::isfinite(energy[k]));
        CHECK(stress[k].allFinite());
        CHECK(energy[k] == at(*law, f[k]).energy);
      }
    }
  }
}

TEST_CASE("Frames of points stand in for the law's own directions") {
  const LawSpec spec = sample_laws(0.45)[4];
  const std::unique_ptr<Law> law = make_law(spec);
  LawSpec open = spec;
  std::get<HolzapfelLaw>(open.law).same_everywhere = false;
  std::get<HolzapfelLaw>(open.law).directions.clear();
  const std::unique_ptr<Law> other = make_law(open);
  const std::vector<Matrix3> f = sample_gradients(5, 0.2, 21);
  const std::vector<FibreFrame> frames(5, law->own_fibres());
  std::vector<double> energy(5), own_energy(5);
  std::vector<Matrix3> stress(5), own_stress(5);
  law->evaluate(f, {}, own_energy, own_stress);
  other->evaluate(f, frames, energy, stress);
  for (std::size_t k = 0; k < 5; ++k) {
    CHECK(energy[k] == own_energy[k]);
    CHECK(stress[k] == own_stress[k]);
  }
  CHECK_THROWS_AS(law->evaluate(f, std::span(frames).first(4), energy, stress), InputError);
  CHECK_THROWS_AS(law->evaluate(f, {}, std::span(energy).first(4), stress), InputError);
}
