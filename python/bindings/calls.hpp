// Calls from Python into the library and back: the lock of the interpreter, Ctrl-C, functions given by the user.
#pragma once

#include "python/bindings/arrays.hpp"
#include "topology/base/interruption.hpp"

#include <csignal>
#include <functional>
#include <memory>

namespace spherecut::bindings {

/// While it lives on the main thread, a SIGINT is also a request_interruption(): computations stop at their next
/// interruption_point(). Python's own handler runs as well. On other threads, where Python handles no signals, and
/// where SIGINT is ignored or has its default effect, it does nothing.
class InterruptNote {
 public:
  InterruptNote();
  ~InterruptNote();
  InterruptNote(const InterruptNote&) = delete;
  InterruptNote& operator=(const InterruptNote&) = delete;

 private:
  bool on_ = false;
};

/// Raises what the user's handler of SIGINT raises, else KeyboardInterrupt.
[[noreturn]] void raise_interrupt();

/// What `call` returns; other Python threads run meanwhile, and Ctrl-C ends it.
template <class Call>
auto unlocked(Call&& call) -> decltype(call()) {
  const InterruptNote note;
  try {
    const py::gil_scoped_release release;
    return call();
  } catch (const Interrupted&) {
  }
  raise_interrupt();
}

/// A Python object that may be let go of by any thread.
class Kept {
 public:
  explicit Kept(py::object object);
  [[nodiscard]] const py::object& operator*() const { return *object_; }

 private:
  std::shared_ptr<py::object> object_;
};

using VectorFunction = std::function<Vector3(const Vector3&)>;
using BoundaryFunction = std::function<Vector3(const Vector3&, const Vector3&)>;
using NumberFunction = std::function<double(const Vector3&)>;

/// A function of x, m, as a std::function that takes the interpreter's lock: `given` is a callable or a constant of
/// shape (3,); None gives the empty function. Throws InputError, naming it, when it is neither, and when a value has
/// another shape.
VectorFunction vector_function(const py::object& given, const char* name);
/// The same of (x, normal).
BoundaryFunction boundary_function(const py::object& given, const char* name);
/// The same with a number for a value; None is refused.
NumberFunction number_function(const py::object& given, const char* name);

} // namespace spherecut::bindings
