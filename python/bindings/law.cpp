// Material laws: those of the library, and laws that are functions of Python's.
#include "python/bindings/floors.hpp"
#include "python/bindings/held.hpp"
#include "solvers/elasticity/function_law.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::bindings {
namespace {

using namespace py::literals;
using solvers::Law;
using solvers::Matrix9;
using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

std::vector<Matrix3> gradients_from(const Doubles& array) {
  const bool one = array.ndim() == 2;
  if (array.ndim() < 2 || array.ndim() > 3 || array.shape(one ? 0 : 1) != 3 || array.shape(one ? 1 : 2) != 3)
    throw InputError(fmt::format("gradients: an array of shape {}; allowed: (n, 3, 3), or (3, 3) for one",
                                 std::string(py::str(array.attr("shape")))));
  std::vector<Matrix3> gradients(one ? 1 : static_cast<std::size_t>(array.shape(0)));
  for (std::size_t n = 0; n < gradients.size(); ++n)
    gradients[n] = Eigen::Map<const RowMajor3>(array.data() + 9 * n);
  if (const auto bad =
          std::find_if(gradients.begin(), gradients.end(), [](const Matrix3& f) { return !f.allFinite(); });
      bad != gradients.end())
    throw InputError(
        fmt::format("gradients: number {} is not finite; allowed: finite numbers", bad - gradients.begin()));
  return gradients;
}

/// (n, 3, 3), or (3, 3): an array of its own in C order, which the function may keep and change.
Doubles array_of_gradients(std::span<const Matrix3> gradients, bool one) {
  std::vector<py::ssize_t> shape{3, 3};
  if (!one)
    shape.insert(shape.begin(), std::ssize(gradients));
  Doubles array(shape);
  double* out = array.mutable_data();
  for (std::size_t n = 0; n < gradients.size(); ++n)
    Eigen::Map<RowMajor3>(out + 9 * n) = gradients[n];
  return array;
}

thread_local int law_functions = 0; // that this thread is in

struct InLawFunction {
  InLawFunction() { ++law_functions; }
  ~InLawFunction() { --law_functions; }
  InLawFunction(const InLawFunction&) = delete;
  InLawFunction& operator=(const InLawFunction&) = delete;
};

/// A function of Python's of n gradients, each with `inner` numbers for a value.
class ArrayFunction {
 public:
  ArrayFunction(const py::object& function, const char* name, std::vector<py::ssize_t> inner, bool many)
      : function_(function), name_(name), inner_(std::move(inner)), many_(many) {
    if (PyCallable_Check(function.ptr()) == 0)
      throw InputError(fmt::format("{}: {}; allowed: a function", name, std::string(py::repr(function))));
  }

  /// take(n, numbers) for every value, in order.
  template <class Take>
  void operator()(std::span<const Matrix3> gradients, const Take& take) const {
    const py::gil_scoped_acquire acquire;
    std::size_t size = 1;
    for (const py::ssize_t axis : inner_)
      size *= static_cast<std::size_t>(axis);
    if (many_) {
      const Doubles values = called(gradients, false);
      for (std::size_t n = 0; n < gradients.size(); ++n)
        take(n, values.data() + size * n);
    } else {
      for (std::size_t n = 0; n < gradients.size(); ++n)
        take(n, called(gradients.subspan(n, 1), true).data());
    }
  }

 private:
  [[nodiscard]] Doubles called(std::span<const Matrix3> gradients, bool one) const {
    const InLawFunction inside; // until it returns
    const py::object value = (*function_)(array_of_gradients(gradients, one));
    Doubles array = Doubles::ensure(value);
    if (!array) {
      PyErr_Clear();
      throw InputError(fmt::format("{}: {}; allowed: an array of numbers", name_, std::string(py::repr(value))));
    }
    std::vector<py::ssize_t> shape = inner_;
    if (!one)
      shape.insert(shape.begin(), std::ssize(gradients));
    if (!std::equal(shape.begin(), shape.end(), array.shape(), array.shape() + array.ndim()))
      throw InputError(fmt::format(
          "{}: an array of shape {} for {}; allowed: {}", name_, std::string(py::str(array.attr("shape"))),
          one ? "one F" : fmt::format("{} of F", gradients.size()), std::string(py::str(py::tuple(py::cast(shape))))));
    return array;
  }

  Kept function_;
  const char* name_;
  std::vector<py::ssize_t> inner_;
  bool many_;
};

std::shared_ptr<Law> law_of_functions(const py::object& energy, const py::object& stress, const py::object& tangent,
                                      double bulk_modulus, const std::string& name, bool many) {
  solvers::LawFunctions functions;
  functions.energy = [call = ArrayFunction(energy, "energy", {}, many)](std::span<const Matrix3> f,
                                                                        std::span<double> out) {
    call(f, [&](std::size_t n, const double* value) { out[n] = *value; });
  };
  if (!stress.is_none())
    functions.stress = [call = ArrayFunction(stress, "stress", {3, 3}, many)](std::span<const Matrix3> f,
                                                                              std::span<Matrix3> out) {
      call(f, [&](std::size_t n, const double* value) { out[n] = Eigen::Map<const RowMajor3>(value); });
    };
  if (!tangent.is_none())
    functions.tangent = [call = ArrayFunction(tangent, "tangent", {3, 3, 3, 3}, many)](std::span<const Matrix3> f,
                                                                                       std::span<Matrix9> out) {
      call(f, [&](std::size_t n, const double* value) {
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j)
            for (int k = 0; k < 3; ++k)
              for (int l = 0; l < 3; ++l)
                out[n](i + 3 * j, k + 3 * l) = *value++;
      });
    };
  functions.bulk_modulus = bulk_modulus;
  functions.name = name;
  return unlocked([&] { return std::shared_ptr<Law>(solvers::make_function_law(std::move(functions))); });
}

std::shared_ptr<Law> built_in(decltype(solvers::LawSpec::law) law, double bulk_modulus) {
  return unlocked([&] { return std::shared_ptr<Law>(solvers::make_law({std::move(law), bulk_modulus, {}})); });
}

std::shared_ptr<Law> ogden(const Doubles& terms, double bulk_modulus) {
  if (terms.ndim() != 2 || terms.shape(1) != 2)
    throw InputError(
        fmt::format("terms: an array of shape {}; allowed: (terms, 2)", std::string(py::str(terms.attr("shape")))));
  solvers::OgdenLaw law;
  for (py::ssize_t k = 0; k < terms.shape(0); ++k)
    law.terms.push_back({terms.at(k, 0), terms.at(k, 1)});
  return built_in(std::move(law), bulk_modulus);
}

std::shared_ptr<Law> holzapfel(double shear_modulus, double fibre_modulus, double fibre_exponent,
                               const Doubles& directions, double bulk_modulus, double dispersion) {
  solvers::HolzapfelLaw law;
  law.shear_modulus = shear_modulus;
  law.fibre_modulus = fibre_modulus;
  law.fibre_exponent = fibre_exponent;
  law.dispersion = dispersion;
  for (const Vector3& direction : one_or_more_points(directions, "directions"))
    law.directions.push_back(direction.normalized());
  law.families = static_cast<int>(law.directions.size());
  return built_in(std::move(law), bulk_modulus);
}

struct Values {
  std::vector<double> energy;
  std::vector<Matrix3> stress;
};

Values values_of_law(const Law& law, const Doubles& gradients) {
  const std::vector<Matrix3> f = gradients_from(gradients);
  Values values{std::vector<double>(f.size()), std::vector<Matrix3>(f.size())};
  unlocked([&] { law.evaluate(f, {}, values.energy, values.stress); });
  return values;
}

py::array tangents_of(const Law& law, const Doubles& gradients) {
  const std::vector<Matrix3> f = gradients_from(gradients);
  std::vector<Matrix9> tangents(f.size());
  unlocked([&] {
    for (std::size_t n = 0; n < f.size(); ++n)
      tangents[n] = law.tangent(f[n], law.own_fibres());
  });
  Doubles array(std::vector<py::ssize_t>{std::ssize(f), 3, 3, 3, 3});
  double* out = array.mutable_data();
  for (const Matrix9& tangent : tangents)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        for (int k = 0; k < 3; ++k)
          for (int l = 0; l < 3; ++l)
            *out++ = tangent(i + 3 * j, k + 3 * l);
  return array;
}

void bind_built_in(py::class_<Law, std::shared_ptr<Law>>& law) {
  law.def_static(
         "linear", [](double shear, double bulk) { return built_in(solvers::LinearLaw{shear}, bulk); },
         "shear_modulus"_a, "bulk_modulus"_a, "Small strain: W = mu dev e : dev e + kappa/2 (tr e)^2. Moduli: Pa.")
      .def_static(
          "neo_hookean", [](double shear, double bulk) { return built_in(solvers::NeoHookeanLaw{shear}, bulk); },
          "shear_modulus"_a, "bulk_modulus"_a,
          "W = mu/2 (J^(-2/3) tr F^T F - 3) + U(J), U = kappa/4 (J^2 - 1 - 2 ln J). Moduli: Pa.")
      .def_static(
          "yeoh",
          [](double c1, double c2, double c3, double bulk) {
            return built_in(solvers::YeohLaw{c1, c2, c3}, bulk);
          },
          "c1"_a, "c2"_a, "c3"_a, "bulk_modulus"_a,
          "W = c1 (I - 3) + c2 (I - 3)^2 + c3 (I - 3)^3 + U(J), I = J^(-2/3) tr F^T F. All in Pa.")
      .def_static("ogden", &ogden, "terms"_a, "bulk_modulus"_a,
                  "W = sum of mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3) + U(J), l the stretches times "
                  "J^(-1/3). terms: (1 to 3, 2) of mu_p, Pa, and alpha_p.")
      .def_static(
          "holzapfel_gasser_ogden", &holzapfel, "shear_modulus"_a, "fibre_modulus"_a, "fibre_exponent"_a,
          "directions"_a, "bulk_modulus"_a, "dispersion"_a = 0.0,
          "The neo-Hookean law with one or two families of fibres, which bear tension alone. fibre_modulus: k1, "
          "Pa. fibre_exponent: k2. directions: (1 or 2, 3), or (3,). dispersion: 0 to 1/3.");
}

} // namespace

bool in_law_function() {
  return law_functions > 0;
}

void bind_law(py::module_& module) {
  py::class_<Law, std::shared_ptr<Law>> law(
      module, "Law",
      "A hyperelastic law: strain energy and stress as functions of the deformation gradient F, (3, 3), at finite "
      "strain. The built-in ones raise InputError for constants with which they are not stable.");
  bind_built_in(law);
  law.def_static(
         "of_functions", &law_of_functions, "energy"_a, "stress"_a = py::none(), "tangent"_a = py::none(),
         py::kw_only(), "bulk_modulus"_a = 0.0, "name"_a = "functions", "many"_a = true,
         "A law from functions of F, (n, 3, 3), det F > 0. energy: W, (n,), J/m3; inf where the law cannot be asked. "
         "stress: first Piola stress dW/dF, (n, 3, 3), Pa. tangent: dP_ij/dF_kl, (n, 3, 3, 3, 3), Pa. Without tangent "
         "it is made by central differences of the stress, without stress that by differences of the energy, of fourth "
         "order in steps of 1e-3, off by 1e-9 of the shear modulus or so (docs/python.md). many=False: the functions "
         "get one F, (3, 3), at a time. bulk_modulus: kappa, Pa; above 0, U(J) = "
         "kappa/4 (J^2 - 1 - 2 ln J) is added, and near nu = 0.5 bodies take the pressure of blocks. Functions are "
         "called with the interpreter's lock, on any thread; what they raise comes out. Raises InputError where they "
         "do not fit each other at six strained states, or F = 1 bears a stress; later for values that are not finite, "
         "with F and the place in the body.")
      .def(
          "energy", [](const Law& self, const Doubles& f) { return owned(values_of_law(self, f).energy); },
          "gradients"_a, "W, (n,), J/m3 of the body at rest, at F, (n, 3, 3) or (3, 3); inf where det F <= 0.")
      .def(
          "stress", [](const Law& self, const Doubles& f) { return owned(values_of_law(self, f).stress); },
          "gradients"_a, "First Piola stress, (n, 3, 3), Pa, at F, (n, 3, 3) or (3, 3).")
      .def("tangent", &tangents_of, "gradients"_a, "dP_ij/dF_kl, (n, 3, 3, 3, 3), Pa, at F, (n, 3, 3) or (3, 3).")
      .def_property_readonly(
          "shear_modulus", [](const Law& self) { return self.small_strain().shear_modulus; },
          "mu at rest, Pa; without fibres.")
      .def_property_readonly(
          "bulk_modulus", [](const Law& self) { return self.small_strain().bulk_modulus; }, "kappa at rest, Pa.")
      .def_property_readonly(
          "young_modulus", [](const Law& self) { return self.small_strain().young_modulus(); }, "E at rest, Pa.")
      .def_property_readonly(
          "poisson_ratio", [](const Law& self) { return self.small_strain().poisson_ratio(); }, "nu at rest.")
      .def_property_readonly("name", &Law::name, "As in a scenario, or as given.");
}

} // namespace spherecut::bindings
