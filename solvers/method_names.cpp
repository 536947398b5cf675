#include "solvers/discretisation.hpp"
#include "topology/errors.hpp"

#include <fmt/format.h>

namespace spherecut::solvers {

std::string_view to_string(Method method) {
  switch (method) {
  case Method::published:
    return "published";
  case Method::collocation:
    return "collocation";
  case Method::galerkin:
    return "galerkin";
  }
  return "unknown";
}

Method method_from_string(std::string_view name) {
  for (Method method : {Method::published, Method::collocation, Method::galerkin})
    if (name == to_string(method))
      return method;
  throw InputError(fmt::format("method '{}' does not exist; there are: published, collocation, galerkin", name));
}

std::string_view to_string(UnheldPieces treatment) {
  switch (treatment) {
  case UnheldPieces::refuse:
    return "refuse";
  case UnheldPieces::hold:
    return "hold";
  case UnheldPieces::drop:
    return "drop";
  }
  return "unknown";
}

UnheldPieces unheld_pieces_from_string(std::string_view name) {
  for (UnheldPieces treatment : {UnheldPieces::refuse, UnheldPieces::hold, UnheldPieces::drop})
    if (name == to_string(treatment))
      return treatment;
  throw InputError(fmt::format("'{}' for pieces that nothing holds; there are: refuse, hold, drop", name));
}

} // namespace spherecut::solvers
