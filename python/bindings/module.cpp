// The Python module spherecut._core. The package around it is python/spherecut.
#include "python/bindings/calls.hpp"
#include "python/bindings/floors.hpp"
#include "solvers/algebra/parallel.hpp"
#include "src/base/output_file.hpp"
#include "src/base/process_settings.hpp"
#include "src/base/version.hpp"
#include "topology/base/errors.hpp"

#include <filesystem>

namespace spherecut::bindings {

void bind_errors(py::module_& module) {
  static const py::exception<InputError> input_error(module, "InputError", PyExc_ValueError);
  static const py::exception<app::OutputError> output_error(module, "OutputError", input_error);
  static const py::exception<NumericalError> numerical_error(module, "NumericalError", PyExc_ArithmeticError);
  input_error.attr("__doc__") = "Input that cannot be used. The message says what, where, the value and the limit: the "
                                "same words as on the command line, which exits with status 2.";
  output_error.attr("__doc__") = "Results that cannot be written. The message has the path and the system's reason.";
  numerical_error.attr("__doc__") =
      "A computation that failed on valid input. The message has the node, or the residual and condition: the same "
      "words as on the command line, which exits with status 3.";
  // The last that is registered is asked first.
  py::register_exception_translator([](std::exception_ptr error) {
    try {
      std::rethrow_exception(std::move(error));
    } catch (const app::OutputError& e) {
      PyErr_SetString(output_error.ptr(), e.what());
    } catch (const InputError& e) {
      PyErr_SetString(input_error.ptr(), e.what());
    } catch (const std::filesystem::filesystem_error& e) {
      PyErr_SetString(input_error.ptr(), e.what());
    } catch (const NumericalError& e) {
      PyErr_SetString(numerical_error.ptr(), e.what());
    } catch (const Interrupted&) {
      PyErr_SetNone(PyExc_KeyboardInterrupt);
    }
  });
}

} // namespace spherecut::bindings

PYBIND11_MODULE(_core, module) {
  using namespace spherecut;
  namespace py = pybind11;
  module.doc() = "Spherecut: cutting and tearing of soft tissue without remeshing. SI units throughout.";
  py::options options;
  options.disable_enum_members_docstring();
  app::use_one_blas_thread();
  bindings::bind_errors(module);
  module.attr("__version__") = std::string(app::version());
  module.def("set_thread_count", &solvers::set_thread_count, py::arg("count"),
             "Threads that assembly and evaluation may use, the calling one included: 1 to 256, 1 unless set. Results "
             "do not depend on it.");
  module.def("thread_count", &solvers::thread_count, "Threads that assembly and evaluation may use.");
  bindings::bind_surface(module);
  bindings::bind_domain(module);
  bindings::bind_tool(module);
  bindings::bind_incision(module);
  bindings::bind_wound(module);
  bindings::bind_nodes(module);
  bindings::bind_body(module);
  bindings::bind_law(module);
  bindings::bind_finite(module);
  bindings::bind_contact(module);
  bindings::bind_fracture(module);
  bindings::bind_session(module);
}
