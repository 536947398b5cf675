#include "python/bindings/calls.hpp"

#include "topology/base/errors.hpp"

#include <fmt/format.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace spherecut::bindings {
namespace {

int notes = 0; // on the main thread alone
struct sigaction before {};

void note_interrupt(int signal) {
  request_interruption();
  before.sa_handler(signal);
}

bool is_main_thread() {
  return ::syscall(SYS_gettid) == ::getpid();
}

Vector3 vector_value(const py::object& value, const char* name) {
  const Doubles array = Doubles::ensure(value);
  if (!array) {
    PyErr_Clear();
    throw InputError(fmt::format("{}: {}; allowed: three numbers", name, std::string(py::repr(value))));
  }
  return vector_from(array, name);
}

// The point is an array of its own: the function may keep it.
template <class... Points>
Vector3 call_for_vector(const Kept& function, const char* name, const Points&... points) {
  const py::gil_scoped_acquire acquire;
  return vector_value((*function)(array_of(points)...), name);
}

[[noreturn]] void refuse_function(const py::object& given, const char* name, const char* allowed) {
  throw InputError(fmt::format("{}: {}; allowed: {}", name, std::string(py::repr(given)), allowed));
}

} // namespace

InterruptNote::InterruptNote() {
  if (!is_main_thread())
    return;
  on_ = true;
  if (notes++ > 0)
    return;
  withdraw_interruption();
  sigaction(SIGINT, nullptr, &before);
  if (before.sa_handler == SIG_DFL || before.sa_handler == SIG_IGN || (before.sa_flags & SA_SIGINFO) != 0) {
    before.sa_handler = nullptr;
    return;
  }
  struct sigaction action = before;
  action.sa_handler = note_interrupt;
  sigaction(SIGINT, &action, nullptr);
}

InterruptNote::~InterruptNote() {
  if (!on_ || --notes > 0)
    return;
  if (before.sa_handler != nullptr)
    sigaction(SIGINT, &before, nullptr);
  withdraw_interruption();
}

void raise_interrupt() {
  if (PyErr_CheckSignals() == 0)
    PyErr_SetNone(PyExc_KeyboardInterrupt);
  throw py::error_already_set();
}

Kept::Kept(py::object object)
    : object_(new py::object(std::move(object)), [](py::object* p) {
        const py::gil_scoped_acquire acquire;
        delete p;
      }) {}

VectorFunction vector_function(const py::object& given, const char* name) {
  if (given.is_none())
    return {};
  if (PyCallable_Check(given.ptr()) != 0)
    return [function = Kept(given), name](const Vector3& x) { return call_for_vector(function, name, x); };
  return [value = vector_value(given, name)](const Vector3&) { return value; };
}

BoundaryFunction boundary_function(const py::object& given, const char* name) {
  if (given.is_none())
    return {};
  if (PyCallable_Check(given.ptr()) != 0)
    return [function = Kept(given), name](const Vector3& x, const Vector3& normal) {
      return call_for_vector(function, name, x, normal);
    };
  return [value = vector_value(given, name)](const Vector3&, const Vector3&) { return value; };
}

NumberFunction number_function(const py::object& given, const char* name) {
  if (PyCallable_Check(given.ptr()) != 0)
    return [function = Kept(given), name](const Vector3& x) {
      const py::gil_scoped_acquire acquire;
      const py::object value = (*function)(array_of(x));
      const double number = PyFloat_AsDouble(value.ptr());
      if (PyErr_Occurred() != nullptr) {
        PyErr_Clear();
        refuse_function(value, name, "a number");
      }
      return number;
    };
  const double number = PyFloat_AsDouble(given.ptr());
  if (PyErr_Occurred() != nullptr) {
    PyErr_Clear();
    refuse_function(given, name, "a number, or a function of a point");
  }
  return [number](const Vector3&) { return number; };
}

} // namespace spherecut::bindings
